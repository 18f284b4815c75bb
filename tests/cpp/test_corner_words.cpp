#include "program/rewrite/corner_words.hpp"

#include <doctest/doctest.h>

#include <cmath>
#include <numbers>
#include <string>

#include "random_blocks.hpp"
#include "shapegcode/error.hpp"

using shapegcode::CornerResult;
using shapegcode::Error;
using shapegcode::ErrorKind;
using shapegcode::insert_corner;
using shapegcode::make_arc;
using shapegcode::make_line;
using shapegcode::point_at;
using shapegcode::Segment;
using shapegcode::SegmentKind;
using shapegcode::tangent_at;
using shapegcode::Vector3;
using shapegcode::tests::block_from;
using shapegcode::tests::Random;
using shapegcode::tests::uniform;

namespace {

constexpr double pi = std::numbers::pi;

/// The same block run backwards: what arrives at a corner.
Segment reversed(const Segment& segment) {
  if (segment.kind == SegmentKind::arc) {
    return make_arc(segment.end_mm, segment.start_mm, segment.centre_mm, -segment.sweep_rad, 2, segment.feed_mm_per_s);
  }
  return make_line(segment.end_mm, segment.start_mm, segment.feed_mm_per_s);
}

/// Least distance of `p` to a block in XY, by golden section about the best of many samples.
double distance_to(const Segment& segment, const Vector3& p) {
  const auto at = [&](double fraction) { return (point_at(segment, fraction * segment.length_mm) - p).norm(); };
  double best = 0.0;
  for (int i = 0; i <= 400; ++i) {
    if (at(i / 400.0) < at(best)) best = i / 400.0;
  }
  double low = std::max(0.0, best - 1.0 / 400.0);
  double high = std::min(1.0, best + 1.0 / 400.0);
  const double ratio = 0.5 * (std::sqrt(5.0) - 1.0);
  for (int i = 0; i < 80; ++i) {
    const double a = high - ratio * (high - low);
    const double b = low + ratio * (high - low);
    (at(a) < at(b) ? high : low) = at(a) < at(b) ? b : a;
  }
  return std::min({at(low), at(high), at(0.0), at(1.0)});
}

struct Corner {
  Segment before;
  Segment after;
  double turn = 0.0;
  bool lines = false;
};

Corner random_corner(Random& random) {
  Corner corner;
  const auto part = [&](double heading, double feed, bool line) {
    const double radius = line ? 0.0 : uniform(random, 5.0, 40.0);
    const double longest = line ? 50.0 : radius * 3.0;
    return block_from({1, 2, 3}, heading, uniform(random, 4.0, longest), radius,
                      uniform(random, -1, 1) < 0 ? -1.0 : 1.0, feed);
  };
  const double arriving = uniform(random, -pi, pi);
  corner.turn = uniform(random, 0.05, 3.0) * (uniform(random, -1, 1) < 0 ? -1.0 : 1.0);
  const bool line_before = uniform(random, 0, 1) < 0.5;
  const bool line_after = uniform(random, 0, 1) < 0.5;
  corner.before = reversed(part(arriving + pi, 10.0, line_before));
  corner.after = part(arriving + corner.turn, 20.0, line_after);
  corner.lines = line_before && line_after;
  return corner;
}

/// Alarm number of the refusal, 0 if there is none.
int refused(const Segment& before, const Segment& after, bool chamfer, double size, const std::string& words = "") {
  try {
    (void)insert_corner(before, after, {chamfer, size, 7, 9}, 2);
  } catch (const Error& error) {
    CHECK_MESSAGE(std::string(error.what()).find(words) != std::string::npos, error.what());
    CHECK(error.kind() == ErrorKind::program);
    CHECK(error.line() == 7);
    CHECK(error.column() == 9);
    return error.alarm();
  }
  return 0;
}

}  // namespace

