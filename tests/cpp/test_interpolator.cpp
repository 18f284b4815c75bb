#include <doctest/doctest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <memory>
#include <numbers>
#include <random>
#include <span>
#include <vector>

#include "shapegcode/error.hpp"
#include "shapegcode/motion.hpp"
#include "stepped_into.hpp"

using shapegcode::Error;
using shapegcode::interpolate;
using shapegcode::Interpolator;
using shapegcode::make_arc;
using shapegcode::make_line;
using shapegcode::Path;
using shapegcode::Samples;
using shapegcode::Segment;
using shapegcode::SpeedPhase;
using shapegcode::SpeedProfile;
using shapegcode::Vector3;

namespace {

using PathPointer = std::shared_ptr<const Path>;
using ProfilePointer = std::shared_ptr<const SpeedProfile>;

PathPointer straight(double length) {
  return std::make_shared<const Path>(std::vector<Segment>{make_line({1, 2, 3}, {1 + length, 2, 3}, 100.0)});
}

/// A line of 10 mm and a half circle of radius 5 mm.
PathPointer line_and_arc() {
  return std::make_shared<const Path>(
      std::vector<Segment>{make_line({0, 0, 0}, {10, 0, 0}, 100.0),
                           make_arc({10, 0, 0}, {10, 10, 0}, {10, 5, 0}, std::numbers::pi, 2, 100.0)});
}

/// Ramp up, steady, ramp down over `length`, by hand.
ProfilePointer trapezoid(double length, double speed, double ramp_s, double jerk_time_s = 0.0) {
  const double a = speed / ramp_s;
  const double way = 0.5 * speed * ramp_s;
  const double steady_s = (length - 2.0 * way) / speed;
  return std::make_shared<const SpeedProfile>(
      std::vector<SpeedPhase>{
          {0.0, ramp_s, 0.0, 0.0, a}, {0.0, steady_s, way, speed, 0.0}, {0.0, ramp_s, length - way, speed, -a}},
      length, jerk_time_s);
}

double trapezoid_distance(double t, double length, double speed, double ramp_s) {
  const double end = length / speed + ramp_s;
  if (t <= 0.0) return 0.0;
  if (t < ramp_s) return 0.5 * speed / ramp_s * t * t;
  if (t < end - ramp_s) return speed * (t - 0.5 * ramp_s);
  if (t < end) return length - 0.5 * speed / ramp_s * (end - t) * (end - t);
  return length;
}

}  // namespace

TEST_CASE("interpolator: set-points of a trapezoid by its closed form") {
  // 20 mm at 100 mm/s, ramps of 50 ms: 0.25 s, one set-point per millisecond and the start.
  const auto path = straight(20.0);
  const Samples samples = interpolate(path, trapezoid(20.0, 100.0, 0.05), 1e-3);
  CHECK(samples.period_s == 1e-3);
  REQUIRE(samples.positions_mm.rows() == 251);
  REQUIRE(samples.positions_mm.cols() == 3);
  double worst = 0.0;
  for (Eigen::Index i = 0; i <= 250; ++i) {
    const double expected = 1.0 + trapezoid_distance(1e-3 * static_cast<double>(i), 20.0, 100.0, 0.05);
    worst = std::max(worst, std::abs(samples.positions_mm(i, 0) - expected));
    CHECK(samples.positions_mm(i, 1) == 2.0);
    CHECK(samples.positions_mm(i, 2) == 3.0);
  }
  CHECK(worst < 1e-12);
  // Increments: 0.05 mm * (2i-1)/50 while ramping, 0.1 mm at speed.
  CHECK(samples.positions_mm(10, 0) - samples.positions_mm(9, 0) == doctest::Approx(0.5 * 2000.0 * 1e-6 * 19.0));
  CHECK(samples.positions_mm(100, 0) - samples.positions_mm(99, 0) == doctest::Approx(0.1));
}

