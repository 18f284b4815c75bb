#include <doctest/doctest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <numbers>
#include <random>
#include <string>
#include <vector>

#include "sanitized.hpp"
#include "shapegcode/error.hpp"
#include "shapegcode/measure/contour.hpp"

using shapegcode::ContourTracker;
using shapegcode::DeviationStats;
using shapegcode::make_arc;
using shapegcode::make_line;
using shapegcode::nearest_on;
using shapegcode::Path;
using shapegcode::PathSide;
using shapegcode::Segment;
using shapegcode::Vector3;

namespace {

constexpr double pi = std::numbers::pi;

Path polyline(const std::vector<Vector3>& points) {
  std::vector<Segment> segments;
  for (std::size_t i = 1; i < points.size(); ++i) segments.push_back(make_line(points[i - 1], points[i], 100.0));
  return Path(segments);
}

/// Left of the path by `left`, above it by `up`, at `s`.
Vector3 beside(const Path& path, double s, double left, double up, std::size_t& cursor) {
  const Vector3 p = path.point(s, cursor);
  const Vector3 t = tangent_at(path[cursor], s - path.distance_mm(cursor));
  const double horizontal = std::hypot(t[0], t[1]);
  Vector3 normal = Vector3::Zero();
  if (horizontal > 0.0) normal = Vector3(-t[1], t[0], 0.0) / horizontal;
  return p + left * normal + up * Vector3::UnitZ();
}

double nearest_of_all(const Path& path, const Vector3& p) {
  double nearest = std::numeric_limits<double>::infinity();
  for (const Segment& segment : path.segments()) nearest = std::min(nearest, nearest_on(segment, p).distance_mm);
  return nearest;
}

/// Walks the path at a constant offset in equal steps; the largest error of the reported deviation.
double worst_on_offset_walk(const Path& path, double step, double left, double up, double expected) {
  ContourTracker tracker(path);
  std::size_t cursor = 0;
  double worst = 0.0;
  for (double s = 0.0; s <= path.length_mm(); s += step) {
    worst = std::max(worst, std::abs(tracker.step(beside(path, s, left, up, cursor)) - expected));
  }
  CHECK(tracker.segment() + 1 >= path.size() - 1);
  return worst;
}

}  // namespace

TEST_CASE("contour: statistics") {
  DeviationStats stats;
  CHECK(stats.rms_mm() == 0.0);
  for (const double value : {1.0, -3.0, 2.0}) stats.add(value);
  CHECK(stats.max_abs_mm == 3.0);
  CHECK(stats.most_positive_mm == 2.0);
  CHECK(stats.most_negative_mm == -3.0);
  CHECK(stats.count == 3);
  CHECK(stats.rms_mm() == doctest::Approx(std::sqrt(14.0 / 3.0)));
}

TEST_CASE("contour: refuses an empty path, ignores what is not finite") {
  CHECK_THROWS_AS(ContourTracker{Path()}, shapegcode::Error);
  ContourTracker tracker(polyline({{0, 0, 0}, {10, 0, 0}}));
  CHECK(tracker.step({0.1, 0.5, 0}) == doctest::Approx(0.5));
  CHECK(std::isnan(tracker.step({std::numeric_limits<double>::quiet_NaN(), 0, 0})));
  CHECK(tracker.step({0.2, -0.5, 0}) == doctest::Approx(-0.5));
  CHECK(tracker.s_mm() == doctest::Approx(0.2));
}

TEST_CASE("contour: sign on lines") {
  const auto one = [](const Vector3& end, const Vector3& p) {
    ContourTracker tracker(polyline({{0, 0, 0}, end}));
    return tracker.step(p);
  };
  CHECK(one({10, 0, 0}, {0.1, 0.01, 0}) == doctest::Approx(0.01));    // left
  CHECK(one({10, 0, 0}, {0.1, -0.01, 0}) == doctest::Approx(-0.01));  // right
  CHECK(one({-10, 0, 0}, {-0.1, 0.01, 0}) == doctest::Approx(-0.01));
  CHECK(one({10, 0, 0}, {0.1, 0, 0.01}) == doctest::Approx(0.01));  // above
  CHECK(one({10, 0, 0}, {0.1, 0, -0.01}) == doctest::Approx(-0.01));
  CHECK(one({10, 0, 0}, {0.1, 3e-3, -4e-3}) == doctest::Approx(5e-3));  // the side decides
  CHECK(one({0, 0, 10}, {0.003, 0.004, 0.1}) == doctest::Approx(0.005));
  CHECK(one({0, 0, 10}, {0.0, 0.0, -0.2}) == doctest::Approx(-0.2));
  CHECK(one({10, 0, 0}, {0.1, 0, 0}) == 0.0);
}

