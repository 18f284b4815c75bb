// What a segment and the junction of two allow: speeds, accelerations, and how long jerk has to be spread.
#pragma once

#include <cstddef>
#include <cstdint>

#include "shapegcode/motion.hpp"
#include "shapegcode/path.hpp"

namespace shapegcode {

/// Throws Error(argument) on a limit that is not positive.
void check_limits(const MotionLimits& limits, const FilterTolerance& filter);

/// Share of acceleration and jerk that is the path's beside a jump; the other half is the jump's.
inline constexpr double reduced_share = 0.5;

/// Acceleration along a segment that is run at most at `speed_limit`. `reduced`: beside a jump of speed or
/// acceleration, which has the other half of the limits.
[[nodiscard]] double segment_acceleration(const Segment& segment, double speed_limit, const MotionLimits& limits,
                                          bool reduced = false) noexcept;

/// How long the smoothing of the acceleration lasts, if no segment is accelerated by more than `fastest`.
[[nodiscard]] double jerk_time(const MotionLimits& limits, double fastest) noexcept;

/// Whether acceleration and jerk are kept where the path jumps.
[[nodiscard]] inline bool looks_at_jumps(const MotionLimits& limits) noexcept { return limits.jumps.duration_s > 0.0; }

/// What jumps at a junction. The greatest is the least.
enum class Jump : std::uint8_t { turn, bend, none };

/// Time before and after a jump in which what the path does adds to it.
[[nodiscard]] inline double jump_time_s(const MotionLimits& limits, double jerk_s) noexcept {
  return limits.jumps.duration_s + 0.5 * jerk_s;
}

/// Speed of a segment beside a jump of direction: on an arc, what leaves half of the acceleration for that.
[[nodiscard]] double limit_beside_turn(const Segment& segment, const MotionLimits& limits) noexcept;

/// What one axis does at a junction, per mm/s and (mm/s)^2 of the speed along the path.
struct AxisJump {
  double speed = 0.0;
  double acceleration_per_mm = 0.0;
  double max_acceleration = MotionLimits::none;
  double max_jerk = MotionLimits::none;
};

/// A junction as the filter behind the path sees it.
struct JunctionShape {
  double shortest_mm = 0.0;     ///< the shorter one of both sides
  double speed_mm_per_s = 0.0;  ///< highest one that both sides allow
};

/// Highest speed at which the jump of an axis stays within its half of acceleration and jerk; none if it does at the
/// speed of the shape.
/// What is nearer to the next junction than the filter reaches takes as much less, so that neighbours may add up.
[[nodiscard]] double jump_speed(const AxisJump& jump, const JunctionShape& shape,
                                const JumpResponse& response) noexcept;

/// By how much the feeds may be raised; how fast a segment can ever be run.
inline constexpr double max_override = 2.0;
[[nodiscard]] double fastest_speed(const Segment& segment, const MotionLimits& limits,
                                   const FilterTolerance& filter) noexcept;

/// What X, Y and Z do at the junction of two segments: of direction, and of its derivative by path length.
struct JunctionJumps {
  Vector3 turn = Vector3::Zero();
  Vector3 bend = Vector3::Zero();
  Jump kind = Jump::none;
};
[[nodiscard]] JunctionJumps junction_jumps(const Segment& before, const Segment& after) noexcept;

/// Highest speed that these jumps allow, or none up to `fastest`.
[[nodiscard]] double junction_jump_speed(const Segment& before, const Segment& after, const MotionLimits& limits,
                                         const JunctionJumps& jumps, double fastest_mm_per_s) noexcept;

}  // namespace shapegcode
