#pragma once

#include <cstdint>
#include <vector>

#include "shapegcode/path.hpp"
#include "shapegcode/samples.hpp"

namespace shapegcode {

/// Limits of a time-optimal trajectory.
struct TrajectoryLimits {
  Vector3 max_feed_mm_per_s = Vector3::Constant(250.0);
  Vector3 max_acceleration_mm_per_s2 = Vector3::Constant(1000.0);
  Vector3 max_jerk_mm_per_s3 = Vector3::Constant(50'000.0);
  /// Permitted deviation from the path where it is rounded: where its direction or its curvature jumps. 0: the motion
  /// stops there instead.
  double contour_tolerance_mm = 0.05;
};

/// Set-points of a whole path from rest to rest, one per period: nearly as fast as speed, acceleration and jerk of
/// every axis and the programmed feeds allow. The differences of the set-points keep the limits to a factor of 1.001,
/// the end is reached to the last bit, and the motion stops at segments with `stop_at_end`. Bit for bit the set-points
/// of a MotionController without filters that plans in step(), if all segments are pushed at once and its window holds
/// them. Method: docs/concepts/time_optimal.md.
///
/// Throws Error(argument) on limits that are not above zero and finite, a tolerance below zero, a segment without a
/// feed, or more set-points than can be numbered; Error(numeric) if the limits cannot be kept.
[[nodiscard]] Samples time_optimal_trajectory(const Path& path, const TrajectoryLimits& limits, double period_s);

/// The same with the segment of the path that each set-point belongs to.
struct TimeOptimalMotion {
  Samples set_points;
  std::vector<std::uint32_t> segments;
};
[[nodiscard]] TimeOptimalMotion time_optimal_motion(const Path& path, const TrajectoryLimits& limits, double period_s);

}  // namespace shapegcode
