#include "shapegcode/shaper.hpp"

#include <doctest/doctest.h>

#include <cmath>
#include <limits>
#include <numbers>
#include <string>
#include <vector>

#include "shapegcode/error.hpp"

using shapegcode::Error;
using shapegcode::ErrorKind;
using shapegcode::Mode;
using shapegcode::Shaper;

namespace {

ErrorKind kind_of_refusal(std::vector<double> times, std::vector<double> amplitudes) {
  try {
    static_cast<void>(shapegcode::make_shaper(std::move(times), std::move(amplitudes)));
  } catch (const Error& error) {
    return error.kind();
  }
  FAIL("accepted");
  return ErrorKind::numeric;
}

}  // namespace

TEST_CASE("shaper: moments, sign and sum") {
  const Shaper shaper = shapegcode::make_shaper({0.0, 0.25, 1.0}, {0.5, 0.75, -0.25});
  CHECK(shapegcode::duration_s(shaper) == 1.0);
  CHECK(shapegcode::mean_s(shaper) == doctest::Approx(-0.0625).epsilon(1e-14));
  CHECK(shapegcode::variance_s2(shaper) == doctest::Approx(0.75 * 0.0625 - 0.25 - 0.0625 * 0.0625).epsilon(1e-14));
  CHECK(shapegcode::has_negative(shaper));
  CHECK(shapegcode::abs_sum(shaper) == 1.5);
  CHECK_FALSE(shapegcode::has_negative(shapegcode::make_shaper({0.0}, {1.0})));
}

TEST_CASE("shaper: refuses taps that are none") {
  const double nan = std::numeric_limits<double>::quiet_NaN();
  CHECK(kind_of_refusal({}, {}) == ErrorKind::argument);
  CHECK(kind_of_refusal({0.0, 1.0}, {1.0}) == ErrorKind::argument);
  CHECK(kind_of_refusal({0.1}, {1.0}) == ErrorKind::argument);
  CHECK(kind_of_refusal({0.0, 0.2, 0.2}, {0.5, 0.25, 0.25}) == ErrorKind::argument);
  CHECK(kind_of_refusal({0.0, nan}, {0.5, 0.5}) == ErrorKind::argument);
  CHECK(kind_of_refusal({0.0, 0.2}, {nan, 0.5}) == ErrorKind::argument);
  CHECK(kind_of_refusal({0.0, 0.2}, {0.5, 0.5 + 2e-9}) == ErrorKind::argument);
}

TEST_CASE("shaper: residual ratio is V(omega, zeta), summed directly") {
  const Mode mode{7.0, 0.05};
  const Shaper shaper = shapegcode::make_shaper({0.0, 0.03, 0.11}, {0.4, -0.1, 0.7});
  const double omega = 2.0 * std::acos(-1.0) * 7.0;
  const double damped = omega * std::sqrt(1.0 - 0.05 * 0.05);
  double real = 0.0;
  double imag = 0.0;
  for (std::size_t k = 0; k < 3; ++k) {
    const double t = shaper.times_s[k];
    real += shaper.amplitudes[k] * std::exp(0.05 * omega * t) * std::cos(damped * t);
    imag += shaper.amplitudes[k] * std::exp(0.05 * omega * t) * std::sin(damped * t);
  }
  CHECK(shapegcode::residual_ratio(shaper, mode) ==
        doctest::Approx(std::exp(-0.05 * omega * 0.11) * std::hypot(real, imag)).epsilon(1e-13));
  CHECK(shapegcode::residual_ratio(shapegcode::make_shaper({0.0}, {1.0}), mode) == doctest::Approx(1.0));
  // a long, well damped shaper must not overflow
  const Shaper late = shapegcode::make_shaper({0.0, 1000.0}, {0.5, 0.5});
  CHECK(shapegcode::residual_ratio(late, {100.0, 0.5}) == doctest::Approx(0.5));
}

TEST_CASE("shaper: ZV on a grid cancels its mode with impulses on the grid, for any period up to a quarter") {
  for (const double frequency_hz : {3.7, 46.0, 131.0}) {
    for (const double damping : {0.0, 0.02, 0.3}) {
      const Mode mode{frequency_hz, damping, 1.0};
      const double half_period_s = duration_s(zv(mode));
      for (const double ratio : {0.5, 0.4999, 0.37, 0.1, 0.013}) {
        const double period_s = ratio * half_period_s;
        const Shaper shaper = zv_on_grid(mode, period_s);
        // Summed directly, with the mode's own exponentials.
        const double rate = mode.damping_ratio * 2.0 * std::numbers::pi * frequency_hz;
        double in_phase = 0.0;
        double across = 0.0;
        for (std::size_t k = 0; k < shaper.times_s.size(); ++k) {
          const double steps = shaper.times_s[k] / period_s;
          CHECK(std::abs(steps - std::round(steps)) < 1e-9);
          CHECK(shaper.amplitudes[k] > 0.0);
          const double angle = std::numbers::pi * shaper.times_s[k] / half_period_s;
          in_phase += shaper.amplitudes[k] * std::exp(rate * shaper.times_s[k]) * std::cos(angle);
          across += shaper.amplitudes[k] * std::exp(rate * shaper.times_s[k]) * std::sin(angle);
        }
        CHECK(std::hypot(in_phase, across) < 1e-12);
        CHECK(duration_s(shaper) < half_period_s + period_s);
      }
      CHECK_THROWS_AS(zv_on_grid(mode, 0.51 * half_period_s), Error);
      CHECK_THROWS_AS(zv_on_grid(mode, 0.0), Error);
    }
  }
}

TEST_CASE("shaper: becomes a filter only where its times lie on the grid") {
  const Shaper shaper = shapegcode::make_shaper({0.0, 0.1 + 0.2, 0.5}, {0.25, 0.5, 0.25});
  const shapegcode::Fir fir = shapegcode::to_fir(shaper, 0.1);
  CHECK(fir.delays() == std::vector<int>{0, 3, 5});
  CHECK(fir.taps() == shaper.amplitudes);
  try {
    static_cast<void>(shapegcode::to_fir(shapegcode::make_shaper({0.0, 0.006514}, {0.5, 0.5}), 0.005));
    FAIL("accepted");
  } catch (const Error& error) {
    CHECK(error.kind() == ErrorKind::design);
    CHECK(std::string(error.what()).find("tap at 6.514 ms is not on the grid of 5 ms: it lies 1.514 ms") !=
          std::string::npos);
  }
  CHECK_THROWS_AS(static_cast<void>(shapegcode::to_fir(shaper, 0.1 * (1.0 + 3e-9))), Error);
  CHECK_THROWS_AS(static_cast<void>(shapegcode::to_fir(shaper, 0.0)), Error);
  CHECK_THROWS_AS(static_cast<void>(shapegcode::to_fir(shaper, 1e-300)), Error);
}
