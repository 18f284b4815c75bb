// Motions of a program from rest to rest. Closed form and full interpolation use the same division into motions and the
// same feeds; only the closed form has waits and reached feeds.
#pragma once

#include <memory>
#include <span>
#include <vector>

#include "shapegcode/fanuc_model.hpp"
#include "shapegcode/filter.hpp"
#include "shapegcode/motion.hpp"
#include "shapegcode/program.hpp"
#include "shapegcode/timing.hpp"

namespace shapegcode::detail {

inline constexpr int tool_change_code = 6;

/// Whether M06 is among the M codes of a block.
[[nodiscard]] bool changes_tool(const MachineFunction& function) noexcept;
[[nodiscard]] bool has_tool_change(const Program& program) noexcept;

/// A cutting move outside of the regions: neither a rapid nor a dwell.
[[nodiscard]] bool is_cutting(const OtherMove& move) noexcept;

/// Whether a step of the program is a cut, in a region or outside.
[[nodiscard]] bool cuts(const Program& program, const ProgramStep& step) noexcept;

/// Collects the cutting moves from step `at` on that follow each other without a stop; returns the step behind them.
[[nodiscard]] std::size_t gather_run(const Program& program, std::size_t at, std::vector<Segment>& run);

/// Whether a region, and whether a cut outside of the regions, runs as shaped blocks.
[[nodiscard]] bool runs_shaped(const Region& region, const FanucModel& model) noexcept;
[[nodiscard]] bool runs_shaped_outside(const FanucModel& model) noexcept;

/// Rules by which a program is planned: the arcs of one with shaped cuts are those that were emitted.
[[nodiscard]] PlannerRules planner_rules(const Program& program, const FanucModel& model) noexcept;

/// Controlled feed of a block; throws Error(argument) where a move has none.
[[nodiscard]] double checked_feed(const Segment& segment, const FanucModel& model);

/// Limits of look-ahead with the model's feed override in them.
[[nodiscard]] MotionLimits overridden_limits(const FanucModel& model);

/// How a look-ahead run ends: whole duration and everything that smooths the profile.
struct PlannedEnd {
  double duration_s = 0.0;
  double idle_s = 0.0;  ///< from the end of the ramps to the tick that ends them
  std::vector<Fir> smoothing;
};
[[nodiscard]] PlannedEnd planned_end(const SpeedProfile& profile, const std::vector<Fir>& filters,
                                     const FanucModel& model);

/// Wait for in-position behind an exact stop, in closed form. `idle_periods`: from the last block's end to its tick.
[[nodiscard]] double wait_behind_blocks(const Path& path, double idle_periods, const std::vector<Fir>& filters,
                                        const FanucModel& model);
[[nodiscard]] double wait_behind_profile(const Path& path, const SpeedProfile& profile, const PlannedEnd& end,
                                         const FanucModel& model);

/// Lowers the feeds of a run's rows to what the acceleration lets them reach: the larger one of the mean feeds over the
/// longest moving average before a block's end and behind its start; for exponential acceleration the feed at its end.
void lower_to_reached(std::span<BlockTime> rows, const FanucModel& model);

/// Rows of a look-ahead run, each with the highest speed of the profile on it.
void append_rows(const Path& path, const SpeedProfile& profile, double start_s, std::vector<BlockTime>& rows);

/// Axes that a segment moves.
[[nodiscard]] std::array<bool, axis_count> moved_axes(const Segment& segment) noexcept;

}  // namespace shapegcode::detail
