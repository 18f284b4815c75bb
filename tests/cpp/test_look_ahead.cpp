#include <doctest/doctest.h>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <limits>
#include <memory>
#include <vector>

#include "shapegcode/error.hpp"
#include "shapegcode/motion.hpp"
#include "speed_plans.hpp"

using shapegcode::AccelerationLaw;
using shapegcode::corner_speed_limit;
using shapegcode::Error;
using shapegcode::FilterTolerance;
using shapegcode::forced_stops;
using shapegcode::make_arc;
using shapegcode::make_line;
using shapegcode::MotionLimits;
using shapegcode::Path;
using shapegcode::plan_speed;
using shapegcode::Segment;
using shapegcode::segment_speed_limit;
using shapegcode::SpeedProfile;
using shapegcode::Vector3;
using shapegcode::tests::check_joined;
using shapegcode::tests::constant_time;
using shapegcode::tests::distance_at;
using shapegcode::tests::none;
using shapegcode::tests::pi;
using shapegcode::tests::speed_at;

namespace {

MotionLimits accelerating(double acceleration, double jerk_time_s = 0.0) {
  MotionLimits limits;
  limits.law = AccelerationLaw::jerk_limited;
  limits.max_acceleration_mm_per_s2 = Vector3::Constant(acceleration);
  limits.jerk_time_s = jerk_time_s;
  return limits;
}

Path straight(double length, double feed) { return Path({make_line({0, 0, 0}, {length, 0, 0}, feed)}); }

/// Collinear lines along X with one feed each.
Path row_of_lines(const std::vector<double>& lengths, const std::vector<double>& feeds) {
  std::vector<Segment> segments;
  double x = 0.0;
  for (std::size_t i = 0; i < lengths.size(); ++i) {
    segments.push_back(make_line({x, 0, 0}, {x + lengths[i], 0, 0}, feeds[i]));
    x += lengths[i];
  }
  return Path(std::move(segments));
}

Path paper_path(double feed) {
  return Path({make_line({0, 0, 0}, {20, 0, 0}, feed), make_arc({20, 0, 0}, {40, 20, 0}, {20, 20, 0}, pi / 2, 2, feed),
               make_line({40, 20, 0}, {40, 40, 0}, feed)});
}

}  // namespace

// --- Closed forms ----------------------------------------------------------------------------------------------------

TEST_CASE("look-ahead: trapezoid and triangle under the acceleration law") {
  // 100 mm at 100 mm/s with 1000 mm/s2: 1 s and one ramp of 0.1 s.
  const SpeedProfile trapezoid = plan_speed(straight(100.0, 100.0), accelerating(1000.0));
  CHECK(trapezoid.duration_s() == doctest::Approx(1.1).epsilon(1e-12));
  REQUIRE(trapezoid.phases().size() == 3);
  CHECK(trapezoid.phases()[0].duration_s == doctest::Approx(0.1));
  CHECK(distance_at(trapezoid, 0.1) == doctest::Approx(5.0));
  CHECK(distance_at(trapezoid, 0.55) == doctest::Approx(50.0));
  CHECK(speed_at(trapezoid, 0.05) == doctest::Approx(50.0));
  CHECK(speed_at(trapezoid, 1.075) == doctest::Approx(25.0));
  // 4 mm: up to sqrt(1000*4) and down, 2*sqrt(4/1000).
  const SpeedProfile triangle = plan_speed(straight(4.0, 100.0), accelerating(1000.0));
  CHECK(triangle.duration_s() == doctest::Approx(2.0 * std::sqrt(0.004)).epsilon(1e-12));
  CHECK(triangle.phases().size() == 2);
  CHECK(distance_at(triangle, std::sqrt(0.004)) == doctest::Approx(2.0));
  check_joined(trapezoid, 100.0);
  check_joined(triangle, 4.0);
}

