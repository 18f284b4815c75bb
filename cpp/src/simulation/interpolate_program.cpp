#include <algorithm>
#include <cmath>
#include <memory>
#include <span>
#include <string>

#include "program_runs.hpp"
#include "shapegcode/error.hpp"
#include "shapegcode/motion/interpolator.hpp"
#include "shapegcode/motion/look_ahead.hpp"
#include "shapegcode/motion/rapid.hpp"
#include "shapegcode/plant/servo_lag.hpp"
#include "shapegcode/simulation/cycle_time.hpp"

namespace shapegcode {
namespace {

constexpr std::uint64_t most_set_points = 4'000'000'000;
constexpr double memory = 40.0;  // time constants of the servo loop that a dwell needs to be played for

class Machine {
 public:
  Machine(const Program& program, const ControllerModel& model)
      : program_(program), model_(model), servo_(model.position_gain_per_s, model.feed_forward_ratio, model.period_s) {
    for (const Fir& filter : acceleration_filters(model)) {
      filters_.emplace_back(filter, axis_count);
    }
  }

  InterpolatedTime run() {
    time_.region_s.reserve(program_.regions.size());
    for (std::size_t at = 0; at < program_.steps.size();) {
      const ProgramStep& step = program_.steps[at];
      if (step.kind == StepKind::move) {
        at = other_move(at);
        continue;
      }
      if (step.kind == StepKind::region) {
        const Region& region = *program_.regions[step.index];
        const double before = periods_cutting_ + periods_waiting_ + measured_s_ / model_.period_s;
        cut(region.path, region.exact_stop_at_end);
        time_.region_s.push_back((periods_cutting_ + periods_waiting_ + measured_s_ / model_.period_s - before) *
                                 model_.period_s);
      } else {
        functions(program_.functions[step.index]);
      }
      ++at;
    }
    time_.cutting_s = periods_cutting_ * model_.period_s;
    time_.rapid_s = periods_rapid_ * model_.period_s;
    time_.in_position_s = periods_waiting_ * model_.period_s + measured_s_;
    time_.total_s =
        time_.cutting_s + time_.rapid_s + time_.in_position_s + time_.dwell_s + time_.tool_change_s + time_.function_s;
    return std::move(time_);
  }

 private:
  void functions(const MachineFunction& function) {
    for (int k = 0; k < function.m_count; ++k) {
      const bool changes = function.m_codes[static_cast<std::size_t>(k)] == detail::tool_change_code;
      (changes ? time_.tool_change_s : time_.function_s) += changes ? model_.tool_change_s : model_.m_function_s;
    }
  }

  std::size_t other_move(std::size_t at) {
    const OtherMove& move = program_.other_moves[program_.steps[at].index];
    if (detail::is_cutting(move)) {
      std::vector<Segment> run;
      at = detail::gather_run(program_, at, run);
      const bool stop = run.back().stop_at_end;
      cut(std::make_shared<const Path>(std::move(run)), stop);
      return at;
    }
    if (move.dwell_s > 0.0) {
      time_.dwell_s += move.dwell_s;
      const double settled_s = memory / model_.position_gain_per_s.minCoeff();
      for (double t = 0.0; t < std::min(move.dwell_s, settled_s); t += model_.period_s) {
        servo_.step(set_point_);
      }
    } else {
      rapid(move.segment);
    }
    return at + 1;
  }

  void rapid(const Segment& segment) {
    RapidPlayer player(segment.start_mm, segment.end_mm, model_);
    Vector3 position;
    player.step(position);
    start_at(position);
    while (player.step(position)) {
      give(position);
      periods_rapid_ += 1.0;
    }
    wait(detail::moved_axes(segment));
  }

  void cut(const std::shared_ptr<const Path>& programmed, bool exact_stop) {
    if (!(programmed->length_mm() > 0.0)) {
      return;
    }
    if (model_.motion == MotionKind::look_ahead) {
      const auto profile =
          std::make_shared<const SpeedProfile>(plan_speed(*programmed, detail::overridden_limits(model_)));
      Interpolator interpolator(programmed, profile, model_.period_s);
      play([&](Vector3& position) { return interpolator.step(position); },
           profile->jerk_time_s() > 1.5 * model_.period_s || !filters_.empty());
    } else {
      std::vector<Segment> blocks = programmed->segments();
      for (Segment& block : blocks) {
        block.feed_mm_per_s = detail::checked_feed(block, model_);
      }
      BlockPlayer player(blocks, model_.period_s, model_.block_end);
      play([&](Vector3& position) { return player.step(position); }, !filters_.empty());
    }
    if (exact_stop) {
      const auto& segments = programmed->segments();
      const auto last = std::find_if(segments.rbegin(), segments.rend(),
                                     [](const Segment& segment) { return segment.length_mm > 0.0; });
      wait(detail::moved_axes(*last));
    }
  }

  // Set-points through the filters until they rest. What comes out of a smoothing is seen to rest when a set-point
  // repeats the one before it: that period counts.
  template <class Step>
  void play(Step&& step, bool smoothed) {
    Vector3 position;
    step(position);
    for (FirStream& filter : filters_) {
      filter.reset({position.data(), axis_count});
    }
    start_at(position);
    Vector3 end = position;
    while (step(position)) {
      end = position;
      give_filtered(position);
    }
    for (bool rested = !smoothed; !rested;) {
      rested = (set_point_ - end).cwiseAbs().maxCoeff() <= 1e-14 * (1.0 + end.cwiseAbs().maxCoeff());
      give_filtered(end);
    }
  }

  void give_filtered(Vector3 position) {
    for (FirStream& filter : filters_) {
      filter.step({position.data(), axis_count});
    }
    give(position);
    periods_cutting_ += 1.0;
  }

  void give(const Vector3& position) {
    if (++time_.set_points > most_set_points) {
      throw Error(ErrorKind::argument,
                  "program takes more than " + std::to_string(most_set_points) + " set-points to interpolate");
    }
    set_point_ = position;
    servo_.step(position);
  }

  // A change of coordinates, or of an axis whose position was not known, moves nothing: the servo loop keeps its error.
  void start_at(const Vector3& position) {
    servo_.shift(position - set_point_);
    set_point_ = position;
  }

  void wait(const std::array<bool, axis_count>& moved) {
    if (model_.in_position == InPosition::measured) {
      double longest_s = 0.0;
      for (int i = 0; i < axis_count; ++i) {
        longest_s = std::max(longest_s, moved[static_cast<std::size_t>(i)] ? model_.in_position_s[i] : 0.0);
      }
      measured_s_ += longest_s;
      for (double t = 0.0; t < longest_s; t += model_.period_s) {
        servo_.step(set_point_);
      }
      return;
    }
    while ((servo_.error_mm().cwiseAbs().array() > model_.in_position_width_mm.array()).any()) {
      servo_.step(set_point_);
      periods_waiting_ += 1.0;
    }
  }

  const Program& program_;
  const ControllerModel& model_;
  std::vector<FirStream> filters_;
  ServoLag servo_;
  Vector3 set_point_ = Vector3::Zero();
  double periods_cutting_ = 0.0;
  double periods_rapid_ = 0.0;
  double periods_waiting_ = 0.0;
  double measured_s_ = 0.0;
  InterpolatedTime time_;
};

}  // namespace

InterpolatedTime interpolate_program(const Program& program, const ControllerModel& model) {
  check(model);
  return Machine(program, model).run();
}

}  // namespace shapegcode
