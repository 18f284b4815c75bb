// The motion of a control: phases out of the plan, one distance a period.
#include "controller/online_profile.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

#include "motion/speed_limits.hpp"

namespace shapegcode {
namespace {

constexpr double longest_time_s = 32768.0;  // after which times are counted again from zero

}  // namespace

void OnlineProfile::restart(std::uint64_t next) noexcept {
  plan_.restart(next);
  running_ = next;
  state_ = State::rest;
  stop_ = replanned_ = false;
  distance_ = speed_now_ = 0.0;
  recent_.reset();
}

bool OnlineProfile::has_restarted() noexcept {
  const bool restarted = has_restarted_;
  has_restarted_ = false;
  return restarted;
}

// What of the running segment lies beyond `offset`: with the speeds of the forward pass as the plan has them, or as
// fast as what follows lets it be.
OnlineProfile::Remaining OnlineProfile::remaining_beyond(double offset, bool as_planned,
                                                         std::uint64_t version) const noexcept {
  const SegmentPlan& entry = plan_.segment(running_, version);
  Remaining remaining;
  double begin = 0.0;
  for (std::size_t k = 0; k < entry.piece_count; ++k) {
    const double end = begin + entry.pieces[k].length;
    if (end > offset || k + 1 == entry.piece_count) {
      Piece& piece = remaining.pieces[remaining.count];
      piece = entry.pieces[k];
      if (begin < offset) piece.length = std::max(end - offset, 0.0);
      if (!as_planned) piece.start_speed = MotionLimits::none;
      remaining.reduced[remaining.count++] = entry.reduced[k];
    }
    begin = end;
  }
  for (std::size_t k = remaining.count; k-- > 0;) {
    Piece& piece = remaining.pieces[k];
    piece.start_speed = std::min(piece.start_speed, speed_beyond(piece, start_after(remaining, k, version)));
  }
  return remaining;
}

double OnlineProfile::start_after(const Remaining& remaining, std::size_t piece, std::uint64_t version) const noexcept {
  if (piece + 1 < remaining.count) return remaining.pieces[piece + 1].start_speed;
  const std::uint64_t end = version == plan_.version() ? absorbed() : plan_.newest() + 1;
  if (running_ + 1 == end || (*ring_)[running_].segment.stop_at_end) return 0.0;
  return plan_.start(running_ + 1, version);
}

void OnlineProfile::enter(std::uint64_t index) noexcept {
  running_ = index;
  remaining_ = remaining_beyond(0.0, true, plan_.version());
  piece_ = 0;
}

// Whether the plan allows a speed where the machine is.
bool OnlineProfile::may_run(double distance, double speed) noexcept {
  if (piece_ == 0) return true;
  Piece piece = remaining_.pieces[piece_ - 1];
  piece.length = std::max(piece_end_ - distance, 0.0);
  return speed <= speed_beyond(piece, start_after(remaining_, piece_ - 1, plan_.version())) * (1.0 + rounding);
}

// The phases to come begin at the last set-point's distance and speed.
void OnlineProfile::regenerate() noexcept {
  changed_ = false;
  const double time_s = static_cast<double>(tick_ - 2) * period_s_;  // of the last set-point
  phase_ = {time_s, 0.0, distance_, speed_now_, 0.0};
  has_phase_ = false;
  length_ = distance_;
  speed_ = speed_now_;
  ramp_ = ramp_count_ = 0;
  remaining_ = remaining_beyond(distance_ - (*ring_)[running_].distance, false, plan_.version());
  piece_ = 0;
  state_ = State::running;
  slow_down_ = speed_ > remaining_.pieces[0].start_speed * (1.0 + rounding);
}

// The ramp down within a piece, as steep as its present speed lets it be.
bool OnlineProfile::next_ramps_down(std::size_t piece) noexcept {
  const double length = remaining_.pieces[piece].length;
  const double acceleration = plan_.acceleration_of((*ring_)[running_], speed_, remaining_.reduced[piece]);
  const double braking = speed_ * speed_ / (2.0 * acceleration);
  const double end = braking < length ? 0.0 : std::sqrt(std::max(0.0, speed_ * speed_ - 2.0 * acceleration * length));
  ramp_ = 0;
  ramp_count_ = 1;
  ramps_[0] = {speed_, end, std::min(braking, length)};
  speed_ = end;
  return true;
}

// Ramps of the next piece; false where the motion ends.
bool OnlineProfile::next_ramps() noexcept {
  const bool down = stop_ || slow_down_ || off_;
  if (down && speed_ <= 0.0) return false;
  while (piece_ == remaining_.count) {
    if (running_ + 1 == absorbed() || (*ring_)[running_].segment.stop_at_end) return false;
    enter(running_ + 1);
  }
  const Piece& piece = remaining_.pieces[piece_++];
  piece_end_ = length_ + piece.length;
  if (down) return next_ramps_down(piece_ - 1);
  const double end = std::min(start_after(remaining_, piece_ - 1, plan_.version()), speed_beyond(piece, speed_));
  ramp_ = 0;
  ramp_count_ = ramps_of(piece, speed_, end, length_, ramps_);
  speed_ = end;
  return true;
}

// The phase after the present one, or more of it; false where the motion ends.
bool OnlineProfile::next_phase() noexcept {
  while (ramp_ == ramp_count_) {
    if (!next_ramps()) return false;
  }
  const Ramp ramp = ramps_[ramp_++];
  if (ramp.distance <= 0.0 || ramp.v0 + ramp.v1 <= 0.0) return true;
  const double duration = PhaseJoin::duration_s(ramp.v0, ramp.v1, ramp.distance);
  const double acceleration = (ramp.v1 - ramp.v0) / duration;
  if (has_phase_ && PhaseJoin::joins(phase_, ramp.v0, acceleration)) {
    phase_.duration_s += duration;
  } else {
    phase_ = {phase_.start_s + phase_.duration_s, duration, length_, ramp.v0, acceleration};
    has_phase_ = true;
  }
  length_ += ramp.distance;
  return true;
}

// A motion begins with segment running_, where distances are counted again from zero.
void OnlineProfile::begin() noexcept {
  tick_ = 1;
  has_restarted_ = true;
  replanned_ = false;
  distance_ = 0.0;
  recent_.reset();
  phase_ = {};
  has_phase_ = changed_ = slow_down_ = false;
  length_ = 0.0;
  speed_ = 0.0;
  ramp_ = ramp_count_ = 0;
  enter(running_);
  state_ = State::running;
}

void OnlineProfile::come_to_rest() noexcept {
  speed_now_ = 0.0;
  const QueuedSegment& entry = (*ring_)[running_];
  if (piece_ == remaining_.count && ramp_ == ramp_count_ &&
      length_ >= (entry.distance + entry.segment.length_mm) * (1.0 - 8.0 * std::numeric_limits<double>::epsilon()) -
                     1e-12 * entry.segment.length_mm) {
    distance_ = entry.distance + entry.segment.length_mm;
    // A hold may end where a segment does, within a motion.
    const bool goes_on = running_ + 1 < absorbed() && !entry.segment.stop_at_end;
    ++running_;
    state_ = goes_on ? State::stopped : State::rest;
  } else {
    distance_ = length_;
    state_ = State::stopped;
  }
}

void OnlineProfile::advance(bool settled) noexcept {
  ++tick_;
  recent_.add(speed_now_);
  // Not before the set-points have come to rest: they are still before the corner.
  const bool waits = !settled || waiting_ || stop_ || off_;
  if (state_ == State::rest && running_ < absorbed() && !waits) begin();
  if ((state_ == State::running && (changed_ || (slow_down_ && may_run(distance_, speed_now_)))) ||
      (state_ == State::stopped && !stop_ && !off_)) {
    regenerate();
  }
  if (state_ != State::running) {
    changed_ = false;
    return;
  }
  if (phase_.start_s > longest_time_s) {
    const auto periods = static_cast<std::int64_t>(phase_.start_s / period_s_);
    tick_ -= periods;
    phase_.start_s -= static_cast<double>(periods) * period_s_;
  }
  const double time_s = static_cast<double>(tick_ - 1) * period_s_;
  while (time_s >= phase_.start_s + phase_.duration_s) {
    if (!next_phase()) {
      come_to_rest();
      return;
    }
  }
  distance_ = phase_.distance_at(time_s);
  speed_now_ = std::max(0.0, phase_.speed_mm_per_s + phase_.acceleration_mm_per_s2 * (time_s - phase_.start_s));
}

}  // namespace shapegcode
