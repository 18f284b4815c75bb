#include "controller/intake.hpp"

#include <algorithm>
#include <cmath>

#include "motion/speed_limits.hpp"
#include "path/arc_end.hpp"

namespace shapegcode {

void Intake::restart(std::span<const double> position) noexcept {
  last_segment_ = Segment{};
  for (int i = 0; i < axis_count; ++i) last_segment_.end_mm[i] = position[static_cast<std::size_t>(i)];
  std::copy_n(position.begin() + axis_count, following_.size(), last_following_.begin());
  has_last_ = false;
}

PushResult Intake::take(const Segment& segment, std::span<const double> following_end, QueuedSegment& entry) noexcept {
  if (following_end.size() != following_.size()) return PushResult::wrong_axes;
  const PushResult result = copy(segment, following_end, entry);
  if (result != PushResult::accepted) return result;
  look_at(entry);
  entry.open_end =
      zone_of_jump(Jump::turn, std::min(entry.fastest, attainable(entry.passed, entry.segment.length_mm, steepest_)),
                   steepest_, jump_time_s_);
  last_segment_ = entry.segment;
  last_rate_ = entry.following_rate;
  last_fastest_ = entry.fastest;
  last_passed_ = entry.passed;
  std::ranges::copy(following_end, last_following_.begin());
  has_last_ = true;
  return PushResult::accepted;
}

// Checks a segment and copies what belongs to it.
PushResult Intake::copy(const Segment& segment, std::span<const double> following_end,
                        QueuedSegment& entry) const noexcept {
  const bool arc = segment.kind == SegmentKind::arc;
  const bool finite = segment.start_mm.allFinite() && segment.end_mm.allFinite() && std::isfinite(segment.length_mm) &&
                      (!arc || (segment.centre_mm.allFinite() && std::isfinite(segment.sweep_rad) &&
                                std::isfinite(segment.start_radius_mm) && std::isfinite(segment.end_radius_mm) &&
                                std::isfinite(segment.start_angle_rad))) &&
                      std::ranges::all_of(following_end, [](double value) { return std::isfinite(value); });
  if (!finite) return PushResult::not_finite;
  if (!(segment.feed_mm_per_s > 0.0) || !std::isfinite(segment.feed_mm_per_s)) return PushResult::no_feed;
  if ((segment.start_mm - last_segment_.end_mm).norm() > largest_gap_mm) return PushResult::not_connected;
  // Its last set-point is its end: a sweep that leads elsewhere would be a jump there.
  if (arc && std::abs(missing_sweep_rad(segment)) * segment.end_radius_mm > largest_gap_mm) {
    return PushResult::not_connected;
  }
  entry.segment = segment;
  for (std::size_t i = 0; i < following_.size(); ++i) {
    entry.following_start[i] = last_following_[i];
    entry.following_end[i] = following_end[i];
    entry.following_rate[i] = following_end[i] - last_following_[i];
  }
  if (!(segment.length_mm > 0.0)) {
    entry.segment.length_mm = 0.0;
    for (std::size_t i = 0; i < following_.size(); ++i) {
      entry.segment.length_mm = std::max(entry.segment.length_mm, std::abs(entry.following_rate[i]));
    }
    entry.segment.end_mm = entry.segment.start_mm;
    entry.segment.kind = SegmentKind::line;
    if (entry.segment.length_mm <= 0.0) return PushResult::no_length;
  }
  for (std::size_t i = 0; i < following_.size(); ++i) entry.following_rate[i] /= entry.segment.length_mm;
  return PushResult::accepted;
}

// What the segment and its junction with the one before allow.
void Intake::look_at(QueuedSegment& entry) const noexcept {
  const Segment& segment = entry.segment;
  entry.feed = segment.feed_mm_per_s * (segment.kind == SegmentKind::arc ? limits_.arc_feed_ratio : 1.0);
  Segment fast = segment;
  fast.feed_mm_per_s = MotionLimits::none;
  entry.hard_limit = segment_speed_limit(fast, limits_, tolerance_);
  entry.following_acceleration = MotionLimits::none;
  for (std::size_t i = 0; i < following_.size(); ++i) {
    const double rate = std::abs(entry.following_rate[i]);
    if (rate > 0.0) {
      entry.hard_limit = std::min(entry.hard_limit, following_[i].max_feed / rate);
      entry.following_acceleration = std::min(entry.following_acceleration, following_[i].max_acceleration / rate);
    }
  }
  entry.fastest = std::min(fastest_speed(segment, limits_, tolerance_), entry.hard_limit);
  entry.corner = MotionLimits::none;
  for (const bool reduced : {false, true}) {
    entry.line_acceleration[reduced ? 1 : 0] = acceleration_along(entry, 0.0, limits_, reduced);
  }
  entry.jump = Zone{};
  entry.passed = 0.0;  // from rest
  entry.beside_turn = limit_beside_turn(segment, limits_);
  if (!has_last_) return;
  if (last_segment_.stop_at_end) {
    entry.corner = 0.0;
    return;
  }
  entry.corner = corner_speed_limit(last_segment_, segment, limits_, tolerance_);
  if (looks_at_jumps(limits_)) look_at_jumps(entry);
}

void Intake::look_at_jumps(QueuedSegment& entry) const noexcept {
  const double fastest = std::min(last_fastest_, entry.fastest);
  const JunctionJumps jumps = junction_jumps(last_segment_, entry.segment);
  Jump kind = jumps.kind;
  if (kind != Jump::none) {
    entry.corner = std::min(entry.corner, junction_jump_speed(last_segment_, entry.segment, limits_, jumps, fastest));
  }
  const JunctionShape shape{std::min(last_segment_.length_mm, entry.segment.length_mm), fastest};
  for (std::size_t i = 0; i < following_.size(); ++i) {
    const double turn = std::abs(entry.following_rate[i] - last_rate_[i]);
    if (turn > 0.0) {
      kind = Jump::turn;
      entry.corner = std::min(
          entry.corner,
          jump_speed({turn, 0.0, following_[i].max_acceleration, following_[i].max_jerk}, shape, limits_.jumps));
    }
  }
  entry.passed = std::min({entry.corner, fastest, attainable(last_passed_, last_segment_.length_mm, steepest_)});
  if (kind != Jump::none) entry.jump = zone_of_jump(kind, entry.passed, steepest_, jump_time_s_);
}

}  // namespace shapegcode
