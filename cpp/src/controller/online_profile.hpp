// The profile of a path that grows while it is run: the distance at each period. Of plan_speed it has the phases; where
// the window holds the path it gives the same distances, bit for bit.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>

#include "controller/online_plan.hpp"

namespace shapegcode {

/// Highest speed of so many periods at least, and of twice as many at most.
class RecentSpeed {
 public:
  explicit RecentSpeed(double periods) : periods_(static_cast<int>(periods)) {}
  void reset() noexcept { since_ = before_ = 0.0; }
  void add(double speed) noexcept {
    since_ = std::max(since_, speed);
    if (++count_ <= periods_) return;
    before_ = since_;
    since_ = speed;
    count_ = 0;
  }
  [[nodiscard]] double highest() const noexcept { return std::max(since_, before_); }

 private:
  int periods_;
  int count_ = 0;
  double since_ = 0.0;
  double before_ = 0.0;
};

class OnlineProfile {
 public:
  OnlineProfile(SegmentRing& ring, const MotionLimits& limits, std::size_t window, double period_s)
      : ring_(&ring),
        plan_(ring, limits, window),
        period_s_(period_s),
        recent_(std::ceil(limits.jerk_time_s / period_s)) {}

  /// At rest before segment `next`, the first one of a motion to come. Nothing is known of any.
  void restart(std::uint64_t next) noexcept;
  /// Looks at the segments before `pushed`, which are in the ring, and at the override: a portion of that work.
  void look_ahead(std::uint64_t pushed) noexcept;
  /// One period on. `settled`: what follows the profile is at rest as well, so that a motion may restart.
  void advance(bool settled) noexcept;

  /// Ratio of the programmed feeds: 0 stops as `stop` does, another one holds as soon as the path is planned with it.
  void override_feeds(double ratio) noexcept;
  /// Come to rest along the path, or go on.
  void stop(bool stopped) noexcept;

  /// Segments before this one are seen.
  [[nodiscard]] std::uint64_t absorbed() const noexcept { return plan_.absorbed(); }
  /// Segment that is being run, or that comes next.
  [[nodiscard]] std::uint64_t running() const noexcept { return running_; }
  /// Segments before this one have been entered.
  [[nodiscard]] std::uint64_t entered() const noexcept { return within_segment() ? running_ + 1 : running_; }
  [[nodiscard]] double distance() const noexcept { return distance_; }
  [[nodiscard]] double speed() const noexcept { return speed_now_; }
  [[nodiscard]] bool at_rest() const noexcept { return speed_now_ == 0.0 && state_ != State::running; }
  /// At rest with nothing left to run.
  [[nodiscard]] bool ran_out() const noexcept { return !within_segment() && !waiting_ && running_ == absorbed(); }
  /// What the last look_ahead did, see OnlinePlan::portion.
  [[nodiscard]] int looked() const noexcept { return plan_.done(); }
  /// True once after a motion began with its distances counted again from zero: whoever smooths them restarts too.
  [[nodiscard]] bool has_restarted() noexcept;

 private:
  enum class State : std::uint8_t {
    rest,     // before running_, which is at its start; nothing is generated
    stopped,  // within a segment
    running,
  };

  // Pieces of the segment that is being run; their start_speed: of both passes.
  struct Remaining {
    std::array<Piece, max_pieces> pieces{};
    std::array<bool, max_pieces> reduced{};
    std::size_t count = 0;
  };

  [[nodiscard]] bool within_segment() const noexcept { return state_ != State::rest; }
  [[nodiscard]] Remaining remaining_beyond(double offset, bool as_planned, std::uint64_t version) const noexcept;
  [[nodiscard]] double start_after(const Remaining& remaining, std::size_t piece, std::uint64_t version) const noexcept;
  void begin() noexcept;
  void enter(std::uint64_t index) noexcept;
  void regenerate() noexcept;
  bool next_phase() noexcept;
  bool next_ramps() noexcept;
  bool next_ramps_down(std::size_t piece) noexcept;
  [[nodiscard]] bool comes_too_late() const noexcept;
  [[nodiscard]] bool slows_down_before(std::uint64_t index) const noexcept;
  [[nodiscard]] bool refuses() const noexcept;
  void take_over() noexcept;
  void turn_off(bool off) noexcept;
  [[nodiscard]] bool fits(std::uint64_t version) const noexcept;
  void come_to_rest() noexcept;
  [[nodiscard]] bool may_run(double distance, double speed) noexcept;

  static constexpr double rounding = 1e-9;  // relative, of a speed that the plan allows

  SegmentRing* ring_;
  OnlinePlan plan_;
  double period_s_;
  double asked_ = 1.0;  // ratio of the feeds

  std::uint64_t running_ = 0;

  State state_ = State::rest;
  bool stop_ = false;       // on request
  bool off_ = false;        // by an override of 0
  bool slow_down_ = false;  // faster than the path now allows
  bool waiting_ = false;
  bool replanned_ = false;  // since the last motion
  bool has_restarted_ = false;
  bool changed_ = false;  // the phases to come are not those of the plan

  std::int64_t tick_ = 0;
  double distance_ = 0.0;
  double speed_now_ = 0.0;
  RecentSpeed recent_;
  SpeedPhase phase_{};
  bool has_phase_ = false;
  double length_ = 0.0;  // of all ramps so far
  double speed_ = 0.0;   // at their end
  std::array<Ramp, max_phases> ramps_{};
  std::size_t ramp_ = 0;
  std::size_t ramp_count_ = 0;
  Remaining remaining_;
  std::size_t piece_ = 0;   // the next one to be made ramps of
  double piece_end_ = 0.0;  // distance at which the one before it ends
};

}  // namespace shapegcode
