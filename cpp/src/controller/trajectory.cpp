#include "shapegcode/planner.hpp"

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <utility>
#include <vector>

#include "base/checks.hpp"
#include "controller/online_planner.hpp"
#include "planner/junction.hpp"
#include "planner/segments.hpp"
#include "shapegcode/controller.hpp"
#include "shapegcode/error.hpp"

namespace shapegcode {
namespace {

// The segments in a ring, and of each its number on the path.
SegmentRing ring_of(const Path& path, double tolerance_mm, std::vector<std::uint32_t>& numbers) {
  SegmentRing ring(std::bit_ceil(path.size() + 1));
  PathTolerance tolerance;
  tolerance.contour_mm = tolerance_mm;
  bool stop = false;
  std::uint32_t number = 0;
  for (const Segment& segment : path.segments()) {
    const std::uint32_t here = number++;
    if (!(segment.feed_mm_per_s > 0.0) || !std::isfinite(segment.feed_mm_per_s)) {
      throw Error(ErrorKind::argument, "segment without a feed greater than zero", segment.line);
    }
    if (!(segment.length_mm > 0.0)) {
      stop = stop || segment.stop_at_end;
      continue;
    }
    PlannedSegment& planned = ring[numbers.size()];
    planned.segment = segment;
    planned.programmed = segment.feed_mm_per_s;
    const std::size_t count = numbers.size();
    planned.stop = count > 0 && stop;
    stop = segment.stop_at_end;
    if (count > 0) look_at_junction(ring[count - 1], tolerance, planned);
    numbers.push_back(here);
  }
  if (!numbers.empty()) ring[numbers.size() - 1].segment.stop_at_end = true;
  return ring;
}

PlanningRules rules_for(const TrajectoryLimits& limits, double period_s, std::size_t count) {
  PlanningRules rules;
  rules.period_s = period_s;
  for (std::size_t i = 0; i < axis_count; ++i) {
    const auto axis = static_cast<Eigen::Index>(i);
    rules.limits.speed[i] = limits.max_feed_mm_per_s[axis];
    rules.limits.acceleration[i] = limits.max_acceleration_mm_per_s2[axis];
    rules.limits.jerk[i] = limits.max_jerk_mm_per_s3[axis];
  }
  rules.window = count + 1;  // never full
  rules.is_open = true;
  return rules;
}

void check(const TrajectoryLimits& limits, double period_s) {
  require_period(period_s);
  require_not_below_zero(limits.contour_tolerance_mm, "contour tolerance", "mm");
  for (int i = 0; i < axis_count; ++i) {
    require_above_zero(limits.max_feed_mm_per_s[i], "axis feed limit", "mm/s");
    require_above_zero(limits.max_acceleration_mm_per_s2[i], "axis acceleration limit", "mm/s2");
    require_above_zero(limits.max_jerk_mm_per_s3[i], "axis jerk limit", "mm/s3");
  }
}

}  // namespace

TimeOptimalMotion time_optimal_motion(const Path& path, const TrajectoryLimits& limits, double period_s) {
  check(limits, period_s);
  std::vector<std::uint32_t> numbers;
  SegmentRing segments = ring_of(path, limits.contour_tolerance_mm, numbers);
  const std::size_t count = numbers.size();
  TimeOptimalMotion motion;
  Samples& samples = motion.set_points;
  samples.period_s = period_s;
  if (count == 0) {
    samples.positions_mm.resize(0, axis_count);
    return motion;
  }
  OnlinePlanner planner(segments, rules_for(limits, period_s, count));
  AxisValues start{};
  std::copy_n(segments[0].segment.start_mm.data(), axis_count, start.begin());
  planner.restart(0, start);
  const SoftLimits anywhere{ControllerSettings{}};
  Sections& sections = planner.sections();
  std::vector<Vector3> points{segments[0].segment.start_mm};
  motion.segments.push_back(numbers[0]);
  while (!sections.at_rest() || sections.current().done < count) {
    if (sections.wants_more() && !planner.plan(count, {}, true, 0) && sections.at_rest()) {
      throw Error(ErrorKind::numeric, "no motion within the limits was found",
                  segments[sections.current().done].segment.line);
    }
    const PlannedPoint& point = sections.step(false, anywhere);
    points.emplace_back(point.position[0], point.position[1], point.position[2]);
    motion.segments.push_back(numbers[point.point.segment]);
    static_cast<void>(require_count(static_cast<double>(points.size()), max_set_points, "a path", "set-points"));
  }
  samples.positions_mm.resize(std::ssize(points), axis_count);
  for (std::size_t k = 0; k < points.size(); ++k) {
    samples.positions_mm.row(static_cast<Eigen::Index>(k)) = points[k];
  }
  return motion;
}

Samples time_optimal_trajectory(const Path& path, const TrajectoryLimits& limits, double period_s) {
  return std::move(time_optimal_motion(path, limits, period_s).set_points);
}

}  // namespace shapegcode
