// How far set-points of blocks can be from the path at most, whatever the feed override: they run through the same
// lines, at other instants.
#pragma once

#include <cstddef>
#include <cstdint>
#include <limits>
#include <vector>

#include "shapegcode/control.hpp"
#include "shapegcode/measure/contour.hpp"
#include "shapegcode/path.hpp"

namespace shapegcode::detail {

/// Blocks in a row, some millimetres of path together.
struct BlockGroup {
  std::size_t first_block = 0;
  double s_mm = 0.0;       ///< foot of its first set-point, from the path's start
  double bound_mm = 0.0;   ///< no point of its blocks is further from the path
  double corner_mm = 0.0;  ///< no corner of the path that is nearest to this group is further from its set-points' track
  bool turns_back = false;  ///< the path turns by a right angle or more: which leg a point belongs to is not plain
  double first_corner_mm = std::numeric_limits<double>::infinity();  ///< of the corners nearest to its lines
  double last_corner_mm = -std::numeric_limits<double>::infinity();
  [[nodiscard]] bool has_corners() const noexcept { return first_corner_mm <= last_corner_mm; }
};

/// Collects the bounds from the set-points of one run, which the tracker has followed.
class DeviationBounds {
 public:
  /// `largest_override`: no run for which the bounds are meant is faster.
  DeviationBounds(const Path& path, Segments blocks, BlockEnd block_end, double largest_override);
  /// Next set-point of the player at override 1, and its deviation, which `tracker` has just measured.
  void add(const BlockPlayer& player, const Vector3& p, double deviation_mm, const ContourTracker& tracker);
  /// After the last set-point: counts the corners in. The groups, in order.
  [[nodiscard]] const std::vector<BlockGroup>& finish();
  /// Corners of the path, where a run is to begin from its own place.
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
  [[nodiscard]] bool turns_back(const Sample& before, const Sample& now) const noexcept;
  void widen_track(const Sample& now) noexcept;

  Path path_;
  Segments blocks_;
  BlockEnd block_end_;
  double largest_override_;
  std::vector<double> chord_mm_;  // of each group: how far the track may cut its blocks short near corners of the path
  CornerReach corners_;
  std::vector<BlockGroup> groups_;
  Sample last_;
  Segment open_;                // block of the last set-point
  bool before_is_arc_ = false;  // that of the one before
};

}  // namespace shapegcode::detail
