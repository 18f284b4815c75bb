#include <doctest/doctest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <memory>
#include <numbers>
#include <vector>

#include "command/feed_search.hpp"
#include "shapegcode/command.hpp"
#include "shapegcode/error.hpp"
#include "shapegcode/motion.hpp"
#include "shapegcode/shaper.hpp"

using shapegcode::ContourTarget;
using shapegcode::Error;
using shapegcode::Fir;
using shapegcode::make_arc;
using shapegcode::make_line;
using shapegcode::Mode;
using shapegcode::MotionLimits;
using shapegcode::nearest_on;
using shapegcode::Path;
using shapegcode::plan_speed;
using shapegcode::plan_within_tolerance;
using shapegcode::PlannedRun;
using shapegcode::RegionShaper;
using shapegcode::RunFilter;
using shapegcode::RunPlanner;
using shapegcode::Segment;
using shapegcode::shape_path;
using shapegcode::ShapedCommand;
using shapegcode::ShapingOptions;
using shapegcode::SpeedCaps;
using shapegcode::SpeedPhase;
using shapegcode::SpeedProfile;
using shapegcode::Vector3;

namespace {

using PathPointer = std::shared_ptr<const Path>;

constexpr double block_s = 0.005;
const std::vector<Mode> both{{46.0, 0.02, 1.0}, {131.0, 0.02, 1.0}};

Fir grid_shaper() { return to_fir(shapegcode::grid_polynomial(both, block_s), block_s); }

PathPointer path_of(std::vector<Segment> segments) { return std::make_shared<const Path>(std::move(segments)); }

/// A line, arcs of 2, 5, 15 mm that join tangentially, a corner of 90 and one of 30 degrees.
PathPointer mixed(double feed) {
  const double quarter = std::numbers::pi / 2;
  return path_of(
      {make_line({0, 0, 0}, {30, 0, 0}, feed), make_arc({30, 0, 0}, {32, 2, 0}, {30, 2, 0}, quarter, 2, feed),
       make_line({32, 2, 0}, {32, 20, 0}, feed), make_arc({32, 20, 0}, {37, 25, 0}, {37, 20, 0}, -quarter, 2, feed),
       make_line({37, 25, 0}, {60, 25, 0}, feed), make_line({60, 25, 0}, {60, 27, 0}, feed),  // 90 degrees
       make_arc({60, 27, 0}, {60, 57, 0}, {60, 42, 0}, 2 * quarter, 2, feed), make_line({60, 57, 0}, {30, 57, 0}, feed),
       make_line({30, 57, 0}, {30 - 30 * std::cos(quarter / 3), 57 - 15, 0}, feed)});
}

ShapingOptions options_for(ContourTarget target, double tolerance_mm) {
  ShapingOptions options;
  options.block_period_s = block_s;
  options.interpolation_period_s = 0.001;
  options.target = target;
  options.modes[0] = {both[0]};
  options.modes[1] = {both[1]};
  options.tolerance.contour_tolerance_mm = tolerance_mm;
  options.limits.max_acceleration_mm_per_s2 = Vector3::Constant(4000.0);
  return options;
}

/// Largest distance in mm of the shaped command, joined by straight lines every half period, from the path; and of the
/// path's corners from the command.
double largest_distance(const Path& path, const ShapedCommand& command) {
  std::vector<Vector3> rows;
  for (Eigen::Index k = 0; k < command.middle_mm.rows(); ++k) {
    rows.emplace_back(command.grid_mm.row(k).transpose());
    rows.emplace_back(command.middle_mm.row(k).transpose());
  }
  rows.emplace_back(command.grid_mm.row(command.grid_mm.rows() - 1).transpose());
  double largest = 0.0;
  for (const Vector3& row : rows) {
    double nearest = 1e300;
    for (const Segment& segment : path.segments()) nearest = std::min(nearest, nearest_on(segment, row).distance_mm);
    largest = std::max(largest, nearest);
  }
  for (const Segment& segment : path.segments()) {
    double nearest = 1e300;
    for (std::size_t k = 1; k < rows.size(); ++k)
      if ((rows[k] - rows[k - 1]).norm() > 1e-12)
        nearest = std::min(nearest, nearest_on(make_line(rows[k - 1], rows[k], 1.0), segment.start_mm).distance_mm);
    largest = std::max(largest, nearest);
  }
  return largest;
}

}  // namespace

