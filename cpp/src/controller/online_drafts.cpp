// What the motion of a control makes of drafts of its plan, and of the operator.
#include <algorithm>
#include <cmath>

#include "controller/online_profile.hpp"

namespace shapegcode {

void OnlineProfile::look_ahead(std::uint64_t pushed) noexcept {
  const auto machine = [&] { return OnlinePlan::MachinePosition{running_, within_segment()}; };
  plan_.begin_portion();
  while (plan_.work(pushed, machine())) {
    if (refuses()) {
      plan_.refuse();
    } else {
      take_over();
    }
  }
  if (off_ && asked_ == plan_.ratio()) turn_off(false);
  // A motion begins when there is nothing more to be seen, at the override that was asked for: but once only, as a dial
  // may never rest.
  waiting_ = plan_.has_more(pushed, machine()) || plan_.absorbs() || (plan_.replans() && !replanned_);
}

// Whether a draft comes too late for the speed of a corner, or for the slow section around it that the jerk time wants:
// the machine stops before it, as it was about to.
bool OnlineProfile::refuses() const noexcept {
  const std::uint64_t first = plan_.first_new();
  if (!plan_.absorbs() || !within_segment() || (*ring_)[first].corner <= 0.0) return false;
  if (comes_too_late()) return true;
  if (state_ != State::running || fits(plan_.draft())) return false;
  if (plan_.newest() > first) return true;  // which of them it is, one by one shows
  const bool fitted = !slow_down_ && !stop_ && fits(plan_.version());
  return (fitted && plan_.jerk_s() > 0.0) || !slows_down_before(first);
}

// Whether the slow section before a corner of the new segments, which the jerk time wants, has begun already, and the
// machine was faster there.
bool OnlineProfile::comes_too_late() const noexcept {
  const double highest = recent_.highest();
  for (std::uint64_t i = plan_.first_new(); i <= plan_.newest(); ++i) {
    const QueuedSegment& entry = (*ring_)[i];
    if (entry.corner <= 0.0 || entry.distance - slow_reach(highest, plan_.jerk_s()) >= distance_) return false;
    if (entry.distance - slow_reach(entry.corner, plan_.jerk_s()) < distance_ &&
        highest > entry.corner * (1.0 + rounding)) {
      return true;
    }
  }
  return false;
}

// Whether the machine can still keep a plan where it is.
bool OnlineProfile::fits(std::uint64_t version) const noexcept {
  const Remaining rest = remaining_beyond(distance_ - (*ring_)[running_].distance, false, version);
  return speed_now_ <= rest.pieces[0].start_speed * (1.0 + rounding);
}

// Whether the machine, decelerating from now on, is seen to enter segment `index` at most at its corner speed, and to
// run as slowly before it as the jerk time wants.
bool OnlineProfile::slows_down_before(std::uint64_t index) const noexcept {
  const double corner = (*ring_)[index].corner;
  const std::uint64_t end = std::min(index, running_ + OnlinePlan::portion);
  double squared = speed_now_ * speed_now_;
  double left = (*ring_)[index].distance - slow_reach(corner, plan_.jerk_s()) - distance_;
  double skipped = distance_ - (*ring_)[running_].distance;
  for (std::uint64_t i = running_; i < end && left > 0.0 && squared > corner * corner; ++i) {
    const SegmentPlan& plan = plan_.segment(i, plan_.draft());
    for (std::size_t k = 0; k < plan.piece_count && squared > corner * corner; ++k) {
      const double part = std::min(left, std::max(0.0, plan.pieces[k].length - skipped));
      squared -= 2.0 * plan_.acceleration_of((*ring_)[i], std::sqrt(squared), plan.reduced[k]) * part;
      left -= part;
      skipped = std::max(0.0, skipped - plan.pieces[k].length);
    }
  }
  return squared <= corner * corner;
}

void OnlineProfile::take_over() noexcept {
  const std::uint64_t next = running_ + 1;
  const bool replanned = !plan_.absorbs();
  if (state_ == State::running) {
    changed_ = changed_ || replanned || next == absorbed() || plan_.first_changed() <= running_ ||
               plan_.start(next, plan_.draft()) != plan_.start(next, plan_.version());
  }
  plan_.take_over();
  if (!replanned) return;
  replanned_ = true;
  if (off_ && asked_ > 0.0) turn_off(false);
}

void OnlineProfile::override_feeds(double ratio) noexcept {
  if (ratio == asked_) return;
  asked_ = ratio;
  if (ratio > 0.0) {
    plan_.override_feeds(ratio);
  } else {
    turn_off(true);
  }
}

void OnlineProfile::turn_off(bool off) noexcept {
  off_ = off;
  changed_ = changed_ || state_ == State::running;
}

void OnlineProfile::stop(bool stopped) noexcept {
  if (stopped == stop_) return;
  stop_ = stopped;
  changed_ = changed_ || state_ == State::running;
}

}  // namespace shapegcode
