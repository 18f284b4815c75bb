#include <doctest/doctest.h>

#include <algorithm>
#include <cmath>
#include <numbers>

#include "shapegcode/error.hpp"
#include "shapegcode/measure/sections.hpp"

using shapegcode::RestVibration;
using shapegcode::Vector3;
using shapegcode::VibrationWatch;

namespace {

constexpr double pi = std::numbers::pi;

/// A e^(-zeta w t) cos(w t) of X after the command stopped at 1 s.
double decay(double t, double amplitude, double frequency_hz, double damping) {
  const double w = 2.0 * pi * frequency_hz;
  return amplitude * std::exp(-damping * w * t) * std::cos(w * t);
}

RestVibration watch(double period_s, double band_mm, double amplitude, double frequency_hz, double damping,
                    double rest_s) {
  VibrationWatch vibration(period_s, band_mm);
  const int before = static_cast<int>(std::lround(1.0 / period_s));
  for (int i = 0; i <= before; ++i) {
    const Vector3 command(i * period_s, 0.0, 0.0);
    vibration.step(command, i == before ? command + Vector3(amplitude, 0, 0) : command);
  }
  for (int i = 1; i <= static_cast<int>(std::lround(rest_s / period_s)); ++i) {
    vibration.step({1.0, 0, 0}, {1.0 + decay(i * period_s, amplitude, frequency_hz, damping), 0, 0});
  }
  return vibration.rest();
}

/// The last instant at which the decay leaves the band: at the last extremum above it, then by bisection.
double leaves_band_s(double band, double amplitude, double frequency_hz, double damping) {
  double last = 0.0;
  for (double t = 0.0; t < 2.0; t += 1e-5) {
    if (std::abs(decay(t, amplitude, frequency_hz, damping)) > band) last = t;
  }
  return last;
}

}  // namespace

TEST_CASE("vibration: residual and settling time of a damped mode") {
  const RestVibration rest = watch(1e-3, 0.001, 0.02, 46.0, 0.02, 2.0);
  CHECK(rest.begin_s == doctest::Approx(1.0));
  CHECK(rest.observed_s == doctest::Approx(2.0));
  CHECK(rest.residual_mm[0] == doctest::Approx(0.02));
  CHECK(rest.residual_mm[1] == 0.0);
  const double expected = leaves_band_s(0.001, 0.02, 46.0, 0.02);
  CHECK(rest.settling_s[0] >= expected);
  CHECK(rest.settling_s[0] <= expected + 2e-3);
  CHECK(rest.settling_s[1] == 0.0);
  // The envelope's logarithm over its rate is never earlier, and at most half a wave later.
  const double envelope = std::log(20.0) / (0.02 * 2.0 * pi * 46.0);
  CHECK(rest.settling_s[0] <= envelope + 2e-3);
  CHECK(rest.settling_s[0] >= envelope - 0.5 / 46.0);
}

TEST_CASE("vibration: a record too short to show that it settles says so") {
  CHECK(std::isnan(watch(1e-3, 0.001, 0.02, 46.0, 0.02, 0.3).settling_s[0]));
  CHECK(std::isnan(watch(1e-3, 0.001, 0.02, 46.0, 0.0, 1.0).settling_s[0]));
}

TEST_CASE("vibration: maxima between samples are found") {
  for (const double phase : {0.1, 0.3, 0.5, 0.9}) {
    VibrationWatch vibration(1e-3, 1.0);
    double largest = 0.0;
    for (int i = 0; i < 40; ++i) {
      const double x = std::sin(2.0 * pi * 125.0 * (i + phase) * 1e-3);
      largest = std::max(largest, vibration.step(Vector3::Zero(), {0.0, 0.0, x})[2]);
    }
    CHECK(largest == doctest::Approx(1.0).epsilon(0.005));
  }
}

TEST_CASE("vibration: a move ends the rest") {
  VibrationWatch vibration(1e-3, 0.001);
  vibration.step({0, 0, 0}, {0, 0, 0});
  vibration.step({0, 0, 0}, {0, 5, 0});
  CHECK(vibration.rest().residual_mm[1] == 5.0);
  CHECK(vibration.moves({0, 0, 1}));
  CHECK_FALSE(vibration.moves({0, 0, 0}));
  vibration.step({0, 0, 1}, {0, 2, 1});
  CHECK(vibration.rest().residual_mm[1] == 2.0);
  CHECK(vibration.rest().observed_s == 0.0);
  CHECK_THROWS_AS(VibrationWatch(0.0, 1.0), shapegcode::Error);
  CHECK_THROWS_AS(VibrationWatch(1.0, 0.0), shapegcode::Error);
}
