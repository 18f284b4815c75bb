#pragma once

#include <doctest/doctest.h>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <limits>
#include <numbers>

#include "shapegcode/motion.hpp"

// What the tests of the look-ahead share.
namespace shapegcode::tests {

inline constexpr double pi = std::numbers::pi;
inline constexpr double none = std::numeric_limits<double>::infinity();

inline MotionLimits constant_time(double time_constant_s) {
  MotionLimits limits;
  limits.law = AccelerationLaw::constant_time;
  limits.time_constant_s = time_constant_s;
  return limits;
}

inline double speed_at(const SpeedProfile& profile, double time) {
  std::size_t cursor = 0;
  return profile.speed_mm_per_s(time, cursor);
}

inline double distance_at(const SpeedProfile& profile, double time) {
  std::size_t cursor = 0;
  return profile.distance_mm(time, cursor);
}

/// The profile joins up: time and distance without gaps, speed without jumps, from rest to rest over the whole length.
inline void check_joined(const SpeedProfile& profile, double length) {
  double time = 0.0;
  double distance = 0.0;
  double speed = 0.0;
  double fastest = 0.0;
  for (const SpeedPhase& phase : profile.phases()) {
    CHECK(phase.duration_s > 0.0);
    CHECK(phase.start_s == doctest::Approx(time).epsilon(1e-12));
    CHECK(std::abs(phase.distance_mm - distance) < 1e-9 * (1.0 + length));
    fastest = std::max(fastest, phase.speed_mm_per_s);
    CHECK(std::abs(phase.speed_mm_per_s - speed) < 1e-5 * (1.0 + fastest));
    CHECK(phase.speed_mm_per_s >= 0.0);
    time += phase.duration_s;
    distance = phase.distance_mm +
               phase.duration_s * (phase.speed_mm_per_s + 0.5 * phase.acceleration_mm_per_s2 * phase.duration_s);
    speed = phase.speed_mm_per_s + phase.acceleration_mm_per_s2 * phase.duration_s;
  }
  CHECK(std::abs(speed) < 1e-5 * (1.0 + fastest));
  CHECK(std::abs(distance - length) < 1e-9 * (1.0 + length));
  CHECK(profile.ramp_duration_s() == doctest::Approx(time).epsilon(1e-12));
}

}  // namespace shapegcode::tests