TEST_CASE("speed caps: a plan keeps them, at junctions and on segments, and nothing else changes") {
  const PathPointer path = mixed(100.0);
  MotionLimits limits;
  limits.max_acceleration_mm_per_s2 = Vector3::Constant(3000.0);
  const float none = std::numeric_limits<float>::infinity();
  SpeedCaps caps{std::vector<float>(path->size(), none), std::vector<float>(path->size(), none)};
  const SpeedProfile plain = plan_speed(*path, limits);
  CHECK(plan_speed(*path, limits, {}, &caps).duration_s() == plain.duration_s());
  caps.on_segment[6] = 40.0F;
  caps.at_junction[2] = 25.0F;
  caps.at_junction[5] = 0.75F;
  for (const auto law : {shapegcode::AccelerationLaw::constant_time, shapegcode::AccelerationLaw::jerk_limited}) {
    limits.law = law;
    const SpeedProfile capped = plan_speed(*path, limits, {}, &caps);
    CHECK(capped.duration_s() > plan_speed(*path, limits).duration_s());
    double distance = 0.0;
    double fastest = 0.0;
    for (const SpeedPhase& phase : capped.phases()) {
      const double end =
          distance + phase.duration_s * (phase.speed_mm_per_s + 0.5 * phase.acceleration_mm_per_s2 * phase.duration_s);
      const double end_speed = phase.speed_mm_per_s + phase.acceleration_mm_per_s2 * phase.duration_s;
      fastest = std::max(fastest, phase.speed_mm_per_s);
      for (std::size_t i = 0; i < path->size(); ++i) {
        const double border = path->distance_mm(i);
        if (border >= distance - 1e-9 && border <= end + 1e-9) {
          const double square =
              phase.speed_mm_per_s * phase.speed_mm_per_s + 2.0 * phase.acceleration_mm_per_s2 * (border - distance);
          CHECK(std::sqrt(std::max(square, 0.0)) <= static_cast<double>(caps.at_junction[i]) * (1 + 1e-6) + 1e-6);
        }
      }
      const double middle = 0.5 * (distance + end);
      if (middle > path->distance_mm(6) && middle < path->distance_mm(7)) {
        CHECK(std::max(phase.speed_mm_per_s, end_speed) <= 40.0 * (1 + 1e-9));
      }
      distance = end;
    }
    CHECK(fastest == doctest::Approx(100.0));
  }
  caps.at_junction.pop_back();
  CHECK_THROWS_AS((void)plan_speed(*path, limits, {}, &caps), Error);
}

TEST_CASE("feed search: the tolerance is kept, and a tighter one takes longer") {
  const PathPointer path = mixed(150.0);
  for (const ContourTarget target : {ContourTarget::command, ContourTarget::response}) {
    Eigen::Index before = std::numeric_limits<Eigen::Index>::max();
    std::vector<Eigen::Index> periods;
    for (const double tolerance : {0.002, 0.005, 0.010, 0.020, 0.050, 0.2, 10.0}) {
      CAPTURE(tolerance);
      const ShapingOptions options = options_for(target, tolerance);
      RegionShaper shaper(path, grid_shaper(), {}, options);
      ShapedCommand command;
      REQUIRE(shaper.next(command, std::numeric_limits<std::uint32_t>::max()));
      CHECK(shaper.largest_deviation_mm() <= tolerance * (1 + 1e-6));
      if (target == ContourTarget::command) {
        // The straight line between two rows of the command misses a corner by a little more than the command does.
        CHECK(largest_distance(*path, command) <= tolerance * 1.02 + 2e-5);
      }
      CHECK(command.grid_mm.rows() <= before);
      before = command.grid_mm.rows();
      periods.push_back(before);
    }
    CHECK(periods.front() > periods.back() + 20);
    // Without a tolerance that binds it is the plain plan.
    ShapingOptions plain = options_for(ContourTarget::none, 10.0);
    CHECK(periods.back() == shape_path(path, grid_shaper(), {}, plain).grid_mm.rows());
  }
}

