// Private: common parts of the models of open planners.
#pragma once

#include <cstddef>
#include <vector>

#include "motion/pieces.hpp"
#include "shapegcode/motion.hpp"
#include "shapegcode/path.hpp"
#include "shapegcode/planner_models.hpp"

namespace shapegcode::detail {

/// Programmed feed times override, at most `most`. Throws Error(argument) on a segment without feed.
[[nodiscard]] double planned_feed(const Segment& segment, const MotionLimits& limits, double most);

/// Lowers the speeds at which pieces begin to what the acceleration allows, so that the motion can rest behind so many
/// pieces that are known at any time.
void pass_speeds_within(std::vector<Piece>& pieces, std::size_t look_ahead);

/// LinuxCNC's planner: the path with its blends, period by period.
[[nodiscard]] ControlledMotion linuxcnc_motion(const Path& path, const MotionLimits& limits, const PlannerRules& rules);

/// Pieces in a row from rest to rest.
[[nodiscard]] SpeedProfile profile_of(const std::vector<Piece>& pieces, double length_mm);

}  // namespace shapegcode::detail
