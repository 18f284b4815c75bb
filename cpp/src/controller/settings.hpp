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

/// The same as a time; 0 = none.
[[nodiscard]] double jerk_s(const ControllerSettings& settings);

/// Limits of the path, so that what leaves the filters keeps those of the settings.
[[nodiscard]] MotionLimits planning_limits_of(const ControllerSettings& settings, const SetPointFilters& filters);
[[nodiscard]] std::vector<FollowingLimits> following_limits_of(const ControllerSettings& settings,
                                                               const SetPointFilters& filters);

}  // namespace shapegcode
