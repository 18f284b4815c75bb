#include "shapegcode/shaper.hpp"

#include <doctest/doctest.h>

#include <algorithm>
#include <cmath>
#include <complex>
#include <numbers>
#include <vector>

#include "shapegcode/error.hpp"

using shapegcode::extra_insensitive;
using shapegcode::ExtraInsensitive;
using shapegcode::Mode;
using shapegcode::Shaper;

namespace {

double left_of(const Shaper& shaper, double frequency_hz, double zeta) {
  const double omega = 2.0 * std::numbers::pi * frequency_hz;
  std::complex<double> sum = 0.0;
  for (std::size_t k = 0; k < shaper.times_s.size(); ++k) {
    const double t = shaper.times_s[k];
    sum += shaper.amplitudes[k] * std::exp(std::complex<double>(zeta, std::sqrt(1.0 - zeta * zeta)) * omega * t);
  }
  return std::exp(-zeta * omega * shaper.times_s.back()) * std::abs(sum);
}

void check_amplitudes(const Shaper& shaper, const std::vector<double>& expected) {
  REQUIRE(shaper.amplitudes.size() == expected.size());
  for (std::size_t k = 0; k < expected.size(); ++k) {
    CHECK(shaper.amplitudes[k] == doctest::Approx(expected[k]).epsilon(1e-13));
    CHECK(shaper.times_s[k] == doctest::Approx(static_cast<double>(k) * 0.05).epsilon(1e-14));  // of 10 Hz
  }
}

}  // namespace

TEST_CASE("extra-insensitive: the published closed forms without damping") {
  for (const double v : {0.01, 0.05, 0.1, 0.3}) {
    const Mode mode{10.0, 0.0};
    check_amplitudes(extra_insensitive(mode, v, 1).shaper, {(1 + v) / 4, (1 - v) / 2, (1 + v) / 4});
    const double x = std::cbrt(v * v * (std::sqrt(1 - v * v) + 1));
    const double outer = (3 * x * x + 2 * x + 3 * v * v) / (16 * x);
    check_amplitudes(extra_insensitive(mode, v, 2).shaper, {outer, 0.5 - outer, 0.5 - outer, outer});
    const double first = (1 + 3 * v + 2 * std::sqrt(2 * (v * v + v))) / 16;
    const double second = (1 - v) / 4;
    check_amplitudes(extra_insensitive(mode, v, 3).shaper, {first, second, 1 - 2 * (first + second), second, first});
  }
}

TEST_CASE("extra-insensitive: damped designs meet their definition") {
  for (const double zeta : {0.0, 0.005, 0.02, 0.05, 0.1, 0.15}) {
    for (const double v : {0.02, 0.05, 0.1}) {
      for (int humps = 1; humps <= shapegcode::max_humps; ++humps) {
        CAPTURE(zeta);
        CAPTURE(v);
        CAPTURE(humps);
        const Mode mode{46.0, zeta};
        const ExtraInsensitive design = extra_insensitive(mode, v, humps);
        CHECK(design.shaper.times_s.size() == static_cast<std::size_t>(humps) + 2);
        CHECK(std::ranges::min(design.shaper.amplitudes) > 0.0);
        REQUIRE(design.zeros_hz.size() == static_cast<std::size_t>(humps) + 1);
        for (const double zero : design.zeros_hz) {
          CHECK(left_of(design.shaper, zero, zeta) < 1e-13);
        }
        for (const double hump : design.humps_hz) {
          CHECK(left_of(design.shaper, hump, zeta) == doctest::Approx(v).epsilon(1e-12));
        }
        CHECK((humps == 2 ? design.zeros_hz[1] : design.humps_hz[static_cast<std::size_t>(humps) / 2]) == 46.0);
        double worst = 0.0;  // nothing between the zeros is above the humps
        for (int i = 0; i <= 2000; ++i) {
          const double share = i / 2000.0;
          worst = std::max(
              worst,
              left_of(design.shaper, design.zeros_hz.front() * (1 - share) + design.zeros_hz.back() * share, zeta));
        }
        CHECK(worst <= v * (1 + 1e-12));
        CHECK(worst >= v * (1 - 1e-4));
      }
    }
  }
}

TEST_CASE("extra-insensitive: small and large limits") {
  for (const double v : {1e-6, 1e-4, 0.5, 0.9}) {
    for (int humps = 1; humps <= 3; ++humps) {
      CAPTURE(v);
      CAPTURE(humps);
      const ExtraInsensitive design = extra_insensitive({46.0, 0.002}, v, humps);
      for (const double zero : design.zeros_hz) {
        CHECK(left_of(design.shaper, zero, 0.002) < 1e-13);
      }
      for (const double hump : design.humps_hz) {
        CHECK(left_of(design.shaper, hump, 0.002) == doctest::Approx(v).epsilon(1e-8));
      }
    }
  }
}

TEST_CASE("extra-insensitive: what it refuses") {
  const Mode mode{46.0, 0.02};
  for (const double limit : {0.0, -0.1, 1.0, std::nan("")}) {
    CHECK_THROWS_AS(static_cast<void>(extra_insensitive(mode, limit, 1)), shapegcode::Error);
  }
  CHECK_THROWS_AS(static_cast<void>(extra_insensitive(mode, 0.05, 0)), shapegcode::Error);
  CHECK_THROWS_AS(static_cast<void>(extra_insensitive(mode, 0.05, 4)), shapegcode::Error);
  // the solution ends at a damping ratio of some .69, .45 and .32
  const std::vector<double> reached{0.68, 0.44, 0.31};
  for (int humps = 1; humps <= 3; ++humps) {
    const double zeta = reached[static_cast<std::size_t>(humps) - 1];
    CHECK(extra_insensitive({46.0, zeta}, 0.05, humps).humps_hz.size() == static_cast<std::size_t>(humps));
    try {
      static_cast<void>(extra_insensitive({46.0, zeta + 0.03}, 0.05, humps));
      FAIL("a strongly damped mode has no such shaper");
    } catch (const shapegcode::Error& error) {
      CHECK(error.kind() == shapegcode::ErrorKind::design);
    }
  }
}
