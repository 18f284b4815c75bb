#pragma once

#include <cstdint>
#include <optional>

#include "shapegcode/path.hpp"

namespace shapegcode {

/// ",R" or ",C" of a block.
struct CornerWord {
  bool chamfer = false;  ///< ,C
  double size_mm = 0.0;
  std::uint32_t line = 0;  ///< where it stands
  std::uint32_t column = 0;
};

/// Two blocks and what a corner word puts between them.
struct CornerResult {
  Segment before;
  std::optional<Segment> inserted;  ///< none at a tangent corner or a size of zero
  Segment after;
};

/// FANUC optional chamfer ",C" or corner rounding ",R" between two blocks in the plane across axis `plane_normal`,
/// lines or arcs. A chamfer begins and ends at `size_mm` from the corner (straight distance, on arcs too); a rounding
/// is the arc of radius `size_mm` tangent to both blocks. Blocks whose directions differ by no more than 1 degree are
/// tangent: nothing is inserted. The inserted block runs at the feed of `before`; motion along the normal axis stays in
/// the shortened blocks.
///
/// Throws Error(program): alarm 0006 (negative size), 0051 (no motion in the plane after the corner), 0052 (a rapid
/// beside the corner), 0055 (no motion before it, a block too short, or no tangent arc of this radius); Error(argument)
/// on blocks that do not join or values that are not finite.
[[nodiscard]] CornerResult insert_corner(const Segment& before, const Segment& after, const CornerWord& word,
                                         int plane_normal);

}  // namespace shapegcode
