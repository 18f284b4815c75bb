#include <doctest/doctest.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <numbers>
#include <random>
#include <utility>
#include <vector>

#include "shapegcode/error.hpp"
#include "shapegcode/measure/contour.hpp"
#include "shapegcode/measure/sections.hpp"

using Eigen::Vector2d;
using shapegcode::ContourTracker;
using shapegcode::make_arc;
using shapegcode::make_line;
using shapegcode::Path;
using shapegcode::Segment;
using shapegcode::SweptWalls;
using shapegcode::Vector3;

namespace {

constexpr double pi = std::numbers::pi;
using Points = std::vector<Vector3>;

Points beside(const Path& path, double step_mm, const std::function<double(double)>& deviation) {
  Points points;
  std::size_t cursor = 0;
  const auto count = static_cast<int>(std::ceil(path.length_mm() / step_mm));
  for (int i = 0; i <= count; ++i) {
    const double s = path.length_mm() * i / count;
    const Vector3 p = path.point(s, cursor);
    const Vector3 t = tangent_at(path[cursor], s - path.distance_mm(cursor));
    points.push_back(p + deviation(s) * Vector3(-t.y(), t.x(), 0.0));
  }
  return points;
}

SweptWalls sweep(const Path& path, const Points& points, double radius, double spacing) {
  SweptWalls walls(path, path_sections(path), radius, spacing);
  ContourTracker tracker(path);
  double foot = 0.0;
  for (std::size_t i = 0; i < points.size(); ++i) {
    const double deviation = tracker.step(points[i]);
    walls.sweep(points[i > 0 ? i - 1 : 0], points[i], foot, tracker.s_mm(), deviation);
    foot = tracker.s_mm();
  }
  return walls;
}

/// Edges of the swept area on the normal of a station, by discs everywhere along the polyline.
std::pair<double, double> brute(const Points& points, const Vector2d& station, const Vector2d& along, double radius) {
  const Vector2d normal(-along.y(), along.x());
  double left = -1e9;
  double right = 1e9;
  for (std::size_t i = 1; i < points.size(); ++i) {
    const Vector2d a = points[i - 1].head<2>() - station;
    const Vector2d b = points[i].head<2>() - station;
    if (std::min(a.norm(), b.norm()) > 2.0 * radius) continue;
    const int pieces = std::max(1, static_cast<int>((b - a).norm() / 5e-4));
    for (int k = 0; k <= pieces; ++k) {
      const Vector2d p = a + (b - a) * k / pieces;
      const double rest = radius * radius - std::pow(p.dot(along), 2);
      if (rest < 0.0) continue;
      left = std::max(left, p.dot(normal) + std::sqrt(rest));
      right = std::min(right, p.dot(normal) - std::sqrt(rest));
    }
  }
  return {left, right};
}

}  // namespace

TEST_CASE("walls: a sinusoidal track on a line cuts its parallel curves") {
  const Path path({make_line({0, 0, 0}, {20, 0, 0}, 100.0)});
  const double amplitude = 0.04;
  const double k = 2.0 * pi / 4.3;
  const double radius = 1.5;
  const SweptWalls walls =
      sweep(path, beside(path, 0.002, [&](double s) { return amplitude * std::sin(k * s); }), radius, 0.05);
  const SweptWalls::Profile profile = walls.profile(0);
  REQUIRE(profile.left.size() == 400);
  double worst = 0.0;
  for (std::size_t i = 40; i < 360; ++i) {
    const double s = profile.first_mm + static_cast<double>(i) * profile.spacing_mm;
    for (const double side : {1.0, -1.0}) {
      // Newton for the point of the track whose normal meets the station.
      double u = s;
      for (int step = 0; step < 50; ++step) {
        const double slope = amplitude * k * std::cos(k * u);
        u = s + side * radius * slope / std::hypot(1.0, slope);
      }
      const double slope = amplitude * k * std::cos(k * u);
      const double expected = amplitude * std::sin(k * u) + side * (radius / std::hypot(1.0, slope) - radius);
      worst = std::max(worst, std::abs((side > 0 ? profile.left : profile.right)[i] - expected));
    }
  }
  CHECK(worst < 1e-6);
}