TEST_CASE("look-ahead: under the constant-time law a ramp lasts the time constant whatever the feed") {
  for (const double feed : {10.0, 100.0, 700.0}) {
    const SpeedProfile profile = plan_speed(straight(100.0, feed), constant_time(0.05));
    CHECK(profile.duration_s() == doctest::Approx(100.0 / feed + 0.05).epsilon(1e-12));
    REQUIRE(profile.phases().size() == 3);
    CHECK(profile.phases()[0].duration_s == doctest::Approx(0.05).epsilon(1e-12));
    CHECK(profile.phases()[2].duration_s == doctest::Approx(0.05).epsilon(1e-12));
  }
  // Too short for both ramps: F/A up and down.
  CHECK(plan_speed(straight(2.0, 100.0), constant_time(0.05)).duration_s() ==
        doctest::Approx(2.0 * std::sqrt(2.0 / 2000.0)).epsilon(1e-12));
}

TEST_CASE("look-ahead: the paper's path, times and ramps of paper 000") {
  struct Case {
    double feed, ratio, duration;
  };
  // Straight: ramp up A, steady, ramp down A of mean (F + rF)/2; arc 10*pi/(rF); twice.
  for (const Case& c :
       {Case{100.0, 0.6, 0.9936}, Case{100.0, 0.99, 0.7678}, Case{200.0, 0.6, 0.0}, Case{200.0, 0.99, 0.0}}) {
    CAPTURE(c.feed);
    CAPTURE(c.ratio);
    MotionLimits limits = constant_time(0.05);
    limits.arc_feed_ratio = c.ratio;
    const Path path = paper_path(c.feed);
    const SpeedProfile profile = plan_speed(path, limits);
    const double slow = c.ratio * c.feed;
    const double steady = (20.0 - 0.05 * c.feed / 2.0 - 0.05 * (c.feed + slow) / 2.0) / c.feed;
    const double expected = 2.0 * (0.1 + steady) + 10.0 * pi / slow;
    CHECK(profile.duration_s() == doctest::Approx(expected).epsilon(1e-12));
    if (c.duration > 0.0) CHECK(std::abs(profile.duration_s() - c.duration) < 5e-5);
    // Deceleration ends exactly where the arc begins, acceleration begins exactly where it ends.
    REQUIRE(profile.phases().size() == 7);
    const auto& phases = profile.phases();
    CHECK(std::abs(phases[3].distance_mm - 20.0) < 1e-12);
    CHECK(phases[3].acceleration_mm_per_s2 == 0.0);
    CHECK(phases[3].speed_mm_per_s == doctest::Approx(slow).epsilon(1e-12));
    CHECK(std::abs(phases[4].distance_mm - path.distance_mm(2)) < 1e-12);
    for (const std::size_t ramp : {0U, 2U, 4U, 6U})
      CHECK(phases[ramp].duration_s == doctest::Approx(0.05).epsilon(1e-9));
    check_joined(profile, path.length_mm());
  }
}

TEST_CASE("look-ahead: a feed step between collinear lines is run on the faster side") {
  // 100 mm at 100 then 100 mm at 50, 1000 mm/s2: 0.1 s up, 3.75 mm of braking before the border, 1.25 mm at the end.
  const Path path = row_of_lines({100.0, 100.0}, {100.0, 50.0});
  const SpeedProfile profile = plan_speed(path, accelerating(1000.0));
  const double first = 0.1 + (100.0 - 5.0 - 3.75) / 100.0 + 0.05;
  const double second = (100.0 - 1.25) / 50.0 + 0.05;
  CHECK(profile.duration_s() == doctest::Approx(first + second).epsilon(1e-12));
  CHECK(distance_at(profile, first) == doctest::Approx(100.0).epsilon(1e-12));
  CHECK(speed_at(profile, first) == doctest::Approx(50.0).epsilon(1e-9));
}

