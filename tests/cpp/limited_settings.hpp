// Settings of a control whose axes are all limited alike, for its tests.
#pragma once

#include "shapegcode/controller.hpp"

namespace shapegcode::tests {

inline constexpr double max_speed = 200.0;
inline constexpr double max_acceleration = 1000.0;
inline constexpr double max_jerk = 50000.0;

inline ControllerSettings limited() {
  ControllerSettings settings;
  settings.limits.law = AccelerationLaw::jerk_limited;
  settings.limits.max_feed_mm_per_s.setConstant(max_speed);
  settings.limits.max_acceleration_mm_per_s2.setConstant(max_acceleration);
  settings.limits.max_jerk_mm_per_s3.setConstant(max_jerk);
  return settings;
}

}  // namespace shapegcode::tests