TEST_CASE("walls: against discs everywhere, on lines and arcs of both senses, with coarse samples") {
  std::mt19937 random(3);
  std::uniform_real_distribution<double> unit(0.0, 1.0);
  for (int trial = 0; trial < 8; ++trial) {
    const double arc_radius = 2.0 + 10.0 * unit(random);
    const double sense = trial % 2 == 0 ? 1.0 : -1.0;
    const double r = 0.3 + 1.5 * unit(random);
    const double turn = 0.5 * pi;
    const Path path(
        {make_line({-6, 0, 0}, {0, 0, 0}, 100.0),
         make_arc({0, 0, 0}, {arc_radius, sense * arc_radius, 0}, {0, sense * arc_radius, 0}, sense * turn, 2, 100.0)});
    const double amplitude = 0.005 + 0.05 * unit(random);
    const double k = 2.0 * pi / (0.7 + 4.0 * unit(random));
    const double phase = 6.0 * unit(random);
    const Points points = beside(path, 0.02 + 0.15 * unit(random),
                                 [&](double s) { return amplitude * std::sin(k * s + phase) * s / 10.0; });
    const SweptWalls walls = sweep(path, points, r, 0.1);
    double worst = 0.0;
    std::size_t cursor = 0;
    for (std::size_t section = 0; section < 2; ++section) {
      const SweptWalls::Profile profile = walls.profile(section);
      for (std::size_t i = 0; i < profile.left.size(); i += 4) {
        const double s = profile.first_mm + static_cast<double>(i) * profile.spacing_mm;
        const Vector2d at = path.point(s, cursor).head<2>();
        const Vector2d along = tangent_at(path[cursor], s - path.distance_mm(cursor)).head<2>();
        const auto [left, right] = brute(points, at, along, r);
        REQUIRE(std::isfinite(profile.left[i]));
        worst = std::max({worst, std::abs(profile.left[i] + r - left), std::abs(profile.right[i] - r - right)});
      }
    }
    CAPTURE(trial);
    CHECK(worst < 5e-5);  // chords of the programmed arc 1e-5; discs of the other way 5e-4 apart
  }
}

TEST_CASE("walls: inside of a corner and of an arc narrower than the tool there is no wall") {
  const Path corner({make_line({0, 0, 0}, {20, 0, 0}, 100.0), make_line({20, 0, 0}, {20, 20, 0}, 100.0)});
  const SweptWalls::Profile first =
      sweep(corner, beside(corner, 0.1, [](double) { return 0.0; }), 1.5, 0.05).profile(0);
  for (std::size_t i = 0; i < first.left.size(); ++i) {
    const double s = first.first_mm + static_cast<double>(i) * first.spacing_mm;
    CHECK(std::isnan(first.left[i]) == (s > 20.0 - 1.5));
    CHECK(first.right[i] == doctest::Approx(0.0).scale(1.0));
  }
  const Path tight({make_arc({0, -1, 0}, {0, 1, 0}, {0, 0, 0}, pi, 2, 100.0)});
  const SweptWalls::Profile inside =
      sweep(tight, beside(tight, 0.01, [](double) { return 0.0; }), 1.5, 0.05).profile(0);
  CHECK(std::isnan(inside.left[inside.left.size() / 2]));
  CHECK(std::abs(inside.right[inside.right.size() / 2]) < 2e-5);
}

TEST_CASE("walls: a swing at the end widens the slot there and nowhere else") {
  const Path path({make_line({0, 0, 0}, {20, 0, 0}, 100.0)});
  Points points = beside(path, 0.05, [](double) { return 0.0; });
  for (const double y : {0.03, -0.02, 0.01, 0.0}) points.emplace_back(20.0, y, 0.0);
  const SweptWalls::Profile profile = sweep(path, points, 1.5, 0.05).profile(0);
  CHECK(profile.left.back() == doctest::Approx(0.03).epsilon(0.01));
  CHECK(profile.right.back() == doctest::Approx(-0.02).epsilon(0.02));
  CHECK(profile.left[profile.left.size() - 10] < 0.03);
  CHECK(std::abs(profile.left[profile.left.size() - 40]) < 1e-9);
}

TEST_CASE("walls: bounded by stations; refuses what is no tool; a plunge has no wall") {
  const Path metre({make_line({0, 0, 0}, {1000, 0, 0}, 10.0)});
  CHECK_THROWS_WITH_AS((void)SweptWalls(metre, shapegcode::path_sections(metre), 1e-12, 0.1),
                       "tool radius 1e-12 mm on a path of 1000 mm: 1e+15 radii, limit 1e+08", shapegcode::Error);
  const Path spiral({make_arc({0.01, 0, 0}, {1e-200, 0, 0}, {0, 0, 0}, 2.0 * pi, 2, 10.0)});
  CHECK(SweptWalls(spiral, shapegcode::path_sections(spiral, 0.0), 1.5, 0.01).station_count(0) == 4);
  const Path path({make_line({0, 0, 0}, {1000, 0, 0}, 100.0)});
  const std::vector<shapegcode::PathSection> sections = path_sections(path);
  CHECK(SweptWalls(path, sections, 1.5, 0.05, 1000).station_count(0) <= 1000);
  CHECK(SweptWalls(path, sections, 1.5, 0.05, 1000).spacing_mm() == doctest::Approx(1.0));
  CHECK_THROWS_AS(SweptWalls(path, sections, 0.0, 0.05), shapegcode::Error);
  CHECK_THROWS_AS(SweptWalls(path, sections, 1.5, -1.0), shapegcode::Error);
  const Path plunge({make_line({0, 0, 0}, {0, 0, -5}, 100.0)});
  for (const double left : sweep(plunge, {{0, 0, 0}, {0.1, 0, -5}}, 1.5, 0.05).profile(0).left) CHECK(std::isnan(left));
}
