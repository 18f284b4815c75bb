// Settings of the C interface, set one number at a time.
#include "c/settings.hpp"

#include <algorithm>
#include <cmath>
#include <memory>
#include <new>
#include <span>
#include <utility>
#include <vector>

#include "base/refuse.hpp"
#include "shapegcode/error.hpp"
#include "shapegcode/filter.hpp"
#include "shapegcode/limits.hpp"

namespace shapegcode::c {
namespace {

static_assert(SHAPEGCODE_MOST_AXES == max_controller_axes);
static_assert(SHAPEGCODE_MOST_FOLLOWING_AXES == max_following_axes);

// What fits into every kind of whole number that is set.
constexpr double largest_count = 2147483647.0;

bool is_count(double value) noexcept { return value >= 0.0 && value <= largest_count && value == std::floor(value); }
bool set_flag(bool& flag, double value) noexcept {
  if (value == 0.0 || value == 1.0) flag = value != 0.0;
  return value == 0.0 || value == 1.0;
}

double* double_of(ControllerSettings& control, int number) noexcept {
  switch (number) {
    case SHAPEGCODE_PERIOD_S:
      return &control.period_s;
    case SHAPEGCODE_CONTOUR_TOLERANCE_MM:
      return &control.contour_tolerance_mm;
    case SHAPEGCODE_SMOOTHING_TIME_S:
      return &control.smoothing_time_s;
    case SHAPEGCODE_TIME_CONSTANT_S:
      return &control.limits.time_constant_s;
    case SHAPEGCODE_JERK_TIME_S:
      return &control.limits.jerk_time_s;
    case SHAPEGCODE_CORNER_STOP_ANGLE_RAD:
      return &control.limits.corner_stop_angle_rad;
    case SHAPEGCODE_BLOCK_TIME_S:
      return &control.limits.block_time_s;
    case SHAPEGCODE_JUNCTION_DEVIATION_MM:
      return &control.limits.junction_deviation_mm;
    case SHAPEGCODE_CENTRIPETAL_ACCELERATION:
      return &control.limits.centripetal_acceleration_mm_per_s2;
    case SHAPEGCODE_POLYLINE_ACCELERATION:
      return &control.limits.polyline_acceleration_mm_per_s2;
    case SHAPEGCODE_ARC_FEED_RATIO:
      return &control.limits.arc_feed_ratio;
    case SHAPEGCODE_SPINDLE_BANDWIDTH_HZ:
      return &control.spindle_bandwidth_hz;
    case SHAPEGCODE_FADE_TIME_S:
      return &control.fade_time_s;
    default:
      return nullptr;
  }
}

// Whole numbers and flags; false: it is none of them, or not such a value.
bool set_whole(shapegcode_settings& settings, int number, double value) noexcept {
  ControllerSettings& control = settings.control;
  if (!is_count(value)) return false;
  switch (number) {
    case SHAPEGCODE_FOLLOWING_AXES:
      if (value > static_cast<double>(max_following_axes)) return false;
      settings.following = static_cast<std::size_t>(value);
      return true;
    case SHAPEGCODE_WINDOW:
      control.window = static_cast<std::size_t>(value);
      return true;
    case SHAPEGCODE_QUEUE:
      control.queue = static_cast<std::size_t>(value);
      return true;
    case SHAPEGCODE_RETRACE_PERIODS:
      control.retrace_periods = static_cast<std::size_t>(value);
      return true;
    case SHAPEGCODE_LEAD_PERIODS:
      control.lead_periods = static_cast<int>(value);
      return true;
    case SHAPEGCODE_PLANS_IN_STEP:
      return set_flag(control.plans_in_step, value);
    case SHAPEGCODE_CONTOUR_CORRECTION:
      return set_flag(control.contour_correction, value);
    case SHAPEGCODE_LAW: {
      bool is_jerk_limited = control.limits.law == AccelerationLaw::jerk_limited;
      const bool is_law = set_flag(is_jerk_limited, value);
      control.limits.law = is_jerk_limited ? AccelerationLaw::jerk_limited : AccelerationLaw::constant_time;
      return is_law;
    }
    default:
      return false;
  }
}

// Of X, Y and Z.
double* leading_number(MotionLimits& limits, int number, int axis) noexcept {
  switch (number) {
    case SHAPEGCODE_MAX_FEED:
      return &limits.max_feed_mm_per_s[axis];
    case SHAPEGCODE_MAX_ACCELERATION:
      limits.law = AccelerationLaw::jerk_limited;
      return &limits.max_acceleration_mm_per_s2[axis];
    case SHAPEGCODE_MAX_JERK:
      return &limits.max_jerk_mm_per_s3[axis];
    case SHAPEGCODE_CORNER_SPEED_DIFFERENCE:
      return &limits.corner_speed_difference_mm_per_s[axis];
    case SHAPEGCODE_CONTOUR_ACCELERATION:
      return &limits.contour_acceleration_mm_per_s2[axis];
    default:
      return nullptr;
  }
}

double* following_number(FollowingLimits& limits, int number) noexcept {
  switch (number) {
    case SHAPEGCODE_MAX_FEED:
      return &limits.max_feed;
    case SHAPEGCODE_MAX_ACCELERATION:
      return &limits.max_acceleration;
    case SHAPEGCODE_MAX_JERK:
      return &limits.max_jerk;
    case SHAPEGCODE_TOLERANCE:
      return &limits.tolerance;
    default:
      return nullptr;
  }
}

// Of any axis.
double* axis_number(AxisNumbers& axis, int number) noexcept {
  switch (number) {
    case SHAPEGCODE_TRAVEL_LOW:
      return &axis.travel.low;
    case SHAPEGCODE_TRAVEL_HIGH:
      return &axis.travel.high;
    case SHAPEGCODE_EMERGENCY_ACCELERATION:
      return &axis.emergency_acceleration.emplace(0.0);
    case SHAPEGCODE_OFFSET_MAX_FEED:
      return &axis.offset.max_feed;
    case SHAPEGCODE_OFFSET_MAX_ACCELERATION:
      return &axis.offset.max_acceleration;
    case SHAPEGCODE_OFFSET_MAX_JERK:
      return &axis.offset.max_jerk;
    case SHAPEGCODE_BACKLASH:
      return &axis.offset.backlash;
    default:
      return nullptr;
  }
}

Fir fir_of(const shapegcode_shaper& shaper) {
  return {std::vector<int>(shaper.delays, shaper.delays + shaper.count),
          std::vector<double>(shaper.taps, shaper.taps + shaper.count)};
}

bool is_whole(const shapegcode_shaper& shaper) noexcept { return shaper.delays != nullptr && shaper.taps != nullptr; }

// What a call comes to that may throw.
template <typename Call>
shapegcode_status status_of_setting(Call&& call) noexcept {
  try {
    std::forward<Call>(call)();
    return SHAPEGCODE_OK;
  } catch (const Error&) {
    return SHAPEGCODE_ERROR_ARGUMENT;
  } catch (...) {
    return SHAPEGCODE_ERROR_OUT_OF_MEMORY;
  }
}

double highest_acceleration(const ControllerSettings& control, std::size_t axis) {
  if (axis >= axis_count) return control.following[axis - axis_count].max_acceleration;
  return control.limits.max_acceleration_mm_per_s2[static_cast<Eigen::Index>(axis)];
}

}  // namespace

ControllerSettings settings_of(const shapegcode_settings& given) {
  ControllerSettings control = given.control;
  const std::size_t n = axis_count + given.following;
  for (std::size_t i = n; i < given.axes.size(); ++i) {
    if (given.axes[i].is_set) {
      throw Error(ErrorKind::argument, detail::message("axis {} is set, but the control has {} axes: "
                                                       "SHAPEGCODE_FOLLOWING_AXES",
                                                       i, n));
    }
  }
  const std::span axes = std::span(given.axes).first(n);
  for (const AxisNumbers& axis : axes.subspan(axis_count)) control.following.push_back(axis.following);
  const bool shapes_each = std::ranges::any_of(axes, [](const AxisNumbers& axis) { return axis.shaper.has_value(); });
  if (shapes_each) {
    std::vector<Fir> each;
    for (const AxisNumbers& axis : axes) each.push_back(axis.shaper.value_or(Fir({0}, {1.0})));
    control.shaper = std::move(each);
  }
  const bool brakes =
      std::ranges::any_of(axes, [](const AxisNumbers& axis) { return axis.emergency_acceleration.has_value(); });
  const bool moves = std::ranges::any_of(
      axes, [](const AxisNumbers& axis) { return axis.offset.max_feed != 0.0 || axis.offset.backlash != 0.0; });
  for (std::size_t i = 0; i < n; ++i) {
    control.travel.push_back(axes[i].travel);
    if (moves) control.offset.push_back(axes[i].offset);
    if (brakes) {
      control.emergency_acceleration.push_back(
          axes[i].emergency_acceleration.value_or(highest_acceleration(control, i)));
    }
  }
  return control;
}

}  // namespace shapegcode::c

