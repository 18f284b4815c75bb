// Time-optimal trajectories: closed forms of single moves, limits and tolerance on random paths, what is refused.

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <limits>
#include <random>
#include <vector>

#include <doctest/doctest.h>

#include "random_motion.hpp"
#include "sanitized.hpp"
#include "shapegcode/error.hpp"
#include "shapegcode/planner.hpp"

using namespace shapegcode;
using namespace shapegcode::tests;

namespace {

constexpr double period_s = 0.001;
constexpr double infinity = std::numeric_limits<double>::infinity();

Vector3 row(const Samples& samples, Eigen::Index k) { return samples.positions_mm.row(k).transpose(); }

// Finite differences from rest to rest.
Differences differences_of(const Samples& samples) {
  Differences differences(axis_count, samples.period_s);
  for (Eigen::Index k = -3; k < samples.positions_mm.rows() + 3; ++k) {
    const Vector3 point = row(samples, std::clamp<Eigen::Index>(k, 0, samples.positions_mm.rows() - 1));
    differences.add(values_of(point));
  }
  return differences;
}

double off_path(const Vector3& point, const std::vector<Segment>& segments) {
  double least = infinity;
  for (const Segment& segment : segments) least = std::min(least, nearest_on(segment, point).distance_mm);
  return least;
}

// Seven phases of constant jerk over a line from rest to rest.
double shortest_s(double length, double speed, double acceleration, double jerk) {
  const double ramp = acceleration / jerk;
  if (speed * jerk >= acceleration * acceleration && speed * (speed / acceleration + ramp) <= length) {
    return length / speed + speed / acceleration + ramp;
  }
  if (length >= 2.0 * acceleration * ramp * ramp) {
    const double reached = 0.5 * acceleration * (std::sqrt(ramp * ramp + 4.0 * length / acceleration) - ramp);
    return 2.0 * (reached / acceleration + ramp);
  }
  return 4.0 * std::cbrt(length / (2.0 * jerk));
}

}  // namespace