TEST_CASE("interpolator: batch and stepwise agree to the last bit, whatever the period") {
  for (const double jerk_time : {0.0, 0.02}) {
    for (const double period : {1e-3, 0.7e-3, 8e-3, 0.11}) {
      const auto path = line_and_arc();
      const auto profile = trapezoid(path->length_mm(), 100.0, 0.05, jerk_time);
      const Samples batch = interpolate(path, profile, period);
      Interpolator stepwise(path, profile, period);
      CHECK(stepwise.sample_count() == static_cast<std::size_t>(batch.positions_mm.rows()));
      CHECK(stepwise.period_s() == period);
      Vector3 position;
      int differing = 0;
      for (Eigen::Index i = 0; i < batch.positions_mm.rows(); ++i) {
        REQUIRE(stepwise.step(position));
        if (position.transpose() != batch.positions_mm.row(i)) ++differing;
      }
      CHECK(differing == 0);
      CHECK_FALSE(stepwise.step(position));
      CHECK(position == Vector3(10.0, 10.0, 0.0));
      CHECK_FALSE(stepwise.step(position));
      CHECK(position == Vector3(10.0, 10.0, 0.0));
      CHECK(stepwise.segment() == 1);
      Interpolator leaping(path, profile, period);
      for (Eigen::Index i = 6; i < batch.positions_mm.rows(); i += 7) {
        REQUIRE(leaping.step(position, 7));
        if (position.transpose() != batch.positions_mm.row(i)) ++differing;
      }
      CHECK(differing == 0);
      CHECK_FALSE(leaping.step(position, 7));
      CHECK(position == Vector3(10.0, 10.0, 0.0));
    }
  }
}

TEST_CASE("interpolator: starts at the start, ends at the end to the last bit, every point on the path") {
  const auto path = line_and_arc();
  for (const double jerk_time : {0.0, 0.013}) {
    for (const double period : {1e-3, 1.7e-3}) {
      const auto profile = trapezoid(path->length_mm(), 77.0, 0.031, jerk_time);
      const Samples samples = interpolate(path, profile, period);
      CHECK(samples.positions_mm.row(0) == Vector3(0, 0, 0).transpose());
      CHECK(samples.positions_mm.row(samples.positions_mm.rows() - 1) == Vector3(10, 10, 0).transpose());
      const double duration = static_cast<double>(samples.positions_mm.rows() - 1) * period;
      // The smoothing is a whole number of periods long.
      CHECK(duration > profile->duration_s() - 2.0 * period);
      CHECK(duration < profile->duration_s() + 2.0 * period);
      double off = 0.0;
      double last_x_on_line = 0.0;
      for (Eigen::Index i = 0; i < samples.positions_mm.rows(); ++i) {
        const Vector3 p = samples.positions_mm.row(i);
        if (p.x() < 10.0 && p.y() == 0.0) {
          CHECK(p.x() >= last_x_on_line);
          last_x_on_line = p.x();
        } else {
          off = std::max(off, std::abs((p - Vector3(10, 5, 0)).norm() - 5.0));
        }
      }
      CHECK(off < 1e-12);
    }
  }
}

TEST_CASE("interpolator: a move that ends on a tick needs no tick more") {
  // 0.25 s in periods of 1 ms, 2.5 ms, 5 ms: rounding of the division must not add one.
  for (const double period : {1e-3, 2.5e-3, 5e-3, 1e-4}) {
    CHECK(Interpolator(straight(20.0), trapezoid(20.0, 100.0, 0.05), period).sample_count() ==
          static_cast<std::size_t>(std::lround(0.25 / period)) + 1);
  }
  // 0.25 s in periods of 4 ms end on the 63rd.
  CHECK(Interpolator(straight(20.0), trapezoid(20.0, 100.0, 0.05), 4e-3).sample_count() == 64);
}

TEST_CASE("interpolator: the jerk time is a moving average of the distance") {
  const auto profile = trapezoid(20.0, 100.0, 0.05, 0.02);
  const Samples samples = interpolate(straight(20.0), profile, 1e-3);
  REQUIRE(samples.positions_mm.rows() == 251 + 19);
  double worst = 0.0;
  for (int i = 0; i < 270; ++i) {
    double mean = 0.0;
    for (int k = 0; k < 20; ++k) mean += trapezoid_distance(1e-3 * (i - k), 20.0, 100.0, 0.05) / 20.0;
    worst = std::max(worst, std::abs(samples.positions_mm(i, 0) - 1.0 - mean));
  }
  CHECK(worst < 1e-11);
}