TEST_CASE("look-ahead: what a filter mixes passes from a lower feed only where the path says a higher one") {
  MotionLimits limits = accelerating(1000.0);
  limits.feed_spread_s = 0.02;
  limits.feed_excess_ratio = 0.05;
  // 5 mm/s in the middle: reached .1 mm before it and left .1 mm behind it; 49 is no lower feed than 50.
  const Path path = row_of_lines({20.0, 1.0, 20.0, 10.0}, {50.0, 5.0, 50.0, 49.0});
  const SpeedProfile profile = plan_speed(path, limits);
  check_joined(profile, 51.0);
  std::size_t cursor = 0;
  const auto speed = [&](double distance) { return speed_at(profile, profile.time_s(distance, cursor)); };
  CHECK(speed(19.9 + 1e-6) == doctest::Approx(5.0).epsilon(1e-3));
  CHECK(speed(21.1 - 1e-6) == doctest::Approx(5.0).epsilon(1e-3));
  CHECK(speed(19.9 - 0.1) == doctest::Approx(std::sqrt(25.0 + 2.0 * 1000.0 * 0.1)).epsilon(1e-3));
  CHECK(speed(41.0 - 0.5) == doctest::Approx(50.0));
  limits.feed_spread_s = 0.0;
  const double saved = profile.duration_s() - plan_speed(path, limits).duration_s();
  CHECK(saved > 0.0);
  CHECK(saved < 0.04);
}

TEST_CASE("look-ahead: collinear lines of one feed are one move") {
  const SpeedProfile profile =
      plan_speed(row_of_lines({0.1, 30.0, 0.001, 20.0}, {100, 100, 100, 100}), accelerating(1000.0));
  CHECK(profile.duration_s() == doctest::Approx(0.50101 + 0.1).epsilon(1e-9));
  CHECK(profile.phases().size() == 3);
}

TEST_CASE("look-ahead: without any acceleration limit every line runs at its own feed") {
  MotionLimits limits;
  limits.law = AccelerationLaw::jerk_limited;
  const Path path = row_of_lines({100.0, 100.0, 50.0}, {100.0, 50.0, 200.0});
  const SpeedProfile profile = plan_speed(path, limits);
  CHECK(profile.duration_s() == doctest::Approx(1.0 + 2.0 + 0.25).epsilon(1e-12));
  CHECK(speed_at(profile, 0.5) == doctest::Approx(100.0));
  CHECK(speed_at(profile, 2.0) == doctest::Approx(50.0));
  CHECK(speed_at(profile, 3.1) == doctest::Approx(200.0));
  CHECK(distance_at(profile, 2.0) == doctest::Approx(150.0));
}

// --- Single limits by hand -------------------------------------------------------------------------------------------

TEST_CASE("look-ahead: axis feed limits act along the direction of travel") {
  MotionLimits limits;
  limits.max_feed_mm_per_s = {100.0, 50.0, 10.0};
  // 3-4-5 triangle: X allows 100/.6, Y allows 50/.8.
  CHECK(segment_speed_limit(make_line({0, 0, 0}, {3, 4, 0}, 500.0), limits) == doctest::Approx(62.5));
  CHECK(segment_speed_limit(make_line({0, 0, 0}, {3, -4, 0}, 40.0), limits) == doctest::Approx(40.0));
  CHECK(segment_speed_limit(make_line({0, 0, 0}, {0, 0, -2}, 40.0), limits) == doctest::Approx(10.0));
  CHECK(segment_speed_limit(make_line({0, 0, 0}, {-7, 0, 0}, 500.0), limits) == doctest::Approx(100.0));
  // An arc in XY points along Y somewhere.
  CHECK(segment_speed_limit(make_arc({10, 0, 0}, {0, 10, 0}, {0, 0, 0}, pi / 2, 2, 500.0), limits) <= 50.0);
}