TEST_CASE("corner words: a right angle, chamfer and rounding in closed form") {
  const Segment before = make_line({0, 0, 0}, {20, 0, 0}, 10.0, 4);
  Segment after = make_line({20, 0, 0}, {20, 30, 0}, 20.0, 5);
  after.stop_at_end = true;
  const CornerResult chamfer = insert_corner(before, after, {true, 3.0, 4, 1}, 2);
  CHECK(chamfer.before.end_mm == Vector3(17, 0, 0));
  REQUIRE(chamfer.inserted);
  CHECK(chamfer.inserted->start_mm == Vector3(17, 0, 0));
  CHECK(chamfer.inserted->end_mm == Vector3(20, 3, 0));
  CHECK(chamfer.inserted->feed_mm_per_s == 10.0);
  CHECK(chamfer.inserted->line == 4);
  CHECK(chamfer.after.start_mm == Vector3(20, 3, 0));
  CHECK(chamfer.after.end_mm == Vector3(20, 30, 0));
  CHECK(chamfer.after.feed_mm_per_s == 20.0);
  CHECK(chamfer.after.line == 5);
  CHECK(chamfer.after.stop_at_end);

  const CornerResult rounding = insert_corner(before, after, {false, 3.0, 4, 1}, 2);
  REQUIRE(rounding.inserted);
  CHECK(rounding.inserted->kind == SegmentKind::arc);
  CHECK((rounding.before.end_mm - Vector3(17, 0, 0)).norm() < 1e-12);
  CHECK((rounding.inserted->centre_mm - Vector3(17, 3, 0)).norm() < 1e-12);
  CHECK((rounding.after.start_mm - Vector3(20, 3, 0)).norm() < 1e-12);
  CHECK(rounding.inserted->sweep_rad == doctest::Approx(pi / 2));
  CHECK(rounding.inserted->feed_mm_per_s == 10.0);
  // The whole of the shorter block may be used.
  CHECK((insert_corner(before, after, {false, 20.0, 4, 1}, 2).before.end_mm - before.start_mm).norm() < 1e-9);
  CHECK((insert_corner(before, after, {true, 20.0, 4, 1}, 2).before.end_mm - before.start_mm).norm() < 1e-9);
}

TEST_CASE("corner words: a chamfer between a line and an arc has its ends at the straight distance from the corner") {
  const Segment line = make_line({0, 0, 0}, {20, 0, 0}, 10.0);
  const Segment arc = make_arc({20, 0, 0}, {10, 10, 0}, {10, 0, 0}, pi / 2, 2, 20.0);
  const CornerResult there = insert_corner(line, arc, {true, 2.0, 1, 1}, 2);
  CHECK((there.before.end_mm - Vector3(18, 0, 0)).norm() < 1e-12);
  CHECK((there.after.start_mm - Vector3(20, 0, 0)).norm() == doctest::Approx(2.0));
  CHECK((there.after.start_mm - Vector3(10, 0, 0)).norm() == doctest::Approx(10.0));
  CHECK(there.after.start_mm.y() > 0.0);
  CHECK(there.after.sweep_rad == doctest::Approx(pi / 2 - 2.0 * std::asin(0.1)));
  const CornerResult back = insert_corner(reversed(arc), reversed(line), {true, 2.0, 1, 1}, 2);
  CHECK((back.before.end_mm - there.after.start_mm).norm() < 1e-12);
  CHECK((back.after.start_mm - there.before.end_mm).norm() < 1e-12);
  CHECK(back.before.sweep_rad == doctest::Approx(-there.after.sweep_rad));
}

