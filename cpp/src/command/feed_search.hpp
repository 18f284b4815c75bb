#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <vector>

#include "command/run_corrector.hpp"
#include "command/run_filter.hpp"
#include "shapegcode/motion.hpp"
#include "shapegcode/path.hpp"

namespace shapegcode {

/// What the axes may do while the contour is corrected.
[[nodiscard]] RunLimits run_limits(const MotionLimits& limits);

/// A shaped run as `RunShaper` gives it out.
struct RunRows {
  Column<Vector3> positions;              ///< one per row
  SteadyColumn<std::int8_t> arc_normals;  ///< one per block period
};

/// A run with the speed at which it keeps the contour tolerance.
struct PlannedRun {
  std::shared_ptr<const Path> path;
  std::shared_ptr<const SpeedProfile> profile;
  double largest_deviation_mm = 0.0;  ///< of what follows the path, as far as the plan tells
  /// Segments before which the run must come to rest, because no speed into them keeps the tolerance. The profile is
  /// then of no use: plan the pieces between.
  std::vector<std::size_t> stops;
  /// The run itself, shaped while it was measured; empty where it is longer than what is kept.
  RunRows rows;
};

/// The highest feed at which a run keeps the contour tolerance: planned at full speed, shaped, measured, and slowed
/// only on the arcs and at the corners that leave the tolerance, until all keep it; what was slowed too far is raised
/// again. `tolerance_mm` is of what the filter's target says shall follow the path. A corner that would have to be
/// crept through is a stop; nothing else is slowed below `least_feed_mm_per_s`, which a controller may not run.
[[nodiscard]] PlannedRun plan_within_tolerance(std::shared_ptr<const Path> path, const MotionLimits& limits,
                                               const RunFilter& filter, std::size_t steps_per_half, double tolerance_mm,
                                               double least_feed_mm_per_s = 0.0);

}  // namespace shapegcode
