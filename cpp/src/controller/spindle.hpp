// A measured spindle, and motion synchronous with it.
#pragma once

#include <atomic>

#include "controller/axis_tracker.hpp"
#include "controller/sections.hpp"

namespace shapegcode {

/// Angle, speed and acceleration of a spindle, in revolutions and s.
struct SpindleState {
  double angle = 0.0, speed = 0.0, acceleration = 0.0;
};

/// From counts of an encoder: an observer with three equal poles, what it foresees, and a filter with three equal poles
/// behind that, whose output has a finite jerk. Both follow a constant acceleration without an error. Of the angle of a
/// ripple of frequency f at most the share 20 r^3 + 15 r^2 a + 3 r a^2 + a^3 / 6 is left, r = f / bandwidth and a = 2
/// pi f times what is foreseen, s: the observer's errors of angle, speed and acceleration, as the filter weighs them.
class Spindle {
 public:
  /// `ahead_s`: by how much later the motion leaves the control.
  Spindle(double bandwidth_hz, double period_s, double ahead_s) noexcept;

  void set_ahead(double ahead_s) noexcept { ahead_s_ = ahead_s; }
  /// Once in every period; from the thread that steps.
  void measure(double revolutions) noexcept;
  /// Or nothing was measured: it goes on as it did.
  void miss() noexcept;
  /// What the motion follows.
  [[nodiscard]] const SpindleState& smooth() const noexcept { return smooth_; }
  /// What it should be.
  [[nodiscard]] SpindleState foreseen() const noexcept;
  /// From any thread, revolutions per s.
  [[nodiscard]] double speed() const noexcept { return speed_.load(std::memory_order_relaxed); }

 private:
  void correct(double missing) noexcept;

  double pole_, period_s_, ahead_s_;
  double angle_gain_, speed_gain_, acceleration_gain_;
  SpindleState observed_, smooth_;
  std::atomic<double> speed_{0.0};
  bool is_measured_ = false;
  int impossible_ = 0;  // angles in a row
};

/// Along a straight segment: so much of it for each revolution. It waits for a whole revolution, catches up, is bound
/// to the angle, and comes to rest at the end.
class SpindleFeed {
 public:
  /// `limits`: of the axes.
  SpindleFeed(const AxisLimits& limits, double period_s) noexcept : limits_(limits), period_s_(period_s) {}

  /// At the start of a segment.
  void begin(const PlannedSegment& segment, const PlannedPoint& start) noexcept;
  /// One period on; `may_begin`: nothing holds it back. `brakes`: it comes to rest at once.
  void step(const Spindle& spindle, bool may_begin, bool brakes) noexcept;

  [[nodiscard]] bool waits() const noexcept { return phase_ == Phase::waits; }
  [[nodiscard]] bool at_end() const noexcept { return phase_ == Phase::ends && along_.at_rest() && at_length(); }
  [[nodiscard]] bool at_rest() const noexcept { return waits() || (phase_ == Phase::brakes && along_.at_rest()); }
  /// The spindle changed faster than the limits let the motion follow: it brakes.
  [[nodiscard]] bool is_lost() const noexcept { return is_lost_; }
  /// Behind what the angle asks for, below 0, mm.
  [[nodiscard]] double error_mm() const noexcept { return error_mm_; }
  [[nodiscard]] const PlannedPoint& point() const noexcept { return point_; }

 private:
  enum class Phase : std::uint8_t { waits, follows, ends, brakes };
  [[nodiscard]] bool at_length() const noexcept { return along_.position() >= segment_->segment.length_mm; }
  void wait(const Spindle& spindle, bool may_begin) noexcept;
  [[nodiscard]] bool asks_too_much(const SpindleState& now, const SpindleState& before) const noexcept;
  void write() noexcept;

  AxisLimits limits_;
  double period_s_;
  const PlannedSegment* segment_ = nullptr;
  Phase phase_ = Phase::waits;
  TrackerLimits along_limits_;
  double pitch_mm_ = 0.0, first_angle_ = 0.0;
  AxisTracker beside_;  // of what the angle asks for
  AxisTracker along_;
  double error_mm_ = 0.0;
  bool is_lost_ = false;
  SpindleState before_;
  PlannedPoint start_, point_;
};

}  // namespace shapegcode