TEST_CASE("contour: constant offset along lines, circles, helices, in every plane and sense") {
  for (const double side : {0.02, -0.02}) {
    CHECK(worst_on_offset_walk(polyline({{0, 0, 0}, {30, 10, 0}, {60, 20, 0}}), 0.1, side, 0, side) < 1e-9);
    CHECK(worst_on_offset_walk(polyline({{0, 0, 0}, {30, 10, 5}}), 0.1, side, 0, side) < 1e-9);
    for (const double turns : {0.25, 0.9, 1.0, 3.0}) {
      for (const double sense : {1.0, -1.0}) {
        for (const double climb : {0.0, 5.0}) {
          CAPTURE(side);
          CAPTURE(turns);
          CAPTURE(sense);
          CAPTURE(climb);
          const double sweep = sense * turns * 2.0 * pi;
          const Vector3 start(10, 0, 0);
          const Vector3 end(10.0 * std::cos(sweep), 10.0 * std::sin(sweep), climb);
          const Path path({make_arc(start, end, Vector3::Zero(), sweep, 2, 50.0)});
          CHECK(worst_on_offset_walk(path, 0.05, side, 0, side) < 1e-6);
          if (climb == 0.0) CHECK(worst_on_offset_walk(path, 0.05, 0, side, side) < 1e-9);
        }
      }
    }
  }
  // XZ and YZ planes: a radial offset lies in the plane and has no XY side except by its X or Y part; the size counts.
  for (const int normal : {0, 1}) {
    const int a = (normal + 1) % 3;
    const int b = (normal + 2) % 3;
    Vector3 start = Vector3::Zero();
    start[a] = 10.0;
    const Path path({make_arc(start, start, Vector3::Zero(), 2.0 * pi, normal, 50.0)});
    ContourTracker tracker(path);
    for (double angle = 0.0; angle < 2.0 * pi; angle += 0.01) {
      Vector3 p = Vector3::Zero();
      p[a] = 10.03 * std::cos(angle);
      p[b] = 10.03 * std::sin(angle);
      CHECK(std::abs(tracker.step(p)) == doctest::Approx(0.03));
    }
    CHECK(tracker.s_mm() == doctest::Approx(20.0 * pi).epsilon(2e-3));
  }
}

TEST_CASE("contour: radii that differ at both ends make a spiral") {
  const Vector3 end(0, 10.01, 0);
  const Path path({make_arc({10, 0, 0}, end, Vector3::Zero(), 0.5 * pi, 2, 50.0)});
  ContourTracker tracker(path);
  for (double fraction = 0.0; fraction <= 1.0; fraction += 0.01) {
    CHECK(std::abs(tracker.step(point_at(path[0], fraction * path.length_mm()))) < 1e-9);
  }
}

TEST_CASE("contour: a full circle between lead-in and lead-out is neither skipped nor taken twice") {
  const Path path({make_line({0, 0, 0}, {10, 0, 0}, 50), make_arc({10, 0, 0}, {10, 0, 0}, {10, 5, 0}, 2 * pi, 2, 50),
                   make_line({10, 0, 0}, {20, 0, 0}, 50)});
  for (const double left : {0.0, 0.01, -0.01}) {
    ContourTracker tracker(path);
    std::size_t cursor = 0;
    double previous = 0.0;
    for (double s = 0.0; s <= path.length_mm(); s += 0.05) {
      CHECK(std::abs(tracker.step(beside(path, s, left, 0, cursor)) - left) < 1e-4);
      CHECK(tracker.s_mm() >= previous - 1e-3);
      CHECK(std::abs(tracker.s_mm() - s) < 0.05);
      previous = tracker.s_mm();
    }
    CHECK(tracker.segment() == 2);
  }
}

