#include <doctest/doctest.h>

#include <cmath>
#include <limits>
#include <numbers>
#include <random>
#include <vector>

#include "shapegcode/error.hpp"
#include "shapegcode/path.hpp"

using shapegcode::Error;
using shapegcode::make_arc;
using shapegcode::make_line;
using shapegcode::Path;
using shapegcode::point_at;
using shapegcode::Segment;
using shapegcode::Vector3;

namespace {

/// The path of paper 000: line, quarter arc of 20 mm, line.
Path paper_path() {
  return Path({make_line({0, 0, 0}, {20, 0, 0}, 100.0),
               make_arc({20, 0, 0}, {40, 20, 0}, {20, 20, 0}, std::numbers::pi / 2, 2, 100.0),
               make_line({40, 20, 0}, {40, 40, 0}, 100.0)});
}

}  // namespace

TEST_CASE("path: distances by hand") {
  const Path path = paper_path();
  REQUIRE(path.size() == 3);
  const double arc = 10.0 * std::numbers::pi;
  CHECK(path.distance_mm(0) == 0.0);
  CHECK(path.distance_mm(1) == 20.0);
  CHECK(path.distance_mm(2) == doctest::Approx(20.0 + arc));
  CHECK(path.length_mm() == doctest::Approx(40.0 + arc));
  std::size_t cursor = 0;
  CHECK(path.point(5.0, cursor) == Vector3(5.0, 0.0, 0.0));
  const double h = 20.0 * std::sqrt(0.5);
  CHECK((path.point(20.0 + 0.5 * arc, cursor) - Vector3(20.0 + h, 20.0 - h, 0.0)).norm() < 1e-12);
  CHECK(cursor == 1);
  CHECK((path.point(30.0 + arc, cursor) - Vector3(40.0, 30.0, 0.0)).norm() < 1e-12);
  CHECK(path.point(1e9, cursor) == Vector3(40.0, 40.0, 0.0));
  CHECK(path.point(-1.0, cursor) == Vector3(0.0, 0.0, 0.0));
}

TEST_CASE("path: a point does not depend on where the cursor stood") {
  const Path path = paper_path();
  std::mt19937_64 generator(1);
  std::uniform_real_distribution<double> distance(-1.0, 1.1 * path.length_mm());
  std::size_t wandering = 0;
  for (int i = 0; i < 2000; ++i) {
    const double s = distance(generator);
    std::size_t fresh = 0;
    std::size_t beyond = 99;
    const Vector3 expected = path.point(s, fresh);
    CHECK(path.point(s, wandering) == expected);
    CHECK(path.point(s, beyond) == expected);
  }
}

TEST_CASE("path: refuses gaps and numbers that are not finite") {
  CHECK_THROWS_AS(Path({make_line({0, 0, 0}, {1, 0, 0}, 1.0), make_line({1, 0, 2e-6}, {2, 0, 0}, 1.0)}), Error);
  CHECK_NOTHROW(Path({make_line({0, 0, 0}, {1, 0, 0}, 1.0), make_line({1, 0, 0.5e-6}, {2, 0, 0}, 1.0)}));
  const double nan = std::numeric_limits<double>::quiet_NaN();
  CHECK_THROWS_AS(Path({make_line({0, 0, 0}, {nan, 0, 0}, 1.0)}), Error);
  const double infinity = std::numeric_limits<double>::infinity();
  CHECK_THROWS_AS(Path({make_line({0, 0, 0}, {infinity, 0, 0}, 1.0)}), Error);
}

TEST_CASE("path: empty, and with segments of no length") {
  const Path empty;
  std::size_t cursor = 3;
  CHECK(empty.length_mm() == 0.0);
  CHECK(empty.point(1.0, cursor) == Vector3::Zero());
  const Path path({make_line({0, 0, 0}, {1, 0, 0}, 1.0), make_line({1, 0, 0}, {1, 0, 0}, 1.0),
                   make_line({1, 0, 0}, {3, 0, 0}, 1.0)});
  CHECK(path.length_mm() == 3.0);
  cursor = 0;
  CHECK(path.point(1.0, cursor) == Vector3(1.0, 0.0, 0.0));
  CHECK(path.point(2.0, cursor) == Vector3(2.0, 0.0, 0.0));
}

