// What the settings of a control come to.
#pragma once

#include <vector>

#include "controller/set_point_filters.hpp"
#include "shapegcode/controller.hpp"

namespace shapegcode {

/// Throws Error(argument) on settings that are none, with value and limit.
void check_settings(const ControllerSettings& settings);

/// Periods of the smoothing by the jerk time; 1 = none. Whole ones, so that it lasts what was asked for at least.
[[nodiscard]] int jerk_periods(const ControllerSettings& settings);

/// Limits of the path, so that what leaves the filters keeps those of the settings; their jerk time is that of the
/// smoothing, 0 = none.
[[nodiscard]] MotionLimits planning_limits_of(const ControllerSettings& settings, const SetPointFilters& filters);
[[nodiscard]] std::vector<FollowingLimits> following_limits_of(const ControllerSettings& settings,
                                                               const SetPointFilters& filters);

}  // namespace shapegcode
