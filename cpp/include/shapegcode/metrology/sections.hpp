#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "shapegcode/path/path.hpp"

namespace shapegcode {

enum class SectionKind : std::uint8_t {
  line,   ///< lines of one direction
  arc,    ///< arcs about one centre
  curve,  ///< anything else
};

/// A stretch of a path that is measured by itself.
struct PathSection {
  std::size_t first = 0;  ///< index of its first segment
  std::size_t last = 0;   ///< inclusive
  double begin_mm = 0.0;  ///< distance of its start from the path's start
  double end_mm = 0.0;
  std::uint32_t first_line = 0;  ///< source lines, from 1; 0 if there are none
  std::uint32_t last_line = 0;
  SectionKind kind = SectionKind::line;
  bool stops_at_end = false;  ///< the path stops there: an exact stop, or its end

  [[nodiscard]] double length_mm() const noexcept { return end_mm - begin_mm; }
};

/// Source lines, both inclusive.
struct LineRange {
  std::uint32_t first = 0;
  std::uint32_t last = 0;
};

/// The whole path as sections: maximal runs of lines of one direction (1e-4 rad) and of arcs about one centre (1 µm)
/// with one radius (1 µm) and sense. Runs shorter than `short_mm` that follow each other (a curve that a CAM system
/// cut into pieces) are one section of the kind `curve`. Throws Error(argument) if `short_mm` is not finite or < 0.
[[nodiscard]] std::vector<PathSection> path_sections(const Path& path, double short_mm = 0.5);

/// The parts of a path that come from given source lines, in the order of the path; a range that the path enters
/// several times gives several sections. Throws Error(argument) if a range runs backwards or two overlap.
[[nodiscard]] std::vector<PathSection> line_sections(const Path& path, std::span<const LineRange> ranges);

}  // namespace shapegcode
