#pragma once

#include <cstdint>
#include <optional>

#include "shapegcode/path.hpp"

namespace shapegcode {

/// Two blocks and what a corner word puts between them.
struct CornerResult {
  Segment before;
  std::optional<Segment> inserted;  ///< none at a tangent corner or a size of zero
  Segment after;
};

/// FANUC optional chamfer ",C" (`chamfer`) or corner rounding ",R" of `size_mm` between two blocks in the plane across
/// axis `plane_normal`, lines or arcs. A chamfer begins and ends at `size_mm` from the corner (straight distance, on
/// arcs too); a rounding is the arc of radius `size_mm` tangent to both blocks. Blocks whose directions differ by no
/// more than 1 degree are tangent: nothing is inserted. The inserted block runs at the feed of `before`; motion along
/// the normal axis stays in the shortened blocks. `line` and `column` are those of the word.
///
/// Throws Error(program): alarm 0006 (negative size), 0051 (no motion in the plane after the corner), 0052 (a rapid
/// beside the corner), 0055 (no motion before it, a block too short, or no tangent arc of this radius); Error(argument)
/// on blocks that do not join or values that are not finite.
[[nodiscard]] CornerResult insert_corner(const Segment& before, const Segment& after, bool chamfer, double size_mm,
                                         int plane_normal, std::uint32_t line, std::uint32_t column);

}  // namespace shapegcode
