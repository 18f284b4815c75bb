#include "shapegcode/shaper.hpp"

#include <doctest/doctest.h>

#include <cmath>
#include <complex>
#include <numbers>
#include <span>
#include <vector>

#include "shapegcode/error.hpp"

using shapegcode::Mode;
using shapegcode::Shaper;

namespace {

/// The residual ratio V written out, not as the library sums it.
double left_of(const Shaper& shaper, double frequency_hz, double zeta) {
  const double omega = 2.0 * std::numbers::pi * frequency_hz;
  double cosine = 0.0;
  double sine = 0.0;
  for (std::size_t k = 0; k < shaper.times_s.size(); ++k) {
    const double t = shaper.times_s[k];
    cosine += shaper.amplitudes[k] * std::exp(zeta * omega * t) * std::cos(omega * std::sqrt(1.0 - zeta * zeta) * t);
    sine += shaper.amplitudes[k] * std::exp(zeta * omega * t) * std::sin(omega * std::sqrt(1.0 - zeta * zeta) * t);
  }
  return std::exp(-zeta * omega * shaper.times_s.back()) * std::hypot(cosine, sine);
}

}  // namespace

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

TEST_CASE("families: ZVD and ZVDD leave vanishing derivatives") {
  for (const double zeta : {0.0, 0.02, 0.3}) {
    const Mode mode{46.0, zeta};
    for (const int zeros : {1, 2, 3, 5}) {
      const Shaper shaper = shapegcode::repeated_zv(mode, zeros);
      CHECK(shaper.times_s.size() == static_cast<std::size_t>(zeros) + 1);
      CHECK(left_of(shaper, 46.0, zeta) < 1e-14);
      // a zero of that order: half the distance leaves 2^-zeros
      const double far = left_of(shaper, 46.0 * 1.002, zeta);
      const double near = left_of(shaper, 46.0 * 1.001, zeta);
      CHECK(near / far == doctest::Approx(std::pow(0.5, zeros)).epsilon(0.01));
    }
  }
  const Shaper zvdd = shapegcode::repeated_zv({46.0, 0.0}, 3);
  CHECK(zvdd.amplitudes == std::vector<double>{0.125, 0.375, 0.375, 0.125});
  CHECK(zvdd.times_s[3] == doctest::Approx(1.5 / 46.0).epsilon(1e-15));
}

TEST_CASE("families: MZV cancels its mode and its second pole, with less slope than ZV") {
  const Shaper undamped = shapegcode::mzv({40.0, 0.0});
  CHECK(undamped.amplitudes[0] == doctest::Approx(1.0 - std::sqrt(0.5)).epsilon(1e-15));
  CHECK(undamped.amplitudes[1] == doctest::Approx(std::sqrt(2.0) - 1.0).epsilon(1e-15));
  CHECK(undamped.times_s[2] == doctest::Approx(0.75 / 40.0).epsilon(1e-15));
  CHECK(shapegcode::mzv_second_zero({40.0, 0.0}).frequency_hz == doctest::Approx(40.0 * 5.0 / 3.0));
  const double step = 1e-6;
  CHECK(left_of(undamped, 40.0 * (1.0 + step), 0.0) / left_of(shapegcode::zv({40.0, 0.0}), 40.0 * (1.0 + step), 0.0) ==
        doctest::Approx(0.75 * std::sqrt(2.0) * (2.0 - std::sqrt(2.0))).epsilon(1e-4));
  for (const double zeta : {0.02, 0.2}) {
    const Shaper shaper = shapegcode::mzv({40.0, zeta});
    const Mode second = shapegcode::mzv_second_zero({40.0, zeta});
    CHECK(left_of(shaper, 40.0, zeta) < 1e-14);
    CHECK(left_of(shaper, second.frequency_hz, second.damping_ratio) < 1e-14);
    CHECK(shapegcode::pole(second).real() == doctest::Approx(shapegcode::pole({40.0, zeta}).real()));
  }
}

TEST_CASE("families: negative ZV of unity magnitude") {
  const Shaper undamped = shapegcode::negative_zv({10.0, 0.0});
  CHECK(undamped.times_s[1] == doctest::Approx(0.1 / 6.0).epsilon(1e-14));
  CHECK(undamped.times_s[2] == doctest::Approx(0.1 / 3.0).epsilon(1e-14));
  for (const double zeta : {0.0, 0.01, 0.02, 0.1, 0.3, 0.5}) {
    const Shaper shaper = shapegcode::negative_zv({46.0, zeta});
    CHECK(shaper.amplitudes == std::vector<double>{1.0, -1.0, 1.0});
    CHECK(left_of(shaper, 46.0, zeta) < 1e-13);
  }
}

TEST_CASE("families: what they refuse") {
  CHECK_THROWS_AS(static_cast<void>(shapegcode::repeated_zv({46.0, 0.0}, 0)), shapegcode::Error);
  CHECK_THROWS_AS(static_cast<void>(shapegcode::repeated_zv({46.0, 0.0}, 21)), shapegcode::Error);
  CHECK_THROWS_AS(static_cast<void>(shapegcode::zv({0.0, 0.0})), shapegcode::Error);
  CHECK_THROWS_AS(static_cast<void>(shapegcode::convolved_zv(std::span<const Mode>{})), shapegcode::Error);
  CHECK_THROWS_AS(static_cast<void>(shapegcode::convolve(Shaper{}, shapegcode::zv({1.0, 0.0}))), shapegcode::Error);
}
