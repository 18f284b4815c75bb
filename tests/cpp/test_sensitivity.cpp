#include "shapegcode/shaper.hpp"

#include <doctest/doctest.h>

#include <algorithm>
#include <cmath>
#include <numbers>
#include <random>
#include <vector>

#include "shapegcode/error.hpp"

using shapegcode::insensitivity;
using shapegcode::Mode;
using shapegcode::Shaper;
using shapegcode::worst_residual;

TEST_CASE("sensitivity: ZV has the closed form |cos(pi f / 2 f0)|") {
  const Mode mode{40.0, 0.0};
  const Shaper shaper = shapegcode::zv(mode);
  const std::vector<double> frequencies{10.0, 36.0, 40.0, 47.0};
  const std::vector<double> curve = shapegcode::sensitivity_curve(shaper, 0.0, frequencies);
  for (std::size_t i = 0; i < curve.size(); ++i) {
    CHECK(curve[i] == doctest::Approx(std::abs(std::cos(std::numbers::pi * frequencies[i] / 80.0))).epsilon(1e-12));
  }
  CHECK(insensitivity(shaper, mode, 0.05) == doctest::Approx(4.0 / std::numbers::pi * std::asin(0.05)).epsilon(1e-8));
  CHECK(insensitivity(shapegcode::repeated_zv(mode, 2), mode, 0.05) ==
        doctest::Approx(4.0 / std::numbers::pi * std::asin(std::sqrt(0.05))).epsilon(1e-8));
  const auto worst = worst_residual(shaper, mode, 35.0, 46.0);
  CHECK(worst.frequency_hz == 46.0);
  CHECK(worst.residual_ratio == doctest::Approx(std::abs(std::cos(std::numbers::pi * 46.0 / 80.0))).epsilon(1e-12));
}

TEST_CASE("sensitivity: humps that touch the limit do not end the band") {
  const Mode mode{40.0, 0.0};
  for (int humps = 1; humps <= 3; ++humps) {
    // without damping V = .05 |T(b cos(theta/2))|, so the band ends where b cos(theta/2) = 1
    const double b = std::cosh(std::acosh(1.0 / 0.05) / (humps + 1));
    const double width = 2.0 - 4.0 / std::numbers::pi * std::acos(1.0 / b);
    CHECK(insensitivity(shapegcode::extra_insensitive(mode, 0.05, humps).shaper, mode, 0.05) ==
          doctest::Approx(width).epsilon(1e-7));
  }
  const double one_hump = insensitivity(shapegcode::extra_insensitive(mode, 0.05, 1).shaper, mode, 0.05);
  CHECK(one_hump == doctest::Approx(0.399).epsilon(2e-3));  // Singhose 1994
  CHECK(insensitivity(shapegcode::extra_insensitive(mode, 0.05, 1).shaper, mode, 0.04) == 0.0);
}

TEST_CASE("sensitivity: the worst residual is no less than any sample, and is attained") {
  std::mt19937 random(7);
  std::uniform_real_distribution<double> uniform(0.0, 1.0);
  for (int trial = 0; trial < 200; ++trial) {
    std::vector<double> times{0.0};
    std::vector<double> amplitudes{uniform(random) - 0.3};
    const int taps = 1 + static_cast<int>(8.0 * uniform(random));
    for (int k = 1; k < taps; ++k) {
      times.push_back(times.back() + 0.001 + 0.02 * uniform(random));
      amplitudes.push_back(uniform(random) - 0.3);
    }
    double sum = 0.0;
    for (const double a : amplitudes) {
      sum += a;
    }
    if (std::abs(sum) < 0.1) {
      continue;
    }
    for (double& a : amplitudes) {
      a /= sum;
    }
    const Shaper shaper = shapegcode::make_shaper(times, amplitudes);
    const Mode mode{50.0, trial % 3 == 0 ? 0.0 : 0.3 * uniform(random)};
    const double low = 5.0 + 40.0 * uniform(random);
    const double high = low + 60.0 * uniform(random);
    const auto worst = worst_residual(shaper, mode, low, high);
    double sampled = 0.0;
    for (int i = 0; i <= 4000; ++i) {
      sampled = std::max(sampled, residual_ratio(shaper, {low + (high - low) * i / 4000.0, mode.damping_ratio}));
    }
    CHECK(sampled <= worst.upper_bound * (1.0 + 1e-12));
    CHECK(worst.upper_bound <= worst.residual_ratio * (1.0 + 1.1e-6) + 1.1e-12);
    CHECK(residual_ratio(shaper, {worst.frequency_hz, mode.damping_ratio}) ==
          doctest::Approx(worst.residual_ratio).epsilon(1e-10));
    // the insensitive band: inside below the limit, just outside above it
    const double limit = std::min(0.9, 1.2 * residual_ratio(shaper, mode));
    const auto band = shapegcode::insensitive_band(shaper, mode, limit);
    if (residual_ratio(shaper, mode) <= limit) {
      CHECK(worst_residual(shaper, mode, band.lowest_hz, band.highest_hz).residual_ratio <= limit * (1.0 + 1e-8));
      CHECK(residual_ratio(shaper, {band.lowest_hz * (1.0 - 1e-4), mode.damping_ratio}) > limit);
      if (band.highest_hz < 499.0) {
        CHECK(residual_ratio(shaper, {band.highest_hz * (1.0 + 1e-4), mode.damping_ratio}) > limit);
      }
    }
  }
}

TEST_CASE("sensitivity: one frequency is a band, and what is refused") {
  const Mode mode{46.0, 0.02};
  const Shaper shaper = shapegcode::zv(mode);
  CHECK(worst_residual(shaper, mode, 46.0, 46.0).upper_bound < 2e-12);
  CHECK(worst_residual(shaper, mode, 50.0, 50.0).residual_ratio == residual_ratio(shaper, {50.0, 0.02}));
  CHECK_THROWS_AS(static_cast<void>(worst_residual(shaper, mode, 47.0, 46.0)), shapegcode::Error);
  CHECK_THROWS_AS(static_cast<void>(worst_residual(shaper, mode, 0.0, 46.0)), shapegcode::Error);
  CHECK_THROWS_AS(static_cast<void>(insensitivity(shaper, mode, 0.0)), shapegcode::Error);
  CHECK_THROWS_AS(static_cast<void>(insensitivity(shaper, mode, 1.0)), shapegcode::Error);
}
