#include <doctest/doctest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <random>
#include <string>
#include <vector>

#include "shapegcode/error.hpp"
#include "shapegcode/path.hpp"

using shapegcode::chords_within;
using shapegcode::curvature;
using shapegcode::Error;
using shapegcode::make_arc;
using shapegcode::make_line;
using shapegcode::nearest_on;
using shapegcode::point_at;
using shapegcode::Segment;
using shapegcode::tangent_at;
using shapegcode::Vector3;

namespace {

constexpr double pi = std::numbers::pi;

Vector3 on_circle(const Vector3& centre, double radius, double angle, int normal, double height) {
  Vector3 p = centre;
  p[(normal + 1) % 3] += radius * std::cos(angle);
  p[(normal + 2) % 3] += radius * std::sin(angle);
  p[normal] = height;
  return p;
}

Segment helix(double radius, double from, double sweep, int normal, double climb) {
  const Vector3 centre(3.0, -7.0, 11.0);
  return make_arc(on_circle(centre, radius, from, normal, 2.0),
                  on_circle(centre, radius, from + sweep, normal, 2.0 + climb), centre, sweep, normal, 10.0, 5);
}

std::vector<Segment> many_arcs() {
  std::vector<Segment> arcs;
  std::mt19937_64 generator(17);
  std::uniform_real_distribution<double> angle(-pi, pi);
  for (int i = 0; i < 60; ++i) {
    const double sweep = (i % 2 == 0 ? 1.0 : -1.0) * (0.05 + (2.0 * pi - 0.05) * (i % 7) / 6.0);
    arcs.push_back(helix(0.5 + i % 11, angle(generator), sweep, i % 3, i % 4 == 0 ? 0.0 : 3.0 * angle(generator)));
  }
  return arcs;
}

}  // namespace

TEST_CASE("segment: a line by hand") {
  const Segment line = make_line({1.0, 2.0, 3.0}, {4.0, 6.0, 15.0}, 10.0, 7);  // 3, 4, 12: 13 mm
  CHECK(line.length_mm == 13.0);
  CHECK(line.line == 7);
  CHECK(point_at(line, 0.0) == line.start_mm);
  CHECK(point_at(line, 13.0) == line.end_mm);
  CHECK(point_at(line, -1.0) == line.start_mm);
  CHECK(point_at(line, 20.0) == line.end_mm);
  CHECK((point_at(line, 6.5) - Vector3(2.5, 4.0, 9.0)).norm() < 1e-14);
  CHECK((tangent_at(line, 5.0) - Vector3(3.0, 4.0, 12.0) / 13.0).norm() < 1e-15);
  CHECK(curvature(line) == 0.0);
  const Segment none = make_line({1.0, 1.0, 1.0}, {1.0, 1.0, 1.0}, 1.0);
  CHECK(none.length_mm == 0.0);
  CHECK(tangent_at(none, 0.0) == Vector3::Zero());
  CHECK(point_at(none, 0.0) == Vector3(1.0, 1.0, 1.0));
  CHECK(nearest_on(none, {1.0, 1.0, 4.0}).distance_mm == 3.0);
}

TEST_CASE("segment: an arc without radius or sweep is refused") {
  CHECK_THROWS_AS((void)make_arc({0, 0, 0}, {1, 0, 0}, {0, 0, 0}, 1.0, 2, 1.0), Error);
  CHECK_THROWS_AS((void)make_arc({1, 0, 0}, {0, 0, 0}, {0, 0, 0}, 1.0, 2, 1.0), Error);
  CHECK_THROWS_AS((void)make_arc({1, 0, 0}, {0, 1, 0}, {0, 0, 0}, 0.0, 2, 1.0), Error);
}