TEST_CASE("look-ahead: an arc's feed ratio and centripetal limit") {
  const Segment arc = make_arc({20, 0, 0}, {40, 20, 0}, {20, 20, 0}, pi / 2, 2, 200.0);
  MotionLimits limits;
  limits.arc_feed_ratio = 0.6;
  CHECK(segment_speed_limit(arc, limits) == doctest::Approx(120.0));
  CHECK(segment_speed_limit(make_line({0, 0, 0}, {1, 0, 0}, 200.0), limits) == doctest::Approx(200.0));
  limits.centripetal_acceleration_mm_per_s2 = 500.0;  // sqrt(500*20)
  CHECK(segment_speed_limit(arc, limits) == doctest::Approx(100.0));
  FilterTolerance contour;
  contour.contour_tolerance_mm = 0.001;
  contour.variance_s2 = 1e-4;  // R*sigma^2*(v/R)^2/2 = tolerance: v = sqrt(2*.001*20/1e-4) = 20
  CHECK(segment_speed_limit(arc, MotionLimits{}, contour) == doctest::Approx(20.0));
}

TEST_CASE("look-ahead: the acceleration of a circle turns with it, jerk v^3 / r^2; no block faster than it is read") {
  const Segment arc = make_arc({20, 0, 0}, {40, 20, 0}, {20, 20, 0}, pi / 2, 2, 200.0);
  MotionLimits limits;
  limits.max_jerk_mm_per_s3 = {2500.0, 2600.0, 1.0};  // cbrt(2500 * 400) = 100; Z does not move
  CHECK(segment_speed_limit(arc, limits) == doctest::Approx(100.0));
  CHECK(segment_speed_limit(make_line({0, 0, 0}, {1, 0, 0}, 200.0), limits) == doctest::Approx(200.0));
  limits = MotionLimits{};
  limits.block_time_s = 0.01;
  CHECK(segment_speed_limit(make_line({0, 0, 0}, {1, 0, 0}, 200.0), limits) == doctest::Approx(100.0));
}

TEST_CASE("look-ahead: corners by junction deviation, and as stops") {
  const Segment along_x = make_line({0, 0, 0}, {10, 0, 0}, 100.0);
  const Segment along_y = make_line({10, 0, 0}, {10, 10, 0}, 100.0);
  MotionLimits limits;
  limits.max_acceleration_mm_per_s2 = {1000.0, 2000.0, none};
  limits.junction_deviation_mm = 0.01;
  // The turn points along (-1, 1) / sqrt(2): X allows 1000 sqrt(2). The arc: r = 0.01 / (sqrt(2) - 1).
  CHECK(corner_speed_limit(along_x, along_y, limits) ==
        doctest::Approx(std::sqrt(1000.0 * std::sqrt(2.0) * 0.01 / (std::sqrt(2.0) - 1.0))));
  limits.corner_stop_angle_rad = 0.51 * pi;
  CHECK(corner_speed_limit(along_x, along_y, limits) > 1.0);
  limits.corner_stop_angle_rad = 0.5 * pi - 1e-9;
  CHECK(corner_speed_limit(along_x, along_y, limits) < 0.01);
}

TEST_CASE("look-ahead: speed difference at corners of 90, 180 and 0 degrees") {
  MotionLimits limits;
  limits.corner_speed_difference_mm_per_s = {8.0, 5.0, none};
  const Segment along_x = make_line({0, 0, 0}, {10, 0, 0}, 100.0);
  const Segment along_y = make_line({10, 0, 0}, {10, 10, 0}, 100.0);
  const Segment back = make_line({10, 0, 0}, {0, 0, 0}, 100.0);
  const Segment on = make_line({10, 0, 0}, {20, 0, 0}, 100.0);
  const Segment up = make_line({10, 0, 0}, {10, 0, 10}, 100.0);
  CHECK(corner_speed_limit(along_x, along_y, limits) == doctest::Approx(5.0));  // X loses v, Y gains v
  CHECK(corner_speed_limit(along_x, back, limits) == doctest::Approx(4.0));     // X changes by 2v
  CHECK(corner_speed_limit(along_x, up, limits) == doctest::Approx(8.0));
  CHECK(corner_speed_limit(along_x, on, limits) == none);
  // 60 degrees: X changes by v/2, Y by v*sqrt(3)/2.
  const Segment slanted = make_line({10, 0, 0}, {15, 5.0 * std::sqrt(3.0), 0}, 100.0);
  CHECK(corner_speed_limit(along_x, slanted, limits) == doctest::Approx(5.0 / std::sqrt(0.75)));
  // A line that runs tangentially into an arc is no corner; one that meets it at 90 degrees is.
  CHECK(corner_speed_limit(along_x, make_arc({10, 0, 0}, {20, 10, 0}, {10, 10, 0}, pi / 2, 2, 1.0), limits) == none);
  CHECK(corner_speed_limit(along_y, make_arc({10, 10, 0}, {20, 20, 0}, {10, 20, 0}, pi / 2, 2, 1.0), limits) ==
        doctest::Approx(5.0));
}