TEST_CASE("contour: rounding a corner inside, overshooting it outside") {
  for (const double turn_deg : {30.0, 90.0, 150.0, 179.0}) {
    for (const double side : {1.0, -1.0}) {
      const double turn = side * turn_deg * pi / 180.0;
      const Vector3 corner(50, 0, 0);
      const Vector3 out(std::cos(turn), std::sin(turn), 0);
      const Path path = polyline({{0, 0, 0}, corner, corner + 50.0 * out});
      // Inside: a moving average of the position rounds the corner.
      ContourTracker tracker(path);
      std::size_t cursor_a = 0;
      double last_deviation = 0.0;
      for (double s = 0.0; s <= 99.0; s += 0.1) {
        Vector3 p = Vector3::Zero();
        for (int k = 0; k < 10; ++k) p += 0.1 * path.point(std::max(0.0, s - 0.1 * k), cursor_a);
        last_deviation = tracker.step(p);
        CHECK(std::abs(last_deviation) == doctest::Approx(nearest_of_all(path, p)).epsilon(1e-6));
        CHECK(last_deviation * side > -1e-9);
      }
      CHECK(tracker.segment() == 1);
      // Outside: past the corner by .3 mm, then across to the second leg.
      ContourTracker outside(path);
      std::size_t cursor_b = 0;
      for (double s = 0.0; s < 50.0; s += 0.1) outside.step(path.point(s, cursor_b));
      for (double f = 0.0; f <= 1.0; f += 0.1) {
        const Vector3 p = corner + Vector3(0.3 * (1.0 - f), -side * 0.2, 0) + f * 0.1 * out;
        const double deviation = outside.step(p);
        CHECK(std::abs(deviation) == doctest::Approx(nearest_of_all(path, p)).epsilon(1e-6));
        if (turn_deg < 100.0) CHECK(deviation * side <= 0.0);
      }
    }
  }
}

TEST_CASE("contour: a path that turns back on itself is followed there and back") {
  // Out 50 mm, back on the same line, then away to the side: the turn is rounded off by the filter, so that the point
  // never reaches the tip.
  const Path path = polyline({{0, 0, 0}, {50, 0, 0}, {0, 0, 0}, {0, 30, 0}});
  ContourTracker tracker(path);
  std::size_t cursor = 0;
  double worst = 0.0;
  double s_mid_return = 0.0;
  for (double s = 0.0; s <= 131.0; s += 0.1) {
    Vector3 p = Vector3::Zero();
    for (int k = 0; k < 10; ++k) p += 0.1 * path.point(std::clamp(s - 0.1 * k, 0.0, 130.0), cursor);
    const double deviation = std::abs(tracker.step(p));
    worst = std::max(worst, std::abs(deviation - nearest_of_all(path, p)));
    if (std::abs(s - 75.0) < 0.05) s_mid_return = tracker.s_mm();
  }
  CHECK(worst < 1e-6);
  CHECK(std::abs(s_mid_return - 75.0) < 1.0);
  CHECK(tracker.segment() == 2);
  CHECK(tracker.s_mm() == doctest::Approx(130.0).epsilon(1e-3));
}

TEST_CASE("contour: two laps of a circle drawn with short lines are two laps") {
  for (const int pieces : {24, 360, 6000}) {
    std::vector<Vector3> points;
    for (int i = 0; i <= 2 * pieces; ++i) {
      const double angle = 2.0 * pi * i / pieces;
      points.emplace_back(20.0 * std::cos(angle), 20.0 * std::sin(angle), 0.0);
    }
    const Path path = polyline(points);
    ContourTracker tracker(path);
    std::size_t cursor = 0;
    double worst = 0.0;
    for (double s = 0.0; s <= path.length_mm(); s += 0.13) {
      tracker.step(beside(path, s, 0.02, 0, cursor));
      worst = std::max(worst, std::abs(tracker.s_mm() - s));
    }
    CAPTURE(pieces);
    CHECK(worst < 0.2);
  }
}

