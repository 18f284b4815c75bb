// Motion of one axis to a target that may change in any period, nearly as fast as its limits allow.
#pragma once

#include "planner/landing.hpp"

namespace shapegcode {

/// What the differences of the positions keep, per s, s^2 and s^3.
struct TrackerLimits {
  double speed = 0.0, acceleration = 0.0, jerk = 0.0;
};

/// A constant jerk in every period. The work of a period is bounded: some hundred tries at the most, where the end of a
/// motion begins, of which each solves for three jerks.
class AxisTracker {
 public:
  explicit AxisTracker(double period_s = 0.001) noexcept : period_s_(period_s) {}

  void restart(double position, double velocity = 0.0, double acceleration = 0.0) noexcept;
  /// One period on towards a goal, which may be infinite. A lower speed is reached as soon as the limits allow; a goal
  /// that cannot be reached without going past it is come back to.
  void step(double goal, const TrackerLimits& limits) noexcept;
  /// One period on towards a speed, with its sign.
  void step_to_speed(double speed, const TrackerLimits& limits) noexcept;

  /// Whether a stop before a goal is still possible after another period; `sign`: the side on which that is.
  [[nodiscard]] bool leaves_room(double goal, double sign, const TrackerLimits& limits) const noexcept;

  [[nodiscard]] double position() const noexcept { return position_; }
  [[nodiscard]] double velocity() const noexcept { return state_.speed; }
  [[nodiscard]] double acceleration() const noexcept { return state_.acceleration; }
  [[nodiscard]] bool at_rest() const noexcept { return state_.speed == 0.0 && state_.acceleration == 0.0; }

 private:
  [[nodiscard]] double jerk_to_speed(double speed, const TrackerLimits& limits) const noexcept;
  bool land(double goal, const TrackerLimits& limits) noexcept;
  void move(double jerk) noexcept;

  double period_s_;
  double position_ = 0.0, goal_ = 0.0;
  AlongPath state_;  // its speed has a sign here
  Landing landing_;
};

}  // namespace shapegcode
