#pragma once

#include <cstddef>
#include <cstdint>
#include <limits>
#include <vector>

#include "shapegcode/path.hpp"

namespace shapegcode {

/// Law of a change of speed.
enum class AccelerationLaw : std::uint8_t {
  constant_time,  ///< a ramp lasts the time constant whatever the speed step, if the path is long enough
  jerk_limited,   ///< the acceleration of the axes, smoothed by the jerk time
};

/// Unit of a programmed feed, and the override that applies.
enum class FeedRate : std::uint8_t {
  per_time,        ///< per s; the feed override
  rapid,           ///< per s; the rapid override
  per_revolution,  ///< per revolution of the spindle; the feed override
  synchronous,     ///< likewise, synchronous with the spindle angle from rest to rest; no override
};

/// Limits of the look-ahead. Infinity switches a limit off.
struct MotionLimits {
  static constexpr double none = std::numeric_limits<double>::infinity();

  AccelerationLaw law = AccelerationLaw::constant_time;
  double time_constant_s = 0.05;  ///< constant_time: duration of a ramp from rest to the programmed feed
  double jerk_time_s = 0.0;       ///< duration of the smoothing of the acceleration; 0 = none
  Vector3 max_feed_mm_per_s = Vector3::Constant(none);
  Vector3 max_acceleration_mm_per_s2 = Vector3::Constant(none);
  Vector3 max_jerk_mm_per_s3 = Vector3::Constant(none);
  Vector3 corner_speed_difference_mm_per_s = Vector3::Constant(none);  ///< per axis at a corner
  double corner_stop_angle_rad = none;  ///< a corner that turns by this angle or more is a stop
  double block_time_s = 0.0;            ///< minimum duration of a block: the control's block processing time
  double junction_deviation_mm =
      none;  ///< a corner is as fast as an arc that cuts it by this distance, at the axes' acceleration
  double centripetal_acceleration_mm_per_s2 = none;                  ///< on arcs (1735)
  double polyline_acceleration_mm_per_s2 = none;                     ///< the same along polylines
  Vector3 contour_acceleration_mm_per_s2 = Vector3::Constant(none);  ///< per axis, of a change of direction (1737)
  double feed_override = 1.0;                                        ///< scales the programmed feeds
  double arc_feed_ratio = 1.0;                                       ///< feed on arcs relative to the programmed feed
  /// A lower programmed feed is reached this long before its segment, and held this long after it, because the filters
  /// after the look-ahead average the motion over this time to both sides.
  double feed_spread_s = 0.0;
  double feed_excess_ratio = 0.0;  ///< neighbours faster by up to this ratio need no such spread
};

/// Deviation permitted to a filter after the interpolation at corners and on arcs. With zero variance and mean
/// deviation it limits nothing.
struct FilterTolerance {
  double contour_tolerance_mm = MotionLimits::none;  ///< permitted deviation by the filter
  double corner_share =
      1.0;  ///< part of it for one corner: the deviations of several corners within one filter length add up
  double variance_s2 = 0.0;       ///< second central moment of the filter
  double mean_deviation_s = 0.0;  ///< its mean absolute deviation from the mean delay
};

/// Highest speed at which no axis of a segment exceeds its maximum feed.
[[nodiscard]] double axis_feed_limit(const Segment& segment, const MotionLimits& limits) noexcept;

/// Highest speed of a segment within the limits, with this filter after the interpolation.
[[nodiscard]] double segment_speed_limit(const Segment& segment, const MotionLimits& limits,
                                         const FilterTolerance& filter = {}) noexcept;

/// Highest speed at the junction of two segments.
[[nodiscard]] double corner_speed_limit(const Segment& before, const Segment& after, const MotionLimits& limits,
                                        const FilterTolerance& filter = {}) noexcept;

/// Indices of segments before which the tool must come to rest: sharp corners between the tool axis and the plane
/// perpendicular to it (a plunge or retract), which a shaper must not round; corners at which the filter exceeds the
/// contour tolerance at every speed; and exact stops. `axis_angle_rad`: largest angle from the tool axis Z that still
/// counts as plunge; `corner_angle_rad`: smallest change of direction of such a corner.
[[nodiscard]] std::vector<std::size_t> forced_stops(const Segments& segments, double axis_angle_rad,
                                                    double corner_angle_rad, const MotionLimits& limits,
                                                    const FilterTolerance& filter = {});

}  // namespace shapegcode
