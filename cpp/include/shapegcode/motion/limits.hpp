#pragma once

#include <cstdint>
#include <limits>

#include "shapegcode/samples.hpp"

namespace shapegcode {

/// Law of a change of speed.
enum class AccelerationLaw : std::uint8_t {
  constant_time,  ///< a ramp lasts the time constant whatever the speed step, where the path leaves room for it
  jerk_limited,   ///< the acceleration of the axes, smoothed by the jerk time
};

/// What look-ahead keeps. Infinity switches a limit off.
struct MotionLimits {
  static constexpr double none = std::numeric_limits<double>::infinity();

  AccelerationLaw law = AccelerationLaw::constant_time;
  double time_constant_s = 0.05;  ///< constant_time: length of a ramp from rest to the programmed feed
  double jerk_time_s = 0.0;       ///< length of the smoothing of the acceleration; 0 = none
  Vector3 max_feed_mm_per_s = Vector3::Constant(none);
  Vector3 max_acceleration_mm_per_s2 = Vector3::Constant(none);
  Vector3 max_jerk_mm_per_s3 = Vector3::Constant(none);
  Vector3 corner_speed_difference_mm_per_s = Vector3::Constant(none);  ///< per axis at a corner
  double centripetal_acceleration_mm_per_s2 = none;                    ///< on arcs and along polylines (1735)
  Vector3 contour_acceleration_mm_per_s2 = Vector3::Constant(none);    ///< per axis, of a change of direction (1737)
  double feed_override = 1.0;                                          ///< scales the programmed feeds
  double arc_feed_ratio = 1.0;                                         ///< feed on arcs relative to the programmed feed
  /// Deviation that a filter with the spread below may cause at corners and on arcs.
  double contour_tolerance_mm = none;
  double corner_share = 1.0;        ///< of it for one corner: several may fall into one filter, and then they add up
  double filter_variance_s2 = 0.0;  ///< second central moment of the filter that follows
  double filter_mean_deviation_s = 0.0;  ///< its mean absolute deviation from the mean delay
};

}  // namespace shapegcode
