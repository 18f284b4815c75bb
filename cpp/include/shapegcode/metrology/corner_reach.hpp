#pragma once

#include <cstddef>
#include <vector>

#include "shapegcode/path/path.hpp"

namespace shapegcode {

/// How far a moving point stays away from the corners of a path. The distance from point to path does not see a corner
/// that is cut short along the path itself (a reversal, a narrow V); the distance from corner to track does.
class CornerReach {
 public:
  /// Corners are junctions at which the direction changes by `least_angle_rad` or more, and the path's end.
  explicit CornerReach(const Path& path, double least_angle_rad = 0.1745);
  /// Next sample, and the distance of its foot point along the path (ContourTracker::s_mm()). No allocation.
  void step(const Vector3& p, double foot_mm) noexcept;
  /// Largest distance of a corner from the track so far, mm.
  [[nodiscard]] double largest_mm() const noexcept;
  /// The same of the corners that lie well behind the point: for a track that ends before the path does.
  [[nodiscard]] double largest_passed_mm() const noexcept;

 private:
  struct Corner {
    Vector3 point;
    double s = 0.0;      // from the path's start
    double best2 = 0.0;  // squared distance to the track
  };
  std::vector<Corner> corners_;
  std::size_t first_ = 0;  // corners [first_, next_) are near enough to be looked at
  std::size_t next_ = 0;
  double largest2_ = 0.0;
  Vector3 last_ = Vector3::Zero();
  bool started_ = false;
};

}  // namespace shapegcode