using namespace shapegcode::c;

shapegcode_settings* shapegcode_settings_create(void) {
  try {
    return std::make_unique<shapegcode_settings>().release();
  } catch (...) {
    return nullptr;
  }
}

shapegcode_status shapegcode_settings_destroy(shapegcode_settings* settings) {
  const std::unique_ptr<shapegcode_settings> owned(settings);
  return SHAPEGCODE_OK;
}

shapegcode_status shapegcode_settings_set(shapegcode_settings* settings, int number, double value) {
  if (settings == nullptr) return SHAPEGCODE_ERROR_NULL;
  if (double* const target = double_of(settings->control, number)) {
    *target = value;
    return SHAPEGCODE_OK;
  }
  return set_whole(*settings, number, value) ? SHAPEGCODE_OK : SHAPEGCODE_ERROR_ARGUMENT;
}

shapegcode_status shapegcode_settings_set_axis(shapegcode_settings* settings, int number, int axis, double value) {
  if (settings == nullptr) return SHAPEGCODE_ERROR_NULL;
  if (axis < 0 || axis >= SHAPEGCODE_MOST_AXES) return SHAPEGCODE_ERROR_ARGUMENT;
  AxisNumbers& numbers = settings->axes[static_cast<std::size_t>(axis)];
  double* target = axis_number(numbers, number);
  if (target == nullptr) {
    target = axis < shapegcode::axis_count ? leading_number(settings->control.limits, number, axis)
                                           : following_number(numbers.following, number);
  }
  if (target == nullptr) return SHAPEGCODE_ERROR_ARGUMENT;
  *target = value;
  numbers.is_set = true;
  return SHAPEGCODE_OK;
}

