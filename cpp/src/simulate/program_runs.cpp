#include "simulate/program_runs.hpp"

#include <algorithm>
#include <array>
#include <cmath>

#include "base/checks.hpp"
#include "shapegcode/error.hpp"
#include "shapegcode/fanuc_model.hpp"

namespace shapegcode::detail {
namespace {

constexpr double memory = 20.0;        // time constants of the servo loop beyond which the past does not count
constexpr double steps_per_lag = 8.0;  // pieces per time constant where the speed changes
constexpr double junction_gap_mm = 1e-6;

// Position error of the servo loop at the end of a command, per axis, summed over pieces of constant velocity, the last
// one first: e = (1 - a) / K * sum of v (exp(-K t) - exp(-K (t + d))), t from a piece's end to the end of the command.
class LagAtEnd {
 public:
  LagAtEnd(const FanucModel& model, double idle_s) : model_(model), until_end_s_(idle_s) {}

  void add(const Vector3& travel_mm, double duration_s) {
    for (int i = 0; i < axis_count; ++i) {
      const double gain = model_.position_gain_per_s[i];
      error_[i] += (1.0 - model_.feed_forward_ratio[i]) * travel_mm[i] * std::exp(-gain * until_end_s_) *
                   -std::expm1(-gain * duration_s) / (gain * duration_s);
    }
    until_end_s_ += duration_s;
  }
  [[nodiscard]] bool complete() const noexcept { return until_end_s_ * model_.position_gain_per_s.minCoeff() > memory; }
  [[nodiscard]] double piece_s() const noexcept {
    return 1.0 / (steps_per_lag * model_.position_gain_per_s.maxCoeff());
  }
  // Behind filters, one period after their last tap: each tap's part has decayed since then.
  [[nodiscard]] Vector3 behind(const std::vector<Fir>& filters) const {
    Vector3 error = error_;
    for (int i = 0; i < axis_count; ++i) {
      const double decay = std::exp(-model_.position_gain_per_s[i] * model_.period_s);
      for (const Fir& filter : filters) {
        double share = 0.0;
        int delay = 0;
        for (std::size_t k = 0; k < filter.taps().size(); ++k) {
          for (; delay < filter.delays()[k]; ++delay) {
            share *= decay;
          }
          share += filter.taps()[k];
        }
        error[i] *= share;
      }
      error[i] *= filters.empty() ? 1.0 : decay;
    }
    return error;
  }

