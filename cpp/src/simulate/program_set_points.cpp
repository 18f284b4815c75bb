#include "simulate/program_set_points.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

#include "base/checks.hpp"
#include "shapegcode/error.hpp"
#include "shapegcode/motion.hpp"
#include "simulate/program_runs.hpp"

namespace shapegcode::detail {
namespace {

constexpr double settling_time_constants =
    40.0;  // time constants of the servo loop that a wait needs to be simulated for
constexpr double tick_slack = 1e-9;
constexpr double rounding_mm = 1e-9;  // between the end of a motion and the start of the next

const FanucModel& checked(const FanucModel& model) {
  check(model);
  return model;
}

}  // namespace

bool ProgramSetPoints::Cut::step(Vector3& position) {
  if (auto* interpolator = std::get_if<Interpolator>(&motion)) {
    return interpolator->step(position);
  }
  return std::get<BlockInterpolator>(motion).step(position);
}

std::uint32_t ProgramSetPoints::Cut::line() const {
  if (const auto* interpolator = std::get_if<Interpolator>(&motion)) {
    return path->line(interpolator->segment());
  }
  return blocks[std::get<BlockInterpolator>(motion).block()].line;
}

ProgramSetPoints::ProgramSetPoints(const Program& program, const FanucModel& model, Waits waits)
    : program_(program),
      model_(checked(model)),
      shaped_model_(for_shaped_blocks(model)),
      rules_(planner_rules(program, model)),
      waits_(waits),
      filters_(acceleration_filters(model)),
      shaped_filters_(acceleration_filters(shaped_model_)),
      function_times_(program, model),
      servo_(model.position_gain_per_s, model.feed_forward_ratio, model.period_s) {
  time_.region_s.reserve(program_.regions.size());
  set_point_ = first_position();
  servo_.reset(set_point_);
  next_.position_mm = set_point_;
}

Vector3 ProgramSetPoints::first_position() const {
  for (const ProgramStep& step : program_.steps) {
    if (step.kind == StepKind::region) {
      return program_.regions[step.index]->path->segments().front().start_mm;
    }
    if (step.kind == StepKind::move && !(program_.other_moves[step.index].dwell_s > 0.0)) {
      return program_.other_moves[step.index].segment.start_mm;
    }
  }
  return Vector3::Zero();
}

bool ProgramSetPoints::step(SetPoint& next) {
  if (!started_) {
    started_ = true;
    next_.line = program_.steps.empty() ? 1 : program_.steps.front().line;
    next_.kind = BlockKind::function;
    next = next_;
    return true;
  }
  const std::uint64_t before = time_.set_points;
  while (time_.set_points == before) {
    if (auto* cut = std::get_if<Cut>(&active_)) {
      if (!step_cut(*cut)) {
        close_cut(*cut);
      }
    } else if (auto* rapid = std::get_if<Rapid>(&active_)) {
      Vector3 position;
      if (rapid->motion.step(position)) {
        give(position);
        periods_rapid_ += 1.0;
      } else {
        open_arrival(rapid->moved);
      }
    } else if (auto* wait = std::get_if<Wait>(&active_); wait != nullptr && wait->periods > 0) {
      --wait->periods;
      give(set_point_);
    } else if (std::holds_alternative<InPositionWait>(active_) &&
               (servo_.error_mm().cwiseAbs().array() > model_.in_position_width_mm.array()).any()) {
      periods_waiting_ += 1.0;
      give(set_point_);
    } else if (!open_step()) {
      return false;
    }
  }
  next_.position_mm = set_point_;
  next = next_;
  next_.jump_mm.setZero();
  return true;
}

bool ProgramSetPoints::open_step() {
  active_ = std::monostate{};
  end_region();
  if (at_ >= program_.steps.size()) {
    return false;
  }
  const ProgramStep& step = program_.steps[at_];
  next_.line = step.line;
  if (detail::cuts(program_, step) && wait_for_spindle()) {
    return true;
  }
  switch (step.kind) {
    case StepKind::region: {
      const Region& region = *program_.regions[step.index];
      next_.region = step.index;
      regions_started_ = step.index + 1;
      in_region_ = true;
      region_start_periods_ = periods_cutting_ + periods_waiting_ + measured_s_ / model_.period_s;
      ++at_;
      open_cut(region.path, region.exact_stop_at_end, true, runs_shaped(region, model_));
      break;
    }
    case StepKind::function:
      ++at_;
      open_functions(program_.functions[step.index]);
      break;
    case StepKind::move:
      open_other_move(step.line);
      break;
  }
  return true;
}

void ProgramSetPoints::end_region() {
  if (in_region_) {
    in_region_ = false;
    const double now = periods_cutting_ + periods_waiting_ + measured_s_ / model_.period_s;
    time_.region_s.push_back((now - region_start_periods_) * model_.period_s);
  }
}

void ProgramSetPoints::open_functions(const MachineFunction& function) {
  const FunctionWait wait = function_times_.functions(function, elapsed_s());
  time_.tool_change_s += wait.tool_change_s;
  time_.function_s += wait.function_s;
  next_.kind = detail::changes_tool(function) ? BlockKind::tool_change : BlockKind::function;
  // A machine function needs no servo loop: the time's full interpolation leaves it out.
  if (waits_ == Waits::full) {
    open_wait(wait.tool_change_s + wait.function_s);
  }
}

bool ProgramSetPoints::wait_for_spindle() {
  const double wait_s = function_times_.before_cut(elapsed_s());
  if (wait_s <= tick_slack * model_.period_s) {
    return false;
  }
  time_.function_s += wait_s;
  next_.kind = BlockKind::function;
  if (waits_ == Waits::full) {
    open_wait(wait_s);
  }
  return true;
}

void ProgramSetPoints::open_other_move(std::uint32_t line) {
  const OtherMove& move = program_.other_moves[program_.steps[at_].index];
  if (is_cutting(move)) {
    std::vector<Segment> run;
    at_ = gather_run(program_, at_, run);
    const bool stop = run.back().stop_at_end;
    open_cut(std::make_shared<const Path>(std::move(run)), stop, false, runs_shaped_outside(model_));
    return;
  }
  ++at_;
  next_.line = line;
  if (move.dwell_s > 0.0) {
    time_.dwell_s += move.dwell_s;
    next_.kind = BlockKind::dwell;
    open_wait(move.dwell_s);
  } else {
    open_rapid(move.segment);
  }
}

void ProgramSetPoints::open_rapid(const Segment& segment) {
  next_.kind = BlockKind::rapid;
  Rapid rapid{RapidInterpolator(segment.start_mm, segment.end_mm, model_), moved_axes(segment)};
  Vector3 position;
  rapid.motion.step(position);
  start_at(position);
  active_ = std::move(rapid);
}

void ProgramSetPoints::open_cut(const std::shared_ptr<const Path>& programmed, bool exact_stop, bool is_region,
                                bool shaped) {
  if (!(programmed->length_mm() > 0.0)) {
    return;
  }
  const FanucModel& model = shaped ? shaped_model_ : model_;
  next_.kind = BlockKind::cutting;
  active_ = Cut{};
  Cut& cut = std::get<Cut>(active_);
  cut.path = programmed;
  cut.exact_stop = exact_stop;
  cut.is_region = is_region;
  cut.filters = shaped ? &shaped_filters_ : &filters_;
  if (is_planned(model)) {
    ControlledMotion planned = controlled_motion(programmed, overridden_limits(model), rules_);
    cut.path = planned.path;
    cut.smoothed = planned.profile->jerk_time_s() > 1.5 * model.period_s || !cut.filters->empty();
    cut.motion.emplace<Interpolator>(planned.path, std::move(planned.profile), model.period_s);
  } else {
    const Segments segments = programmed->segments();
    cut.blocks.assign(segments.begin(), segments.end());
    for (Segment& block : cut.blocks) {
      block.feed_mm_per_s = checked_feed(block, model);
    }
    cut.smoothed = !cut.filters->empty();
    cut.motion.emplace<BlockInterpolator>(cut.blocks, model.period_s, model.block_end);
  }
  Vector3 position;
  cut.step(position);
  cut.end = position;
  cut.filters->reset(position);
  start_at(position);
}

bool ProgramSetPoints::step_cut(Cut& cut) {
  if (!cut.draining) {
    Vector3 position;
    if (cut.step(position)) {
      cut.end = position;
      next_.line = cut.line();
    } else {
      cut.draining = true;
    }
  }
  if (cut.draining) {
    if (!cut.smoothed) {
      return false;
    }
    cut.smoothed = (set_point_ - cut.end).cwiseAbs().maxCoeff() > 1e-14 * (1.0 + cut.end.cwiseAbs().maxCoeff());
  }
  Vector3 position = cut.end;
  cut.filters->step(position);
  give(position);
  periods_cutting_ += 1.0;
  return true;
}

void ProgramSetPoints::close_cut(const Cut& cut) {
  if (!cut.exact_stop) {
    active_ = std::monostate{};
    return;
  }
  const Segments segments = cut.path->segments();
  std::size_t last = segments.size() - 1;
  while (!(segments[last].length_mm > 0.0)) --last;
  open_arrival(moved_axes(segments[last]));
}

void ProgramSetPoints::open_arrival(const std::array<bool, axis_count>& moved) {
  if (model_.in_position != InPosition::measured) {
    active_ = InPositionWait{};
    return;
  }
  double longest_s = 0.0;
  for (int i = 0; i < axis_count; ++i) {
    longest_s = std::max(longest_s, moved[static_cast<std::size_t>(i)] ? model_.in_position_s[i] : 0.0);
  }
  measured_s_ += longest_s;
  open_wait(longest_s);
}

void ProgramSetPoints::open_wait(double seconds) {
  owed_periods_ += seconds / model_.period_s;
  const double whole = std::floor(owed_periods_ + tick_slack);
  owed_periods_ -= whole;
  const double settling_periods =
      std::ceil(settling_time_constants / (model_.position_gain_per_s.minCoeff() * model_.period_s));
  const double simulated_periods = waits_ == Waits::cut ? std::min(whole, settling_periods) : whole;
  active_ = Wait{static_cast<std::uint64_t>(require_count(simulated_periods, max_set_points, "a wait", "set-points"))};
}

void ProgramSetPoints::start_at(const Vector3& position) {
  const Vector3 jump = position - set_point_;
  servo_.shift(jump);
  set_point_ = position;
  if (jump.cwiseAbs().maxCoeff() <= rounding_mm) {
    return;
  }
  next_.jump_mm += jump;
  if (!in_region_ && regions_started_ < program_.regions.size()) {
    next_.region = regions_started_;
  }
}

void ProgramSetPoints::give(const Vector3& position) {
  if (const auto count = static_cast<double>(++time_.set_points); count > max_set_points) {
    static_cast<void>(require_count(count, max_set_points, "a program", "set-points"));
  }
  set_point_ = position;
  servo_.step(position);
}

double ProgramSetPoints::elapsed_s() const noexcept {
  return (periods_cutting_ + periods_rapid_ + periods_waiting_) * model_.period_s + measured_s_ + time_.dwell_s +
         time_.tool_change_s + time_.function_s;
}

InterpolatedTime ProgramSetPoints::time() const {
  InterpolatedTime time = time_;
  time.cutting_s = periods_cutting_ * model_.period_s;
  time.rapid_s = periods_rapid_ * model_.period_s;
  time.in_position_s = periods_waiting_ * model_.period_s + measured_s_;
  time.total_s =
      time.cutting_s + time.rapid_s + time.in_position_s + time.dwell_s + time.tool_change_s + time.function_s;
  return time;
}

}  // namespace shapegcode::detail
