// Random paths under random settings, while somebody turns the override and presses hold: what of the limits the
// set-points take. A seed says everything about a path; those that 20 divides have settings of every kind and up to
// 10 000 segments. `random 1 SEED TRACE` runs it again, says its settings and writes a line for every step: number,
// activity, segments done, override, speed, distance, set-point; then the path.
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

#include "../cpp/random_trial.hpp"
#include "peers.hpp"

namespace shapegcode::peers {
namespace {

using tests::Outcome;
using tests::Trial;

constexpr double allowed_ratio = 1.001;
constexpr double allowed_segment_s = 20.0;  // the longest segments take some seconds
constexpr std::size_t most_steps = 20'000'000;
constexpr std::uint32_t wide_each = 20;  // these take twenty times as long
constexpr std::array order_names{"speed", "acceleration", "jerk"};

void write_step(std::FILE* trace, const ControllerState& state) {
  fmt::print(trace, "{} {} {} {:.6g} {:.17g} {:.17g} {:.17g}\n", state.steps, shapegcode::text_of(state.activity),
             state.segments_done, state.feed_override, state.speed_mm_per_s, state.distance_mm,
             fmt::join(state.set_point, " "));
}

void write_path(std::FILE* trace, const Trial& trial) {
  fmt::print(trace, "# {}\n", tests::text_of(trial.settings));
  for (std::size_t i = 0; i < trial.segments.size(); ++i) {
    const Segment& segment = trial.segments[i];
    fmt::print(trace, "# {} {} of {:.17g} mm to {:.17g}, radius {:.17g} sweep {:.17g}, feed {:.17g}{}; {:.17g}\n", i,
               segment.kind == SegmentKind::arc ? "arc" : "line", segment.length_mm, fmt::join(segment.end_mm, " "),
               segment.start_radius_mm, segment.sweep_rad, segment.feed_mm_per_s, segment.stop_at_end ? " stop" : "",
               fmt::join(trial.following_end[i], " "));
  }
}

// The largest of many values, and how many are above what is allowed.
struct Largest {
  double worst = 0.0;
  std::uint32_t seed = 0;
  std::size_t above = 0;

  void add(double value, double allowed, std::uint32_t of_seed) {
    above += value > allowed ? 1 : 0;
    if (value <= worst) return;
    worst = value;
    seed = of_seed;
  }
  void print(const char* name, int decimals) const {
    std::printf(", \"%s\": {\"worst\": %.*f, \"seed\": %u, \"above\": %zu}", name, decimals, worst, seed, above);
  }
};

// The worst of many paths.
struct Summary {
  std::size_t paths = 0;
  std::size_t lost = 0;
  std::array<Largest, 3> ratios;
  Largest segment_s;

  void add(const Outcome& outcome, std::uint32_t of_seed) {
    ++paths;
    lost += outcome.ended && outcome.arrived ? 0 : 1;
    segment_s.add(outcome.longest_segment_s, allowed_segment_s, of_seed);
    for (std::size_t i = 0; i < ratios.size(); ++i) ratios[i].add(outcome.worst[i], allowed_ratio, of_seed);
  }
  void print(const char* name) const {
    std::printf(", \"%s\": {\"paths\": %zu, \"lost\": %zu", name, paths, lost);
    for (std::size_t i = 0; i < ratios.size(); ++i) ratios[i].print(order_names[i], 7);
    segment_s.print("segment_s", 3);
    std::printf("}");
  }
};

// What is wrong with a path, if anything, with its settings; `always`: those at least.
void tell(const Outcome& outcome, const Trial& trial, std::uint32_t seed, bool always) {
  bool wrong = !outcome.ended || !outcome.arrived;
  if (wrong) std::fprintf(stderr, "seed %u: %s\n", seed, outcome.ended ? "at rest elsewhere" : "not at rest at last");
  if (outcome.longest_segment_s > allowed_segment_s) {
    std::fprintf(stderr, "seed %u: %.1f s in one segment\n", seed, outcome.longest_segment_s);
    wrong = true;
  }
  for (std::size_t order = 0; order < order_names.size(); ++order) {
    if (outcome.worst[order] <= allowed_ratio) continue;
    std::fprintf(stderr, "seed %u: %s at %.6f of its limit\n", seed, order_names[order], outcome.worst[order]);
    wrong = true;
  }
  if (wrong || always) std::fprintf(stderr, "    %s\n", tests::text_of(trial.settings).c_str());
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
    const Trial trial = seed % wide_each == 0 ? tests::wide_trial(seed) : tests::random_trial(seed);
    const auto see = [&](const ControllerState& state) {
      if (trace != nullptr) write_step(trace, state);
    };
    if (trace != nullptr) write_path(trace, trial);
    const Outcome outcome = tests::run_trial(trial, seed, see, most_steps);
    (std::holds_alternative<FollowingFir>(trial.settings.shaper) ? following : fixed).add(outcome, seed);
    tell(outcome, trial, seed, count == 1);
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
