#include "shapegcode/planner.hpp"

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <utility>
#include <vector>

#include "base/checks.hpp"
#include "planner/junction.hpp"
#include "planner/path_motion.hpp"
#include "planner/path_plan.hpp"
#include "planner/planned_limits.hpp"
#include "planner/segments.hpp"
#include "shapegcode/error.hpp"

namespace shapegcode {
namespace {

constexpr int most_plans = 24;
// A motion with less progress than this in so many periods does not end.
constexpr std::size_t progress_periods = 4096;
constexpr double progress_mm = 1e-6;

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

// Set-points, and the segment of each; `ends`: at the end of the path.
struct Run {
  std::vector<Vector3> points;
  std::vector<std::size_t> segments;
  std::size_t count = 0;  // of the segments of the path
  bool ends = true;
};

Run follow(const PathPlan& plan, const SegmentRing& segments, std::size_t count, double period_s) {
  PathMotion motion(plan, period_s);
  Run run{{segments[0].segment.start_mm}, {0}, count};
  Vector3 seen = run.points.back();
  while (!motion.at_end()) {
    motion.advance();
    const AxisValues position = motion.position();
    run.points.emplace_back(position[0], position[1], position[2]);
    run.segments.push_back(motion.point().segment);
    static_cast<void>(require_count(static_cast<double>(run.points.size()), max_set_points, "a path", "set-points"));
    if (run.points.size() % progress_periods != 0) continue;
    if ((run.points.back() - seen).norm() < progress_mm) {
      run.ends = false;
      return run;
    }
    seen = run.points.back();
  }
  run.points.back() = segments[count - 1].segment.end_mm;
  return run;
}

double largest(const Vector3& value, const Vector3& limit) noexcept {
  return value.cwiseAbs().cwiseQuotient(limit).maxCoeff();
}

// Largest differences of the set-points over the limits. Where acceleration or jerk are beyond them, less is planned on
// the segments around.
double worst_of(const Run& run, const TrajectoryLimits& limits, double period_s, SegmentRing& segments,
                double& feed_share) {
  const std::ptrdiff_t last = std::ssize(run.points) - 1;
  const auto index = [last](std::ptrdiff_t k) {
    return static_cast<std::size_t>(std::clamp<std::ptrdiff_t>(k, 0, last));
  };
  const auto at = [&](std::ptrdiff_t k) -> const Vector3& { return run.points[index(k)]; };
  const std::size_t count = run.count;
  std::vector<double> share(count, 1.0);
  std::vector<double> slower = share;
  double fastest = 0.0;
  double worst = 0.0;
  for (std::ptrdiff_t k = 1; k <= last + 3; ++k) {
    const Vector3 speed = (at(k) - at(k - 1)) / period_s;
    const Vector3 acceleration = (at(k) - 2.0 * at(k - 1) + at(k - 2)) / (period_s * period_s);
    const Vector3 jerk = (at(k) - 3.0 * at(k - 1) + 3.0 * at(k - 2) - at(k - 3)) / (period_s * period_s * period_s);
    // A coordinate is rounded: what its last bits do to a difference is no motion.
    const double rounded = 8.0 * at(k).cwiseAbs().maxCoeff() * std::numeric_limits<double>::epsilon();
    const Vector3 noise = Vector3::Constant(rounded / (period_s * period_s * period_s));
    fastest = std::max(fastest, largest(speed, limits.max_feed_mm_per_s));
    const double beyond = std::max(largest(acceleration, limits.max_acceleration_mm_per_s2),
                                   largest((jerk.cwiseAbs() - noise).cwiseMax(0.0), limits.max_jerk_mm_per_s3));
    const std::size_t now = run.segments[index(k)];
    const double feed = std::max(segments[run.segments[index(k - 1)]].programmed, segments[now].programmed);
    const double faster = speed.norm() / feed;
    worst = std::max(worst, beyond);
    if (faster > kept_feed) {
      worst = std::max(worst, faster);
      for (const std::ptrdiff_t i : {k - 1, k}) {
        double& less = slower[run.segments[index(i)]];
        less = std::min(less, 1.0 / faster);
      }
    }
    if (beyond <= kept) continue;
    const std::size_t first = run.segments[index(k - 4)];
    const std::size_t end = std::min(count, run.segments[index(k + 1)] + 2);
    for (std::size_t i = first - std::min<std::size_t>(first, 1); i < end; ++i) {
      share[i] = std::min(share[i], std::max(most_less, 1.0 / beyond));
    }
  }
  if (!run.ends) {
    worst = std::numeric_limits<double>::infinity();
    const std::size_t where = run.segments.back();
    for (std::size_t i = where - std::min<std::size_t>(where, 1); i < std::min(count, where + 3); ++i) {
      share[i] = most_less;
    }
  }
  for (std::size_t i = 0; i < count; ++i) {
    segments[i].limit_share *= share[i];
    segments[i].feed_share *= slower[i];
    // What is still beyond them when little is planned is run from rest to rest.
    if (share[i] < 1.0 && i > 0 && segments[i].limit_share < least_share) segments[i].stop = true;
  }
  if (fastest > kept) feed_share /= fastest;
  return std::max(worst, fastest);
}

// A motion within the limits: planned with less acceleration and jerk where it exceeds one, until it keeps them.
Run run_within(SegmentRing& segments, std::size_t count, const TrajectoryLimits& limits, double period_s) {
  double feed_share = 1.0;
  for (int n = 0; n < most_plans; ++n) {
    AxisLimits asked;
    for (std::size_t i = 0; i < axis_count; ++i) {
      const auto axis = static_cast<Eigen::Index>(i);
      asked.speed[i] = feed_share * limits.max_feed_mm_per_s[axis];
      asked.acceleration[i] = limits.max_acceleration_mm_per_s2[axis];
      asked.jerk[i] = limits.max_jerk_mm_per_s3[axis];
    }
    PathPlan plan(segments, planned_limits(asked, period_s), period_s, 0);
    plan.make({}, {}, count, {});
    Run found = follow(plan, segments, count, period_s);
    if (worst_of(found, limits, period_s, segments, feed_share) > kept) continue;
    if (plan.choose_valleys()) {
      Run other = follow(plan, segments, count, period_s);
      const bool is_faster = other.ends && other.points.size() < found.points.size();
      if (is_faster && worst_of(other, limits, period_s, segments, feed_share) <= kept) return other;
    }
    return found;
  }
  throw Error(ErrorKind::numeric, "no motion within the limits was found");
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
  const Run found = run_within(segments, count, limits, period_s);
  samples.positions_mm.resize(std::ssize(found.points), axis_count);
  for (std::size_t k = 0; k < found.points.size(); ++k) {
    samples.positions_mm.row(static_cast<Eigen::Index>(k)) = found.points[k];
    motion.segments.push_back(numbers[found.segments[k]]);
  }
  return motion;
}

Samples time_optimal_trajectory(const Path& path, const TrajectoryLimits& limits, double period_s) {
  return std::move(time_optimal_motion(path, limits, period_s).set_points);
}

}  // namespace shapegcode
