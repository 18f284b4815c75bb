// Random paths under random settings, while somebody turns the override and presses hold: what of the limits the
// set-points take. A seed says everything about a path; `random 1 SEED TRACE` runs it again, says its settings and
// writes a line for every step: number, activity, segments done, override, speed, distance, set-point; then the path.
#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <random>
#include <string>
#include <vector>

#include <fmt/format.h>
#include <fmt/ranges.h>

#include "../cpp/random_motion.hpp"
#include "peers.hpp"
#include "peers_trial.hpp"

namespace shapegcode::peers {
namespace {

constexpr double allowed_ratio = 1.001;
constexpr std::size_t most_steps_of_path = 1'000'000;
constexpr std::array order_names{"speed", "acceleration", "jerk"};

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
  std::array<std::array<double, 3>, most_controller_axes> limits_{};
  std::vector<tests::Differences> watchers_;
};

struct Outcome {
  std::array<double, 3> worst{};
  std::size_t steps = 0;
  std::size_t turns = 0;
  std::size_t holds = 0;
  bool ended = false;    // came to rest at last
  bool arrived = false;  // at the end of the path, or was aborted
};

void write_step(std::FILE* trace, const ControllerState& state) {
  fmt::print(trace, "{} {} {} {:.6g} {:.17g} {:.17g} {:.17g}\n", state.steps, shapegcode::text_of(state.activity),
             state.segments_done, state.feed_override, state.speed_mm_per_s, state.distance_mm,
             fmt::join(state.set_point, " "));
}

void write_path(std::FILE* trace, const Trial& trial) {
  for (std::size_t i = 0; i < trial.segments.size(); ++i) {
    const Segment& segment = trial.segments[i];
    fmt::print(trace, "# {} {} of {:.17g} mm to {:.17g}, radius {:.17g} sweep {:.17g}, feed {:.17g}{}; {:.17g}\n", i,
               segment.kind == SegmentKind::arc ? "arc" : "line", segment.length_mm, fmt::join(segment.end_mm, " "),
               segment.start_radius_mm, segment.sweep_rad, segment.feed_mm_per_s, segment.stop_at_end ? " stop" : "",
               fmt::join(trial.following_end[i], " "));
  }
}

Outcome run(const Trial& trial, std::uint32_t seed, std::FILE* trace) {
  Draw draw{std::mt19937(seed ^ 0x9e3779b9U)};
  MotionController control(trial.settings);
  const std::size_t n_following = trial.settings.following.size();
  std::array<double, most_controller_axes> point{};
  const std::span<double> out(point.data(), axis_count + n_following);
  Ratios ratios(trial.settings);
  ratios.add(out);
  Outcome outcome;
  std::size_t pushed = 0;
  while (outcome.steps < most_steps_of_path && !outcome.ended) {
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
    if (trace != nullptr) write_step(trace, control.state());
    ++outcome.steps;
    const bool idle = activity == Activity::idle && pushed == trial.segments.size();
    outcome.ended = idle || activity == Activity::aborted;
    const Vector3 end = trial.segments.back().end_mm;
    outcome.arrived = activity == Activity::aborted ||
                      (idle && (Eigen::Map<const Vector3>(point.data()) - end).norm() <= 1e-9 * (1.0 + end.norm()));
  }
  outcome.worst = ratios.worst();
  return outcome;
}

// The worst of many paths.
struct Summary {
  std::size_t paths = 0;
  std::size_t lost = 0;
  std::array<double, 3> worst{};
  std::array<std::uint32_t, 3> seed{};
  std::array<std::size_t, 3> above{};

  void add(const Outcome& outcome, std::uint32_t of_seed) {
    ++paths;
    lost += outcome.ended && outcome.arrived ? 0 : 1;
    for (std::size_t order = 0; order < worst.size(); ++order) {
      above[order] += outcome.worst[order] > allowed_ratio ? 1 : 0;
      if (outcome.worst[order] <= worst[order]) continue;
      worst[order] = outcome.worst[order];
      seed[order] = of_seed;
    }
  }
  void print(const char* name) const {
    std::printf(", \"%s\": {\"paths\": %zu, \"lost\": %zu", name, paths, lost);
    for (std::size_t order = 0; order < worst.size(); ++order) {
      std::printf(", \"%s\": {\"worst\": %.7f, \"seed\": %u, \"above\": %zu}", order_names[order], worst[order],
                  seed[order], above[order]);
    }
    std::printf("}");
  }
};

// What is wrong with a path, if anything, with its settings; `always`: those at least.
void tell(const Outcome& outcome, const Trial& trial, std::uint32_t seed, bool always) {
  bool wrong = !outcome.ended || !outcome.arrived;
  if (wrong) std::fprintf(stderr, "seed %u: %s\n", seed, outcome.ended ? "at rest elsewhere" : "not at rest at last");
  for (std::size_t order = 0; order < order_names.size(); ++order) {
    if (outcome.worst[order] <= allowed_ratio) continue;
    std::fprintf(stderr, "seed %u: %s at %.6f of its limit\n", seed, order_names[order], outcome.worst[order]);
    wrong = true;
  }
  if (wrong || always) std::fprintf(stderr, "    %s\n", text_of(trial.settings).c_str());
}

}  // namespace

int random_motion(std::span<const char* const> arguments) {
  const auto count = static_cast<std::uint32_t>(std::strtoul(arguments[0], nullptr, 10));
  const auto first = static_cast<std::uint32_t>(std::strtoul(arguments[1], nullptr, 10));
  std::FILE* trace = arguments.size() > 2 ? std::fopen(arguments[2], "w") : nullptr;
  Summary fixed;      // whose shapers stay what they are
  Summary following;  // whose shaper follows an axis
  std::size_t steps = 0;
  std::size_t turns = 0;
  std::size_t holds = 0;
  for (std::uint32_t seed = first; seed < first + count; ++seed) {
    const Trial trial = random_trial(seed);
    const Outcome outcome = run(trial, seed, trace);
    (std::holds_alternative<FollowingFir>(trial.settings.shaper) ? following : fixed).add(outcome, seed);
    tell(outcome, trial, seed, count == 1);
    if (trace != nullptr) write_path(trace, trial);
    steps += outcome.steps;
    turns += outcome.turns;
    holds += outcome.holds;
  }
  std::printf("{\"set_points\": %zu, \"overrides\": %zu, \"holds\": %zu", steps, turns, holds);
  fixed.print("fixed");
  following.print("following");
  std::printf("}\n");
  if (trace != nullptr) std::fclose(trace);
  return 0;
}

}  // namespace shapegcode::peers
