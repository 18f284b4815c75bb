#pragma once

#include <cstddef>
#include <vector>

#include "shapegcode/path/segment.hpp"

namespace shapegcode {

/// A connected run of segments with the distance of each from the start. Constant after construction.
class Path {
 public:
  Path() = default;
  /// Throws Error(argument) if a segment does not start where its predecessor ends (1e-6 mm) or a number is not finite.
  explicit Path(std::vector<Segment> segments);

  [[nodiscard]] const std::vector<Segment>& segments() const noexcept { return segments_; }
  [[nodiscard]] std::size_t size() const noexcept { return segments_.size(); }
  [[nodiscard]] const Segment& operator[](std::size_t i) const noexcept { return segments_[i]; }
  /// Distance of segment i's start from the path's start; `distance(size())` is the whole length.
  [[nodiscard]] double distance_mm(std::size_t i) const noexcept { return distance_mm_[i]; }
  [[nodiscard]] double length_mm() const noexcept { return distance_mm_.empty() ? 0.0 : distance_mm_.back(); }

  /// Position at `s_mm` from the start. `cursor` is the segment index of the previous call: amortised O(1) on a
  /// monotonous walk, and real-time safe.
  [[nodiscard]] Vector3 point(double s_mm, std::size_t& cursor) const noexcept;

 private:
  std::vector<Segment> segments_;
  std::vector<double> distance_mm_;  // size()+1 entries
};

}  // namespace shapegcode
