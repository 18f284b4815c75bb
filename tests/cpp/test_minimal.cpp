#include "shapegcode/minimal_shapers.hpp"

#include <doctest/doctest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <limits>
#include <vector>

#include "shapegcode/error.hpp"
#include "shapegcode/shaper.hpp"

using shapegcode::minimal_two_mode;
using shapegcode::Mode;
using shapegcode::Shaper;

namespace {

void check_same(const Shaper& found, const std::vector<double>& times, const std::vector<double>& amplitudes,
                double time_tolerance, double amplitude_tolerance) {
  REQUIRE(found.times_s.size() == times.size());
  for (std::size_t k = 0; k < times.size(); ++k) {
    CHECK(std::abs(found.times_s[k] - times[k]) <= time_tolerance);
    CHECK(std::abs(found.amplitudes[k] - amplitudes[k]) <= amplitude_tolerance);
  }
}

/// Largest residual ratio of either mode with its frequency 5 % off.
double worst_at_5_percent(const Shaper& shaper, const std::array<Mode, 2>& modes) {
  double worst = 0.0;
  for (const Mode& mode : modes) {
    for (const double factor : {0.95, 1.05}) {
      worst = std::max(worst, residual_ratio(shaper, {mode.frequency_hz * factor, mode.damping_ratio}));
    }
  }
  return worst;
}

}  // namespace

TEST_CASE("minimal: 1 and 4 Hz, undamped, up to .8 s: these seven and no others") {
  const double a = 0.72360679774997897;  // (5 + sqrt 5)/10
  const double b = 0.44721359549995794;  // 1/sqrt 5
  const double c = 0.27639320225002103;  // (5 - sqrt 5)/10
  const double third = 1.0 / 3.0;
  const std::vector<Shaper> shapers = minimal_two_mode({1.0, 0.0}, {4.0, 0.0}, 0.8);
  REQUIRE(shapers.size() == 7);
  check_same(shapers[0], {0.0, 0.2, 0.4}, {a, -b, a}, 1e-14, 1e-14);
  check_same(shapers[1], {0.0, 0.2, 0.6}, {c, c, b}, 1e-14, 1e-14);
  check_same(shapers[2], {0.0, 0.4, 0.6}, {b, c, c}, 1e-14, 1e-14);
  check_same(shapers[3], {0.0, third, 2.0 * third}, {third, third, third}, 1e-14, 1e-14);
  check_same(shapers[4], {0.0, 0.2, 0.8}, {-b, a, a}, 1e-14, 1e-14);
  check_same(shapers[5], {0.0, 0.4, 0.8}, {c, b, c}, 1e-14, 1e-14);
  check_same(shapers[6], {0.0, 0.6, 0.8}, {a, a, -b}, 1e-14, 1e-14);
  CHECK(minimal_two_mode({4.0, 0.0}, {1.0, 0.0}, 0.8).size() == 7);
  CHECK(minimal_two_mode({4.0, 0.0}, {1.0, 0.0}, 0.8, 1.5).size() == 4);  // the bound on sum |a|
  CHECK(minimal_two_mode({4.0, 0.0}, {1.0, 0.0}, 0.39).empty());
}

TEST_CASE("minimal: the machine of paper 000") {
  const Mode x{46.0, 0.02};
  const Mode y{131.0, 0.02};
  const std::vector<Shaper> shapers = minimal_two_mode(x, y, 0.06);
  REQUIRE(shapers.size() == 43);  // brute force finds the same: tests/python/test_shaping.py
  const auto first = std::ranges::find_if(shapers, [](const Shaper& each) { return !has_negative(each); });
  REQUIRE(first != shapers.end());
  check_same(*first, {0.0, 0.006514, 0.011326}, {0.49156, 0.06297, 0.44547}, 5e-7, 5e-6);
  double last = 0.0;
  for (const Shaper& shaper : shapers) {
    CHECK(residual_ratio(shaper, x) < 1e-14);
    CHECK(residual_ratio(shaper, y) < 1e-14);
    CHECK(duration_s(shaper) >= last);
    last = duration_s(shaper);
  }
}

TEST_CASE("minimal: sensitivity beside the convolved ZV at r = 2") {
  for (const double zeta : {0.0, 0.03}) {
    const std::array<Mode, 2> modes{Mode{1.0, zeta}, Mode{2.0, zeta}};
    const std::vector<Shaper> shapers = minimal_two_mode(modes[0], modes[1], 0.9);
    REQUIRE(!shapers.empty());
    CHECK(std::abs(worst_at_5_percent(shapers.front(), modes) - (zeta > 0.0 ? 0.111 : 0.127)) < 6e-4);
    CHECK(std::abs(worst_at_5_percent(shapegcode::convolved_zv(modes), modes) - (zeta > 0.0 ? 0.068 : 0.0775)) < 6e-4);
  }
}

TEST_CASE("minimal: modes that one ZV serves") {
  const std::vector<Shaper> shapers = minimal_two_mode({1.0, 0.0}, {3.0, 0.0}, 1.0);
  REQUIRE(shapers.size() == 2);
  check_same(shapers[0], {0.0, 0.5}, {0.5, 0.5}, 1e-14, 1e-14);
  check_same(shapers[1], {0.0, 0.5, 1.0}, {0.25, 0.5, 0.25}, 1e-14, 1e-14);  // not unique: the smallest squares
}

TEST_CASE("minimal: strongly damped modes") {
  const Mode slow{1.0, 0.5};
  const Mode fast{4.0, 0.3};
  const std::vector<Shaper> shapers = minimal_two_mode(slow, fast, 0.8);
  CHECK(shapers.size() == 2);
  for (const Shaper& shaper : shapers) {
    CHECK(residual_ratio(shaper, slow) < 1e-14);
    CHECK(residual_ratio(shaper, fast) < 1e-14);
  }
}

TEST_CASE("minimal: what it refuses") {
  const double nan = std::numeric_limits<double>::quiet_NaN();
  const auto refused = [](const Mode& first, const Mode& second, double duration, double sum) {
    CHECK_THROWS_AS(static_cast<void>(minimal_two_mode(first, second, duration, sum)), shapegcode::Error);
  };
  refused({1.0, 0.02}, {1.0, 0.02}, 1.0, 10.0);
  refused({1.0, 0.02}, {1.0 + 1e-8, 0.02}, 1.0, 10.0);
  refused({1.0, 0.0}, {4.0, 0.0}, 0.0, 10.0);
  refused({1.0, 0.0}, {4.0, 0.0}, nan, 10.0);
  refused({1.0, 0.0}, {4.0, 0.0}, 26.0, 10.0);
  refused({1.0, 0.0}, {4.0, 0.0}, 1.0, 0.5);
  refused({1.0, 0.0}, {4.0, 0.0}, 1.0, nan);
  refused({-1.0, 0.0}, {4.0, 0.0}, 1.0, 10.0);
}