TEST_CASE("look-ahead: a corner is passed at its limit, not below and not above") {
  MotionLimits limits = accelerating(1000.0);
  limits.corner_speed_difference_mm_per_s = Vector3::Constant(10.0);
  const Path path({make_line({0, 0, 0}, {20, 0, 0}, 100.0), make_line({20, 0, 0}, {20, 20, 0}, 100.0)});
  const SpeedProfile profile = plan_speed(path, limits);
  std::size_t cursor = 0;
  const double at_corner = profile.time_s(20.0, cursor);
  CHECK(speed_at(profile, at_corner) == doctest::Approx(10.0).epsilon(1e-6));
  // Each side: 0 to 100 in 5 mm, 100 to 10 in 4.95 mm, the rest steady.
  CHECK(profile.duration_s() == doctest::Approx(2.0 * (0.1 + 0.09 + (20.0 - 5.0 - 4.95) / 100.0)).epsilon(1e-9));
}

TEST_CASE("look-ahead: the corner limit of the contour tolerance holds behind a filter of that spread") {
  // Two equal taps 2*d apart have the mean deviation d and the variance d^2. Simulated through them, the corner is cut
  // by no more than the tolerance, ramps on both sides included.
  constexpr double period = 1e-4;
  constexpr int d = 40;
  const MotionLimits limits = accelerating(1500.0);
  const FilterTolerance filter{0.02, 1.0, d * period * d * period, d * period};
  for (const double angle : {pi / 2, pi / 4, 2.0}) {
    const Vector3 turned(std::cos(angle), std::sin(angle), 0.0);
    const auto path = std::make_shared<const Path>(
        std::vector<Segment>{make_line({-20, 0, 0}, {0, 0, 0}, 200.0), make_line({0, 0, 0}, 20.0 * turned, 200.0)});
    // The speed by hand: |change|*(v*d + a*d^2/2)/2 = tolerance.
    const double change = 2.0 * std::sin(angle / 2.0);
    const double acceleration = 1500.0 / std::max(std::abs(turned.x()), std::abs(turned.y()));  // the larger side's
    const double by_hand = (2.0 * 0.02 / change - 0.5 * acceleration * filter.variance_s2) / (d * period);
    CHECK(corner_speed_limit((*path)[0], (*path)[1], limits, filter) == doctest::Approx(by_hand).epsilon(1e-3));
    const auto profile = std::make_shared<const SpeedProfile>(plan_speed(*path, limits, filter));
    const auto filtered =
        shapegcode::Fir({0, 2 * d}, {0.5, 0.5}).apply(shapegcode::interpolate(path, profile, period)).positions_mm;
    double worst = 0.0;
    for (Eigen::Index i = 0; i < filtered.rows(); ++i) {
      const Vector3 p = filtered.row(i);
      const double to_first = p.x() < 0.0 ? std::hypot(p.y(), p.z()) : p.norm();
      const double along = std::max(0.0, p.dot(turned));
      worst = std::max(worst, std::min(to_first, (p - along * turned).norm()));
    }
    CAPTURE(angle);
    CHECK(worst < 0.02);
    CHECK(worst > 0.005);  // and the limit is no more careful than need be
  }
}

