// Commands that the time-optimal planner plans for the shaper: sections with one feed, set-points with their segments,
// the tolerance shared with the shaper, stops, limits.
#include <doctest/doctest.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>
#include <memory>
#include <numbers>
#include <vector>

#include "command/run_motion.hpp"
#include "motion/feed_sections.hpp"
#include "shapegcode/command.hpp"
#include "shapegcode/error.hpp"
#include "shapegcode/motion.hpp"
#include "shapegcode/planner.hpp"
#include "shapegcode/shaper.hpp"

using shapegcode::CommandPlanner;
using shapegcode::ContourTarget;
using shapegcode::Error;
using shapegcode::feed_sections;
using shapegcode::FeedSections;
using shapegcode::Fir;
using shapegcode::make_arc;
using shapegcode::make_line;
using shapegcode::Mode;
using shapegcode::MotionLimits;
using shapegcode::nearest_on;
using shapegcode::Path;
using shapegcode::point_at;
using shapegcode::RunMotion;
using shapegcode::RunPlanner;
using shapegcode::section_of;
using shapegcode::Segment;
using shapegcode::shape_path;
using shapegcode::ShapedCommand;
using shapegcode::ShapingOptions;
using shapegcode::SpeedCaps;
using shapegcode::tangent_at;
using shapegcode::time_optimal_motion;
using shapegcode::time_optimal_trajectory;
using shapegcode::TimeOptimalMotion;
using shapegcode::TrajectoryLimits;
using shapegcode::Vector3;

