#include "random_trial.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cstdint>
#include <span>
#include <variant>

#include "random_motion.hpp"

namespace shapegcode::tests {
namespace {

ControllerShaper random_shaper(Draw& draw) {
  const auto two_taps = [&] {
    const double first = draw.between(0.45, 0.6);
    return Fir({0, static_cast<int>(draw.between(3.0, 25.0))}, {first, 1.0 - first});
  };
  const double kind = draw.uniform();
  if (kind < 0.35) return Fir({0}, {1.0});
  if (kind < 0.6) return two_taps();
  if (kind < 0.75) {
    const int half = static_cast<int>(draw.between(3.0, 12.0));
    return Fir({0, half, 2 * half}, {1.0, -1.0, 1.0});  // a shaper of unity magnitude
  }
  if (kind < 0.9) return std::vector<Fir>{two_taps(), Fir({0}, {1.0}), Fir::moving_average(8)};
  return FollowingFir(VaryingFir({two_taps(), two_taps()}), draw.chance(0.5) ? 0 : 1, {-30.0, 30.0});
}

ControllerSettings random_settings(Draw& draw) {
  ControllerSettings settings;
  settings.period_s = draw.chance(0.8) ? 0.001 : draw.chance(0.5) ? 0.0005 : 0.002;
  MotionLimits& limits = settings.limits;
  limits.law = AccelerationLaw::jerk_limited;
  const double acceleration = draw.logarithmic(200.0, 5000.0);
  const double jerk = draw.chance(0.1) ? MotionLimits::none : acceleration * draw.logarithmic(10.0, 200.0);
  for (int axis = 0; axis < axis_count; ++axis) {
    limits.max_feed_mm_per_s[axis] = draw.logarithmic(40.0, 400.0);
    limits.max_acceleration_mm_per_s2[axis] = acceleration * draw.between(0.4, 1.0);
    limits.max_jerk_mm_per_s3[axis] = jerk * draw.between(0.4, 1.0);
  }
  if (draw.chance(0.3)) settings.contour_tolerance_mm = draw.logarithmic(0.003, 0.1);
  settings.smoothing_time_s = draw.chance(0.1) ? 0.0 : 0.001 * draw.between(4.0, 20.0);
  settings.shaper = random_shaper(draw);
  // The settings want one shaper for each axis: following axes do not go with a list of three.
  if (!std::holds_alternative<std::vector<Fir>>(settings.shaper) && draw.chance(0.3)) {
    settings.following.resize(draw.chance(0.5) ? 1 : 2);
    for (FollowingLimits& axis : settings.following) {
      axis.max_feed = draw.logarithmic(20.0, 200.0);
      axis.max_acceleration = draw.logarithmic(200.0, 5000.0);
      axis.max_jerk = std::isfinite(jerk) ? axis.max_acceleration * draw.logarithmic(10.0, 200.0) : jerk;
    }
  }
  settings.contour_correction = draw.chance(0.25) && !std::holds_alternative<FollowingFir>(settings.shaper);
  settings.window = static_cast<std::size_t>(draw.logarithmic(8.0, 100.0));
  settings.queue = static_cast<std::size_t>(draw.logarithmic(4.0, 200.0));
  return settings;
}

// Finite differences of the set-points over the limits, per axis.
class Ratios {
 public:
  explicit Ratios(const ControllerSettings& settings)
      : axes_(static_cast<std::size_t>(axis_count) + settings.following.size()), period_s_(settings.period_s) {
    for (std::size_t axis = 0; axis < axes_; ++axis) {
      limits_[axis] = limits_of(settings, axis);
      watchers_.emplace_back(1, period_s_);
    }
  }
  void add(std::span<const double> position) {
    for (std::size_t axis = 0; axis < axes_; ++axis) watchers_[axis].add(position.subspan(axis, 1));
  }
  [[nodiscard]] std::array<double, 3> worst() const {
    std::array<double, 3> worst{};
    for (std::size_t axis = 0; axis < axes_; ++axis) {
      const std::array<double, 3> seen{watchers_[axis].speed(), watchers_[axis].acceleration(), watchers_[axis].jerk()};
      for (std::size_t order = 0; order < 3; ++order) {
        worst[order] = std::max(worst[order], seen[order] / limits_[axis][order]);
      }
    }
    return worst;
  }