TEST_CASE("corner words: a rounding is tangent to both blocks, its centre at the size from both") {
  Random random(77);
  int inserted = 0;
  int refusals = 0;
  double worst_join = 0.0;
  double worst_direction = 0.0;
  double worst_distance = 0.0;
  for (int round = 0; round < 4000; ++round) {
    const Corner corner = random_corner(random);
    const double size = std::pow(10.0, uniform(random, -2.0, 1.3));
    try {
      const CornerResult result = insert_corner(corner.before, corner.after, {false, size, 1, 1}, 2);
      REQUIRE(result.inserted);
      ++inserted;
      const Segment& arc = *result.inserted;
      const Segment& a = result.before;
      const Segment& b = result.after;
      CHECK(a.start_mm == corner.before.start_mm);
      CHECK(b.end_mm == corner.after.end_mm);
      CHECK(a.end_mm == arc.start_mm);
      CHECK(b.start_mm == arc.end_mm);
      CHECK(a.length_mm < corner.before.length_mm);
      CHECK(b.length_mm < corner.after.length_mm);
      CHECK((arc.sweep_rad > 0.0) == (corner.turn > 0.0));
      // Rounded or not, the path turns by the same angle from its start to its end.
      CHECK(a.sweep_rad + arc.sweep_rad + b.sweep_rad ==
            doctest::Approx(corner.before.sweep_rad + corner.turn + corner.after.sweep_rad).epsilon(1e-9));
      // The arc's own formula, just before its end, and the tangents across both joins.
      worst_join = std::max(worst_join, (point_at(arc, arc.length_mm * (1 - 1e-13)) - arc.end_mm).norm());
      if (a.length_mm > 1e-3 && b.length_mm > 1e-3) {
        worst_direction = std::max(worst_direction, (tangent_at(a, a.length_mm) - tangent_at(arc, 0.0)).norm());
        worst_direction = std::max(worst_direction, (tangent_at(b, 0.0) - tangent_at(arc, arc.length_mm)).norm());
      }
      if (round < 800) {
        for (const Segment& programmed : {corner.before, corner.after}) {
          worst_distance = std::max(worst_distance, std::abs(distance_to(programmed, arc.centre_mm) - size));
        }
      }
      if (corner.lines) {
        CHECK(arc.sweep_rad == doctest::Approx(corner.turn));
        CHECK((a.end_mm - corner.before.end_mm).norm() ==
              doctest::Approx(size * std::tan(0.5 * std::abs(corner.turn))));
      }
    } catch (const Error& error) {
      ++refusals;
      CHECK(error.alarm() == 55);
      if (corner.lines) {  // only where the tangent points lie beyond a block
        CHECK(size * std::tan(0.5 * std::abs(corner.turn)) > std::min(corner.before.length_mm, corner.after.length_mm));
      }
      CHECK(size * std::tan(0.5 * std::abs(corner.turn)) > 0.1);
    }
  }
  CHECK(inserted > 1500);
  CHECK(refusals > 100);
  CHECK(worst_join < 1e-9);
  CHECK(worst_direction < 1e-6);
  CHECK(worst_distance < 1e-6);
}

TEST_CASE("corner words: nothing is inserted at a tangent corner or with a size of zero") {
  const Segment before = make_line({0, 0, 0}, {20, 0, 0}, 10.0);
  const Segment arc = make_arc({20, 0, 0}, {30, 10, 0}, {20, 10, 0}, pi / 2, 2, 20.0);
  for (const bool chamfer : {false, true}) {
    for (const double degrees : {0.0, 0.99, -0.99, 1.01}) {
      const Segment after = block_from({20, 0, 0}, degrees * pi / 180.0, 30.0, 0.0, 1.0, 20.0);
      const CornerResult result = insert_corner(before, after, {chamfer, 1.0, 1, 1}, 2);
      CHECK(result.inserted.has_value() == (degrees > 1.0));
      if (!result.inserted) {
        CHECK(result.before.end_mm == before.end_mm);
        CHECK(result.after.start_mm == after.start_mm);
      }
    }
    CHECK_FALSE(insert_corner(before, arc, {chamfer, 1.0, 1, 1}, 2).inserted);
    CHECK_FALSE(
        insert_corner(before, block_from({20, 0, 0}, 1.0, 30.0, 0.0, 1.0, 20.0), {chamfer, 0.0, 1, 1}, 2).inserted);
  }
}

TEST_CASE("corner words: motion along the normal axis stays in the blocks, other planes turn the axes") {
  const Segment before = make_line({0, 0, 0}, {20, 0, -1}, 10.0);
  const Segment after = make_line({20, 0, -1}, {20, 30, -3}, 20.0);
  const CornerResult result = insert_corner(before, after, {false, 4.0, 1, 1}, 2);
  REQUIRE(result.inserted);
  CHECK(result.inserted->start_mm.z() == -1.0);
  CHECK(result.inserted->end_mm.z() == -1.0);
  CHECK(result.after.end_mm.z() == -3.0);
  // G18: axes Z, X.
  const CornerResult g18 = insert_corner(make_line({0, 0, 0}, {0, 0, 20}, 10.0),
                                         make_line({0, 0, 20}, {30, 0, 20}, 10.0), {false, 4.0, 1, 1}, 1);
  REQUIRE(g18.inserted);
  CHECK((g18.inserted->centre_mm - Vector3(4, 0, 16)).norm() < 1e-12);
  CHECK(int{g18.inserted->normal} == 1);
  CHECK(g18.inserted->sweep_rad == doctest::Approx(pi / 2));
}