namespace {

using PathPointer = std::shared_ptr<const Path>;

constexpr double block_s = 0.005;
constexpr double half_s = 0.5 * block_s;
const std::vector<Mode> both{{46.0, 0.02, 1.0}, {131.0, 0.02, 1.0}};

PathPointer path_of(std::vector<Segment> segments) { return std::make_shared<const Path>(std::move(segments)); }

/// A line, a tangent arc, a line, a corner, two feeds, and an exact stop in the middle if wanted.
PathPointer mixed(bool stops) {
  const double quarter = std::numbers::pi / 2;
  std::vector<Segment> segments{make_line({0, 0, 0}, {30, 0, 0}, 100.0),
                                make_arc({30, 0, 0}, {38, 8, 0}, {30, 8, 0}, quarter, 2, 100.0),
                                make_line({38, 8, 0}, {38, 40, 0}, 100.0), make_line({38, 40, 0}, {10, 40, 0}, 40.0),
                                make_line({10, 40, 0}, {0, 30, 0}, 100.0)};
  segments[2].stop_at_end = stops;
  return path_of(std::move(segments));
}

MotionLimits machine_limits() {
  MotionLimits limits;
  limits.max_feed_mm_per_s.setConstant(250.0);
  limits.max_acceleration_mm_per_s2.setConstant(3000.0);
  limits.max_jerk_mm_per_s3.setConstant(100'000.0);
  limits.centripetal_acceleration_mm_per_s2 = 2500.0;
  limits.corner_speed_difference_mm_per_s.setConstant(8.0);
  return limits;
}

ShapingOptions options_for(ContourTarget target, double tolerance_mm) {
  ShapingOptions options;
  options.limits = machine_limits();
  options.planner = CommandPlanner::time_optimal;
  options.target = target;
  options.tolerance.contour_tolerance_mm = tolerance_mm;
  options.block_period_s = block_s;
  if (target == ContourTarget::response) options.modes = {{{both[0]}, {both[1]}, {}}};
  return options;
}

Fir grid_shaper() { return to_fir(shapegcode::grid_polynomial(both, block_s), block_s); }

double distance_to(const Path& path, const Vector3& point) {
  double nearest = std::numeric_limits<double>::infinity();
  for (const Segment& segment : path.segments()) nearest = std::min(nearest, nearest_on(segment, point).distance_mm);
  return nearest;
}

}  // namespace

TEST_CASE("run motion: sections are the path, cut where its feed changes") {
  const PathPointer path = mixed(false);
  SpeedCaps caps{std::vector<float>(path->size(), std::numeric_limits<float>::infinity()),
                 std::vector<float>(path->size(), std::numeric_limits<float>::infinity())};
  caps.at_junction[4] = 5.0F;
  MotionLimits limits = machine_limits();
  limits.corner_speed_difference_mm_per_s.setConstant(MotionLimits::none);
  limits.feed_spread_s = 0.02;
  const FeedSections sections = feed_sections(*path, limits, {}, &caps, 0.04);
  REQUIRE(sections.segments.size() == sections.path.size());
  CHECK(sections.path.length_mm() == doctest::Approx(path->length_mm()).epsilon(1e-12));
  for (std::size_t i = 0; i < sections.path.size(); ++i) {
    const Segment section = sections.path[i];
    const Segment whole = (*path)[sections.segments[i]];
    const double begin = sections.path.distance_mm(i) - path->distance_mm(sections.segments[i]);
    for (const double share : {0.0, 0.3, 1.0}) {
      const double s = share * section.length_mm;
      CHECK((point_at(section, s) - point_at(whole, begin + s)).norm() < 1e-9);
      CHECK((tangent_at(section, s) - tangent_at(whole, begin + s)).norm() < 1e-9);
    }
    CHECK(section.feed_mm_per_s <= whole.feed_mm_per_s);
  }
  // 40 mm/s are reached .02 s before the slower segment; 5 mm/s hold .02 s to both sides of the capped corner.
  std::size_t cursor = 0;
  const auto feed_at = [&](double s) {
    cursor = 0;
    static_cast<void>(sections.path.point(s, cursor));
    return sections.path.feed_mm_per_s(cursor);
  };
  const double slow = path->distance_mm(3);
  CHECK(feed_at(slow - 0.79) == doctest::Approx(40.0));
  CHECK(feed_at(slow - 0.81) == doctest::Approx(100.0));
  const double corner = path->distance_mm(4);
  CHECK(feed_at(corner - 0.09) == doctest::Approx(5.0));
  CHECK(feed_at(corner + 0.09) == doctest::Approx(5.0));
  CHECK(feed_at(corner - 0.11) == doctest::Approx(40.0));
}

TEST_CASE("run motion: a section of a helix runs on it") {
  const Segment helix = make_arc({10, 0, 0}, {-12, 0, 4}, {0, 0, 0}, std::numbers::pi, 2, 50.0);
  const double length = helix.length_mm;
  const Segment section = section_of(helix, 0.25 * length, 0.7 * length);
  for (const double share : {0.0, 0.5, 1.0}) {
    const double s = share * section.length_mm;
    CHECK((point_at(section, s) - point_at(helix, 0.25 * length + s)).norm() < 1e-9);
  }
}

TEST_CASE("run motion: each planned set-point has its segment") {
  std::vector<Segment> segments{make_line({0, 0, 0}, {0, 0, 0}, 50.0), make_line({0, 0, 0}, {10, 0, 0}, 50.0),
                                make_line({10, 0, 0}, {10, 0, 0}, 50.0), make_line({10, 0, 0}, {10, 10, 0}, 50.0)};
  const Path path(segments);
  const TrajectoryLimits limits;
  const TimeOptimalMotion motion = time_optimal_motion(path, limits, 0.001);
  CHECK(motion.set_points.positions_mm == time_optimal_trajectory(path, limits, 0.001).positions_mm);
  REQUIRE(std::ssize(motion.segments) == motion.set_points.positions_mm.rows());
  CHECK(std::ranges::is_sorted(motion.segments));
  CHECK(motion.segments.front() == 1);
  CHECK(motion.segments.back() == 3);
  for (std::size_t k = 0; k < motion.segments.size(); ++k) {
    const Vector3 at = motion.set_points.positions_mm.row(static_cast<Eigen::Index>(k));
    CHECK(nearest_on(segments[motion.segments[k]], at).distance_mm <= limits.contour_tolerance_mm + 1e-9);
  }
}

TEST_CASE("run motion: the command before shaping keeps the limits of every axis and the programmed feeds") {
  const PathPointer path = mixed(false);
  const ShapingOptions options = options_for(ContourTarget::command, 0.02);
  const RunPlanner planner(options, 0.01);
  const std::shared_ptr<const RunMotion> motion = planner.plan(path);
  CHECK(motion->rounding_mm() > 0.0);
  CHECK(motion->rounding_mm() < 0.02);
  const auto rows = motion->read(half_s, 0.0);
  const auto later = motion->read(half_s, 3.5 * half_s);
  std::vector<Vector3> points(2 * motion->block_periods(half_s) + 1);
  std::vector<std::size_t> on;
  for (Vector3& point : points) {
    rows->next(point);
    on.push_back(rows->segment());
    CHECK(distance_to(*path, point) <= motion->rounding_mm() + 1e-9);
  }
  CHECK(points.front() == Vector3(path->segments().front().start_mm));
  CHECK(points.back() == Vector3(path->segments().back().end_mm));
  CHECK(std::ranges::is_sorted(on));
  const auto at = [&](std::ptrdiff_t k) {
    return points[static_cast<std::size_t>(std::clamp<std::ptrdiff_t>(k, 0, std::ssize(points) - 1))];
  };
  for (std::ptrdiff_t k = 0; k < std::ssize(points) + 3; ++k) {
    const Vector3 speed = (at(k) - at(k - 1)) / half_s;
    const Vector3 acceleration = (at(k) - 2 * at(k - 1) + at(k - 2)) / (half_s * half_s);
    const Vector3 jerk = (at(k) - 3 * at(k - 1) + 3 * at(k - 2) - at(k - 3)) / (half_s * half_s * half_s);
    CHECK(acceleration.cwiseAbs().maxCoeff() <= 3000.0 * 1.002);
    CHECK(jerk.cwiseAbs().maxCoeff() <= 100'000.0 * 1.002);
    if (k > 0 && k < std::ssize(points)) {
      CHECK(speed.norm() <= (*path)[on[static_cast<std::size_t>(k - 1)]].feed_mm_per_s * 1.002);
    }
  }
  // Read later by 3.5 rows it is the same motion: the mean of two rows, but for what it bends between them.
  for (std::ptrdiff_t k = 0; k < std::ssize(points); ++k) {
    Vector3 point;
    later->next(point);
    const Vector3 mean = 0.5 * (at(k - 3) + at(k - 4));
    const double bends = 0.125 * (at(k - 3) - at(k - 4) - (at(k - 4) - at(k - 5))).norm() + 0.001;
    CHECK((point - mean).norm() <= bends);
  }
}

TEST_CASE("run motion: rounding and shaper share one tolerance, and an exact stop is one") {
  const PathPointer path = mixed(true);
  for (const ContourTarget target : {ContourTarget::none, ContourTarget::command, ContourTarget::response}) {
    for (const double tolerance : {0.005, 0.02}) {
      ShapingOptions options = options_for(target, tolerance);
      if (target == ContourTarget::none) {
        const Fir shaper = grid_shaper();
        double mean = 0.0;
        for (std::size_t k = 0; k < shaper.taps().size(); ++k) mean += shaper.taps()[k] * shaper.delays()[k] * block_s;
        for (std::size_t k = 0; k < shaper.taps().size(); ++k) {
          const double from_mean = shaper.delays()[k] * block_s - mean;
          options.tolerance.variance_s2 += shaper.taps()[k] * from_mean * from_mean;
          options.tolerance.mean_deviation_s += shaper.taps()[k] * std::abs(from_mean);
        }
        options.tolerance.corner_share = 0.75;
      }
      const std::vector<std::uint32_t> marks{3};
      const ShapedCommand command = shape_path(path, grid_shaper(), marks, options);
      REQUIRE(command.run_ends.size() == 2);
      const Vector3 stop = command.grid_mm.row(command.run_ends[0]);
      CHECK((stop - Vector3(38, 40, 0)).norm() < 1e-9);
      CHECK(command.segment_periods[0] == command.run_ends[0]);
      CHECK((Vector3(command.grid_mm.bottomRows(1).transpose()) - Vector3(0, 30, 0)).norm() < 1e-9);
      if (target == ContourTarget::response) continue;  // what then is near the path is the table
      double worst = 0.0;
      for (Eigen::Index k = 0; k < command.grid_mm.rows(); ++k) {
        worst = std::max(worst, distance_to(*path, command.grid_mm.row(k)));
        if (k < command.middle_mm.rows()) worst = std::max(worst, distance_to(*path, command.middle_mm.row(k)));
      }
      CHECK(worst <= tolerance);
      CHECK(worst > 0.2 * tolerance);  // it is used
    }
  }
}

TEST_CASE("run motion: the time-optimal planner asks for every limit of the axes") {
  ShapingOptions options = options_for(ContourTarget::command, 0.02);
  CHECK_NOTHROW(RunPlanner(options, 0.01));
  options.limits.max_jerk_mm_per_s3[1] = MotionLimits::none;
  CHECK_THROWS_WITH_AS(RunPlanner(options, 0.01), doctest::Contains("jerk of every axis: Y has"), Error);
}