 private:
  const FanucModel& model_;
  double until_end_s_;
  Vector3 error_ = Vector3::Zero();
};

Segment last_moving(const Path& path) {
  std::size_t i = path.size() - 1;
  while (i > 0 && path[i].length_mm <= 0.0) {
    --i;
  }
  return path[i];
}

}  // namespace

bool changes_tool(const MachineFunction& function) noexcept {
  const auto end = function.m_codes.begin() + function.m_count;
  return std::find(function.m_codes.begin(), end, tool_change_code) != end;
}

bool has_tool_change(const Program& program) noexcept {
  return std::any_of(program.functions.begin(), program.functions.end(), changes_tool);
}

bool is_cutting(const OtherMove& move) noexcept {
  return !(move.dwell_s > 0.0) && move.segment.kind != SegmentKind::rapid;
}

bool cuts(const Program& program, const ProgramStep& step) noexcept {
  return step.kind == StepKind::region || (step.kind == StepKind::move && is_cutting(program.other_moves[step.index]));
}

std::size_t gather_run(const Program& program, std::size_t at, std::vector<Segment>& run) {
  for (; at < program.steps.size(); ++at) {
    const ProgramStep& step = program.steps[at];
    if (step.kind != StepKind::move || !is_cutting(program.other_moves[step.index])) {
      break;
    }
    const Segment& segment = program.other_moves[step.index].segment;
    if (!run.empty() &&
        (run.back().stop_at_end || (segment.start_mm - run.back().end_mm).cwiseAbs().maxCoeff() > junction_gap_mm)) {
      break;
    }
    run.push_back(segment);
  }
  return at;
}

bool runs_shaped(const Region& region, const FanucModel& model) noexcept {
  return model.shaped_regions == ShapedRegions::all || (model.shaped_regions == ShapedRegions::marked && region.shaped);
}

bool runs_shaped_outside(const FanucModel& model) noexcept { return model.shaped_regions == ShapedRegions::all; }

PlannerRules planner_rules(const Program& program, const FanucModel& model) noexcept {
  const auto shaped = [&](const auto& region) { return runs_shaped(*region, model); };
  const bool emitted =
      runs_shaped_outside(model) || std::any_of(program.regions.begin(), program.regions.end(), shaped);
  PlannerRules rules = model.planner;
  if (emitted) rules.chord_tolerance_mm = model.chord_tolerance_mm;
  return rules;
}

double checked_feed(const Segment& segment, const FanucModel& model) {
  if (segment.length_mm > 0.0 && !(segment.feed_mm_per_s > 0.0)) {
    throw Error(ErrorKind::argument, "block without a feed greater than zero", segment.line);
  }
  return controlled_feed_mm_per_s(segment, model);
}

MotionLimits overridden_limits(const FanucModel& model) {
  MotionLimits limits = model.limits;
  limits.feed_override *= model.feed_override;
  return limits;
}

PlannedEnd planned_end(const SpeedProfile& profile, const std::vector<Fir>& filters, const FanucModel& model) {
  PlannedEnd end;
  const double jerk = std::round(profile.jerk_time_s() / model.period_s);
  const auto jerk_periods = static_cast<int>(require_count(jerk, max_filter_samples, "the jerk time", "periods"));
  if (jerk_periods > 1) {
    end.smoothing.push_back(Fir::moving_average(jerk_periods));
  }
  end.smoothing.insert(end.smoothing.end(), filters.begin(), filters.end());
  const double ramps = whole_periods(profile.ramp_duration_s() / model.period_s) * model.period_s;
  end.idle_s = std::max(0.0, ramps - profile.ramp_duration_s());
  end.duration_s = ramps + filter_periods(end.smoothing) * model.period_s;
  return end;
}

double wait_behind_blocks(const Path& path, double idle_periods, const std::vector<Fir>& filters,
                          const FanucModel& model) {
  const auto moved = moved_axes(last_moving(path));
  if (model.in_position == InPosition::measured) {
    return in_position_wait_s(Vector3::Zero(), moved, model);
  }
  LagAtEnd lag(model, idle_periods * model.period_s);
  for (std::size_t i = path.size(); i-- > 0 && !lag.complete();) {
    const Segment& segment = path[i];
    const double duration_s =
        block_periods(segment.length_mm, checked_feed(segment, model), model.period_s, model.block_end) *
        model.period_s;
    if (duration_s <= 0.0) {
      continue;
    }
    const double pieces = segment.kind == SegmentKind::arc ? std::ceil(duration_s / lag.piece_s()) : 1.0;
    Vector3 end = segment.end_mm;
    for (double k = pieces - 1.0; k >= 0.0 && !lag.complete(); k -= 1.0) {
      const Vector3 start = k > 0.0 ? point_at(segment, segment.length_mm * k / pieces) : segment.start_mm;
      lag.add(end - start, duration_s / pieces);
      end = start;
    }
  }
  return in_position_wait_s(lag.behind(filters), moved, model);
}

double wait_behind_profile(const Path& path, const SpeedProfile& profile, const PlannedEnd& end,
                           const FanucModel& model) {
  const auto moved = moved_axes(last_moving(path));
  if (model.in_position == InPosition::measured) {
    return in_position_wait_s(Vector3::Zero(), moved, model);
  }
  LagAtEnd lag(model, end.idle_s);
  std::size_t phase = profile.phases().size() - 1;
  std::size_t segment = path.size() - 1;
  Vector3 position = path.point(path.length_mm(), segment);
  for (double time_s = profile.ramp_duration_s(); time_s > 0.0 && !lag.complete();) {
    const double piece_s = std::min(lag.piece_s(), time_s);
    time_s -= piece_s;
    const Vector3 before = path.point(profile.distance_mm(time_s, phase), segment);
    lag.add(position - before, piece_s);
    position = before;
  }
  return in_position_wait_s(lag.behind(end.smoothing), moved, model);
}

void lower_to_reached(std::span<BlockTime> rows, const FanucModel& model) {
  if (model.filter_shape == FilterShape::exponential) {
    double speed = 0.0;
    for (BlockTime& row : rows) {
      speed += (row.feed_mm_per_s - speed) * -std::expm1(-row.duration_s / model.time_constant_s);
      row.feed_mm_per_s = speed;
    }
    return;
  }
  const double window_s = std::max(model.time_constant_s, model.bell_time_s);
  if (!(window_s > 0.0)) {
    return;
  }
  // Distance from the run's start to a time at programmed feeds; both cursors only move on.
  std::vector<double> travel(rows.size() + 1, 0.0);
  for (std::size_t i = 0; i < rows.size(); ++i) {
    travel[i + 1] = travel[i] + rows[i].feed_mm_per_s * rows[i].duration_s;
  }
  const auto travel_at = [&](double time_s, std::size_t& cursor) {
    while (cursor + 1 < rows.size() && rows[cursor].start_s + rows[cursor].duration_s < time_s) {
      ++cursor;
    }
    const double inside = std::clamp(time_s - rows[cursor].start_s, 0.0, rows[cursor].duration_s);
    return travel[cursor] + inside * rows[cursor].feed_mm_per_s;
  };
  std::vector<double> reached(rows.size());
  std::size_t before = 0;
  std::size_t behind = 0;
  for (std::size_t i = 0; i < rows.size(); ++i) {
    const double to_end = travel[i + 1] - travel_at(rows[i].start_s + rows[i].duration_s - window_s, before);
    const double from_start = travel_at(rows[i].start_s + window_s, behind) - travel[i];
    reached[i] = std::max(to_end, from_start) / window_s;
  }
  for (std::size_t i = 0; i < rows.size(); ++i) {
    rows[i].feed_mm_per_s = std::min(rows[i].feed_mm_per_s, reached[i]);
  }
}

void append_rows(const Path& path, const SpeedProfile& profile, double start_s, std::vector<BlockTime>& rows) {
  const auto& phases = profile.phases();
  std::size_t cursor = 0;
  std::size_t phase = 0;
  double time_s = 0.0;
  for (std::size_t i = 0; i < path.size(); ++i) {
    const double from = path.distance_mm(i);
    const double to = path.distance_mm(i + 1);
    const double end_s = profile.time_s(to, cursor);
    double fastest = 0.0;
    const auto phase_end = [&](std::size_t k) {
      return k + 1 < phases.size() ? phases[k + 1].distance_mm : profile.length_mm();
    };
    while (phase + 1 < phases.size() && phase_end(phase) <= from) {
      ++phase;
    }
    for (std::size_t k = phase; k < phases.size() && phases[k].distance_mm < to; ++k) {
      for (const double at : {std::max(from, phases[k].distance_mm), std::min(to, phase_end(k))}) {
        const double v = phases[k].speed_mm_per_s;
        const double squared = v * v + 2.0 * phases[k].acceleration_mm_per_s2 * (at - phases[k].distance_mm);
        fastest = std::max(fastest, std::sqrt(std::max(0.0, squared)));
      }
    }
    rows.push_back({path.line(i), BlockKind::cutting, start_s + time_s, end_s - time_s, to > from ? fastest : 0.0});
    time_s = end_s;
  }
}

std::array<bool, axis_count> moved_axes(const Segment& segment) noexcept {
  std::array<bool, axis_count> moved{};
  for (int i = 0; i < axis_count; ++i) {
    moved[static_cast<std::size_t>(i)] =
        segment.start_mm[i] != segment.end_mm[i] || (segment.kind == SegmentKind::arc && i != segment.normal);
  }
  return moved;
}

}  // namespace shapegcode::detail
