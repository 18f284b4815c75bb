// The planned speed on straight lines, planned as a whole and while it runs, against closed forms: with feeds that are
// reached within a few periods, and where a slower or a faster segment follows.
#include <algorithm>
#include <cmath>
#include <cstddef>
#include <numbers>
#include <utility>
#include <vector>

#include <doctest/doctest.h>

#include "random_motion.hpp"
#include "row_of_lines.hpp"
#include "shapegcode/controller.hpp"
#include "shapegcode/planner.hpp"

using namespace shapegcode;
using namespace shapegcode::tests;

namespace {

constexpr double period_s = 0.001;

struct Dynamics {
  double acceleration, jerk;
};
constexpr Dynamics all_dynamics[] = {{1000.0, 5e4}, {2000.0, 2e5}, {5000.0, 1e5}, {5000.0, 5e5}};

std::vector<Vector3> planned_as_a_whole(const std::vector<Segment>& segments, const Dynamics& dynamics,
                                        double tolerance_mm = TrajectoryLimits{}.contour_tolerance_mm) {
  TrajectoryLimits limits;
  limits.contour_tolerance_mm = tolerance_mm;
  limits.max_feed_mm_per_s.setConstant(250.0);
  limits.max_acceleration_mm_per_s2.setConstant(dynamics.acceleration);
  limits.max_jerk_mm_per_s3.setConstant(dynamics.jerk);
  const Samples samples = time_optimal_trajectory(Path(segments), limits, period_s);
  std::vector<Vector3> points;
  for (Eigen::Index k = 0; k < samples.positions_mm.rows(); ++k) points.emplace_back(samples.positions_mm.row(k));
  return points;
}

std::vector<Vector3> planned_online(const std::vector<Segment>& segments, const Dynamics& dynamics) {
  ControllerSettings settings;
  settings.period_s = period_s;
  settings.limits.law = AccelerationLaw::jerk_limited;
  settings.limits.max_feed_mm_per_s.setConstant(250.0);
  settings.limits.max_acceleration_mm_per_s2.setConstant(dynamics.acceleration);
  settings.limits.max_jerk_mm_per_s3.setConstant(dynamics.jerk);
  settings.plans_in_step = true;
  MotionController control(settings);
  for (const Segment& segment : segments) REQUIRE(control.push(segment) == PushResult::accepted);
  std::vector<Vector3> points{Vector3::Zero()};
  Vector3 point = Vector3::Zero();
  while (control.step(values_of(point)) != Activity::idle && points.size() < 100'000) points.push_back(point);
  return points;
}

// The speed from set-point to set-point, and between which places of the path.
void for_speeds(const std::vector<Vector3>& points, double from, double to, const auto& check) {
  double travel = 0.0;
  for (std::size_t k = 1; k < points.size(); ++k) {
    const double step = (points[k] - points[k - 1]).norm();
    if (travel >= from && travel + step <= to) check(step / period_s);
    travel += step;
  }
}

// The distance within which a speed changes by a jerk and an acceleration.
double change_mm(double from, double to, const Dynamics& dynamics) {
  const double rise_s = dynamics.acceleration / dynamics.jerk;
  const double change = std::abs(to - from);
  const double time_s = change > dynamics.acceleration * rise_s ? change / dynamics.acceleration + rise_s
                                                                : 2.0 * std::sqrt(change / dynamics.jerk);
  return 0.5 * (from + to) * time_s;
}

}  // namespace

TEST_CASE("a line is run at its feed, without ripple, between a start and an end of a few periods") {
  for (const Dynamics& dynamics : all_dynamics) {
    for (const double feed : {1.0, 2.0, 2.5, 5.0, 10.0, 40.0}) {
      CAPTURE(dynamics.jerk);
      CAPTURE(feed);
      const std::vector<Segment> segments = row_of_lines({9.0}, {feed});
      const double ends_mm = change_mm(0.0, feed, dynamics) + 12.0 * feed * period_s;
      for (const std::vector<Vector3>& points :
           {planned_as_a_whole(segments, dynamics), planned_online(segments, dynamics)}) {
        CHECK(points.back()[0] == doctest::Approx(9.0));
        for_speeds(points, ends_mm, 9.0 - ends_mm, [&](double speed) {
          CHECK(speed <= feed * (1.0 + 1e-4));
          CHECK(speed >= feed * 0.998);
        });
      }
    }
  }
}

TEST_CASE("a slower feed is reached where it begins, and not passed below") {
  for (const Dynamics& dynamics : all_dynamics) {
    for (const auto& [before, after] : {std::pair{50.0, 10.0}, std::pair{100.0, 40.0}, std::pair{20.0, 5.0}}) {
      CAPTURE(dynamics.jerk);
      CAPTURE(before);
      const std::vector<Segment> segments = row_of_lines({30.0, 20.0}, {before, after});
      const double start_mm = change_mm(0.0, before, dynamics);
      const double end_mm = change_mm(0.0, after, dynamics);
      // As fast as if the feed of the second were reached at its very beginning, but for some periods.
      const double shortest_s = (30.0 + start_mm - change_mm(before, after, dynamics)) / before +
                                change_mm(before, after, dynamics) / (0.5 * (before + after)) + (20.0 + end_mm) / after;
      for (const std::vector<Vector3>& points :
           {planned_as_a_whole(segments, dynamics), planned_online(segments, dynamics)}) {
        CHECK(static_cast<double>(points.size()) * period_s <= shortest_s + 0.015);
        for_speeds(points, start_mm, 50.0 - end_mm - 12.0 * after * period_s,
                   [&](double speed) { CHECK(speed >= 0.9 * after); });
        for_speeds(points, 30.0, 50.0, [&](double speed) { CHECK(speed <= after * (1.0 + 1e-4)); });
      }
    }
  }
}

TEST_CASE("a circle is run at its feed") {
  constexpr double radius_mm = 5.0;
  const double length_mm = 2.0 * std::numbers::pi * radius_mm;
  for (const Dynamics& dynamics : all_dynamics) {
    for (const double feed : {2.5, 10.0, 50.0}) {
      CAPTURE(dynamics.jerk);
      CAPTURE(feed);
      std::vector<Segment> segments{
          make_arc(Vector3::Zero(), Vector3::Zero(), {radius_mm, 0.0, 0.0}, 2.0 * std::numbers::pi, 2, feed)};
      segments.back().stop_at_end = true;
      const double ends_mm = 2.0 * change_mm(0.0, feed, dynamics) + 12.0 * feed * period_s;
      for (const std::vector<Vector3>& points :
           {planned_as_a_whole(segments, dynamics), planned_online(segments, dynamics)}) {
        for_speeds(points, ends_mm, length_mm - ends_mm, [&](double speed) {
          CHECK(speed <= feed * (1.0 + 1e-4));
          CHECK(speed >= feed * 0.995);
        });
      }
    }
  }
}

TEST_CASE("where the feed falls in steps the motion never gets faster, whatever the length of the steps") {
  constexpr int steps = 40;
  for (const Dynamics& dynamics : all_dynamics) {
    for (const double step_mm : {0.05, 0.1, 0.3, 1.0}) {
      CAPTURE(dynamics.jerk);
      CAPTURE(step_mm);
      std::vector<double> lengths_mm{20.0};
      std::vector<double> feeds{50.0};
      for (int k = 0; k < steps; ++k) {
        lengths_mm.push_back(step_mm);
        feeds.push_back(49.0 - k);
      }
      lengths_mm.push_back(10.0);
      feeds.push_back(9.0);
      const std::vector<Segment> segments = row_of_lines(lengths_mm, feeds);
      for (const std::vector<Vector3>& points :
           {planned_as_a_whole(segments, dynamics), planned_online(segments, dynamics)}) {
        double before = 50.0;
        for_speeds(points, change_mm(0.0, 50.0, dynamics) + 1.0, 20.0 + steps * step_mm + 5.0, [&](double speed) {
          CHECK(speed <= 1.015 * before);
          CHECK(speed >= 8.9);
          before = std::min(before, speed);
        });
        CHECK(before == doctest::Approx(9.0).epsilon(0.01));
      }
    }
  }
}

TEST_CASE("a feed begins, however slow it is") {
  for (const Dynamics& dynamics : {Dynamics{1000.0, 5e5}, Dynamics{5000.0, 5e5}, Dynamics{1000.0, 1e9}}) {
    for (const double feed : {0.1, 0.05, 0.02}) {
      for (const double length : {0.001, 0.05}) {
        CAPTURE(dynamics.jerk);
        CAPTURE(feed);
        CAPTURE(length);
        const std::vector<Vector3> points = planned_as_a_whole(row_of_lines({length}, {feed}), dynamics);
        REQUIRE(points.back()[0] == length);
        // To reach it and to stop takes some periods.
        CHECK(static_cast<double>(points.size()) * period_s <= length / feed + 0.06);
        for_speeds(points, 0.0, length, [&](double speed) { REQUIRE(speed <= 1.001 * feed); });
      }
    }
  }
}

TEST_CASE("set-points keep the feed where an arc is rounded into its lines") {
  const double feed = 5.0;
  const double sweep = 0.9 * std::numbers::pi;
  for (const double radius : {0.05, 0.1, 1.0}) {
    for (const double tolerance : {0.01, 0.05, 0.2}) {
      CAPTURE(radius);
      CAPTURE(tolerance);
      const Vector3 begin(5.0, 0.0, 0.0);
      const Vector3 centre = begin + Vector3(0.0, radius, 0.0);
      const Vector3 end = centre + radius * Vector3(std::sin(sweep), -std::cos(sweep), 0.0);
      const std::vector<Segment> segments{
          make_line(Vector3::Zero(), begin, feed), make_arc(begin, end, centre, sweep, 2, feed),
          make_line(end, end + 5.0 * Vector3(std::cos(sweep), std::sin(sweep), 0.0), feed)};
      const std::vector<Vector3> points = planned_as_a_whole(segments, {5000.0, 1e6}, tolerance);
      REQUIRE(points.back() == segments.back().end_mm);
      for_speeds(points, 0.0, 20.0, [&](double speed) { REQUIRE(speed <= 1.001 * feed); });
    }
  }
}
