// The end of a motion: three constant jerks, each for whole periods.
#pragma once

#include <algorithm>
#include <array>

#include <Eigen/LU>

#include "planner/stations.hpp"

namespace shapegcode {

struct Landing {
  std::array<double, 3> jerk{};
  std::array<int, 3> periods{};

  [[nodiscard]] bool runs() const noexcept { return periods[0] + periods[1] + periods[2] > 0; }
  /// The jerk of the next period.
  double next() noexcept {
    std::size_t part = 0;
    while (periods[part] == 0) ++part;
    --periods[part];
    return jerk[part];
  }
};

/// From a state to rest after `travel`, with so many periods of each jerk, at least one.
[[nodiscard]] inline Landing landing_after(double travel, const AlongPath& state, const std::array<int, 3>& periods,
                                           double period_s) noexcept {
  Landing found;
  found.periods = periods;
  const double whole = (periods[0] + periods[1] + periods[2]) * period_s;
  // What a jerk of 1 in each part makes of acceleration, speed and distance at the end.
  Eigen::Matrix3d effect;
  double after = whole;
  for (Eigen::Index i = 0; i < 3; ++i) {
    const double t = found.periods[static_cast<std::size_t>(i)] * period_s;
    after -= t;
    effect(0, i) = t;
    effect(1, i) = t * (0.5 * t + after);
    effect(2, i) = t * (t * t / 6.0 + after * 0.5 * (t + after));
  }
  const double a = state.acceleration;
  const double v = state.speed;
  const Vector3 jerk = effect.inverse() * Vector3(-a, -v - a * whole, travel - whole * (v + 0.5 * a * whole));
  std::copy_n(jerk.data(), 3, found.jerk.begin());
  return found;
}

}  // namespace shapegcode