TEST_CASE("segment: an arc about no axis, or of numbers that are not finite, is refused") {
  const double nan = std::nan("");
  const double infinite = std::numeric_limits<double>::infinity();
  const auto refused = [](const Vector3& start, const Vector3& end, const Vector3& centre, double sweep, int normal,
                          double feed, const char* what) {
    try {
      (void)make_arc(start, end, centre, sweep, normal, feed, 17);
      return false;
    } catch (const Error& error) {
      CAPTURE(error.what());
      CHECK(error.kind() == shapegcode::ErrorKind::argument);
      CHECK(error.line() == 17);
      return std::string(error.what()).find(what) != std::string::npos;
    }
  };
  const Vector3 start(1, 0, 0);
  const Vector3 end(0, 1, 0);
  const Vector3 centre(0, 0, 0);
  for (const int normal : {-2, -1, 3, 5, 258}) {
    CAPTURE(normal);
    CHECK(refused(start, end, centre, 0.5 * pi, normal, 1.0, ("not " + std::to_string(normal)).c_str()));
  }
  for (const double bad : {nan, infinite, -infinite}) {
    CAPTURE(bad);
    CHECK(refused({1, 0, bad}, end, centre, 0.5 * pi, 2, 1.0, "finite"));
    CHECK(refused(start, {bad, 1, 0}, centre, 0.5 * pi, 2, 1.0, "finite"));
    CHECK(refused(start, end, {0, bad, 0}, 0.5 * pi, 2, 1.0, "finite"));
    CHECK(refused(start, end, centre, bad, 2, 1.0, "finite"));
    CHECK(refused(start, end, centre, 0.5 * pi, 2, bad, "finite"));
  }
  // The centre's height is nobody's business.
  CHECK(make_arc(start, end, {0, 0, nan}, 0.5 * pi, 2, 1.0).length_mm == doctest::Approx(0.5 * pi));
}

TEST_CASE("segment: arcs pass through the points of their circle") {
  for (int normal = 0; normal < 3; ++normal) {
    for (const double sweep : {pi / 2, -pi / 2, 1.9 * pi, -2.0 * pi}) {
      const Segment arc = helix(20.0, 0.3, sweep, normal, 6.0);
      for (const double fraction : {0.0, 0.25, 0.5, 0.875, 1.0}) {
        const Vector3 expected = on_circle(arc.centre_mm, 20.0, 0.3 + sweep * fraction, normal, 2.0 + 6.0 * fraction);
        CHECK((point_at(arc, fraction * arc.length_mm) - expected).norm() < 1e-12);
      }
      // Both ends to the last bit.
      CHECK(point_at(arc, arc.length_mm) == arc.end_mm);
      CHECK((point_at(arc, 0.0) - arc.start_mm).norm() < 1e-13);
      CHECK(curvature(arc) == doctest::Approx(20.0 / (400.0 + 36.0 / (sweep * sweep))));
    }
  }
  CHECK(curvature(helix(20.0, 0.3, 1.0, 2, 0.0)) == doctest::Approx(0.05));
}

TEST_CASE("segment: length, tangent and curvature against the polygon of 20000 points") {
  for (const Segment& arc : many_arcs()) {
    constexpr int n = 20000;
    double length = 0.0;
    Vector3 last = arc.start_mm;
    for (int i = 1; i <= n; ++i) {
      const Vector3 p = point_at(arc, arc.length_mm * i / n);
      length += (p - last).norm();
      last = p;
    }
    CHECK(length == doctest::Approx(arc.length_mm).epsilon(1e-7));
    const double h = 1e-4 * arc.length_mm;
    for (const double s : {0.1 * arc.length_mm, 0.5 * arc.length_mm, 0.8 * arc.length_mm}) {
      const Vector3 tangent = tangent_at(arc, s);
      CHECK(tangent.norm() == doctest::Approx(1.0).epsilon(1e-14));
      CHECK((tangent - (point_at(arc, s + h) - point_at(arc, s - h)) / (2.0 * h)).norm() < 1e-6);
      const Vector3 bend = (tangent_at(arc, s + h) - tangent_at(arc, s - h)) / (2.0 * h);
      CHECK(bend.norm() == doctest::Approx(curvature(arc)).epsilon(1e-5));
    }
  }
}