namespace {

/// Vibrates in X and Y while it creeps along; the largest distance of the foot from where the point is on the path,
/// counted along the path, and the largest error of the deviation against the whole path.
struct Followed {
  double along_mm = 0.0;
  double deviation_mm = 0.0;
  double missed_mm = 0.0;
};
Followed creep(const Path& path, double step, double amplitude, double swing) {
  ContourTracker tracker(path);
  shapegcode::CornerReach reach(path);
  std::size_t cursor = 0;
  Followed worst;
  const int last = static_cast<int>(path.length_mm() / step);
  for (int k = 0; k <= last; ++k) {
    const double s = std::min(step * k, path.length_mm());
    const double vibration = amplitude * std::sin(swing * k);
    const Vector3 p = path.point(s, cursor) + Vector3(vibration, 0.6 * vibration, 0.0);
    const double deviation = std::abs(tracker.step(p));
    reach.step(p, tracker.s_mm());
    worst.along_mm = std::max(worst.along_mm, std::abs(tracker.s_mm() - s));
    worst.deviation_mm = std::max(worst.deviation_mm, std::abs(deviation - nearest_of_all(path, p)));
  }
  reach.step(path[path.size() - 1].end_mm, tracker.s_mm());
  worst.missed_mm = reach.largest_mm();
  return worst;
}

}  // namespace

TEST_CASE("contour: small figures traced again and again under vibration are followed pass by pass") {
  const Vector3 origin = Vector3::Zero();
  for (const double radius : {0.1, 0.3, 0.6, 2.0}) {
    const Vector3 start(radius, 0.0, 0.0);
    const Segment left = make_arc(start, start, origin, 2.0 * pi, 2, 50.0);
    const Segment right = make_arc(start, start, origin, -2.0 * pi, 2, 50.0);
    const Vector3 top(0.5 * radius, radius, 0.0);
    const std::vector<Path> paths = {
        Path({left, left, left}),                                                        // one circle three times
        Path({left, right, left, right}),                                                // there and back
        polyline({origin, start, top, origin, start, top, origin}),                      // a triangle twice
        polyline({origin, start, origin, start, origin, start, origin}),                 // a line there and back
        Path({make_line(origin, start, 50), left, left, make_line(start, origin, 50)}),  // a ball bar
    };
    for (std::size_t i = 0; i < paths.size(); ++i) {
      for (const double swing : {0.13, 0.29, 0.82}) {
        const double amplitude = 0.01 * radius;
        const Followed worst = creep(paths[i], 0.0005, amplitude, swing);
        CAPTURE(radius);
        CAPTURE(i);
        CAPTURE(swing);
        // Near a tip a vibration may take the foot over it and back.
        CHECK(worst.along_mm < 20.0 * amplitude + 0.002);
        CHECK(worst.missed_mm < 2.0 * amplitude + 0.0005);
        CHECK(worst.deviation_mm < 2.0 * amplitude);
      }
    }
  }
}

TEST_CASE("contour: random polylines of 1 um to 100 mm pieces under vibration, against a search of the whole path") {
  std::mt19937_64 generator(7);
  std::uniform_real_distribution<double> unit(0.0, 1.0);
  for (int trial = 0; trial < 20; ++trial) {
    // Turns of less than a quarter, climbing in Y on the whole, so that the path does not come near itself.
    std::vector<Vector3> points{Vector3::Zero()};
    for (int i = 0; i < 200; ++i) {
      const double length = std::pow(10.0, -3.0 + 5.0 * unit(generator));
      const double heading = pi / 2 + 0.6 * (2.0 * unit(generator) - 1.0);
      points.push_back(points.back() + length * Vector3(std::cos(heading), std::sin(heading), 0.1 * unit(generator)));
    }
    const Path path = polyline(points);
    ContourTracker tracker(path);
    std::size_t cursor = 0;
    double worst = 0.0;
    const double step = 0.2 * unit(generator) + 0.01;
    for (double s = 0.0; s <= path.length_mm(); s += step) {
      const Vector3 p =
          path.point(s, cursor) + 0.03 * Vector3(std::sin(1.7 * s), std::cos(2.9 * s), 0.1 * std::sin(0.3 * s));
      worst = std::max(worst, std::abs(std::abs(tracker.step(p)) - nearest_of_all(path, p)));
      if (s > 300.0) break;
    }
    CAPTURE(trial);
    CHECK(worst < 1e-8);
  }
}

