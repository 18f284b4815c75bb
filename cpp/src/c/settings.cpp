// Settings as C has them, into those of the library and back.
#include "c/settings.hpp"

#include <algorithm>
#include <cstddef>
#include <cstring>
#include <iterator>
#include <span>
#include <utility>
#include <vector>

#include "base/refuse.hpp"
#include "shapegcode/filter.hpp"
#include "shapegcode/motion.hpp"

namespace shapegcode::c {
namespace {

static_assert(SHAPEGCODE_MOST_AXES == max_controller_axes);
static_assert(SHAPEGCODE_MOST_FOLLOWING_AXES == max_following_axes);

// What the first version of the struct holds.
constexpr std::size_t first_settings_size = offsetof(shapegcode_settings, queue) + sizeof(std::size_t);

bool is_known_size(std::size_t size) noexcept {
  return size >= first_settings_size && size <= sizeof(shapegcode_settings);
}

void write_vector(const Vector3& vector, double* values) noexcept { std::copy_n(vector.data(), axis_count, values); }

MotionLimits limits_of(const shapegcode_limits& from) {
  if (from.law != SHAPEGCODE_CONSTANT_TIME && from.law != SHAPEGCODE_JERK_LIMITED) {
    detail::refuse("law is {}, must be {} (constant time) or {} (jerk limited)", from.law,
                   static_cast<int>(SHAPEGCODE_CONSTANT_TIME), static_cast<int>(SHAPEGCODE_JERK_LIMITED));
  }
  MotionLimits limits;
  const bool is_jerk_limited = from.law == SHAPEGCODE_JERK_LIMITED;
  limits.law = is_jerk_limited ? AccelerationLaw::jerk_limited : AccelerationLaw::constant_time;
  limits.time_constant_s = from.time_constant_s;
  limits.jerk_time_s = from.jerk_time_s;
  limits.max_feed_mm_per_s = vector_of(from.max_feed_mm_per_s);
  limits.max_acceleration_mm_per_s2 = vector_of(from.max_acceleration_mm_per_s2);
  limits.max_jerk_mm_per_s3 = vector_of(from.max_jerk_mm_per_s3);
  limits.corner_speed_difference_mm_per_s = vector_of(from.corner_speed_difference_mm_per_s);
  limits.corner_stop_angle_rad = from.corner_stop_angle_rad;
  limits.block_time_s = from.block_time_s;
  limits.junction_deviation_mm = from.junction_deviation_mm;
  limits.centripetal_acceleration_mm_per_s2 = from.centripetal_acceleration_mm_per_s2;
  limits.polyline_acceleration_mm_per_s2 = from.polyline_acceleration_mm_per_s2;
  limits.contour_acceleration_mm_per_s2 = vector_of(from.contour_acceleration_mm_per_s2);
  limits.arc_feed_ratio = from.arc_feed_ratio;
  return limits;
}

shapegcode_limits limits_for_c(const MotionLimits& from) noexcept {
  shapegcode_limits limits{};
  const bool is_jerk_limited = from.law == AccelerationLaw::jerk_limited;
  limits.law = is_jerk_limited ? SHAPEGCODE_JERK_LIMITED : SHAPEGCODE_CONSTANT_TIME;
  limits.time_constant_s = from.time_constant_s;
  limits.jerk_time_s = from.jerk_time_s;
  write_vector(from.max_feed_mm_per_s, limits.max_feed_mm_per_s);
  write_vector(from.max_acceleration_mm_per_s2, limits.max_acceleration_mm_per_s2);
  write_vector(from.max_jerk_mm_per_s3, limits.max_jerk_mm_per_s3);
  write_vector(from.corner_speed_difference_mm_per_s, limits.corner_speed_difference_mm_per_s);
  limits.corner_stop_angle_rad = from.corner_stop_angle_rad;
  limits.block_time_s = from.block_time_s;
  limits.junction_deviation_mm = from.junction_deviation_mm;
  limits.centripetal_acceleration_mm_per_s2 = from.centripetal_acceleration_mm_per_s2;
  limits.polyline_acceleration_mm_per_s2 = from.polyline_acceleration_mm_per_s2;
  write_vector(from.contour_acceleration_mm_per_s2, limits.contour_acceleration_mm_per_s2);
  limits.arc_feed_ratio = from.arc_feed_ratio;
  return limits;
}

shapegcode_settings default_settings() {
  const ControllerSettings defaults;
  shapegcode_settings settings{};
  settings.struct_size = sizeof settings;
  settings.period_s = defaults.period_s;
  settings.limits = limits_for_c(defaults.limits);
  const FollowingLimits none;
  std::fill(std::begin(settings.following), std::end(settings.following),
            shapegcode_following_limits{none.max_feed, none.max_acceleration, none.max_jerk});
  settings.contour_tolerance_mm = defaults.contour_tolerance_mm;
  settings.smoothing_time_s = defaults.smoothing_time_s;
  settings.contour_correction = defaults.contour_correction ? 1 : 0;
  settings.window = defaults.window;
  settings.queue = defaults.queue;
  settings.plans_in_step = defaults.plans_in_step ? 1 : 0;
  settings.lead_periods = defaults.lead_periods;
  std::fill(std::begin(settings.following_tolerance), std::end(settings.following_tolerance), none.tolerance);
  return settings;
}

Fir fir_of(const shapegcode_shaper& shaper) {
  if (shaper.delays == nullptr || shaper.taps == nullptr) detail::refuse("a shaper's delays or taps are NULL");
  return {std::vector<int>(shaper.delays, shaper.delays + shaper.count),
          std::vector<double>(shaper.taps, shaper.taps + shaper.count)};
}

ControllerShaper shaper_of(const shapegcode_settings& from) {
  if (from.shaper_count == 0) return ControllerSettings{}.shaper;
  if (from.shapers == nullptr) detail::refuse("shapers is NULL and shaper_count is {}", from.shaper_count);
  if (from.shaper_count > max_controller_axes) {
    detail::refuse("shaper_count is {}, at most {} are possible", from.shaper_count, max_controller_axes);
  }
  std::vector<Fir> each;
  for (const shapegcode_shaper& shaper : std::span(from.shapers, from.shaper_count)) each.push_back(fir_of(shaper));
  if (each.size() == 1) return each.front();
  return each;
}

}  // namespace

bool has_known_size(const shapegcode_settings& settings) noexcept { return is_known_size(settings.struct_size); }

ControllerSettings settings_of(const shapegcode_settings& given) {
  shapegcode_settings from = default_settings();
  std::memcpy(&from, &given, given.struct_size);
  ControllerSettings settings;
  settings.period_s = from.period_s;
  settings.limits = limits_of(from.limits);
  if (from.following_count > max_following_axes) {
    detail::refuse("following_count is {}, at most {} are possible", from.following_count, max_following_axes);
  }
  for (std::size_t i = 0; i < from.following_count; ++i) {
    const shapegcode_following_limits& axis = from.following[i];
    settings.following.push_back({axis.max_feed, axis.max_acceleration, axis.max_jerk, from.following_tolerance[i]});
  }
  settings.contour_tolerance_mm = from.contour_tolerance_mm;
  settings.smoothing_time_s = from.smoothing_time_s;
  settings.shaper = shaper_of(from);
  settings.contour_correction = from.contour_correction != 0;
  settings.window = from.window;
  settings.queue = from.queue;
  settings.plans_in_step = from.plans_in_step != 0;
  settings.lead_periods = from.lead_periods;
  return settings;
}

}  // namespace shapegcode::c

shapegcode_status shapegcode_settings_init(shapegcode_settings* settings, size_t struct_size) {
  if (settings == nullptr) return SHAPEGCODE_ERROR_NULL;
  if (!shapegcode::c::is_known_size(struct_size)) return SHAPEGCODE_ERROR_STRUCT_SIZE;
  try {
    shapegcode_settings defaults = shapegcode::c::default_settings();
    defaults.struct_size = struct_size;
    std::memcpy(settings, &defaults, struct_size);
  } catch (...) {
    return SHAPEGCODE_ERROR_OUT_OF_MEMORY;  // it makes the filter that is no shaper, and nothing else that could fail
  }
  return SHAPEGCODE_OK;
}
