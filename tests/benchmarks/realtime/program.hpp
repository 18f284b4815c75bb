// What is run: a path without end as CAM writes it, and an operator at the panel. The same every time.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <numbers>

#include "shapegcode/controller.hpp"

namespace realtime {

using shapegcode::Activity;
using shapegcode::MotionController;
using shapegcode::PushResult;
using shapegcode::Segment;
using shapegcode::Vector3;

inline constexpr double period_s = 1e-3;

/// Jerk-limited, ZV shaper of 46 Hz, contour correction, X Y Z.
/// Another thread plans so many periods ahead; 0: step() does.
inline shapegcode::ControllerSettings settings_with(std::size_t window, int lead_periods = 0) {
  shapegcode::ControllerSettings settings;
  settings.period_s = period_s;
  settings.limits.law = shapegcode::AccelerationLaw::jerk_limited;
  settings.limits.max_feed_mm_per_s.setConstant(500.0);
  settings.limits.max_acceleration_mm_per_s2.setConstant(5000.0);
  settings.limits.max_jerk_mm_per_s3.setConstant(200'000.0);
  settings.contour_tolerance_mm = 0.02;
  settings.shaper = shapegcode::Fir({0, 11}, {0.516, 0.484});
  settings.contour_correction = true;
  settings.window = window;
  settings.queue = 1024;
  settings.plans_in_step = lead_periods == 0;
  settings.lead_periods = lead_periods;
  return settings;
}

/// A smooth curve within some 200 mm in lines of .1 to .5 mm; a quarter arc of 1 to 5 mm after each 60 of them, a sharp
/// corner after each 250, a long line at high feed after each 500.
class Program {
 public:
  Segment next() {
    ++made_;
    if (made_ % 500 == 0) return straight(20.0 + 40.0 * draw(), 300.0);
    if (made_ % 60 == 0) return arc(1.0 + 4.0 * draw());
    if (made_ % 250 == 0) heading_ += draw() < 0.5 ? 1.6 : -1.6;
    curvature_ += 0.02 * (draw() - 0.5) - 0.05 * curvature_;
    // Far out the way leads back.
    const double away = std::hypot(at_[0], at_[1]);
    if (away > 150.0) {
      const double home = std::remainder(std::atan2(-at_[1], -at_[0]) - heading_, 2.0 * std::numbers::pi);
      heading_ += std::clamp(home, -0.05, 0.05);
    }
    const double length = 0.1 + 0.4 * draw();
    heading_ += curvature_ * length;
    return straight(length, feed_);
  }
  [[nodiscard]] const Vector3& at() const noexcept { return at_; }

 private:
  double draw() noexcept {  // xorshift64*
    state_ ^= state_ >> 12;
    state_ ^= state_ << 25;
    state_ ^= state_ >> 27;
    return static_cast<double>((state_ * 0x2545F4914F6CDD1DULL) >> 11) * 0x1p-53;
  }
  Segment straight(double length, double feed) {
    const double climb = 0.1 * std::sin(1e-3 * static_cast<double>(made_));
    const Vector3 end = at_ + length * Vector3(std::cos(heading_), std::sin(heading_), climb);
    const Segment segment = shapegcode::make_line(at_, end, feed, line());
    at_ = end;
    return segment;
  }
  Segment arc(double radius) {
    const double side = draw() < 0.5 ? 1.0 : -1.0;
    const Vector3 centre = at_ + side * radius * Vector3(-std::sin(heading_), std::cos(heading_), 0.0);
    heading_ += side * 0.5 * std::numbers::pi;
    const Vector3 end = centre - side * radius * Vector3(-std::sin(heading_), std::cos(heading_), 0.0);
    const Segment segment = shapegcode::make_arc(at_, end, centre, side * 0.5 * std::numbers::pi, 2, feed_, line());
    at_ = end;
    return segment;
  }
  [[nodiscard]] std::uint32_t line() const noexcept { return static_cast<std::uint32_t>(made_); }

  Vector3 at_ = Vector3::Zero();
  double heading_ = 0.0;
  double curvature_ = 0.0;
  double feed_ = 100.0;
  std::uint64_t made_ = 0;
  std::uint64_t state_ = 0x9E3779B97F4A7C15ULL;
};

/// Turns the override by ten clicks of 10 % every 20 s, holds for .2 s every 50 s.
class Operator {
 public:
  /// Before a step: true if the next step has something new to follow.
  bool act(MotionController& control, Activity activity) noexcept {
    ++steps_;
    if (activity == Activity::held && ++held_ == 200) {
      held_ = 0;
      control.resume();
      return true;
    }
    if (steps_ % 50'000 == 0) {
      control.hold();
      return true;
    }
    const std::uint64_t since_turn = steps_ % 20'000;
    if (since_turn % 50 != 0 || since_turn >= 500) return false;
    percent_ += up_ ? 10 : -10;
    if (percent_ >= 150 || percent_ <= 50) up_ = !up_;
    control.feed_override(0.01 * percent_);
    return true;
  }

 private:
  std::uint64_t steps_ = 0;
  int held_ = 0;
  int percent_ = 100;
  bool up_ = false;
};

}  // namespace realtime