TEST_CASE("interpolator: distance and segment of the set-point last given") {
  const auto path = line_and_arc();
  const auto profile = trapezoid(path->length_mm(), 100.0, 0.05);
  Interpolator interpolator(path, profile, 1e-3);
  Vector3 position;
  for (int i = 0; interpolator.step(position); ++i) {
    const double expected = trapezoid_distance(1e-3 * i, path->length_mm(), 100.0, 0.05);
    CHECK(interpolator.distance_mm() == doctest::Approx(expected).epsilon(1e-12));
    CHECK(interpolator.segment() == (interpolator.distance_mm() >= 10.0 ? 1U : 0U));
  }
}

TEST_CASE("interpolator: refuses a period that is not positive; nothing to do is one set-point") {
  const auto profile = trapezoid(20.0, 100.0, 0.05);
  CHECK_THROWS_AS(Interpolator(straight(20.0), profile, 0.0), Error);
  CHECK_THROWS_AS(Interpolator(straight(20.0), profile, -1e-3), Error);
  CHECK_THROWS_AS(Interpolator(straight(20.0), profile, std::numeric_limits<double>::quiet_NaN()), Error);
  const auto still = std::make_shared<const Path>(std::vector<Segment>{make_line({1, 2, 3}, {1, 2, 3}, 1.0)});
  const Samples samples = interpolate(still, std::make_shared<const SpeedProfile>(), 1e-3);
  REQUIRE(samples.positions_mm.rows() == 1);
  CHECK(samples.positions_mm.row(0) == Vector3(1, 2, 3).transpose());
}

TEST_CASE("interpolator: refuses more set-points than can be counted") {
  // A feed of 1e-18 mm/s: 1e22 set-points fit into no whole number.
  const PathPointer path = straight(10.0);
  const auto slow = std::make_shared<const SpeedProfile>(std::vector<SpeedPhase>{{0.0, 1e19, 0.0, 1e-18, 0.0}},
                                                         path->length_mm(), 0.0);
  CHECK_THROWS_WITH_AS(Interpolator(path, slow, 1e-3), "a path takes 1e+22 set-points, at most 4000000000 are possible",
                       Error);
  const auto smooth =
      std::make_shared<const SpeedProfile>(std::vector<SpeedPhase>{{0.0, 1.0, 0.0, 10.0, 0.0}}, path->length_mm(), 1e9);
  CHECK_THROWS_WITH_AS(Interpolator(path, smooth, 1e-3),
                       "the jerk time takes 1e+12 periods, at most 10000000 are possible", Error);
}

TEST_CASE("interpolator: a delay is rest at the start, also of part of a period") {
  const double length = 30.0;
  const double speed = 100.0;
  const auto profile = trapezoid(length, speed, 0.05);
  for (const double delay : {0.0, 0.004, 0.0123, 0.2}) {
    Interpolator interpolator(straight(length), profile, 0.001, delay);
    CHECK(interpolator.sample_count() ==
          static_cast<std::size_t>(std::ceil((profile->duration_s() + delay) / 0.001 - 1e-9)) + 1);
    double worst = 0.0;
    Vector3 position;
    for (std::size_t k = 0; k < interpolator.sample_count(); ++k) {
      REQUIRE(interpolator.step(position));
      const double time = static_cast<double>(k) * 0.001 - delay;
      worst = std::max(worst, std::abs(position.x() - 1.0 - trapezoid_distance(time, length, speed, 0.05)));
    }
    CHECK(worst < 1e-12);
    CHECK(!interpolator.step(position));
    CHECK(position == Vector3(1.0 + length, 2.0, 3.0));
  }
}

TEST_CASE("interpolator: into memory of the caller's, the same set-points") {
  const PathPointer path = line_and_arc();
  const ProfilePointer profile = std::make_shared<const SpeedProfile>(plan_speed(*path, shapegcode::MotionLimits{}));
  Interpolator interpolator(path, profile, 0.004);
  Interpolator other(path, profile, 0.004);
  shapegcode::tests::check_same_into_memory(interpolator, other);
}