TEST_CASE("look-ahead: axis acceleration acts along the direction of travel") {
  MotionLimits limits;
  limits.law = AccelerationLaw::jerk_limited;
  limits.max_acceleration_mm_per_s2 = {3000.0, 800.0, 100.0};
  // 3-4-5: X allows 5000, Y allows 1000.
  const Path slanted({make_line({0, 0, 0}, {30, 40, 0}, 100.0)});
  CHECK(plan_speed(slanted, limits).duration_s() == doctest::Approx(0.5 + 0.1).epsilon(1e-12));
  const Path plunge({make_line({0, 0, 0}, {0, 0, -50}, 50.0)});
  CHECK(plan_speed(plunge, limits).duration_s() == doctest::Approx(1.0 + 0.5).epsilon(1e-12));
}

// --- Jerk time -------------------------------------------------------------------------------------------------------

TEST_CASE(
    "look-ahead: the jerk time adds itself to a move from rest to rest and bounds the slope of the acceleration") {
  for (const double length : {100.0, 8.0}) {  // a trapezoid, and a triangle whose acceleration turns over at once
    MotionLimits limits = accelerating(1000.0);
    limits.max_jerk_mm_per_s3 = Vector3::Constant(20000.0);
    const auto path = std::make_shared<const Path>(straight(length, 100.0));
    const auto profile = std::make_shared<const SpeedProfile>(plan_speed(*path, limits));
    CHECK(profile->jerk_time_s() >= 0.05 - 1e-12);  // 1000/20000 at least
    CHECK(profile->duration_s() == doctest::Approx(profile->ramp_duration_s() + profile->jerk_time_s()));
    constexpr double period = 1e-4;
    const Eigen::MatrixXd p = shapegcode::interpolate(path, profile, period).positions_mm;
    double jerk = 0.0;
    double acceleration = 0.0;
    for (Eigen::Index i = 3; i < p.rows(); ++i) {
      acceleration = std::max(acceleration, std::abs(p(i, 0) - 2.0 * p(i - 1, 0) + p(i - 2, 0)) / (period * period));
      jerk = std::max(
          jerk, std::abs(p(i, 0) - 3.0 * p(i - 1, 0) + 3.0 * p(i - 2, 0) - p(i - 3, 0)) / (period * period * period));
    }
    CAPTURE(length);
    CHECK(acceleration < 1000.0 * (1.0 + 1e-6));
    CHECK(jerk < 20000.0 * (1.0 + 1e-3));
  }
}

TEST_CASE("look-ahead: a given jerk time is kept as it is, by both laws") {
  CHECK(plan_speed(straight(100.0, 100.0), accelerating(1000.0, 0.03)).jerk_time_s() == 0.03);
  CHECK(plan_speed(straight(100.0, 100.0), accelerating(1000.0, 0.03)).duration_s() == doctest::Approx(1.13));
  MotionLimits limits = constant_time(0.05);
  limits.jerk_time_s = 0.03;
  CHECK(plan_speed(straight(100.0, 100.0), limits).duration_s() == doctest::Approx(1.08));
  CHECK(plan_speed(straight(100.0, 100.0), constant_time(0.05)).jerk_time_s() == 0.0);
}

// --- Refusals and stops ----------------------------------------------------------------------------------------------

