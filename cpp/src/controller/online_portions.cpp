// Which draft of a plan comes next, and how far it goes in a period.
#include <algorithm>
#include <bit>

#include "controller/online_plan.hpp"

namespace shapegcode {

OnlinePlan::OnlinePlan(SegmentRing& ring, const MotionLimits& limits, std::size_t window)
    : ring_(&ring),
      limits_(limits),
      window_(window + window / 8),
      mask_(std::bit_ceil(window_) - 1),
      entries_(mask_ + 1) {}

void OnlinePlan::restart(std::uint64_t next) noexcept {
  absorbed_ = first_ = newest_ = changed_ = next;
  pass_ = Pass::none;
  anew_ = false;
  seen_ = 0;
  // What was drafted is of no version any more.
  version_ += 2;
}

bool OnlinePlan::work(std::uint64_t pushed, MachinePosition machine) noexcept {
  machine_ = machine;
  // The machine came to rest before the first of the new segments: with it a motion begins.
  if (absorbs() && joined_ && machine.running == first_) absorb(first_, newest_ + 1 - first_);
  // Nothing is left of what was to be planned with another override.
  if (anew_ && machine.running > newest_) pass_ = Pass::complete;
  if (pass_ == Pass::none && !next_draft(pushed)) return false;
  while (pass_ != Pass::complete && left_ > 0) visit();
  return pass_ == Pass::complete;
}

// A new override waits for the segments that came into reach while the last one was being worked out, so that a dial
// that never rests does not shorten the look-ahead.
bool OnlinePlan::next_draft(std::uint64_t pushed) noexcept {
  const std::uint64_t seen = absorbed_ - machine_.running;
  const bool more = has_more(pushed, machine_);
  if (seen == 0) ratio_ = wished_;
  if (wished_ != ratio_ && (!more || seen > seen_)) {
    seen_ = seen;
    replan();
    return true;
  }
  // The more is in sight, the more braking may change at once: then many segments share that work.
  const std::uint64_t most = std::max<std::uint64_t>(min_batch, seen / 4);
  if (more) absorb(absorbed_, std::min({most, pushed - absorbed_, window_ - seen}));
  return more;
}

void OnlinePlan::absorb(std::uint64_t first, std::uint64_t count) noexcept {
  anew_ = false;
  draft_ratio_ = ratio_;
  first_ = first;
  newest_ = first + count - 1;
  joined_ = first > machine_.running;
  lowest_ = first;
  go_through(Pass::zones);
}

void OnlinePlan::replan() noexcept {
  anew_ = true;
  draft_ratio_ = wished_;
  first_ = machine_.running;
  newest_ = absorbed_ - 1;
  lowest_ = first_;
  go_through(Pass::zones);
}

void OnlinePlan::go_through(Pass pass) noexcept {
  pass_ = pass;
  next_ = pass == Pass::forget ? lowest_ : pass == Pass::pieces ? changed_ : newest_;
}

void OnlinePlan::visit() noexcept {
  switch (pass_) {
    case Pass::none:
    case Pass::complete:
      return;
    case Pass::forget:
      --left_;
      next_ = std::max(next_, machine_.running);
      entries_[next_ & mask_].plan.forget(draft());
      entries_[next_ & mask_].start.forget(draft());
      if (next_++ >= newest_) absorb(first_, 1);
      return;
    case Pass::zones:
      left_ -= next_ >= absorbed_ ? first_visit : 2;
      return visit_zones();
    case Pass::pieces:
      left_ -= 5;
      return visit_pieces();
    case Pass::speeds:
      --left_;
      return visit_speeds();
  }
}

void OnlinePlan::take_over() noexcept {
  --left_;
  ++version_;
  absorbed_ = newest_ + 1;
  ratio_ = draft_ratio_;
  pass_ = Pass::none;
  anew_ = false;
}

void OnlinePlan::refuse() noexcept {
  --left_;
  if (newest_ == first_) stop_before(first_);
  go_through(Pass::forget);
}

}  // namespace shapegcode