TEST_CASE("contour: a close parallel pass does not steal the point") {
  // Pocket rows 40 um apart, the point swinging by 15 um.
  std::vector<Vector3> points;
  for (int row = 0; row < 10; ++row) {
    const double y = 0.04 * row;
    points.emplace_back(row % 2 == 0 ? 0.0 : 30.0, y, 0.0);
    points.emplace_back(row % 2 == 0 ? 30.0 : 0.0, y, 0.0);
  }
  const Path path = polyline(points);
  ContourTracker tracker(path);
  std::size_t cursor = 0;
  double worst = 0.0;
  for (double s = 0.0; s <= path.length_mm(); s += 0.1) {
    tracker.step(path.point(s, cursor) + Vector3(0.0, 0.015 * std::sin(0.9 * s), 0.0));
    worst = std::max(worst, std::abs(tracker.s_mm() - s));
  }
  CHECK(worst < 0.1);
}

TEST_CASE("contour: a lost track is found again") {
  // The point skips a detour of 200 mm that the path makes.
  const Path path = polyline({{0, 0, 0}, {50, 0, 0}, {50, 100, 0}, {50.5, 100, 0}, {50.5, 0, 0}, {120, 0, 0}});
  ContourTracker tracker(path);
  double deviation = 0.0;
  for (double x = 0.0; x <= 110.0; x += 0.1) deviation = tracker.step({x, 0, 0});
  CHECK(std::abs(deviation) < 1e-9);
  CHECK(tracker.segment() == 4);
  // A jump far ahead in one sample is within that sample's window.
  ContourTracker jump(path);
  CHECK(jump.step({50, 60, 0}) == doctest::Approx(0.0));
}

TEST_CASE("contour: pieces without length do no harm") {
  const Path path = polyline({{0, 0, 0}, {0, 0, 0}, {10, 0, 0}, {10, 0, 0}, {10, 10, 0}, {10, 10, 0}});
  CHECK(worst_on_offset_walk(polyline({{0, 0, 0}, {0, 0, 0}, {10, 0, 0}}), 0.1, 0.01, 0, 0.01) < 1e-9);
  ContourTracker tracker(path);
  CHECK(tracker.step({0.0, 0.1, 0}) == doctest::Approx(0.1));
  for (double x = 0.0; x <= 10.2; x += 0.1) tracker.step({x, -0.1, 0});
  CHECK(tracker.step({10.1, -0.1, 0}) == doctest::Approx(-0.1 * std::sqrt(2.0)));
  for (double y = 0.0; y <= 10.0; y += 0.1) tracker.step({10.1, y, 0});
  CHECK(tracker.step({10.1, 10.0, 0}) == doctest::Approx(-0.1));
}

TEST_CASE("side of a deviation: vertical ones are neither left nor right") {
  struct Row {
    double left, up;
    PathSide side;
  };
  const std::vector<Row> rows = {{0.02, 0.0, PathSide::left},     {-0.02, 0.01, PathSide::right},
                                 {0.01, 0.02, PathSide::above},   {-0.01, -0.02, PathSide::below},
                                 {1e-5, -0.02, PathSide::below},  {0.0, 0.02, PathSide::above},
                                 {0.02, -0.0199, PathSide::left}, {0.0, 0.0, PathSide::none}};
  const Path line = polyline({{0, 0, 0}, {10, 10, 0}});
  const Path arc(std::vector<Segment>{make_arc({10, 0, 0}, {0, 10, 0}, {0, 0, 0}, pi / 2, 2, 100.0)});
  for (const Path* path : {&line, &arc}) {
    for (const Row& row : rows) {
      ContourTracker tracker(*path);
      std::size_t cursor = 0;
      for (double s = 0.0; s < 5.0; s += 0.1) tracker.step(beside(*path, s, row.left, row.up, cursor));
      CAPTURE(row.left);
      CAPTURE(row.up);
      // On the arc the foot of a point on it is off by rounding: that is beside the path, however little.
      if (row.side != PathSide::none || path == &line) CHECK(tracker.side() == row.side);
    }
  }
  // Beside a plunge there is no left and no right; below its end there is a below.
  ContourTracker plunge(polyline({{0, 0, 5}, {0, 0, 0}}));
  plunge.step({0.01, 0.0, 4.9});
  CHECK(plunge.side() == PathSide::none);
  for (double z = 4.8; z > -0.05; z -= 0.1) plunge.step({0.0, 0.0, z});
  plunge.step({0.0, 0.0, -0.03});
  CHECK(plunge.side() == PathSide::below);
}

