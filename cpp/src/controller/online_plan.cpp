// The look-ahead of a control: limits, zones, pieces and speeds of the segments that it sees.
#include "controller/online_profile.hpp"

#include <algorithm>
#include <cmath>

#include "motion/speed_limits.hpp"

namespace shapegcode {

double OnlineProfile::limit_of(const QueuedSegment& entry) const noexcept {
  return std::min(entry.feed * ratio_, entry.hard_limit);
}

ZoneSet OnlineProfile::zones_between(std::uint64_t from, std::uint64_t into) noexcept {
  const QueuedSegment& source = (*ring_)[from];
  const QueuedSegment& junction = (*ring_)[std::max(from, into)];
  return junction_zones(
      {source.limit, source.segment.feed_mm_per_s * ratio_, (*ring_)[into].limit, junction.corner, junction.jump},
      limits_, jerk_s_);
}

void OnlineProfile::split(QueuedSegment& entry) noexcept {
  std::array<Stretch, most_pieces> stretches;
  entry.piece_count =
      split_segment(entry.at_start, entry.at_end, entry.segment.length_mm, entry.limit, entry.beside_turn, stretches);
  for (std::size_t k = 0; k < entry.piece_count; ++k) {
    const auto& [length, limit, eased] = stretches[k];
    entry.pieces[k] = {length, limit, acceleration_of(entry, limit, eased), 0.0};
    entry.eased[k] = eased;
  }
}

double acceleration_along(const QueuedSegment& entry, double speed, const MotionLimits& limits, bool eased) noexcept {
  return std::min(eased ? eased_share * entry.following_acceleration : entry.following_acceleration,
                  segment_acceleration(entry.segment, speed, limits, eased));
}

double OnlineProfile::acceleration_of(const QueuedSegment& entry, double speed, bool eased) const noexcept {
  if (entry.segment.kind != SegmentKind::arc) return entry.line_acceleration[eased ? 1 : 0];
  return acceleration_along(entry, speed, limits_, eased);
}

// Forward speeds of `first` and all after it; that of `first` itself stands.
void OnlineProfile::pass_forward(std::uint64_t first) noexcept {
  for (std::uint64_t i = first; i < absorbed_; ++i) {
    QueuedSegment& entry = (*ring_)[i];
    double speed = entry.forward;
    for (std::size_t k = 0; k < entry.piece_count; ++k) {
      speed = std::min(speed, entry.pieces[k].limit);
      entry.pieces[k].start_speed = speed;
      if (k == 0) entry.forward = speed;
      speed = speed_beyond(entry.pieces[k], speed);
    }
    if (i + 1 < absorbed_) {
      QueuedSegment& next = (*ring_)[i + 1];
      next.forward = std::min({speed, next.corner, next.pieces[0].limit});
    }
  }
}

// Start speeds from the newest segment back to where nothing changes any more, but those of `first_changed` and all
// after it in any case. True if the segment after the one that is being run has another one than before.
bool OnlineProfile::pass_backward(std::uint64_t first_changed) noexcept {
  double speed = 0.0;
  const std::uint64_t last = within_segment() ? running_ + 1 : running_;
  for (std::uint64_t i = absorbed_; i-- > last;) {
    QueuedSegment& entry = (*ring_)[i];
    for (std::size_t k = entry.piece_count; k-- > 0;) {
      speed = std::min(entry.pieces[k].start_speed, speed_beyond(entry.pieces[k], speed));
    }
    if (i < first_changed && speed == entry.start) return false;
    const bool same = speed == entry.start;
    entry.start = speed;
    if (i == last) return !same || i == absorbed_ - 1;
  }
  return true;
}

// Zones that reach back from the junctions, from that of `newest` to where nothing changes (`all`: to the segment that
// is being run). First segment that changed. While the machine moves, no farther than the zones of the newest
// and of the one before it reach: what a row of zones, each going on from the last, would lower behind them has nothing
// to do with it.
std::uint64_t OnlineProfile::zones_backward(std::uint64_t newest, bool all) noexcept {
  QueuedSegment& last = (*ring_)[newest];
  last.at_end = ZoneSet{};
  // What comes next may jump: so far the end is approached as if it did.
  if (looks_at_jumps(limits_) && !last.segment.stop_at_end) {
    last.at_end[jump_zone] = last.open_end;
    cut_to(last.at_end, last.fastest, jump_time_s(limits_, jerk_s_));
  }
  ZoneSet carry = beyond(last.at_end, last.segment.length_mm);
  std::uint64_t changed = newest;
  double left = MotionLimits::none;
  if (within_segment() && !all && newest > running_) {
    const ZoneSet own = zones_between(newest, newest - 1);
    left = (*ring_)[newest - 1].open_end.reach;  // which the newest takes back
    for (std::size_t kind = 0; kind < zone_kinds; ++kind) left = std::max({left, own[kind].reach, carry[kind].reach});
  }
  for (std::uint64_t i = newest; left > 0.0 && i-- > running_;) {
    QueuedSegment& entry = (*ring_)[i];
    left -= entry.segment.length_mm;
    if (entry.segment.stop_at_end) {
      carry = ZoneSet{};  // everything settles there
    } else {
      extend(carry, zones_between(i + 1, i));
    }
    cut_to(carry, entry.fastest, jump_time_s(limits_, jerk_s_));
    if (!all && carry == entry.at_end) break;
    entry.at_end = carry;
    changed = i;
    carry = beyond(carry, entry.segment.length_mm);
  }
  return changed;
}

// Zones that reach over the junction at the start of segment `index`.
void OnlineProfile::zones_at_start(std::uint64_t index) noexcept {
  QueuedSegment& entry = (*ring_)[index];
  const QueuedSegment& before = (*ring_)[index - 1];
  entry.at_start = ZoneSet{};
  entry.behind = ZoneSet{};
  if (before.segment.stop_at_end) return;
  entry.at_start = beyond(before.at_start, before.segment.length_mm);
  extend(entry.at_start, zones_between(index - 1, index));
  cut_to(entry.at_start, entry.fastest, jump_time_s(limits_, jerk_s_));
  entry.behind = beyond(before.behind, before.segment.length_mm);
  extend(entry.behind,
         junction_zones({before.hard_limit, MotionLimits::none, entry.fastest, entry.corner, {}}, limits_, jerk_s_));
}

void OnlineProfile::absorb() noexcept {
  const std::uint64_t i = absorbed_;
  QueuedSegment& entry = (*ring_)[i];
  entry.limit = limit_of(entry);
  const bool first = i == running_;  // a motion begins with it: nothing is before it
  if (first) {
    entry.distance = distance_;
    entry.at_start = ZoneSet{};
    entry.behind = ZoneSet{};
    entry.forward = 0.0;
  } else {
    const QueuedSegment& before = (*ring_)[i - 1];
    entry.distance = before.distance + before.segment.length_mm;
    zones_at_start(i);
  }
  ++absorbed_;
  if (first) {
    static_cast<void>(zones_backward(i, false));
    split(entry);
    pass_forward(i);
    pass_backward(i);
    return;
  }
  if (entry.corner <= 0.0 || comes_too_late(i)) stop_before(i);
  const bool fitted = state_ == State::running && !slow_down_ && !stop_ && fits();
  connect(i);
  if (state_ == State::running && !fits() && ((fitted && jerk_s_ > 0.0) || !slows_down_before(i))) {
    // Too late for the speed of that corner, or for the slow stretch around it that the jerk time wants: the machine
    // stops there, as it was about to.
    stop_before(i);
    connect(i);
  }
}

// Whether the slow stretch before the corner of segment `index`, which the jerk time wants, has begun already, and the
// machine was faster there.
bool OnlineProfile::comes_too_late(std::uint64_t index) noexcept {
  const QueuedSegment& entry = (*ring_)[index];
  return within_segment() && entry.distance - 0.5 * entry.corner * jerk_s_ < distance_ &&
         recent_.highest() > entry.corner * (1.0 + rounding);
}

// Whether the machine, decelerating from now on, enters segment `index` at most at its corner speed, and runs as slowly
// before it as the jerk time wants.
bool OnlineProfile::slows_down_before(std::uint64_t index) noexcept {
  const double corner = (*ring_)[index].corner;
  double squared = speed_now_ * speed_now_;
  double left = (*ring_)[index].distance - 0.5 * corner * jerk_s_ - distance_;
  double skipped = distance_ - (*ring_)[running_].distance;
  for (std::uint64_t i = running_; i < index && left > 0.0 && squared > corner * corner; ++i) {
    const QueuedSegment& entry = (*ring_)[i];
    for (std::size_t k = 0; k < entry.piece_count && squared > corner * corner; ++k) {
      const double way = std::min(left, std::max(0.0, entry.pieces[k].length - skipped));
      squared -= 2.0 * acceleration_of(entry, std::sqrt(squared), entry.eased[k]) * way;
      left -= way;
      skipped = std::max(0.0, skipped - entry.pieces[k].length);
    }
  }
  return squared <= corner * corner;
}

// Come to rest before segment `index`, until everything has settled.
void OnlineProfile::stop_before(std::uint64_t index) noexcept {
  QueuedSegment& before = (*ring_)[index - 1];
  QueuedSegment& entry = (*ring_)[index];
  before.segment.stop_at_end = true;
  entry.corner = 0.0;
  entry.jump = Zone{};
  zones_at_start(index);
}

// Zones, pieces and speeds that the newest segment changes.
void OnlineProfile::connect(std::uint64_t newest) noexcept {
  const std::uint64_t changed = zones_backward(newest, false);
  for (std::uint64_t k = changed; k <= newest; ++k) split((*ring_)[k]);
  // The speed at which a segment is entered stands, if those before it do.
  pass_forward(std::min(changed > running_ ? changed - 1 : running_, newest - 1));
  const bool next_differs = pass_backward(changed);
  if (state_ == State::running && (next_differs || changed <= running_)) changed_ = true;
}

// Whether the machine can still keep the plan where it is.
bool OnlineProfile::fits() const noexcept {
  const Remaining rest = remaining_beyond(distance_ - (*ring_)[running_].distance, false);
  return speed_now_ <= rest.pieces[0].start_speed * (1.0 + rounding);
}

void OnlineProfile::override_feeds(double ratio) noexcept {
  if (ratio == ratio_) return;
  ratio_ = ratio;
  changed_ = state_ == State::running;
  if (ratio <= 0.0 || running_ == absorbed_) return;
  for (std::uint64_t i = running_; i < absorbed_; ++i) (*ring_)[i].limit = limit_of((*ring_)[i]);
  // The segment before this one may be gone.
  extend((*ring_)[running_].at_start, (*ring_)[running_].behind);
  for (std::uint64_t i = running_ + 1; i < absorbed_; ++i) zones_at_start(i);
  zones_backward(absorbed_ - 1, true);
  for (std::uint64_t i = running_; i < absorbed_; ++i) split((*ring_)[i]);
  // How fast the machine can be there is not known from here: what is generated looks at it.
  (*ring_)[running_].forward = within_segment() ? MotionLimits::none : 0.0;
  pass_forward(running_);
  pass_backward(running_);
}

void OnlineProfile::stop(bool stopped) noexcept {
  if (stopped == stop_) return;
  stop_ = stopped;
  changed_ = changed_ || state_ == State::running;
}

}  // namespace shapegcode
