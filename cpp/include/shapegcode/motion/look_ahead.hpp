#pragma once

#include <cstddef>
#include <vector>

#include "shapegcode/motion/limits.hpp"
#include "shapegcode/motion/speed_profile.hpp"
#include "shapegcode/path/path.hpp"

namespace shapegcode {

/// Speeds that a path may have beside its limits, mm/s; infinity where there is none.
struct SpeedCaps {
  std::vector<float> on_segment;   ///< of each segment
  std::vector<float> at_junction;  ///< [i]: where segment i is entered
};

/// Tangential speed profile over a whole path from rest to rest: every segment at most at its feed, every limit kept,
/// deceleration ended where a slower segment begins. O(n). Throws Error(argument) on a limit that is not positive
/// or a segment without feed, or caps that are not one per segment.
///
/// Forward and backward passes over the segments' boundary speeds (the planner of grbl and of LinuxCNC, in v^2); then,
/// under the constant-time law, ramps are stretched to the time constant where a neighbouring steady stretch leaves
/// room. A jerk time smooths distance over time by a moving average of that length; the slow stretches around corners
/// are lengthened by half of it on both sides, so that smoothing does not raise the speed at the corner.
///
/// Behind a jerk time the acceleration of an axis may exceed its limit where segments of different direction meet at
/// speed (there the corner limits bound what happens), and jerk on arcs is not bounded.
[[nodiscard]] SpeedProfile plan_speed(const Path& path, const MotionLimits& limits, const SpeedCaps* caps = nullptr);

/// Highest speed at which no axis of a segment is above its largest feed.
[[nodiscard]] double axis_feed_limit(const Segment& segment, const MotionLimits& limits) noexcept;

/// Highest speed at which segment `i` may be run under the limits.
[[nodiscard]] double segment_speed_limit(const Segment& segment, const MotionLimits& limits) noexcept;

/// Highest speed at the junction of two segments.
[[nodiscard]] double corner_speed_limit(const Segment& before, const Segment& after,
                                        const MotionLimits& limits) noexcept;

/// Indices of segments before which the tool must come to rest: sharp corners between the tool axis and the plane
/// across it (a plunge or retract), which a shaper must not mix; corners that the filter behind cannot pass within the
/// contour tolerance at any speed; and exact stops. `axis_angle_rad`: how far a side may lean from the tool axis Z and
/// still count as plunge; `corner_angle_rad`: least change of direction of such a corner.
[[nodiscard]] std::vector<std::size_t> forced_stops(const std::vector<Segment>& segments, double axis_angle_rad,
                                                    double corner_angle_rad, const MotionLimits& limits);

}  // namespace shapegcode
