#include <doctest/doctest.h>

#include <cmath>
#include <numbers>
#include <optional>
#include <random>

#include "program/interpret/arc_geometry.hpp"
#include "shapegcode/error.hpp"

using shapegcode::ArcWords;
using shapegcode::Error;
using shapegcode::resolve_arc;
using shapegcode::Segment;
using shapegcode::Vector3;

namespace {

constexpr double pi = std::numbers::pi;

/// Point of a circle about `centre` at `angle`, counted in the plane across `normal` from axis normal+1 to normal+2.
Vector3 on_circle(const Vector3& centre, double radius, double angle, int normal, double height) {
  Vector3 p = centre;
  p[(normal + 1) % 3] += radius * std::cos(angle);
  p[(normal + 2) % 3] += radius * std::sin(angle);
  p[normal] = height;
  return p;
}

}  // namespace

TEST_CASE("arc geometry: R and I J K find the circle that the words were made from") {
  // Independent source: the words are made from a known circle, start angle and sweep.
  std::mt19937_64 generator(11);
  std::uniform_real_distribution<double> coordinate(-100.0, 100.0);
  std::uniform_real_distribution<double> angle(-pi, pi);
  std::uniform_real_distribution<double> turn(0.02, 2.0 * pi - 0.02);
  double worst_centre = 0.0;
  double worst_sweep = 0.0;
  for (int i = 0; i < 20000; ++i) {
    const int normal = i % 3;
    const bool clockwise = (i / 3) % 2 == 0;
    const double radius = 0.1 + std::abs(coordinate(generator));
    const Vector3 centre(coordinate(generator), coordinate(generator), coordinate(generator));
    const double from = angle(generator);
    const double size = turn(generator);
    const double sweep = clockwise ? -size : size;
    ArcWords words;
    words.start_mm = on_circle(centre, radius, from, normal, 1.0);
    words.end_mm = on_circle(centre, radius, from + sweep, normal, 3.0);
    words.clockwise = clockwise;
    words.normal = normal;
    words.tolerance_mm = 1e-6;
    words.centre_mm = centre;
    for (const bool by_radius : {false, true}) {
      // At half a turn R is ill-conditioned: the centre moves with the square root of the rounding.
      if (by_radius && std::abs(size - pi) < 0.02) continue;
      words.radius_mm = by_radius ? std::optional<double>(size > pi ? -radius : radius) : std::nullopt;
      const Segment arc = resolve_arc(words, 5.0, 9, 3);
      Vector3 off = arc.centre_mm - centre;
      off[normal] = 0.0;
      worst_centre = std::max(worst_centre, off.norm());
      worst_sweep = std::max(worst_sweep, std::abs(arc.sweep_rad - sweep));
      if (i < 100) {
        CHECK(arc.length_mm == doctest::Approx(std::hypot(radius * size, 2.0)).epsilon(1e-6));
        CHECK(arc.feed_mm_per_s == 5.0);
        CHECK(arc.line == 9);
        CHECK(int{arc.normal} == normal);
        CHECK(arc.end_mm == words.end_mm);
      }
    }
  }
  CHECK(worst_centre < 1e-8);
  CHECK(worst_sweep < 1e-8);
}

TEST_CASE("arc geometry: start and end in one place are a full circle, a hair apart the shortest or the whole turn") {
  ArcWords words;
  words.start_mm = words.end_mm = Vector3(10.0, 0.0, 0.0);
  for (const bool clockwise : {false, true}) {
    words.clockwise = clockwise;
    CHECK(resolve_arc(words, 1.0, 1, 1).sweep_rad == doctest::Approx(clockwise ? -2.0 * pi : 2.0 * pi));
  }
  words.end_mm = Vector3(10.0, 0.001, 0.0);  // one increment on, counter-clockwise
  words.clockwise = false;
  CHECK(resolve_arc(words, 1.0, 1, 1).sweep_rad == doctest::Approx(1e-4).epsilon(1e-6));
  words.clockwise = true;
  CHECK(resolve_arc(words, 1.0, 1, 1).sweep_rad == doctest::Approx(1e-4 - 2.0 * pi).epsilon(1e-9));
}

TEST_CASE("arc geometry: an end on the start's ray is a whole turn that spreads the difference of the radii") {
  ArcWords words;
  words.start_mm = Vector3(10.0, 0.0, 0.0);
  words.end_mm = Vector3(10.005, 0.0, 0.0);
  CHECK(resolve_arc(words, 1.0, 1, 1).sweep_rad == doctest::Approx(2.0 * pi));
  words.clockwise = true;
  CHECK(resolve_arc(words, 1.0, 1, 1).sweep_rad == doctest::Approx(-2.0 * pi));
}

TEST_CASE("arc geometry: the tolerance is on the difference of the radii, on both sides of it") {
  ArcWords words;
  words.start_mm = Vector3(10.0, 0.0, 0.0);
  words.tolerance_mm = 0.01;
  words.end_mm = Vector3(0.0, 10.0099, 0.0);
  CHECK_NOTHROW((void)resolve_arc(words, 1.0, 1, 1));
  words.end_mm = Vector3(0.0, 9.9901, 0.0);
  CHECK_NOTHROW((void)resolve_arc(words, 1.0, 1, 1));
  words.end_mm = Vector3(0.0, 10.0101, 0.0);
  CHECK_THROWS_AS((void)resolve_arc(words, 1.0, 1, 1), Error);
  words.end_mm = Vector3(0.0, 9.9899, 0.0);
  CHECK_THROWS_AS((void)resolve_arc(words, 1.0, 1, 1), Error);
}
