#include <doctest/doctest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <random>
#include <vector>

#include "controller/axis_tracker.hpp"

using namespace shapegcode;

namespace {

constexpr double period_s = 0.001;
constexpr double infinite = std::numeric_limits<double>::infinity();

// The largest difference of positions over its limit; at rest before.
double largest_share(std::vector<double> x, const TrackerLimits& limits) {
  x.insert(x.begin(), 3, x.front());
  double share = 0.0;
  for (std::size_t k = 3; k < x.size(); ++k) {
    const double noise = 8.0 * std::abs(x[k]) * std::numeric_limits<double>::epsilon();
    const double v = x[k] - x[k - 1];
    const double a = v - (x[k - 1] - x[k - 2]);
    const double j = a - (x[k - 1] - 2.0 * x[k - 2] + x[k - 3]);
    share = std::max({share, (std::abs(v) - noise) / (limits.speed * period_s),
                      (std::abs(a) - noise) / (limits.acceleration * period_s * period_s),
                      (std::abs(j) - noise) / (limits.jerk * std::pow(period_s, 3))});
  }
  return share;
}

// Of the fastest motion from rest to rest: seven phases, or fewer.
double shortest_s(double distance, const TrackerLimits& limits) {
  const auto ramp_s = [&](double v) {
    const double a = limits.acceleration;
    return v * limits.jerk >= a * a ? v / a + a / limits.jerk : 2.0 * std::sqrt(v / limits.jerk);
  };
  if (limits.speed * ramp_s(limits.speed) <= distance)
    return 2.0 * ramp_s(limits.speed) + (distance - limits.speed * ramp_s(limits.speed)) / limits.speed;
  double low = 0.0;
  double high = limits.speed;
  for (int n = 0; n < 200; ++n) {
    const double middle = 0.5 * (low + high);
    (middle * ramp_s(middle) > distance ? high : low) = middle;
  }
  return 2.0 * ramp_s(low);
}

}  // namespace

TEST_CASE("a tracker goes to its goal nearly as fast as seven phases would") {
  std::mt19937 random(1);
  const auto drawn = [&](double low, double high) {
    return std::exp(std::uniform_real_distribution(std::log(low), std::log(high))(random));
  };
  int slow_ones = 0;
  for (int trial = 0; trial < 400; ++trial) {
    TrackerLimits limits{drawn(0.5, 1000.0), drawn(50.0, 10000.0), drawn(1e3, 1e7)};
    limits.jerk = std::min(limits.jerk, limits.acceleration / period_s);
    const double distance = drawn(1e-5, 500.0) * (trial % 2 == 0 ? 1.0 : -1.0);
    AxisTracker tracker(period_s);
    std::vector<double> x{0.0};
    while (x.size() < 2'000'000 && (x.size() == 1 || !tracker.at_rest())) {
      tracker.step(distance, limits);
      x.push_back(tracker.position());
    }
    CAPTURE(trial);
    CAPTURE(distance);
    CAPTURE(limits.speed);
    CAPTURE(limits.acceleration);
    CAPTURE(limits.jerk);
    CHECK(x.back() == distance);
    CHECK(std::abs(*std::ranges::max_element(x, {}, [](double value) { return std::abs(value); })) <=
          std::abs(distance) * (1.0 + 1e-9));
    CHECK(largest_share(x, limits) <= 1.0 + 1e-6);
    const double took_s = static_cast<double>(x.size() - 1) * period_s;
    slow_ones += took_s > 1.05 * shortest_s(std::abs(distance), limits) + 8.0 * period_s ? 1 : 0;
    CHECK(took_s <= 1.3 * shortest_s(std::abs(distance), limits) + 8.0 * period_s);
  }
  CHECK(slow_ones <= 4);
}

TEST_CASE("a goal, speeds and stops that change in any period keep the limits") {
  std::mt19937 random(2);
  const TrackerLimits limits{120.0, 900.0, 40'000.0};
  std::uniform_real_distribution<double> share(0.0, 1.0);
  for (int trial = 0; trial < 100; ++trial) {
    AxisTracker tracker(period_s);
    std::vector<double> x{0.0};
    double goal = 0.0;
    TrackerLimits now = limits;
    int mode = 0;
    for (int k = 0; k < 3000; ++k) {
      if (share(random) < 0.01) {
        mode = static_cast<int>(3.0 * share(random));
        goal = share(random) < 0.2 ? infinite : 60.0 * (share(random) - 0.5);
        now.speed = limits.speed * share(random);
      }
      mode == 2 ? tracker.step_to_speed(0.0, now) : tracker.step(goal, now);
      x.push_back(tracker.position());
    }
    now.speed = limits.speed;
    for (int k = 0; k < 8000 && (tracker.position() != 1.0 || !tracker.at_rest()); ++k) {
      tracker.step(1.0, now);
      x.push_back(tracker.position());
    }
    CAPTURE(trial);
    CHECK(x.back() == 1.0);
    CHECK(largest_share(x, limits) <= 1.0 + 1e-6);
  }
}
