// Acceleration limit of a segment, and the time over which jerk is spread.
#pragma once

#include "shapegcode/limits.hpp"
#include "shapegcode/path.hpp"

namespace shapegcode {

/// Throws Error(argument) on a limit that is not positive.
void check_limits(const MotionLimits& limits, const FilterTolerance& filter);

/// The largest along a direction of which no axis has more than its limit; `share`: of each axis in it.
[[nodiscard]] double tangential_limit(const Vector3& share, const Vector3& limit) noexcept;

/// Acceleration along a segment that is run at most at `speed_limit`.
[[nodiscard]] double segment_acceleration(const Segment& segment, double speed_limit,
                                          const MotionLimits& limits) noexcept;

/// How long the smoothing of the acceleration lasts, if no segment is accelerated by more than `fastest`.
[[nodiscard]] double jerk_time(const MotionLimits& limits, double fastest) noexcept;

}  // namespace shapegcode