TEST_CASE("a single move takes no more than two periods more than the shortest that its limits allow") {
  for (const double length : {1.0, 3.0, 10.0, 40.0, 100.0, 250.0}) {
    CAPTURE(length);
    TrajectoryLimits limits;
    limits.max_feed_mm_per_s.setConstant(100.0);
    const Path path({make_line({0, 0, 0}, {length, 0, 0}, 500.0)});
    const Samples samples = time_optimal_trajectory(path, limits, period_s);
    const double taken_s = static_cast<double>(samples.positions_mm.rows() - 1) * period_s;
    const double least_s = shortest_s(length, 100.0, 1000.0, 50'000.0);
    CHECK(taken_s >= least_s - period_s);
    CHECK(taken_s <= least_s + 2.0 * period_s + 1e-9);
    CHECK(row(samples, samples.positions_mm.rows() - 1) == Vector3(length, 0, 0));
  }
}

TEST_CASE("limits and tolerance are kept on random paths, and stops are stops") {
  for (unsigned seed = 0; seed < trials(80); ++seed) {
    CAPTURE(seed);
    std::mt19937 random(seed);
    std::uniform_real_distribution<double> uniform(0.0, 1.0);
    std::vector<Segment> segments =
        random_segments(random, 1 + seed % 20, 20.0 + 300.0 * uniform(random), seed % 2 == 0);
    if (segments.size() > 4) segments[2].stop_at_end = true;
    TrajectoryLimits limits;
    const double acceleration = std::pow(10.0, 2.5 + uniform(random));
    const double jerk = acceleration * std::pow(10.0, 1.0 + uniform(random));
    for (int axis = 0; axis < axis_count; ++axis) {
      limits.max_feed_mm_per_s[axis] = 60.0 + 200.0 * uniform(random);
      limits.max_acceleration_mm_per_s2[axis] = acceleration * (0.5 + 0.5 * uniform(random));
      limits.max_jerk_mm_per_s3[axis] = jerk * (0.5 + 0.5 * uniform(random));
    }
    limits.contour_tolerance_mm = std::pow(10.0, -2.5 + 1.5 * uniform(random));
    const Samples samples = time_optimal_trajectory(Path(segments), limits, period_s);
    for (int axis = 0; axis < axis_count; ++axis) {
      Samples one;
      one.period_s = period_s;
      one.positions_mm = Eigen::MatrixXd::Zero(samples.positions_mm.rows(), axis_count);
      one.positions_mm.col(axis) = samples.positions_mm.col(axis);
      const Differences differences = differences_of(one);
      CHECK(differences.speed() <= 1.001 * limits.max_feed_mm_per_s[axis]);
      CHECK(differences.acceleration() <= 1.001 * limits.max_acceleration_mm_per_s2[axis]);
      CHECK(differences.jerk() <= 1.001 * limits.max_jerk_mm_per_s3[axis] + 100.0);
    }
    double off = 0.0;
    double from_stop = infinity;
    for (Eigen::Index k = 0; k < samples.positions_mm.rows(); ++k) {
      off = std::max(off, off_path(row(samples, k), segments));
      if (segments.size() > 4) from_stop = std::min(from_stop, (row(samples, k) - segments[2].end_mm).norm());
    }
    CHECK(off <= 1.0001 * limits.contour_tolerance_mm + 1e-6);
    if (segments.size() > 4) CHECK(from_stop <= 1e-6);
    CHECK(row(samples, 0) == segments.front().start_mm);
    CHECK(row(samples, samples.positions_mm.rows() - 1) == segments.back().end_mm);
  }
}

TEST_CASE("without a tolerance the motion rests where the direction jumps") {
  TrajectoryLimits limits;
  limits.contour_tolerance_mm = 0.0;
  const Path path({make_line({0, 0, 0}, {10, 0, 0}, 100.0), make_line({10, 0, 0}, {10, 10, 0}, 100.0),
                   make_line({10, 10, 0}, {10, 30, 0}, 100.0)});
  const Samples samples = time_optimal_trajectory(path, limits, period_s);
  double off = 0.0;
  for (Eigen::Index k = 0; k < samples.positions_mm.rows(); ++k) {
    const Vector3 point = row(samples, k);
    off = std::max(off, std::min(std::abs(point[1]), std::abs(point[0] - 10.0)));
  }
  CHECK(off <= 1e-9);
  // Two moves by themselves: the second corner does not turn.
  const double least_s = shortest_s(10.0, 100.0, 1000.0, 50'000.0) + shortest_s(30.0, 100.0, 1000.0, 50'000.0);
  CHECK(static_cast<double>(samples.positions_mm.rows() - 1) * period_s == doctest::Approx(least_s).epsilon(0.01));
}

TEST_CASE("a reversal is turned round within the tolerance") {
  TrajectoryLimits limits;
  const Path path({make_line({0, 0, 0}, {10, 0, 0}, 100.0), make_line({10, 0, 0}, {0, 0, 0}, 100.0)});
  const Samples samples = time_optimal_trajectory(path, limits, period_s);
  const double farthest = samples.positions_mm.col(0).maxCoeff();
  CHECK(farthest <= 10.0);
  CHECK(farthest >= 10.0 - 1.01 * limits.contour_tolerance_mm);
  CHECK(differences_of(samples).jerk() <= 1.001 * 50'000.0);
}

TEST_CASE("what cannot be planned is refused") {
  const Path path({make_line({0, 0, 0}, {10, 0, 0}, 100.0)});
  const auto with = [&](auto change) {
    TrajectoryLimits limits;
    change(limits);
    return limits;
  };
  const TrajectoryLimits limits;
  CHECK_THROWS_AS(static_cast<void>(time_optimal_trajectory(path, limits, 0.0)), Error);
  for (const double wrong : {0.0, -1.0, infinity, std::nan("")}) {
    CHECK_THROWS_AS(static_cast<void>(time_optimal_trajectory(
                        path, with([&](auto& of) { of.max_jerk_mm_per_s3[1] = wrong; }), period_s)),
                    Error);
    CHECK_THROWS_AS(static_cast<void>(time_optimal_trajectory(
                        path, with([&](auto& of) { of.max_acceleration_mm_per_s2[0] = wrong; }), period_s)),
                    Error);
  }
  CHECK_THROWS_AS(static_cast<void>(
                      time_optimal_trajectory(path, with([](auto& of) { of.contour_tolerance_mm = -0.01; }), period_s)),
                  Error);
  const Path still({make_line({0, 0, 0}, {10, 0, 0}, 0.0, 7)});
  CHECK_THROWS_WITH_AS(static_cast<void>(time_optimal_trajectory(still, limits, period_s)), doctest::Contains("feed"),
                       Error);
  CHECK(time_optimal_trajectory(Path(), limits, period_s).positions_mm.rows() == 0);
}
