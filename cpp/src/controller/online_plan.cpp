// The passes of the look-ahead of a control: limits, zones, pieces and speeds of the segments of a draft.
#include "controller/online_plan.hpp"

#include <algorithm>

#include "motion/speed_limits.hpp"

namespace shapegcode {

double acceleration_along(const QueuedSegment& entry, double speed, const MotionLimits& limits, bool reduced) noexcept {
  return std::min(reduced ? reduced_share * entry.following_acceleration : entry.following_acceleration,
                  segment_acceleration(entry.segment, speed, limits, reduced));
}

double OnlinePlan::acceleration_of(const QueuedSegment& entry, double speed, bool reduced) const noexcept {
  if (entry.segment.kind != SegmentKind::arc) return entry.line_acceleration[reduced ? 1 : 0];
  return acceleration_along(entry, speed, limits_, reduced);
}

double OnlinePlan::limit_of(const QueuedSegment& entry) const noexcept {
  return std::min(entry.feed * draft_ratio_, entry.hard_limit);
}

ZoneSet OnlinePlan::zones_between(std::uint64_t from, std::uint64_t into) const noexcept {
  const QueuedSegment& source = (*ring_)[from];
  const QueuedSegment& junction = (*ring_)[std::max(from, into)];
  return junction_zones({limit_of(source), source.segment.feed_mm_per_s * draft_ratio_, limit_of((*ring_)[into]),
                         junction.corner, junction.jump},
                        limits_, jerk_s());
}

void OnlinePlan::split(const QueuedSegment& entry, SegmentPlan& plan) const noexcept {
  std::array<Section, max_pieces> sections;
  const std::size_t count =
      split_segment(plan.at_start, plan.at_end, entry.segment.length_mm, limit_of(entry), entry.beside_turn, sections);
  for (std::size_t k = 0; k < count; ++k) {
    const auto& [length, limit, reduced] = sections[k];
    plan.pieces[k] = {length, limit, acceleration_of(entry, limit, reduced), 0.0};
    plan.reduced[k] = reduced;
  }
  plan.piece_count = static_cast<std::uint8_t>(count);
}

// Come to rest before segment `index`, until everything has settled.
void OnlinePlan::stop_before(std::uint64_t index) noexcept {
  QueuedSegment& entry = (*ring_)[index];
  (*ring_)[index - 1].segment.stop_at_end = true;
  entry.corner = 0.0;
  entry.jump = Zone{};
}

// Zones that reach back from the junctions, from that of the newest segment to where nothing changes (another override:
// to the segment that is being run). While the machine moves, no farther than the zones of the new junctions reach:
// what a row of zones, each going on from the last, would lower behind them has nothing to do with it.
void OnlinePlan::visit_zones() noexcept {
  const std::uint64_t i = next_;
  if (i < machine_.running) return go_through(Pass::pieces);
  const QueuedSegment& entry = (*ring_)[i];
  if (i >= absorbed_ && i > machine_.running && entry.corner <= 0.0) stop_before(i);
  if (i == newest_) {
    carry_ = ZoneSet{};
    // What comes next may jump: so far the end is approached as if it did.
    if (looks_at_jumps(limits_) && !entry.segment.stop_at_end) carry_[jump_zone] = entry.open_end;
  } else {
    const ZoneSet own = zones_between(i + 1, i);
    if (i + 1 == first_) reach_ = std::max(reach_, entry.open_end.reach);  // which the new segments take back
    if (i + 1 >= first_) {
      for (const Zone& zone : own) reach_ = std::max(reach_, zone.reach);
    }
    if (i < first_ && machine_.within && reach_ <= 0.0) return go_through(Pass::pieces);
    reach_ -= entry.segment.length_mm;
    if (entry.segment.stop_at_end) {
      carry_ = ZoneSet{};  // everything settles there
    } else {
      extend(carry_, own);
    }
  }
  cut_to(carry_, entry.fastest, jump_time_s(limits_, jerk_s()));
  Versions<SegmentPlan>& plan = entries_[i & mask_].plan;
  if (i < first_) {
    const SegmentPlan& before = plan.at(version_);
    if (carry_ == before.at_end) return go_through(Pass::pieces);
    plan.draft(draft()).at_start = before.at_start;
  }
  plan.draft(draft()).at_end = carry_;
  carry_ = beyond(carry_, entry.segment.length_mm);
  if (i == newest_) {
    reach_ = 0.0;
    for (const Zone& zone : carry_) reach_ = std::max(reach_, zone.reach);
  }
  changed_ = i;
  lowest_ = std::min(lowest_, i);
  if (i == machine_.running) return go_through(Pass::pieces);
  --next_;
}

ZoneSet OnlinePlan::zones_at_start(std::uint64_t index) const noexcept {
  const QueuedSegment& entry = (*ring_)[index];
  const QueuedSegment& before = (*ring_)[index - 1];
  if (before.segment.stop_at_end) return {};
  ZoneSet zones = beyond(segment(index - 1, draft()).at_start, before.segment.length_mm);
  extend(zones, zones_between(index - 1, index));
  cut_to(zones, entry.fastest, jump_time_s(limits_, jerk_s()));
  return zones;
}

ZoneSet OnlinePlan::zones_behind(std::uint64_t index) const noexcept {
  const QueuedSegment& entry = (*ring_)[index];
  const QueuedSegment& before = (*ring_)[index - 1];
  if (before.segment.stop_at_end) return {};
  ZoneSet zones = beyond(before.behind, before.segment.length_mm);
  extend(zones,
         junction_zones({before.hard_limit, MotionLimits::none, entry.fastest, entry.corner, {}}, limits_, jerk_s()));
  return zones;
}

// Zones at the start, pieces, and the speeds that acceleration lets a segment have. What lies behind the start of the
// running one is not looked at: it stands.
void OnlinePlan::visit_pieces() noexcept {
  const std::uint64_t i = next_ = std::max(next_, machine_.running);
  const bool is_new = i >= absorbed_;
  QueuedSegment& entry = (*ring_)[i];
  SegmentPlan& plan = entries_[i & mask_].plan.draft(draft());
  double speed = 0.0;
  if (i > machine_.running) {
    const QueuedSegment& before = (*ring_)[i - 1];
    if (is_new) {
      entry.distance = before.segment.stop_at_end ? 0.0 : before.distance + before.segment.length_mm;
      entry.behind = zones_behind(i);
    }
    if (is_new || anew_) plan.at_start = zones_at_start(i);
    if (i == changed_) {
      const SegmentPlan& standing = segment(i - 1, version_);
      const Piece& last = standing.pieces[standing.piece_count - 1U];
      speed_ = speed_beyond(last, last.start_speed);
    }
    speed = std::min(speed_, entry.corner);
  } else if (is_new) {
    entry.distance = 0.0;
    entry.behind = ZoneSet{};
    plan.at_start = ZoneSet{};
  } else {
    const SegmentPlan& standing = segment(i, version_);
    plan.at_start = standing.at_start;
    speed = standing.pieces[0].start_speed;
    // How fast the machine can be there is not known from here: the motion looks at it.
    if (anew_) {
      extend(plan.at_start, entry.behind);  // the segment before this one may be gone
      speed = machine_.within ? MotionLimits::none : 0.0;
    }
  }
  split(entry, plan);
  for (std::size_t k = 0; k < plan.piece_count; ++k) {
    speed = std::min(speed, plan.pieces[k].limit);
    plan.pieces[k].start_speed = speed;
    speed = speed_beyond(plan.pieces[k], speed);
  }
  speed_ = speed;
  if (next_++ == newest_) {
    speed_ = 0.0;
    go_through(Pass::speeds);
  }
}

// Speeds that braking allows, from the newest segment back to where nothing changes any more.
void OnlinePlan::visit_speeds() noexcept {
  const std::uint64_t i = next_;
  const std::uint64_t last = machine_.within ? machine_.running + 1 : machine_.running;
  if (i < last) {
    pass_ = Pass::complete;
    return;
  }
  const SegmentPlan& plan = segment(i, draft());
  for (std::size_t k = plan.piece_count; k-- > 0;) {
    speed_ = std::min(plan.pieces[k].start_speed, speed_beyond(plan.pieces[k], speed_));
  }
  const bool same = i < changed_ && speed_ == start(i, version_);
  if (!same) {
    entries_[i & mask_].start.draft(draft()) = speed_;
    lowest_ = std::min(lowest_, i);
  }
  if (same || i == last) {
    pass_ = Pass::complete;
  } else {
    --next_;
  }
}

}  // namespace shapegcode