TEST_CASE("contour tracker: many short pieces within a step are the one line that they make") {
  // 40 000 pieces of 1 um and one line, the samples 0.3 mm apart and far beside; then back, and onto a copy far ahead.
  std::vector<Segment> pieces;
  for (int i = 0; i < 40'000; ++i) pieces.push_back(make_line({i * 1e-3, 0, 0}, {(i + 1) * 1e-3, 0, 0}, 10.0));
  const Path fine(pieces);
  const Path coarse({make_line({0, 0, 0}, {40, 0, 0}, 10.0)});
  ContourTracker many(fine);
  ContourTracker one(coarse);
  for (int i = 0; i < 230; ++i) {
    const double x = i < 120 ? 0.3 * i : 0.3 * (240 - i);
    const Vector3 p(x, 0.05 * std::sin(0.7 * i) + (i % 50 == 7 ? 3.0 : 0.0), i % 60 == 11 ? -1.0 : 0.0);
    const double deviation = many.step(p);
    CHECK(deviation == doctest::Approx(one.step(p)).epsilon(1e-9));
    CHECK(std::abs(many.s_mm() - one.s_mm()) < 1e-9);
  }
}

namespace {

// Largest deviation of a point that shakes about a place moving along a path, as the tracker sees it, and as a search
// of everything within reach of that place does. Both in mm.
struct Seen {
  double tracker = 0.0;
  double search = 0.0;
  double differ = 0.0;
};

Seen follow(const Path& path, double feed_mm_per_s, double amplitude_mm) {
  constexpr double period_s = 1e-3;
  constexpr int steps = 400;
  const double reach = 2.0 * amplitude_mm + 0.02;
  ContourTracker driven(path);
  ContourTracker tracker(path);
  Seen seen;
  std::size_t cursor = 0;
  for (double time_s = 0.0; time_s * feed_mm_per_s < path.length_mm(); time_s += period_s) {
    const double s = time_s * feed_mm_per_s;
    const Vector3 command = path.point(s, cursor);
    driven.step(command);
    Vector3 p = command;
    p[0] += amplitude_mm * std::sin(251.3 * time_s);
    p[1] += amplitude_mm * (std::cos(284.0 * time_s) - 1.0);
    const double tracked = std::abs(tracker.step(p, driven));
    double nearest = std::numeric_limits<double>::infinity();
    std::size_t near = cursor;
    const double first = std::max(0.0, s - reach);
    const double last = std::min(path.length_mm(), s + reach);
    for (int k = 0; k <= steps; ++k) {
      nearest = std::min(nearest, (path.point(first + (last - first) * k / steps, near) - p).norm());
    }
    seen.tracker = std::max(seen.tracker, tracked);
    seen.search = std::max(seen.search, nearest);
    seen.differ = std::max(seen.differ, std::abs(tracked - nearest));
  }
  return seen;
}

std::vector<Segment> circles(double radius, int turns, bool to_and_fro, double pitch) {
  std::vector<Segment> path;
  double z = 0.0;
  for (int k = 0; k < turns; ++k) {
    const double sweep = to_and_fro && k % 2 == 1 ? -2.0 * std::numbers::pi : 2.0 * std::numbers::pi;
    path.push_back(make_arc({radius, 0, z}, {radius, 0, z - pitch}, {0, 0, z}, sweep, 2, 1.0));
    z -= pitch;
  }
  return path;
}

std::vector<Segment> squares(double side, int turns, bool back) {
  const Vector3 corners[4] = {{0, 0, 0}, {side, 0, 0}, {side, side, 0}, {0, side, 0}};
  std::vector<Segment> path;
  for (int k = 0; k < 4 * turns; ++k) {
    path.push_back(make_line(corners[k % 4], corners[(k + 1) % 4], 1.0));
  }
  for (int k = 4 * turns; back && k-- > 0;) {
    path.push_back(make_line(corners[(k + 1) % 4], corners[k % 4], 1.0));
  }
  return path;
}

}  // namespace

TEST_CASE("contour: a path that runs over itself is followed on its own pass, however small and slow") {
  // Slower than the vibration is quick: the point moves backward most of the time.
  for (const double feed : {0.05, 0.5}) {
    for (const double radius : {0.05, 0.1, 0.5}) {
      for (const auto& [name, path] : {std::pair{"turns", circles(radius, 6, false, 0.0)},
                                       {"to and fro", circles(radius, 6, true, 0.0)},
                                       {"helix of 1 um", circles(radius, 6, false, 0.001)},
                                       {"square three times", squares(radius, 3, false)},
                                       {"square and back", squares(radius, 1, true)}}) {
        const std::string path_name(name);
        CAPTURE(path_name);
        CAPTURE(feed);
        CAPTURE(radius);
        const Path followed(path);
        if (followed.length_mm() / feed > (shapegcode::tests::is_sanitized ? 3.0 : 40.0)) {
          continue;  // enough of it is seen on the smaller ones
        }
        const Seen seen = follow(followed, feed, 0.003);
        CHECK(seen.search < 0.008);
        // At a tip, within the vibration, the one leg is as good as the other.
        CHECK(seen.differ < (std::string(name) == "to and fro" ? 0.006 : 0.0005));
        CHECK(seen.tracker == doctest::Approx(seen.search).epsilon(0.05));
      }
    }
  }
}

namespace {

// A curve of lines, gently bent or with corners, long and short; `kept`: each ends in a stop, so that none is a plain
// line and the tracker searches for every foot.
std::vector<Segment> wandering(std::mt19937& random, double bend_rad, double longest_mm, bool kept) {
  std::uniform_real_distribution<double> any(-1.0, 1.0);
  std::vector<Segment> path;
  Vector3 at(10.0, -20.0, 5.0);
  double heading = 0.0;
  for (int i = 0; i < 400; ++i) {
    heading += bend_rad * any(random) * (i % 37 == 0 ? 20.0 : 1.0);
    const double length = longest_mm * (0.55 + 0.45 * any(random));
    const Vector3 next = at + length * Vector3(std::cos(heading), std::sin(heading), 0.3 * any(random) * bend_rad);
    path.push_back(make_line(at, next, 20.0));
    path.back().stop_at_end = kept;
    at = next;
  }
  return path;
}

}  // namespace

TEST_CASE("contour tracker: where the path runs straight the short way finds the foot of the search, to the last bit") {
  for (unsigned seed = 0; seed < 24; ++seed) {
    const double bend = std::array{0.002, 0.02, 0.1, 0.6}[seed % 4];
    const double longest = std::array{0.02, 0.3, 2.0}[seed % 3];
    const double shake = std::array{0.0, 0.004, 0.08}[(seed / 4) % 3];
    CAPTURE(seed);
    std::mt19937 first(seed);
    std::mt19937 second(seed);
    const Path plain(wandering(first, bend, longest, false));
    const Path kept(wandering(second, bend, longest, true));
    ContourTracker driver(plain);
    ContourTracker quick(plain);
    ContourTracker thorough(kept);
    std::size_t cursor = 0;
    bool same = true;
    const double step = 0.04;
    for (int k = 0; k * step < plain.length_mm() + 1.0; ++k) {
      const Vector3 command = plain.point(std::min(k * step, plain.length_mm()), cursor);
      driver.step(command);
      const Vector3 p =
          command + shake * Vector3(std::sin(0.29 * k), std::sin(0.41 * k) * std::cos(0.05 * k), 0.2 * std::sin(k));
      const double found = quick.step(p, driver);
      same = same && found == thorough.step(p, driver) && quick.s_mm() == thorough.s_mm() &&
             quick.segment() == thorough.segment() && quick.side() == thorough.side();
      double nearest = std::numeric_limits<double>::infinity();
      for (std::size_t i = quick.segment() < 3 ? 0 : quick.segment() - 3;
           i < std::min(quick.segment() + 4, plain.size()); ++i) {
        nearest = std::min(nearest, nearest_on(plain[i], p).distance_mm);
      }
      if (bend < 0.1 && k % 7 == 0) CHECK(std::abs(found) == doctest::Approx(nearest).epsilon(1e-6));
    }
    CHECK(same);
  }
}