TEST_CASE("look-ahead: refuses limits that are not positive and segments without feed") {
  const Path path = straight(10.0, 100.0);
  const double nan = std::numeric_limits<double>::quiet_NaN();
  for (const double bad : {0.0, -1.0, nan}) {
    MotionLimits limits;
    limits.time_constant_s = bad;
    CHECK_THROWS_AS((void)plan_speed(path, limits), Error);
    limits = MotionLimits{};
    limits.max_feed_mm_per_s.y() = bad;
    CHECK_THROWS_AS((void)plan_speed(path, limits), Error);
    limits = MotionLimits{};
    limits.max_acceleration_mm_per_s2.z() = bad;
    CHECK_THROWS_AS((void)plan_speed(path, limits), Error);
    limits = MotionLimits{};
    limits.max_jerk_mm_per_s3.x() = bad;
    CHECK_THROWS_AS((void)plan_speed(path, limits), Error);
    limits = MotionLimits{};
    limits.corner_speed_difference_mm_per_s.x() = bad;
    CHECK_THROWS_AS((void)plan_speed(path, limits), Error);
    limits = MotionLimits{};
    limits.arc_feed_ratio = bad;
    CHECK_THROWS_AS((void)plan_speed(path, limits), Error);
    limits = MotionLimits{};
    limits.centripetal_acceleration_mm_per_s2 = bad;
    CHECK_THROWS_AS((void)plan_speed(path, limits), Error);
    for (double MotionLimits::*limit : {&MotionLimits::polyline_acceleration_mm_per_s2,
                                        &MotionLimits::junction_deviation_mm, &MotionLimits::corner_stop_angle_rad}) {
      limits = MotionLimits{};
      limits.*limit = bad;
      CHECK_THROWS_AS((void)plan_speed(path, limits), Error);
    }
    CHECK_THROWS_AS((void)plan_speed(straight(10.0, bad), MotionLimits{}), Error);
  }
  MotionLimits limits;
  limits.jerk_time_s = -0.01;
  CHECK_THROWS_AS((void)plan_speed(path, limits), Error);
  limits.jerk_time_s = nan;
  CHECK_THROWS_AS((void)plan_speed(path, limits), Error);
}

TEST_CASE("look-ahead: a path without length takes no time") {
  CHECK(plan_speed(Path(), MotionLimits{}).duration_s() == 0.0);
  CHECK(plan_speed(Path({make_line({1, 0, 0}, {1, 0, 0}, 10.0)}), MotionLimits{}).duration_s() == 0.0);
}

TEST_CASE("look-ahead: forced stops at plunges, retracts and exact stops") {
  const double lean = 15.0 * pi / 180.0;
  const double corner = 45.0 * pi / 180.0;
  std::vector<Segment> segments = {
      make_line({0, 0, 5}, {0, 0, 0}, 1.0),        // 0: plunge
      make_line({0, 0, 0}, {10, 0, 0}, 1.0),       // 1: stop before it
      make_line({10, 0, 0}, {10, 10, 0}, 1.0),     // 2: a corner in the plane is none
      make_line({10, 10, 0}, {10, 10, 5}, 1.0),    // 3: retract: stop before it
      make_line({10, 10, 5}, {10, 10, 9}, 1.0),    // 4: straight on
      make_line({10, 10, 9}, {10, 12, 19}, 1.0),   // 5: leans by 11.3 degrees, turns by as much: none
      make_line({10, 12, 19}, {10, 22, 19}, 1.0),  // 6: from near the axis by 79 degrees: stop
  };
  CHECK(forced_stops(segments, lean, corner, MotionLimits{}) == std::vector<std::size_t>{1, 3, 6});
  segments[1].stop_at_end = true;
  segments[6].stop_at_end = true;  // the end of the path is a stop anyway
  CHECK(forced_stops(segments, lean, corner, MotionLimits{}) == std::vector<std::size_t>{1, 2, 3, 6});
  // 40 degrees off the axis is no plunge.
  const double tan40 = std::tan(40.0 * pi / 180.0);
  CHECK(forced_stops({make_line({0, 0, 10}, {10 * tan40, 0, 0}, 1.0), make_line({10 * tan40, 0, 0}, {50, 0, 0}, 1.0)},
                     lean, corner, MotionLimits{})
            .empty());
  CHECK(forced_stops({}, lean, corner, MotionLimits{}).empty());
  // A filter of 10 ms spread cuts a right angle by sqrt(2)*a*(10 ms)^2/4 = 0.035 mm even if the speed is zero there.
  const MotionLimits limits = accelerating(1000.0);
  FilterTolerance filter{0.035, 1.0, 1e-4, 0.01};
  const std::vector<Segment> right_angle = {make_line({0, 0, 0}, {50, 0, 0}, 100.0),
                                            make_line({50, 0, 0}, {50, 50, 0}, 100.0)};
  CHECK(forced_stops(right_angle, lean, corner, limits, filter) == std::vector<std::size_t>{1});
  filter.contour_tolerance_mm = 0.036;
  CHECK(forced_stops(right_angle, lean, corner, limits, filter).empty());
}
