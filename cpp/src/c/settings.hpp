#pragma once

#include <array>
#include <cstddef>
#include <optional>
#include <vector>

#include "shapegcode/controller.hpp"
#include "shapegcode/samples.hpp"
#include "shapegcode/shapegcode.h"

namespace shapegcode::c {

[[nodiscard]] inline Vector3 vector_of(const double* values) noexcept { return {values[0], values[1], values[2]}; }

/// Numbers set for an axis, whether the control has the axis or not.
struct AxisNumbers {
  FollowingLimits following;
  AxisTravel travel;
  OffsetLimits offset;
  std::optional<double> emergency_acceleration;
  std::optional<Fir> shaper;
  bool is_set = false;
};

}  // namespace shapegcode::c

// What the header calls so.
struct shapegcode_settings {
  shapegcode::ControllerSettings control;
  std::size_t following = 0;
  std::array<shapegcode::c::AxisNumbers, shapegcode::max_controller_axes> axes;
};

namespace shapegcode::c {

/// Throws Error(argument).
[[nodiscard]] ControllerSettings settings_of(const shapegcode_settings& given);

}  // namespace shapegcode::c