 private:
  static std::array<double, 3> limits_of(const ControllerSettings& settings, std::size_t axis) {
    if (axis >= axis_count) {
      const FollowingLimits& limits = settings.following[axis - axis_count];
      return {limits.max_feed, limits.max_acceleration, limits.max_jerk};
    }
    const auto i = static_cast<Eigen::Index>(axis);
    const MotionLimits& limits = settings.limits;
    return {limits.max_feed_mm_per_s[i], limits.max_acceleration_mm_per_s2[i], limits.max_jerk_mm_per_s3[i]};
  }

  std::size_t axes_;
  double period_s_;
  std::array<std::array<double, 3>, max_controller_axes> limits_{};
  std::vector<Differences> watchers_;
};

}  // namespace

namespace {

// A path for the settings, and what somebody does meanwhile.
Trial trial_of(const ControllerSettings& settings, double fewest, double most, Draw& draw) {
  Trial trial;
  trial.settings = settings;
  const auto count = static_cast<std::size_t>(draw.logarithmic(fewest, most));
  trial.segments = random_segments(draw.engine, count, draw.logarithmic(20.0, 400.0), draw.chance(0.6));
  std::array<double, max_following_axes> at{};
  for (std::size_t i = 0; i < count; ++i) {
    for (std::size_t axis = 0; axis < trial.settings.following.size(); ++axis) {
      if (draw.chance(0.7)) at[axis] += draw.between(-20.0, 20.0);
    }
    trial.following_end.push_back(at);
    if (draw.chance(0.03)) trial.segments[i].stop_at_end = true;
  }
  trial.does.push = draw.chance(0.5) ? 1.0 : draw.logarithmic(0.01, 0.5);
  trial.does.turn = draw.logarithmic(0.0005, 0.02);
  trial.does.hold = draw.chance(0.7) ? draw.logarithmic(0.0003, 0.01) : 0.0;
  trial.does.resume = draw.logarithmic(0.003, 0.1);
  trial.does.abort = draw.chance(0.05) ? 0.0005 : 0.0;
  trial.does.leaves = 20'000;
  return trial;
}

}  // namespace

Trial random_trial(std::uint32_t seed) {
  Draw draw{std::mt19937(seed)};
  const ControllerSettings settings = random_settings(draw);
  return trial_of(settings, 3.0, 60.0, draw);
}

Trial wide_trial(std::uint32_t seed) {
  Draw draw{std::mt19937(seed)};
  ControllerSettings settings = random_settings(draw);
  if (draw.chance(0.4)) {
    settings.limits.law = AccelerationLaw::constant_time;
    settings.limits.time_constant_s = draw.logarithmic(0.005, 0.3);
  }
  settings.limits.feed_override = draw.chance(0.3) ? 1.0 : draw.logarithmic(0.02, 2.0);
  settings.contour_correction = draw.chance(0.4) && !std::holds_alternative<FollowingFir>(settings.shaper);
  settings.window = static_cast<std::size_t>(draw.logarithmic(8.0, 1025.0));
  settings.queue = static_cast<std::size_t>(draw.logarithmic(4.0, 2000.0));
  if (!std::holds_alternative<std::vector<Fir>>(settings.shaper)) {
    settings.following.resize(draw.chance(0.5) ? 0 : static_cast<std::size_t>(draw.between(1.0, 7.0)));
    for (FollowingLimits& axis : settings.following) {
      axis.max_feed = draw.logarithmic(20.0, 200.0);
      axis.max_acceleration = draw.logarithmic(200.0, 5000.0);
      axis.max_jerk =
          draw.chance(0.9) ? axis.max_acceleration * draw.logarithmic(10.0, 200.0) : FollowingLimits{}.max_jerk;
    }
  }
  return trial_of(settings, 1.0, 10'001.0, draw);
}

Outcome run_trial(const Trial& trial, std::uint32_t seed, const std::function<void(const ControllerState&)>& see,
                  std::size_t max_steps) {
  Draw draw{std::mt19937(seed ^ 0x9e3779b9U)};
  MotionController control(trial.settings);
  const std::size_t n_following = trial.settings.following.size();
  std::array<double, max_controller_axes> point{};
  const std::span<double> out(point.data(), axis_count + n_following);
  Ratios ratios(trial.settings);
  ratios.add(out);
  Outcome outcome;
  std::size_t pushed = 0;
  std::uint64_t segment = 0;
  std::size_t segment_begin = 0;
  while (outcome.steps < max_steps && !outcome.ended) {
    const bool alone = outcome.steps >= trial.does.leaves;
    while (pushed < trial.segments.size() && (alone || draw.chance(trial.does.push))) {
      if (control.push(trial.segments[pushed], std::span(trial.following_end[pushed].data(), n_following)) !=
          PushResult::accepted) {
        break;
      }
      ++pushed;
    }
    if (alone) {
      control.feed_override(1.0);
      control.resume();
    } else {
      if (draw.chance(trial.does.turn)) {
        control.feed_override(draw.chance(0.1) ? 0.0 : draw.between(0.0, 2.0));
        ++outcome.turns;
      }
      if (draw.chance(trial.does.hold)) {
        control.hold();
        ++outcome.holds;
      }
      if (draw.chance(trial.does.resume)) control.resume();
      if (draw.chance(trial.does.abort)) control.abort();
    }
    const Activity activity = control.step(out);
    ratios.add(out);
    if (see) see(control.state());
    ++outcome.steps;
    if (alone) {
      const std::uint64_t now = control.state().segments_done;
      if (now != segment || outcome.steps == trial.does.leaves + 1) segment_begin = outcome.steps;
      segment = now;
      const double time_s = trial.settings.period_s * static_cast<double>(outcome.steps - segment_begin);
      outcome.longest_segment_s = std::max(outcome.longest_segment_s, time_s);
    }
    const bool idle = activity == Activity::idle && pushed == trial.segments.size();
    outcome.ended = idle || activity == Activity::aborted;
    const Vector3 end = trial.segments.back().end_mm;
    outcome.arrived = activity == Activity::aborted ||
                      (idle && (Eigen::Map<const Vector3>(point.data()) - end).norm() <= 1e-9 * (1.0 + end.norm()));
  }
  outcome.worst = ratios.worst();
  outcome.late_plans = control.state().late_plans;
  return outcome;
}

std::string text_of(const ControllerSettings& settings) {
  const auto list = [](const Vector3& vector) {
    return fmt::format("{:.6g} {:.6g} {:.6g}", vector[0], vector[1], vector[2]);
  };
  return fmt::format(
      "law {} override {:.6g} time constant {:.6g} period {} window {} queue {} smoothing {:.6g} tolerance {:.6g} "
      "correction {} shaper kind {} following {}; feed "
      "{}; "
      "acceleration {}; jerk {}",
      static_cast<int>(settings.limits.law), settings.limits.feed_override, settings.limits.time_constant_s,
      settings.period_s, settings.window, settings.queue, settings.smoothing_time_s, settings.contour_tolerance_mm,
      settings.contour_correction, settings.shaper.index(), settings.following.size(),
      list(settings.limits.max_feed_mm_per_s), list(settings.limits.max_acceleration_mm_per_s2),
      list(settings.limits.max_jerk_mm_per_s3));
}

}  // namespace shapegcode::tests
