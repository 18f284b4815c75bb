// The profile of a path that grows while it is run: look-ahead over a window of segments, and the distance at each
// period. Of plan_speed it has the limits, zones, pieces and phases; where the window holds the path it gives the same
// distances, bit for bit.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "motion/pieces.hpp"
#include "shapegcode/controller.hpp"

namespace shapegcode {

/// A segment in the queue: first what the planning thread finds out, then what belongs to the look-ahead.
struct QueuedSegment {
  Segment segment;
  std::array<double, most_following_axes> following_start{}, following_end{};
  std::array<double, most_following_axes> following_rate{};  ///< per mm of the way
  double feed = 0.0;                                         ///< programmed, with the ratio of arcs
  double hard_limit = 0.0;                                   ///< speed whatever the override
  double following_acceleration = MotionLimits::none;        ///< of the way
  double corner = MotionLimits::none;                        ///< speed at which it is entered
  Zone jump;                                                 ///< what jumps there, as far as it counts
  Zone open_end;                                             ///< the same of whatever may follow
  double passed = 0.0;                                       ///< highest speed at which it is ever entered
  double fastest = 0.0;                                      ///< speed at which it can ever be run
  double beside_turn = MotionLimits::none;                   ///< its speed beside a jump of direction
  std::array<double, 2> line_acceleration{};                 ///< of a line, whatever its speed; and beside a jump

  double distance = 0.0;  ///< of its start
  double limit = 0.0;
  ZoneSet at_start{}, at_end{};
  ZoneSet behind{};  ///< at its start, of slow corners and segments before it, whatever the override
  std::array<Piece, most_pieces> pieces{};  ///< their start_speed: of the forward pass
  std::array<bool, most_pieces> eased{};
  std::size_t piece_count = 0;
  double forward = 0.0;  ///< speed at its start, of the forward pass
  double start = 0.0;    ///< of both
};

/// Acceleration along a segment that is run at most at `speed`; `eased`: beside a jump.
[[nodiscard]] double acceleration_along(const QueuedSegment& entry, double speed, const MotionLimits& limits,
                                        bool eased) noexcept;

/// A ring of segments: `index & mask` is the place of segment `index`, counted from the first ever pushed.
class SegmentRing {
 public:
  explicit SegmentRing(std::size_t capacity) : places_(capacity) {}
  [[nodiscard]] QueuedSegment& operator[](std::uint64_t index) noexcept {
    return places_[index & (places_.size() - 1)];
  }
  [[nodiscard]] std::size_t capacity() const noexcept { return places_.size(); }

 private:
  std::vector<QueuedSegment> places_;
};

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
  OnlineProfile(SegmentRing& ring, const MotionLimits& limits, double jerk_s, double period_s)
      : ring_(&ring), limits_(limits), jerk_s_(jerk_s), period_s_(period_s), recent_(std::ceil(jerk_s / period_s)) {}

  /// At rest before segment `next`, the first one of a motion to come. Nothing is known of any.
  void restart(std::uint64_t next) noexcept;
  /// Sees segment `absorbed()`, which is in the ring. Work bounded by the window.
  void absorb() noexcept;
  /// One period on. `settled`: what follows the profile is at rest as well, so that a motion may begin anew.
  void advance(bool settled) noexcept;

  /// Ratio of the programmed feeds; 0 stops as `stop` does. Work bounded by the window.
  void override_feeds(double ratio) noexcept;
  /// Come to rest along the path, or go on.
  void stop(bool stopped) noexcept;
  /// While true, a motion at rest does not begin.
  void wait(bool waiting) noexcept { waiting_ = waiting; }

  [[nodiscard]] std::uint64_t absorbed() const noexcept { return absorbed_; }
  /// Segment that is being run, or that comes next.
  [[nodiscard]] std::uint64_t running() const noexcept { return running_; }
  [[nodiscard]] double distance() const noexcept { return distance_; }
  [[nodiscard]] double speed() const noexcept { return speed_now_; }
  [[nodiscard]] bool at_rest() const noexcept { return speed_now_ == 0.0 && state_ != State::running; }
  /// At rest with nothing left to run.
  [[nodiscard]] bool ran_out() const noexcept { return !within_segment() && running_ == absorbed_; }
  /// True once after a motion began with its distances counted anew: whoever smooths them begins anew too.
  [[nodiscard]] bool began_anew() noexcept;

 private:
  enum class State : std::uint8_t {
    rest,     // before running_, which is at its start; nothing is generated
    stopped,  // within a segment
    running,
  };

  // Pieces of the segment that is being run; their start_speed: of both passes.
  struct Remaining {
    std::array<Piece, most_pieces> pieces{};
    std::array<bool, most_pieces> eased{};
    std::size_t count = 0;
  };

  [[nodiscard]] bool within_segment() const noexcept { return state_ != State::rest; }
  [[nodiscard]] double limit_of(const QueuedSegment& entry) const noexcept;
  [[nodiscard]] ZoneSet zones_between(std::uint64_t from, std::uint64_t into) noexcept;
  void split(QueuedSegment& entry) noexcept;
  [[nodiscard]] double acceleration_of(const QueuedSegment& entry, double speed, bool eased) const noexcept;
  void pass_forward(std::uint64_t first) noexcept;
  bool pass_backward(std::uint64_t first_changed) noexcept;
  std::uint64_t zones_backward(std::uint64_t newest, bool all) noexcept;
  [[nodiscard]] Remaining remaining_beyond(double offset, bool as_planned) const noexcept;
  [[nodiscard]] double start_after(const Remaining& remaining, std::size_t piece) const noexcept;
  void begin() noexcept;
  void enter(std::uint64_t index) noexcept;
  void generate_anew() noexcept;
  bool next_phase() noexcept;
  bool next_ramps() noexcept;
  bool next_ramps_down(std::size_t piece) noexcept;
  [[nodiscard]] bool comes_too_late(std::uint64_t index) noexcept;
  [[nodiscard]] bool slows_down_before(std::uint64_t index) noexcept;
  void stop_before(std::uint64_t index) noexcept;
  void zones_at_start(std::uint64_t index) noexcept;
  void connect(std::uint64_t newest) noexcept;
  [[nodiscard]] bool fits() const noexcept;
  void come_to_rest() noexcept;
  [[nodiscard]] bool may_run(double distance, double speed) noexcept;

  static constexpr double rounding = 1e-9;  // relative, of a speed that the plan allows

  SegmentRing* ring_;
  MotionLimits limits_;
  double jerk_s_;
  double period_s_;
  double ratio_ = 1.0;

  std::uint64_t absorbed_ = 0;
  std::uint64_t running_ = 0;

  State state_ = State::rest;
  bool stop_ = false;       // on request
  bool slow_down_ = false;  // faster than the path now allows
  bool waiting_ = false;
  bool began_anew_ = false;
  bool changed_ = false;  // the phases to come are not those of the plan

  std::int64_t tick_ = 0;
  double distance_ = 0.0;
  double speed_now_ = 0.0;
  RecentSpeed recent_;
  SpeedPhase phase_{};
  bool has_phase_ = false;
  double length_ = 0.0;  // of all ramps so far
  double speed_ = 0.0;   // at their end
  std::array<Ramp, most_phases> ramps_{};
  std::size_t ramp_ = 0;
  std::size_t ramp_count_ = 0;
  Remaining remaining_;
  std::size_t piece_ = 0;   // the next one to be made ramps of
  double piece_end_ = 0.0;  // distance at which the one before it ends
};

}  // namespace shapegcode