TEST_CASE("segment: a difference of the radii is spread over the sweep") {
  const Segment arc = make_arc({10.0, 0.0, 0.0}, {0.0, 10.01, 0.0}, {0.0, 0.0, 0.0}, pi / 2, 2, 1.0);
  const Vector3 middle = point_at(arc, 0.5 * arc.length_mm);
  CHECK(middle.norm() == doctest::Approx(10.005).epsilon(1e-12));
  CHECK(middle.x() == doctest::Approx(middle.y()));
  CHECK(point_at(arc, arc.length_mm) == Vector3(0.0, 10.01, 0.0));
  const double h = 1e-5;
  CHECK((tangent_at(arc, 3.0) - (point_at(arc, 3.0 + h) - point_at(arc, 3.0 - h)).normalized()).norm() < 1e-8);
}

TEST_CASE("segment: the nearest point against a search of the whole segment") {
  std::mt19937_64 generator(23);
  std::uniform_real_distribution<double> off(-1.0, 1.0);
  const auto searched = [](const Segment& segment, const Vector3& p) {
    constexpr int n = 4000;
    int best = 0;
    double nearest = 1e300;
    for (int i = 0; i <= n; ++i) {
      const double distance = (p - point_at(segment, segment.length_mm * i / n)).norm();
      if (distance < nearest) {
        nearest = distance;
        best = i;
      }
    }
    double low = segment.length_mm * std::max(0, best - 1) / n;
    double high = segment.length_mm * std::min(n, best + 1) / n;
    for (int k = 0; k < 100; ++k) {
      const double a = low + (high - low) / 3.0;
      const double b = high - (high - low) / 3.0;
      if ((p - point_at(segment, a)).norm() < (p - point_at(segment, b)).norm()) {
        high = b;
      } else {
        low = a;
      }
    }
    return (p - point_at(segment, 0.5 * (low + high))).norm();
  };
  std::vector<Segment> segments = many_arcs();
  segments.push_back(make_line({1.0, 2.0, 3.0}, {4.0, 6.0, 15.0}, 10.0));
  for (const Segment& segment : segments) {
    CAPTURE(segment.sweep_rad);
    const bool flat = segment.start_mm[segment.normal] == segment.end_mm[segment.normal];
    for (int i = 0; i < 20; ++i) {
      // Deviations as a tool has them; far points too where the curve is plane.
      const double size = flat && i % 2 == 0 ? 3.0 : 0.05;
      const Vector3 p = point_at(segment, segment.length_mm * (0.5 + 0.6 * off(generator))) +
                        size * Vector3(off(generator), off(generator), off(generator));
      const auto found = nearest_on(segment, p);
      CHECK(found.distance_mm == doctest::Approx(searched(segment, p)).epsilon(flat ? 1e-7 : 1e-3));
      CHECK(found.s_mm >= 0.0);
      CHECK(found.s_mm <= segment.length_mm);
      CHECK((p - point_at(segment, found.s_mm)).norm() == doctest::Approx(found.distance_mm).epsilon(1e-9));
    }
  }
}

TEST_CASE("segment: chords of an arc within a tolerance, and one less is not") {
  const Segment arc = make_arc({20, 0, 0}, {0, 20, 0}, {0, 0, 0}, 0.5 * pi, 2, 10.0);
  const auto off_mm = [](double chords) { return 20.0 * (1.0 - std::cos(0.25 * pi / chords)); };
  for (const double tolerance_mm : {0.0005, 0.01, 1.0}) {
    const double chords = chords_within(arc, tolerance_mm);
    CHECK(off_mm(chords) <= tolerance_mm);
    CHECK(off_mm(chords - 1.0) > tolerance_mm);
  }
  CHECK(chords_within(arc, 50.0) == 1.0);
  CHECK(chords_within(make_line({0, 0, 0}, {9, 0, 0}, 10.0), 0.001) == 1.0);
}
