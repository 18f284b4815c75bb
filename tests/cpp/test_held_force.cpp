#include "identify/held_force.hpp"

#include <cmath>
#include <numbers>
#include <vector>

#include <doctest/doctest.h>

using shapegcode::ForceHold;
using shapegcode::identification::HeldForce;
using shapegcode::identification::pulse_of;

TEST_CASE("a pulse is what lies between the first and the last force") {
  const std::vector<double> force{0.0, 0.0, 1.0, 0.0, -2.0, 0.0};
  CHECK(pulse_of(force).begin == 2);
  CHECK(pulse_of(force).end == 5);
  CHECK(pulse_of(std::vector<double>(4, 0.0)).size() == 0);
}

TEST_CASE("a force that is linear between samples is its samples") {
  const std::vector<double> force{0.0, 0.0, 3.0, 5.0, 0.0, 0.0, 0.0};
  const HeldForce held(force, ForceHold::linear);
  REQUIRE(held.steps() == 1);
  CHECK(held.within(0).empty());
  for (std::size_t k = 1; k < 4; ++k) {
    REQUIRE(held.within(k).size() == 2);
    CHECK(held.within(k)[0] == force[k]);
    CHECK(held.within(k)[1] == force[k + 1]);
  }
  CHECK(held.within(4).empty());
}

TEST_CASE("a band-limited force is a sine between the samples of a sine") {
  // Up to .4 of the sampling rate, under a smooth window that has no share above .45.
  constexpr std::size_t n = 400;
  for (const double share : {0.02, 0.1, 0.25, 0.4}) {
    const auto value = [&](double t) {
      const double window = std::sin(std::numbers::pi * t / n);
      return window * window * window * window * std::sin(2.0 * std::numbers::pi * share * t + 0.3);
    };
    std::vector<double> force(n);
    for (std::size_t k = 0; k < n; ++k) force[k] = value(static_cast<double>(k));
    const HeldForce held(force, ForceHold::band_limited);
    double worst = 0.0;
    for (std::size_t k = 0; k + 1 < n; ++k) {
      const auto within = held.within(k);
      for (std::size_t i = 0; i < within.size(); ++i) {
        const double t = static_cast<double>(k) + static_cast<double>(i) / static_cast<double>(held.steps());
        worst = std::max(worst, std::abs(within[i] - value(t)));
      }
    }
    CAPTURE(share);
    CHECK(worst < 3e-4);
  }
}

TEST_CASE("blows stand at their samples") {
  const std::vector<double> force{4.0, 0.0, 7.0};
  const HeldForce held(force, ForceHold::impulse);
  CHECK(held.blow(0) == 4.0);
  CHECK(held.blow(2) == 7.0);
  CHECK(held.blow(3) == 0.0);
  CHECK(held.within(0).empty());
}