TEST_CASE("feed search: only what leaves the tolerance is slowed") {
  // Two quarter arcs far apart: the narrow one is slowed, the wide one is passed at full speed.
  const double feed = 100.0;
  const double quarter = std::numbers::pi / 2;
  const PathPointer path = path_of(
      {make_line({0, 0, 0}, {60, 0, 0}, feed), make_arc({60, 0, 0}, {62, 2, 0}, {60, 2, 0}, quarter, 2, feed),
       make_line({62, 2, 0}, {62, 60, 0}, feed), make_arc({62, 60, 0}, {2, 120, 0}, {2, 60, 0}, quarter, 2, feed),
       make_line({2, 120, 0}, {-60, 120, 0}, feed)});
  const ShapingOptions options = options_for(ContourTarget::command, 0.003);
  const std::vector<Fir> shaper{grid_shaper()};
  const RunFilter filter(shaper, options.target, options.modes, block_s, 1.0);
  const RunPlanner planner(options, 0.0);
  const PlannedRun plan = plan_within_tolerance(path, {}, filter, planner, 0.003);
  REQUIRE(plan.stops.empty());
  CHECK(plan.largest_deviation_mm <= 0.003);
  CHECK(plan.largest_deviation_mm > 0.003 * 0.8);  // the highest speed, not just some
  const auto rows = plan.motion->read(filter.half_period_s, 0.0);
  const std::size_t count = 2 * plan.motion->block_periods(filter.half_period_s) + 1;
  Vector3 before;
  rows->next(before);
  std::vector<double> fastest(path->size(), 0.0);
  for (std::size_t row = 1; row < count; ++row) {
    Vector3 here;
    rows->next(here);
    const double speed = (here - before).norm() / filter.half_period_s;
    fastest[rows->segment()] = std::max(fastest[rows->segment()], speed);
    before = here;
  }
  CHECK(fastest[1] < 60.0);
  CHECK(fastest[3] == doctest::Approx(feed).epsilon(1e-3));
}

TEST_CASE("feed search: a corner that no speed passes within the tolerance is a stop") {
  const PathPointer path = path_of({make_line({0, 0, 0}, {20, 0, 0}, 100.0), make_line({20, 0, 0}, {0, 0.5, 0}, 100.0),
                                    make_line({0, 0.5, 0}, {20, 1, 0}, 100.0)});
  RegionShaper loose(path, grid_shaper(), {}, options_for(ContourTarget::command, 5.0));
  ShapedCommand command;
  REQUIRE(loose.next(command, std::numeric_limits<std::uint32_t>::max()));
  CHECK(loose.stops() == 0);
  CHECK(command.run_ends.size() == 1);
  RegionShaper tight(path, grid_shaper(), {}, options_for(ContourTarget::command, 1e-5));
  REQUIRE(tight.next(command, std::numeric_limits<std::uint32_t>::max()));
  CHECK(tight.stops() == 2);
  REQUIRE(command.run_ends.size() == 3);
  for (std::size_t i = 0; i < 3; ++i)
    CHECK((command.grid_mm.row(command.run_ends[i]).transpose() - (*path)[i].end_mm).norm() < 1e-12);
  CHECK(largest_distance(*path, command) < 1.01e-5);
}

TEST_CASE("feed search: what is given out before it ends is the run that it ends with, or is void") {
  const PathPointer path = mixed(100.0);
  const auto all = std::numeric_limits<std::uint32_t>::max();
  ShapedCommand waited;
  RegionShaper patient(path, grid_shaper(), {}, options_for(ContourTarget::command, 5.0));
  REQUIRE(patient.next(waited, all));
  // A tolerance that the first plan keeps: the same rows, in pieces.
  RegionShaper early(path, grid_shaper(), {}, options_for(ContourTarget::command, 5.0));
  early.begin_early();
  Eigen::Index row = 0;
  for (ShapedCommand piece; early.next(piece, 100);) {
    CHECK(piece.grid_mm == waited.grid_mm.middleRows(row, piece.grid_mm.rows()));
    CHECK(piece.middle_mm == waited.middle_mm.middleRows(row, piece.middle_mm.rows()));
    row += piece.middle_mm.rows();
  }
  CHECK(row == waited.middle_mm.rows());
  CHECK_FALSE(early.is_withdrawn());
  CHECK(early.largest_deviation_mm() == patient.largest_deviation_mm());
  // And given out once more, whole.
  ShapedCommand again;
  REQUIRE(early.restart());
  REQUIRE(early.next(again, all));
  CHECK(again.grid_mm == waited.grid_mm);
  CHECK_FALSE(early.restart());

  // One that it does not: withdrawn, then the run that the search finds.
  RegionShaper careful(path, grid_shaper(), {}, options_for(ContourTarget::command, 0.01));
  REQUIRE(careful.next(waited, all));
  RegionShaper hasty(path, grid_shaper(), {}, options_for(ContourTarget::command, 0.01));
  hasty.begin_early();
  for (ShapedCommand piece; hasty.next(piece, 10);) {
  }
  CHECK(hasty.is_withdrawn());
  REQUIRE(hasty.restart());
  CHECK_FALSE(hasty.is_withdrawn());
  REQUIRE(hasty.next(again, all));
  CHECK(again.grid_mm == waited.grid_mm);
  CHECK(hasty.largest_deviation_mm() == careful.largest_deviation_mm());
  CHECK(hasty.stops() == careful.stops());
}