shapegcode_status shapegcode_settings_set_shaper(shapegcode_settings* settings, int axis,
                                                 const shapegcode_shaper* shaper) {
  if (settings == nullptr || shaper == nullptr || !is_whole(*shaper)) return SHAPEGCODE_ERROR_NULL;
  if (axis < -1 || axis >= SHAPEGCODE_MOST_AXES) return SHAPEGCODE_ERROR_ARGUMENT;
  return status_of_setting([&] {
    if (axis < 0) {
      settings->control.shaper = fir_of(*shaper);
    } else {
      AxisNumbers& numbers = settings->axes[static_cast<std::size_t>(axis)];
      numbers.shaper = fir_of(*shaper);
      numbers.is_set = true;
    }
  });
}

shapegcode_status shapegcode_settings_add_shapers(shapegcode_settings* settings, const shapegcode_shaper* shapers,
                                                  size_t count) {
  if (settings == nullptr || shapers == nullptr) return SHAPEGCODE_ERROR_NULL;
  const std::span given(shapers, count);
  if (!std::ranges::all_of(given, is_whole)) return SHAPEGCODE_ERROR_NULL;
  if (count == 0) return SHAPEGCODE_ERROR_ARGUMENT;
  return status_of_setting([&] {
    std::vector<shapegcode::Fir> each;
    for (const shapegcode_shaper& shaper : given) each.push_back(fir_of(shaper));
    auto& others = settings->control.other_shapers;
    if (count == 1) {
      others.emplace_back(each.front());
    } else {
      others.emplace_back(std::move(each));
    }
  });
}

shapegcode_status shapegcode_settings_set_following_shaper(shapegcode_settings* settings, int axis,
                                                           const double* positions_mm, const shapegcode_shaper* shapers,
                                                           size_t count) {
  if (settings == nullptr || positions_mm == nullptr || shapers == nullptr) return SHAPEGCODE_ERROR_NULL;
  const std::span given(shapers, count);
  if (!std::ranges::all_of(given, is_whole)) return SHAPEGCODE_ERROR_NULL;
  return status_of_setting([&] {
    std::vector<shapegcode::Fir> filters;
    for (const shapegcode_shaper& shaper : given) filters.push_back(fir_of(shaper));
    settings->control.shaper = shapegcode::FollowingFir(shapegcode::VaryingFir(filters), axis,
                                                        std::vector<double>(positions_mm, positions_mm + count));
  });
}
