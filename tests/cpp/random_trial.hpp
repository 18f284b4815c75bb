// A random path, settings of a control, and what somebody does to it while it runs: all of one seed.
#pragma once

#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <random>
#include <string>
#include <vector>

#include "shapegcode/controller.hpp"
#include "shapegcode/path.hpp"

namespace shapegcode::tests {

struct Draw {
  std::mt19937 engine;
  double uniform() { return std::uniform_real_distribution<double>(0.0, 1.0)(engine); }
  double between(double low, double high) { return low + (high - low) * uniform(); }
  double logarithmic(double low, double high) { return low * std::pow(high / low, uniform()); }
  bool chance(double share) { return uniform() < share; }
};

// What somebody does to a control: chances of each period.
struct Operator {
  double push = 1.0;
  double turn = 0.0;
  double hold = 0.0;
  double resume = 0.01;
  double abort = 0.0;
  std::size_t leaves = 0;  // from this step on nothing more is done
};

struct Trial {
  ControllerSettings settings;
  std::vector<Segment> segments;
  std::vector<std::array<double, max_following_axes>> following_end;
  Operator does;
};

Trial random_trial(std::uint32_t seed);

/// Every setting is drawn: both laws, the override at the start, correction, windows of 8 to 1024, up to six following
/// axes, 1 to 10 000 segments. The seeds of `random_trial` keep the trials that they stand for in its tests.
Trial wide_trial(std::uint32_t seed);

inline constexpr std::size_t max_steps_of_trial = 1'000'000;

struct Outcome {
  std::array<double, 3>
      worst{};  ///< largest speed, acceleration and jerk of any axis (finite differences), over its limit
  double longest_segment_s = 0.0;  ///< time in one segment after the operator has left
  std::uint64_t late_plans = 0;
  std::size_t steps = 0;
  std::size_t turns = 0;
  std::size_t holds = 0;
  bool ended = false;    ///< came to rest at last
  bool arrived = false;  ///< at the end of the path, or was aborted
};

/// Runs the path of a seed; `see` gets the state after each step.
Outcome run_trial(const Trial& trial, std::uint32_t seed, const std::function<void(const ControllerState&)>& see = {},
                  std::size_t max_steps = max_steps_of_trial);

/// The settings in one line, for a message.
std::string text_of(const ControllerSettings& settings);

}  // namespace shapegcode::tests
