#pragma once

#include <cstddef>
#include <vector>

#include "shapegcode/path.hpp"

namespace shapegcode {

/// Change of direction where two segments meet: the length of the difference of the unit tangents.
[[nodiscard]] double junction_change(const Segment& before, const Segment& after) noexcept;

/// From this `junction_change` on a junction is a corner: 5 degrees. Smoother junctions of polylines are curves.
inline constexpr double corner_change = 0.0872;

/// The corners of a path, a bit each.
class Corners {
 public:
  explicit Corners(const Path& path);
  /// Whether there is a corner between one segment and a later one.
  [[nodiscard]] bool passed(std::size_t before, std::size_t after) const noexcept;

 private:
  std::vector<bool> at_;  // where a segment is entered
};

}  // namespace shapegcode