TEST_CASE("corner words: what the control refuses, with the word's place and the sizes") {
  const Segment before = make_line({0, 0, 0}, {20, 0, 0}, 10.0);
  const Segment after = make_line({20, 0, 0}, {20, 30, 0}, 10.0);
  const Segment down = make_line({20, 0, 0}, {20, 0, -5}, 10.0);
  CHECK(refused(before, after, true, -1.0, "chamfer ,C-1.0000: a size below zero") == 6);
  CHECK(refused(before, after, false, -1.0, "corner rounding ,R-1.0000") == 6);
  CHECK(refused(before, after, true, 20.1, "20.0000 mm long in the plane, the corner takes 20.1000 mm") == 55);
  CHECK(refused(before, after, false, 20.1, "20.0000 mm long in the plane, the corner takes 20.1000 mm") == 55);
  CHECK(refused(before, down, false, 1.0, "moves 0.0000 mm in the plane") == 51);
  CHECK(refused(make_line({20, 0, 5}, {20, 0, 0}, 10.0), after, false, 1.0, "moves 0.0000 mm in the plane") == 55);
  Segment rapid = before;
  rapid.kind = SegmentKind::rapid;
  CHECK(refused(rapid, after, false, 1.0, "is a rapid") == 52);
  CHECK(refused(before, make_line({20, 0, 0}, {0, 0, 0}, 10.0), false, 1.0, "turn by 180.000 degrees") == 55);
  // A rounding of 5 inside an arc of 4, and a chamfer longer than the arc's diameter.
  const Segment arc = make_arc({20, 0, 0}, {16, 4, 0}, {16, 0, 0}, pi / 2, 2, 20.0);
  CHECK(refused(before, arc, false, 5.0, "arc after the corner, radius 4.0000 mm") == 55);
  CHECK(refused(before, arc, true, 9.0, "arc of radius 4.0000 mm") == 55);
  CHECK_THROWS_AS((void)insert_corner(before, after, {true, std::nan(""), 1, 1}, 2), Error);
  CHECK_THROWS_AS((void)insert_corner(before, after, {true, 1.0, 1, 1}, 3), Error);
  CHECK_THROWS_AS((void)insert_corner(before, make_line({21, 0, 0}, {30, 9, 0}, 1.0), {true, 1.0, 1, 1}, 2), Error);
}

TEST_CASE("corner words: arbitrary corners end in finite blocks or a refusal") {
  Random random(3);
  int bad = 0;
  int done = 0;
  for (int round = 0; round < 50000; ++round) {
    const double scale = std::pow(10.0, uniform(random, -4.0, 3.0));
    const auto part = [&](double heading) {
      const double radius = uniform(random, 0, 1) < 0.5 ? 0.0 : scale * std::pow(10.0, uniform(random, -2.0, 1.0));
      const double length = radius == 0.0 ? scale * uniform(random, 0.0, 10.0) : radius * uniform(random, 1e-6, 6.28);
      return block_from({0, 0, 0}, heading, length, radius, uniform(random, -1, 1) < 0 ? -1.0 : 1.0, 1.0);
    };
    const double turn = uniform(random, 0, 1) < 0.2 ? pi : uniform(random, -pi, pi);
    const Segment before = reversed(part(pi));
    const Segment after = part(turn);
    try {
      const CornerResult result =
          insert_corner(before, after, {round % 2 == 0, scale * uniform(random, 0.0, 2.0), 1, 1}, 2);
      ++done;
      const Segment middle = result.inserted.value_or(make_line(result.before.end_mm, result.after.start_mm, 1.0));
      for (const Segment& s : {result.before, middle, result.after}) {
        const bool fine = s.start_mm.allFinite() && s.end_mm.allFinite() && std::isfinite(s.length_mm) &&
                          std::isfinite(s.sweep_rad) && std::abs(s.sweep_rad) <= 2.0 * pi;
        bad += fine ? 0 : 1;
      }
      if (result.inserted && round % 2 == 1 && std::abs(turn) < 3.14 && scale > 0.1) {
        const double turned = result.before.sweep_rad + middle.sweep_rad + result.after.sweep_rad;
        bad += std::abs(turned - (before.sweep_rad + turn + after.sweep_rad)) < 1e-6 ? 0 : 1;
      }
      bad += result.before.end_mm == middle.start_mm && middle.end_mm == result.after.start_mm ? 0 : 1;
    } catch (const Error& error) {
      bad += error.alarm() == 0 ? 1 : 0;
    }
  }
  CHECK(bad == 0);
  CHECK(done > 5000);
}
