#include "limits/speed_limits.hpp"

#include <algorithm>
#include <cmath>
#include <vector>

#include "base/checks.hpp"

namespace shapegcode {
namespace {

// The planner needs a speed at every junction; this one is practically a stop.
constexpr double standstill_mm_per_s = 1e-3;

// A tangent junction to within what the least increment lets a program say (1 um over 1 mm).
constexpr double tangent_change = 1e-6;

// Share of the acceleration of an axis that is that of the turn on an arc, at most; what is left along the path is at
// least the root of what the square of that leaves.
constexpr double turning_share = 0.9;
constexpr double left_squared = 0.19;

// Infinity switches a limit off.
void require_limit(double value, const char* name, const char* unit) { require(value > 0.0, name, value, unit, "> 0"); }

// Largest share of each axis in the tangent; an arc may point along any direction of its plane.
Vector3 axis_share(const Segment& segment) noexcept {
  if (segment.kind != SegmentKind::arc) {
    return tangent_at(segment, 0.0).cwiseAbs();
  }
  Vector3 share = Vector3::Ones();
  share[segment.normal] =
      segment.length_mm > 0.0
          ? std::abs(segment.end_mm[segment.normal] - segment.start_mm[segment.normal]) / segment.length_mm
          : 0.0;
  return share;
}

// In-plane axes of an arc share their acceleration between the turn and the change of speed.
double arc_centripetal_limit(const Segment& segment, const MotionLimits& limits) noexcept {
  double limit = limits.centripetal_acceleration_mm_per_s2;
  for (int i = 0; i < axis_count; ++i) {
    if (i != segment.normal) {
      limit = std::min(
          {limit, turning_share * limits.max_acceleration_mm_per_s2[i], limits.contour_acceleration_mm_per_s2[i]});
    }
  }
  return limit;
}

// The acceleration of a circle turns with it: jerk v^3 / r^2.
double arc_jerk_speed(const Segment& segment, const MotionLimits& limits) noexcept {
  double jerk = MotionLimits::none;
  for (int i = 0; i < axis_count; ++i) {
    if (i != segment.normal) {
      jerk = std::min(jerk, limits.max_jerk_mm_per_s3[i]);
    }
  }
  const double bend = curvature(segment);
  return std::isfinite(jerk) && bend > 0.0 ? std::cbrt(jerk / (bend * bend)) : MotionLimits::none;
}

double polyline_reach(const Segment& before, const Segment& after) noexcept {
  return 0.5 * (before.length_mm + after.length_mm);
}

double polyline_curvature(const Segment& before, const Segment& after, double angle) noexcept {
  const double reach = polyline_reach(before, after);
  return reach > 0.0 ? angle / reach : 0.0;
}

// Speed at which the turn of the direction by `change`, spread over the distance between the middles of both blocks,
// costs no axis more than its contour acceleration: a = |change| v^2 / reach.
double contour_speed(const Vector3& change, double reach, const MotionLimits& limits) noexcept {
  return std::sqrt(tangential_limit(change.cwiseAbs(), limits.contour_acceleration_mm_per_s2) * reach);
}

// Speed on the arc that is tangent to both sides of a corner and cuts it by the deviation: a d c / (1 - c), c the
// cosine of half the turn. (Sonny Jeon's rule of grbl, 2011.)
double junction_deviation_speed(double angle, double acceleration, double deviation_mm) noexcept {
  const double cosine = std::cos(0.5 * angle);
  return std::sqrt(acceleration * deviation_mm * cosine / (1.0 - cosine));
}

double curvature_speed(double curvature_per_mm, double centripetal, const FilterTolerance& filter,
                       double tolerance_mm) noexcept {
  if (curvature_per_mm <= 0.0) {
    return MotionLimits::none;
  }
  double speed = std::sqrt(centripetal / curvature_per_mm);
  if (filter.variance_s2 > 0.0) {
    // Radial error of a filter on an arc: variance * v^2 * curvature / 2.
    speed = std::min(speed, std::sqrt(2.0 * tolerance_mm / (filter.variance_s2 * curvature_per_mm)));
  }
  return speed;
}

}  // namespace

double tangential_limit(const Vector3& share, const Vector3& limit) noexcept {
  double result = MotionLimits::none;
  for (int i = 0; i < axis_count; ++i) {
    if (share[i] > 0.0) {
      result = std::min(result, limit[i] / share[i]);
    }
  }
  return result;
}

void check_limits(const MotionLimits& limits, const FilterTolerance& filter) {
  require_limit(limits.time_constant_s, "acceleration time constant", "s");
  require_limit(limits.feed_override, "feed override", "");
  require_limit(limits.arc_feed_ratio, "arc feed ratio", "");
  require_not_below_zero(limits.jerk_time_s, "jerk time", "s");
  require_not_below_zero(limits.feed_spread_s, "spread of feeds", "s");
  require_not_below_zero(limits.feed_excess_ratio, "excess of feeds", "");
  require_limit(filter.contour_tolerance_mm, "contour tolerance", "mm");
  require_limit(limits.centripetal_acceleration_mm_per_s2, "centripetal acceleration", "mm/s2");
  require_limit(limits.polyline_acceleration_mm_per_s2, "acceleration along polylines", "mm/s2");
  require_limit(limits.junction_deviation_mm, "junction deviation", "mm");
  require_not_below_zero(limits.block_time_s, "block time", "s");
  require_limit(limits.corner_stop_angle_rad, "angle of corners that are stops", "rad");
  for (int i = 0; i < axis_count; ++i) {
    require_limit(limits.max_feed_mm_per_s[i], "axis feed limit", "mm/s");
    require_limit(limits.max_acceleration_mm_per_s2[i], "axis acceleration limit", "mm/s2");
    require_limit(limits.max_jerk_mm_per_s3[i], "axis jerk limit", "mm/s3");
    require_limit(limits.corner_speed_difference_mm_per_s[i], "corner speed difference", "mm/s");
    require_limit(limits.contour_acceleration_mm_per_s2[i], "contour acceleration", "mm/s2");
  }
}

double segment_acceleration(const Segment& segment, double speed_limit, const MotionLimits& limits) noexcept {
  double axes = tangential_limit(axis_share(segment), limits.max_acceleration_mm_per_s2);
  if (segment.kind == SegmentKind::arc && std::isfinite(axes)) {
    const double turning = speed_limit * speed_limit * curvature(segment);
    axes = std::sqrt(std::max(left_squared * axes * axes, axes * axes - turning * turning));
  }
  if (limits.law == AccelerationLaw::constant_time) {
    return std::min(axes, segment.feed_mm_per_s * limits.feed_override / limits.time_constant_s);
  }
  return axes;
}

double jerk_time(const MotionLimits& limits, double fastest) noexcept {
  double longest = limits.jerk_time_s;
  for (int i = 0; i < axis_count; ++i) {
    const double acceleration = std::min(limits.max_acceleration_mm_per_s2[i], fastest);
    if (std::isfinite(limits.max_jerk_mm_per_s3[i]) && std::isfinite(acceleration)) {
      // Twice, because acceleration may turn into deceleration at once.
      longest = std::max(longest, 2.0 * acceleration / limits.max_jerk_mm_per_s3[i]);
    }
  }
  return longest;
}

double axis_feed_limit(const Segment& segment, const MotionLimits& limits) noexcept {
  return tangential_limit(axis_share(segment), limits.max_feed_mm_per_s);
}

double segment_speed_limit(const Segment& segment, const MotionLimits& limits, const FilterTolerance& filter) noexcept {
  double speed = segment.feed_mm_per_s * limits.feed_override;
  if (segment.kind == SegmentKind::arc) {
    speed *= limits.arc_feed_ratio;
    speed = std::min(speed, curvature_speed(curvature(segment), arc_centripetal_limit(segment, limits), filter,
                                            filter.contour_tolerance_mm));
    speed = std::min(speed, arc_jerk_speed(segment, limits));
  }
  if (limits.block_time_s > 0.0 && segment.length_mm > 0.0) {
    speed = std::min(speed, segment.length_mm / limits.block_time_s);
  }
  return std::min(speed, axis_feed_limit(segment, limits));
}

double corner_speed_limit(const Segment& before, const Segment& after, const MotionLimits& limits,
                          const FilterTolerance& filter) noexcept {
  const Vector3 change = tangent_at(after, 0.0) - tangent_at(before, before.length_mm);
  const double size = change.norm();
  if (size < tangent_change) {
    return MotionLimits::none;
  }
  double speed = tangential_limit(change.cwiseAbs(), limits.corner_speed_difference_mm_per_s);
  const double angle = 2.0 * std::asin(std::min(1.0, 0.5 * size));
  const double tolerance = filter.corner_share * filter.contour_tolerance_mm;
  speed = std::min(speed, curvature_speed(polyline_curvature(before, after, angle),
                                          limits.polyline_acceleration_mm_per_s2, filter, tolerance));
  if (angle >= limits.corner_stop_angle_rad) {
    speed = std::min(speed, standstill_mm_per_s);
  }
  if (limits.junction_deviation_mm < MotionLimits::none) {
    const double acceleration = tangential_limit(change.cwiseAbs() / size, limits.max_acceleration_mm_per_s2);
    speed = std::min(speed, std::max(standstill_mm_per_s,
                                     junction_deviation_speed(angle, acceleration, limits.junction_deviation_mm)));
  }
  speed = std::min(speed, contour_speed(change, polyline_reach(before, after), limits));
  if (filter.mean_deviation_s > 0.0) {
    // A filter of symmetric spread passes the corner at |change| * (v*E|t| + a*E[t^2]/2) / 2: what the speed at the
    // corner and the ramps on both sides of it cost.
    const double acceleration =
        std::max(segment_acceleration(before, segment_speed_limit(before, limits, filter), limits),
                 segment_acceleration(after, segment_speed_limit(after, limits, filter), limits));
    const double ramps = std::isfinite(acceleration) ? 0.5 * acceleration * filter.variance_s2 : 0.0;
    const double room = 2.0 * tolerance / size - ramps;
    speed = std::min(speed, std::max(0.0, room / filter.mean_deviation_s));
  }
  return speed;
}

std::vector<std::size_t> forced_stops(const Segments& segments, double axis_angle_rad, double corner_angle_rad,
                                      const MotionLimits& limits, const FilterTolerance& filter) {
  const double along = std::cos(axis_angle_rad);
  const double turned = std::cos(corner_angle_rad);
  std::vector<std::size_t> stops;
  if (segments.empty()) return stops;
  Segment last = segments[0];
  for (std::size_t i = 1; i < segments.size(); ++i) {
    const Segment next = segments[i];
    const Vector3 before = tangent_at(last, last.length_mm);
    const Vector3 after = tangent_at(next, 0.0);
    const bool plunges = std::abs(before[2]) >= along || std::abs(after[2]) >= along;
    if (last.stop_at_end || (plunges && before.dot(after) <= turned) ||
        corner_speed_limit(last, next, limits, filter) <= 0.0) {
      stops.push_back(i);
    }
    last = next;
  }
  return stops;
}

}  // namespace shapegcode
