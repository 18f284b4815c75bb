#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>

#include "shapegcode/motion.hpp"
#include "shapegcode/path.hpp"

namespace shapegcode {

/// The control whose rules plan a program.
enum class ControllerKind : std::uint8_t {
  fanuc,     ///< `plan_speed` under MotionLimits, or block by block
  linuxcnc,  ///< trapezoids in whole servo periods, blend arcs, kink rule (2.9)
  klipper,   ///< trapezoids, square corner velocity, minimum cruise ratio
  grbl,      ///< trapezoids, junction deviation, a buffer of a few blocks
};

/// Settings of the open planners, by the names of their own configuration. Feed, override and acceleration of the axes
/// are those of MotionLimits; jerk and the rules of a FANUC control have no effect.
struct PlannerRules {
  ControllerKind kind = ControllerKind::fanuc;
  double arc_resolution_mm = 1.0;  ///< klipper: length of the chords of an arc ([gcode_arcs] resolution)
  /// klipper, grbl: arcs are emitted as equal chords within it; 0: as arcs, which the control divides by its own rule
  double chord_tolerance_mm = 0.0;
  double square_corner_velocity_mm_per_s = 5.0;  ///< klipper: speed at a corner of 90 degrees
  double minimum_cruise_ratio = 0.5;             ///< klipper: max_accel_to_decel is max_accel times (1 - ratio)
  double arc_tolerance_mm = 0.002;               ///< grbl: chords of an arc lie within it ($12)
  double junction_deviation_mm = 0.01;  ///< grbl: a corner is as fast as an arc that cuts it by this distance ($11)
  double period_s = 0.001;              ///< linuxcnc: of the servo thread, which plans ([EMCMOT] SERVO_PERIOD)
  double blend_tolerance_mm = 0.0;      ///< linuxcnc: G64 P; 0: limited by half of a segment only
  /// linuxcnc: G64 Q, by default that of P: lines of one feed within it are joined, an arc in XY within it becomes two
  /// lines
  double naive_cam_tolerance_mm = 0.0;
  double ramp_frequency_hz = 100.0;  ///< linuxcnc: segments of less than 1/it s are ramps ([TRAJ] ARC_BLEND_RAMP_FREQ)
  double kink_ratio = 0.1;           ///< linuxcnc: part of the acceleration that a kink may take (ARC_BLEND_KINK_RATIO)
  double max_feed_override = 1.0;    ///< linuxcnc: [DISPLAY] MAX_FEED_OVERRIDE, for which it plans
  /// linuxcnc: a rapid follows the path; else (a dwell, an M function) the path's last segment has half of the
  /// acceleration
  bool rapid_follows = true;
  std::size_t optimization_depth = 50;  ///< linuxcnc: segments in its look-ahead (ARC_BLEND_OPTIMIZATION_DEPTH)
  /// grbl: blocks of its planner's buffer. It can stop at the end of the last of them at any time.
  std::size_t look_ahead_blocks = 15;
};

/// Throws Error(argument) on an invalid setting; the message names it and its range.
void check(const PlannerRules& rules);

/// A path as a control executes it, with its speed profile.
struct ControlledMotion {
  /// Arcs as chords (grbl, klipper), corners as blends (linuxcnc); the given path where the control does not change it.
  std::shared_ptr<const Path> path;
  std::shared_ptr<const SpeedProfile> profile;
};

/// A path planned by the rules of a control from rest to rest. All blocks are assumed to arrive in time, except for the
/// limit of its buffer. Written from the published rules: grbl: Jeon's junction deviation, "Improving Grbl: Cornering
/// Algorithm" (2011), and the project's wiki. klipper: docs/Kinematics.md and docs/Config_Reference.md of the project.
/// linuxcnc: the trajectory planner of 2.9 (blend arcs by Ellenberg, 2014) as described in its manual and comments.
/// Throws Error(argument) on a segment without feed, or a setting or limit that is not positive and finite.
[[nodiscard]] ControlledMotion controlled_motion(const std::shared_ptr<const Path>& path, const MotionLimits& limits,
                                                 const PlannerRules& rules);

/// Effect of LinuxCNC's rules for short segments (kinks and ramps) on a path at its feeds.
struct LinuxcncSlowing {
  std::size_t segments = 0;
  std::size_t kinks = 0;        ///< junctions that need at least the kink ratio of the acceleration
  double largest_ratio = 0.0;   ///< needed by any junction of at most `corner_rad`
  double speed_mm_per_s = 0.0;  ///< there
  double angle_rad = 0.0;
  std::uint32_t line = 0;
  std::size_t ramps = 0;  ///< segments whose speed is a ramp, because they take less than the ramp frequency's inverse
};

/// Finds segments slowed by these rules. Turns of more than `corner_rad` are corners of the path and do not count.
[[nodiscard]] LinuxcncSlowing linuxcnc_slowing(const Path& path, const MotionLimits& limits, const PlannerRules& rules,
                                               double corner_rad);

}  // namespace shapegcode
