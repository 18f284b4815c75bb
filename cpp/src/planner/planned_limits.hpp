// Fraction of the limits used in planning, and the reaction if set-points exceed them anyway, because limits are
// checked only at some points of an interval.
#pragma once

#include <algorithm>

#include "planner/stations.hpp"

namespace shapegcode {

/// Share of acceleration and jerk that is planned, and by how much set-points may exceed what is asked for.
inline constexpr double planned_share = 0.9998;
inline constexpr double kept = 1.0009;
inline constexpr double kept_feed = 1.0009;
/// Beyond that less is planned around there: at once at most by the first factor and, where the filters behind leave
/// the tolerance, at least by the second; below the first share from rest to rest, and nowhere less than the second.
inline constexpr double most_less = 0.7;
inline constexpr double least_less = 0.97;
inline constexpr double least_share = 0.3;
inline constexpr double useful_share = 0.002;

[[nodiscard]] inline AxisLimits planned_limits(const AxisLimits& asked, double period_s) noexcept {
  AxisLimits limits = asked.share(planned_share);
  for (std::size_t i = 0; i < limits.axes; ++i) {
    // No more than what changes the acceleration within a period.
    limits.jerk[i] = std::min(limits.jerk[i], limits.acceleration[i] / period_s);
  }
  return limits;
}

}  // namespace shapegcode
