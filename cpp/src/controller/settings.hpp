// Values derived from the settings of a control.
#pragma once

#include "controller/online_planner.hpp"
#include "controller/set_point_filters.hpp"
#include "shapegcode/controller.hpp"

namespace shapegcode {

/// By how much the feeds may be raised.
inline constexpr double max_override = 2.0;

/// Throws Error(argument) on invalid settings, with value and limit.
void check_settings(const ControllerSettings& settings);

/// Limits of the motion along the path, so that what leaves the filters keeps those of the settings.
[[nodiscard]] PlanningRules planning_rules_of(const ControllerSettings& settings, const SetPointFilters& filters);
/// What may come into the filters of what leaves them.
struct InputShare {
  double speed = 1.0, acceleration = 1.0, jerk = 1.0;
};
[[nodiscard]] InputShare input_share(const ControllerSettings& settings, const SetPointFilters& filters,
                                     std::size_t axis) noexcept;
/// Of each axis, before the filters; without settings 0.
[[nodiscard]] AxisValues emergency_of(const ControllerSettings& settings, const SetPointFilters& filters) noexcept;
/// What rounding may take of the contour tolerance: half of it where filters behind take the other half, mm.
[[nodiscard]] double path_tolerance_of(const ControllerSettings& settings, const SetPointFilters& filters);
/// Where a contour correction leaves only what filters cut off corners: of that the time, by which it grows with the
/// speed.
[[nodiscard]] double corner_time_of(const SetPointFilters& filters);

}  // namespace shapegcode
