// Upper bound of the distance of block set-points from the path at any feed override: they follow the same lines, at
// other instants.
#pragma once

#include <cstddef>
#include <cstdint>
#include <limits>
#include <vector>

#include "shapegcode/fanuc_model.hpp"
#include "shapegcode/measure/contour.hpp"
#include "shapegcode/path.hpp"

namespace shapegcode::detail {

/// Some millimetres of blocks: several in a row, or part of one.
struct BlockGroup {
  std::size_t first_block = 0;
  double along_mm = 0.0;  ///< where on that block the group begins
  double s_mm = 0.0;      ///< foot of its first set-point, from the path's start
  double bound_mm = 0.0;  ///< no point of its blocks is further from the path
  double corner_mm =
      0.0;                ///< no corner of the path that is nearest to this group is further from its set-points' track
  double turn_rad = 0.0;  ///< by which the path changes its direction, all changes together
  double first_corner_mm = std::numeric_limits<double>::infinity();  ///< of the corners nearest to its lines
  double last_corner_mm = -std::numeric_limits<double>::infinity();
  /// Whether the set-point last given is in it, or behind it.
  [[nodiscard]] bool is_reached(const BlockInterpolator& interpolator) const noexcept {
    return interpolator.block() > first_block ||
           (interpolator.block() == first_block && interpolator.along_mm() >= along_mm);
  }
  [[nodiscard]] bool has_corners() const noexcept { return first_corner_mm <= last_corner_mm; }
};

/// Collects the bounds from the set-points of one run, which the tracker has followed.
class DeviationBounds {
 public:
  /// `largest_override`: no run for which the bounds are meant is faster.
  DeviationBounds(const Path& path, Segments blocks, BlockEnd block_end, double largest_override);
  /// Next set-point of the interpolator at override 1, and its deviation, which `tracker` has just measured.
  void add(const BlockInterpolator& interpolator, const Vector3& p, double deviation_mm, const ContourTracker& tracker);
  /// After the last set-point: counts the corners in. The groups, in order.
  [[nodiscard]] const std::vector<BlockGroup>& finish();
  /// Corners of the path, where a run is to begin from its own position.
  [[nodiscard]] const CornerReach& corners() const noexcept { return corners_; }

 private:
  struct Sample {
    std::size_t block = 0;
    double along_mm = 0.0;  // of the block
    Vector3 p = Vector3::Zero();
    double deviation_mm = 0.0;
    double s_mm = 0.0;
    std::size_t segment = 0;
  };
  [[nodiscard]] double bound_between(const Sample& before, const Sample& now) const noexcept;
  [[nodiscard]] double travel_mm(const Sample& before, const Sample& now) const noexcept;
  [[nodiscard]] double turn_rad(const Sample& before, const Sample& now) const noexcept;
  void widen_track(const Sample& now) noexcept;

  Path path_;
  Segments blocks_;
  BlockEnd block_end_;
  double largest_override_;
  std::vector<double> chord_mm_;  // of each group: how far the track may cut its blocks short near corners of the path
  CornerReach corners_;
  std::vector<BlockGroup> groups_;
  Sample last_;
  double curvature_ = 0.0;         // 1/mm, of the block of the last set-point
  double curvature_before_ = 0.0;  // of that of the one before
  double path_curvature_ = 0.0;    // of the segment of its foot
};

}  // namespace shapegcode::detail
