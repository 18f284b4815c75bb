#include "controller/intake.hpp"

#include <algorithm>
#include <cmath>

#include "path/arc_end.hpp"

namespace shapegcode {
namespace {

// A corner with a speed limit below this is a stop.
constexpr double crawl_mm_per_s = 1e-2;
// A share of what another axis travels that hardly is travel of X, Y and Z.
constexpr double hardly_moves = 0.1;

}  // namespace

Intake::Intake(const ControllerSettings& settings, double tolerance_mm, double corner_time_s)
    : rules_(settings.limits),
      corners_(settings.limits),
      n_following_(settings.following.size()),
      corner_time_s_(corner_time_s) {
  rules_.feed_override = corners_.feed_override = 1.0;
  rules_.max_feed_mm_per_s.setConstant(MotionLimits::none);
  rules_.max_acceleration_mm_per_s2.setConstant(MotionLimits::none);
  rules_.max_jerk_mm_per_s3.setConstant(MotionLimits::none);
  tolerance_.contour_mm = tolerance_mm;
  tolerance_.axes = axis_count + n_following_;
  for (std::size_t i = 0; i < n_following_; ++i) tolerance_.axis[axis_count + i] = settings.following[i].tolerance;
}

void Intake::restart(std::span<const double> position) noexcept {
  last_ = PlannedSegment{};
  for (int i = 0; i < axis_count; ++i) last_.segment.end_mm[i] = position[static_cast<std::size_t>(i)];
  std::copy(position.begin() + axis_count, position.end(), last_.end.begin() + axis_count);
  has_last_ = rests_ = false;
  waits_ = 0;
  dwell_ = 0;
}

PushResult Intake::take(const Segment& segment, std::span<const double> following_end, const SegmentRules& rules,
                        PlannedSegment& entry) noexcept {
  if (following_end.size() != n_following_) return PushResult::wrong_axes;
  const PushResult result = copy(segment, following_end, entry);
  if (result != PushResult::accepted) return result;
  if (!(rules.max_acceleration > 0.0 && rules.max_jerk > 0.0)) return PushResult::bad_limit;
  const bool is_bound = rules.feed_rate == FeedRate::synchronous;
  if (is_bound && segment.kind == SegmentKind::arc) return PushResult::not_straight;
  set_feed(segment, rules, entry);
  look_at(entry);
  entry.stop = entry.stop || is_bound;
  entry.stop = entry.stop || rests_;
  entry.dwell = dwell_;
  entry.waits = waits_;
  rests_ = is_bound;
  waits_ = 0;
  dwell_ = 0;
  last_ = entry;
  has_last_ = true;
  return PushResult::accepted;
}

// Checks a segment and copies what belongs to it.
PushResult Intake::copy(const Segment& segment, std::span<const double> following_end,
                        PlannedSegment& entry) const noexcept {
  const bool arc = segment.kind == SegmentKind::arc;
  const bool finite = segment.start_mm.allFinite() && segment.end_mm.allFinite() && std::isfinite(segment.length_mm) &&
                      (!arc || (segment.centre_mm.allFinite() && std::isfinite(segment.sweep_rad) &&
                                std::isfinite(segment.start_radius_mm) && std::isfinite(segment.end_radius_mm) &&
                                std::isfinite(segment.start_angle_rad))) &&
                      std::ranges::all_of(following_end, [](double value) { return std::isfinite(value); });
  if (!finite) return PushResult::not_finite;
  if (!(segment.feed_mm_per_s > 0.0) || !std::isfinite(segment.feed_mm_per_s)) return PushResult::no_feed;
  if ((segment.start_mm - last_.segment.end_mm).norm() > largest_gap_mm) return PushResult::not_connected;
  const double missing_mm = arc ? std::abs(missing_sweep_rad(segment)) * segment.end_radius_mm : 0.0;
  if (missing_mm > largest_gap_mm) return PushResult::not_connected;
  PlannedSegment planned;
  planned.segment = segment;
  // A gap, there or at the end of a sweep, would be a jump within a period.
  if (segment.start_mm != last_.segment.end_mm || missing_mm > no_travel_mm) {
    planned.segment = begun_at(segment, last_.segment.end_mm);
    const bool turns = planned.segment.start_radius_mm > 0.0 && planned.segment.sweep_rad * segment.sweep_rad > 0.0;
    if (arc && !turns) return PushResult::not_connected;
  }
  double longest = 0.0;
  for (std::size_t i = 0; i < n_following_; ++i) {
    const std::size_t axis = axis_count + i;
    planned.start[axis] = last_.end[axis];
    planned.end[axis] = following_end[i];
    planned.rate[axis] = following_end[i] - last_.end[axis];
    longest = std::max(longest, std::abs(planned.rate[axis]));
  }
  if (!(segment.length_mm > 0.0)) {
    planned.segment.length_mm = 0.0;
    planned.segment.end_mm = planned.segment.start_mm;
    planned.segment.kind = SegmentKind::line;
  }
  // Where X, Y and Z hardly move, what moves is the path.
  if (planned.segment.kind != SegmentKind::arc && planned.segment.length_mm < hardly_moves * longest) {
    planned.segment.length_mm = longest;
  }
  if (planned.segment.length_mm <= no_travel_mm) return PushResult::no_length;
  for (double& rate : planned.rate) rate /= planned.segment.length_mm;
  entry = planned;
  return PushResult::accepted;
}

// Its feed along the path parameter.
void Intake::set_feed(const Segment& segment, const SegmentRules& rules, PlannedSegment& entry) const noexcept {
  const double length = entry.segment.length_mm;
  const double xyz = segment.length_mm;
  double squares = xyz * xyz;
  double longest = 0.0;
  for (std::size_t i = axis_count; i < axis_count + n_following_; ++i) {
    const double travel = std::abs(entry.rate[i]) * length;
    squares += travel * travel;
    longest = std::max(longest, travel);
  }
  double counted = xyz > no_travel_mm ? xyz : longest;
  if (rules.feed_of == FeedOf::all_axes) counted = std::sqrt(squares);
  if (rules.feed_of == FeedOf::dominant) counted = std::max(xyz, longest);
  if (rules.feed_of == FeedOf::time) counted = 1.0;
  entry.segment.feed_mm_per_s *= length / counted;
  entry.rate_of = rules.feed_rate;
  entry.max_acceleration = rules.max_acceleration;
  entry.max_jerk = rules.max_jerk;
}

// What the segment and its junction with the one before allow.
void Intake::look_at(PlannedSegment& entry) const noexcept {
  Segment fast = entry.segment;
  entry.programmed = fast.feed_mm_per_s * (fast.kind == SegmentKind::arc ? rules_.arc_feed_ratio : 1.0);
  if (rules_.law == AccelerationLaw::constant_time) {
    entry.max_acceleration = std::min(entry.max_acceleration, fast.feed_mm_per_s / rules_.time_constant_s);
    if (rules_.jerk_time_s > 0.0)
      entry.max_jerk = std::min(entry.max_jerk, entry.max_acceleration / rules_.jerk_time_s);
  }
  fast.feed_mm_per_s = MotionLimits::none;
  entry.max_speed = segment_speed_limit(fast, rules_, {});
  if (!has_last_) return;
  look_at_junction(last_, tolerance_, entry);
  if (entry.stop) return;
  entry.corner_speed = corner_speed_limit(last_.segment, entry.segment, corners_, {});
  const double turned = Vector3(entry.turn[0], entry.turn[1], entry.turn[2]).norm();
  if (corner_time_s_ * turned > 0.0) {
    entry.corner_speed = std::min(entry.corner_speed, tolerance_.contour_mm / (corner_time_s_ * turned));
  }
  entry.stop = entry.corner_speed <= crawl_mm_per_s;
}

}  // namespace shapegcode
