#include "shapegcode/shaping/families.hpp"

#include <doctest/doctest.h>

#include <cmath>
#include <span>
#include <vector>

#include "shapegcode/error.hpp"

using shapegcode::Mode;
using shapegcode::Shaper;

TEST_CASE("families: ZV cancels its mode") {
  const Shaper undamped = shapegcode::zv({4.0, 0.0});
  CHECK(undamped.times_s[1] == doctest::Approx(0.125).epsilon(1e-15));
  CHECK(undamped.amplitudes == std::vector<double>{0.5, 0.5});
  for (const double zeta : {0.0, 0.001, 0.02, 0.3, 0.95}) {
    const Mode mode{46.0, zeta};
    const Shaper shaper = shapegcode::zv(mode);
    CHECK_FALSE(shapegcode::has_negative(shaper));
    CHECK(shapegcode::duration_s(shaper) == doctest::Approx(0.5 / (46.0 * std::sqrt(1.0 - zeta * zeta))));
    CHECK(shapegcode::residual_ratio(shaper, mode) < 1e-15);
  }
}

TEST_CASE("families: the convolved ZV of 1 and 4 Hz lasts .625 s (paper 002)") {
  const std::vector<Mode> modes{{1.0, 0.0}, {4.0, 0.0}};
  const Shaper shaper = shapegcode::convolved_zv(modes);
  CHECK(shapegcode::duration_s(shaper) == doctest::Approx(0.625).epsilon(1e-15));
  CHECK(shaper.amplitudes == std::vector<double>{0.25, 0.25, 0.25, 0.25});
  for (const Mode& mode : modes) {
    CHECK(shapegcode::residual_ratio(shaper, mode) < 1e-15);
  }
}

TEST_CASE("families: convolution adds durations, means and variances and merges equal times") {
  const Mode slow{46.0, 0.02};
  const Mode fast{131.0, 0.03};
  const Shaper a = shapegcode::zv(slow);
  const Shaper b = shapegcode::zv(fast);
  const Shaper both = shapegcode::convolve(a, b);
  CHECK(shapegcode::duration_s(both) == shapegcode::duration_s(a) + shapegcode::duration_s(b));
  CHECK(shapegcode::mean_s(both) == doctest::Approx(shapegcode::mean_s(a) + shapegcode::mean_s(b)).epsilon(1e-14));
  CHECK(shapegcode::variance_s2(both) ==
        doctest::Approx(shapegcode::variance_s2(a) + shapegcode::variance_s2(b)).epsilon(1e-13));
  const Shaper twice = shapegcode::convolve(a, a);  // ZVD
  CHECK(twice.times_s.size() == 3);
  CHECK(shapegcode::residual_ratio(twice, slow) < 1e-15);
  CHECK(shapegcode::residual_ratio(twice, {slow.frequency_hz * 1.05, slow.damping_ratio}) < 0.01);
}

TEST_CASE("families: what they refuse") {
  CHECK_THROWS_AS(static_cast<void>(shapegcode::zv({0.0, 0.0})), shapegcode::Error);
  CHECK_THROWS_AS(static_cast<void>(shapegcode::convolved_zv(std::span<const Mode>{})), shapegcode::Error);
  CHECK_THROWS_AS(static_cast<void>(shapegcode::convolve(Shaper{}, shapegcode::zv({1.0, 0.0}))), shapegcode::Error);
}
