#pragma once

#include <vector>

#include "shapegcode/controller.hpp"
#include "shapegcode/mode.hpp"
#include "shapegcode/plant/feed_drive.hpp"

// The machine that the example controls, in one place: what to change for another one.

struct Machine {
  double period_s = 0.001;
  double max_speed_mm_per_s = 250.0;  // of every axis
  double max_acceleration_mm_per_s2 = 3000.0;
  double max_jerk_mm_per_s3 = 100'000.0;
  double rapid_mm_per_s = 200.0;
  double contour_tolerance_mm = 0.02;
  double spindle_time_s = 0.5;  // until the spindle has its speed
  double feed_forward_ratio = 1.0;
  bool has_friction = false;  // in the guideways: then the drives are not linear any more
  std::vector<shapegcode::Mode> modes = {{46.0, 0.02, 1.0}, {58.0, 0.02, 1.0}};  // of X and Y
};

/// Limits of every axis, and a shaper whose zeros lie on both modes.
shapegcode::ControllerSettings settings_of(const Machine& machine);

/// Position and speed loop, ball screw and table of an axis (0, 1, 2), with its mode.
shapegcode::FeedDriveParameters drive_of(const Machine& machine, int axis);

/// A drive as the control sees it: a set-point goes in, and where the table is comes out. It is simulated; on a machine
/// this is the servo card, and all that is asked for here comes from its feedback.
class Drive {
 public:
  Drive(const Machine& machine, int axis);

  /// Position in mm, with the speed and the acceleration that belong to it. What is fed forward is the speed, and by
  /// how much more the speed loop must be asked for so that it gives the force m a + c v: its integral gives a part of
  /// that by itself, with its time constant. As the drive takes nothing but positions, all of it is asked for as a
  /// lead.
  double step(double position, double velocity, double acceleration) noexcept {
    const double asked = lag_by_acceleration_s_ * acceleration + lag_by_velocity_ * velocity;  // mm/s
    const double lead = velocity + asked - integral_;
    integral_ += integral_share_ * (asked - integral_);
    return drive_.step(position + feed_forward_ratio_ / position_gain_per_s_ * lead);
  }
  void reset(double position_mm) noexcept { drive_.reset(position_mm); }

 private:
  shapegcode::FeedDriveRealTime drive_;
  double feed_forward_ratio_, position_gain_per_s_;
  double lag_by_acceleration_s_, lag_by_velocity_, integral_share_;
  double integral_ = 0.0;
};
