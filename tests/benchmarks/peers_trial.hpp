// A random path, settings of a control, and what somebody does to it while it runs: all of one seed.
#pragma once

#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <random>
#include <string>
#include <vector>

#include "shapegcode/controller.hpp"
#include "shapegcode/path.hpp"

namespace shapegcode::peers {

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
  std::vector<std::array<double, most_following_axes>> following_end;
  Operator does;
};

Trial random_trial(std::uint32_t seed);

/// The settings in one line, for a message.
std::string text_of(const ControllerSettings& settings);

}  // namespace shapegcode::peers