TEST_CASE("segments: an array in braces, or handed over, is kept") {
  const auto line = [](double from) { return make_line({from, 0, 0}, {from + 1.0, 0, 0}, 10.0); };
  const auto braces = [&]() -> shapegcode::Segments { return {line(0.0), line(1.0), line(2.0)}; }();
  const auto handed_over = [&]() -> shapegcode::Segments { return std::vector<Segment>{line(0.0), line(1.0)}; }();
  const std::vector<Segment> other(64, line(9.0));  // where the arrays stood, if they are gone
  REQUIRE(braces.size() == 3);
  CHECK(braces.back().end_mm == Vector3(3, 0, 0));
  CHECK(braces.part(1, 1).front().end_mm == Vector3(2, 0, 0));
  CHECK(handed_over.back().end_mm == Vector3(2, 0, 0));
  CHECK(shapegcode::Segments(other)[5].end_mm == Vector3(10, 0, 0));
}

TEST_CASE("path: every segment comes back as it went in, to the bit") {
  std::mt19937_64 generator(7);
  std::uniform_real_distribution<double> place(-100.0, 100.0);
  std::vector<Segment> segments;
  Vector3 at = Vector3::Zero();
  for (std::uint32_t i = 0; i < 5000; ++i) {
    const Vector3 to(place(generator), place(generator), i % 5 == 0 ? -0.0 : place(generator));
    // Feeds and lines that stay for a while, and some that do not.
    const double feed = i < 2000 ? 50.0 : 50.0 + 0.1 * static_cast<double>(i % 37);
    Segment segment = make_line(at, to, feed, i < 3000 ? i + 1 : 7 * (i / 3));
    if (i % 11 == 3) {
      const Vector3 centre(0.5 * (at[0] + to[0]), 0.5 * (at[1] + to[1]), at[2]);
      segment = make_arc(at, to, centre, std::numbers::pi, 2, feed, i);
    }
    if (i % 101 == 0) segment.stop_at_end = true;
    if (i % 211 == 0) segment.length_mm *= 1.0 + 1e-15;
    if (i % 307 == 0) segment.kind = shapegcode::SegmentKind::rapid;
    segments.push_back(segment);
    at = to;
    if (i % 401 == 0) at[0] += 5e-7;  // a gap that is allowed
  }
  const Path path(segments);
  REQUIRE(path.size() == segments.size());
  double distance = 0.0;
  std::size_t differing = 0;
  for (std::size_t i = 0; i < segments.size(); ++i) {
    const Segment& was = segments[i];
    const Segment now = path[i];
    const bool same = was.start_mm == now.start_mm && was.end_mm == now.end_mm && was.centre_mm == now.centre_mm &&
                      was.start_radius_mm == now.start_radius_mm && was.end_radius_mm == now.end_radius_mm &&
                      was.start_angle_rad == now.start_angle_rad && was.sweep_rad == now.sweep_rad &&
                      was.length_mm == now.length_mm && was.feed_mm_per_s == now.feed_mm_per_s &&
                      was.line == now.line && was.kind == now.kind && was.normal == now.normal &&
                      was.stop_at_end == now.stop_at_end && std::signbit(was.end_mm[2]) == std::signbit(now.end_mm[2]);
    const bool one_by_one = path.start_mm(i) == was.start_mm && path.end_mm(i) == was.end_mm &&
                            path.feed_mm_per_s(i) == was.feed_mm_per_s && path.line(i) == was.line &&
                            path.is_arc(i) == (was.kind == shapegcode::SegmentKind::arc) &&
                            path.distance_mm(i) == distance;
    differing += same && one_by_one ? 0U : 1U;
    distance += was.length_mm;
  }
  CHECK(differing == 0);
  CHECK(path.length_mm() == distance);
  const Path copy = path;
  CHECK(copy[17].end_mm == segments[17].end_mm);
  CHECK(path.segments().part(100, 3).back().line == segments[102].line);
}
