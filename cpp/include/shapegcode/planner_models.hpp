#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>

#include "shapegcode/motion.hpp"
#include "shapegcode/path.hpp"

namespace shapegcode {

/// Whose rules plan a program.
enum class ControllerKind : std::uint8_t {
  fanuc,     ///< `plan_speed` under MotionLimits, or block by block
  linuxcnc,  ///< trapezoids in whole servo periods, blend arcs, kink rule (2.9)
  klipper,   ///< trapezoids, square corner velocity, minimum cruise ratio
  grbl,      ///< trapezoids, junction deviation, a buffer of a few blocks
};

/// Settings of the open planners, by the names of their own configuration. Feed, override and acceleration of the axes
/// are those of MotionLimits; jerk and the rules of a FANUC control do not act.
struct PlannerRules {
  ControllerKind kind = ControllerKind::fanuc;
  double arc_resolution_mm = 1.0;  ///< klipper: length of the chords of an arc ([gcode_arcs] resolution)
  /// klipper, grbl: arcs are emitted as equal chords within it; 0: as arcs, which the control cuts by its own rule
  double chord_tolerance_mm = 0.0;
  double square_corner_velocity_mm_per_s = 5.0;  ///< klipper: speed at a corner of 90 degrees
  double minimum_cruise_ratio = 0.5;             ///< klipper: max_accel_to_decel is max_accel times what it leaves of 1
  double arc_tolerance_mm = 0.002;               ///< grbl: chords of an arc lie within it ($12)
  double junction_deviation_mm = 0.01;           ///< grbl: a corner is passed as an arc that cuts it by so much ($11)
  double period_s = 0.001;          ///< linuxcnc: of the servo thread, in which it plans ([EMCMOT] SERVO_PERIOD)
  double blend_tolerance_mm = 0.0;  ///< linuxcnc: G64 P; 0: as far as half of a segment lets it
  /// linuxcnc: G64 Q, without it that of P: lines of one feed within it are one, an arc in XY within it is two lines
  double naive_cam_tolerance_mm = 0.0;
  double ramp_frequency_hz = 100.0;  ///< linuxcnc: shorter segments are ramps ([TRAJ] ARC_BLEND_RAMP_FREQ)
  double kink_ratio = 0.1;           ///< linuxcnc: share of the acceleration for a kink (ARC_BLEND_KINK_RATIO)
  double max_feed_override = 1.0;    ///< linuxcnc: [DISPLAY] MAX_FEED_OVERRIDE; it plans for that
  /// linuxcnc: a rapid follows the path; else (a dwell, an M function) its last segment has half of the acceleration
  bool rapid_follows = true;
  std::size_t optimization_depth = 50;  ///< linuxcnc: segments that it looks ahead (ARC_BLEND_OPTIMIZATION_DEPTH)
  /// grbl: blocks of its planner's buffer. It can stop at the end of the last of them at any time.
  std::size_t look_ahead_blocks = 15;
};

/// Throws Error(argument) on a setting that the planner does not take; the message names it and its range.
void check(const PlannerRules& rules);

/// A path as a control executes it, and how fast.
struct ControlledMotion {
  /// Arcs as chords (grbl, klipper), corners as blends (linuxcnc); the given one where the control leaves it as it is.
  std::shared_ptr<const Path> path;
  std::shared_ptr<const SpeedProfile> profile;
};

/// A path planned by the rules of a control from rest to rest, with all of its blocks in time (but for the blocks that
/// its buffer holds). Written from the published rules:
/// grbl: Jeon's junction deviation, "Improving Grbl: Cornering Algorithm" (2011), and the project's wiki.
/// klipper: docs/Kinematics.md and docs/Config_Reference.md of the project.
/// linuxcnc: the trajectory planner of 2.9 (blend arcs by Ellenberg, 2014) as its manual and comments state it.
/// Throws Error(argument) on a segment without feed, or a setting or limit that is not positive and finite.
[[nodiscard]] ControlledMotion controlled_motion(const std::shared_ptr<const Path>& path, const MotionLimits& limits,
                                                 const PlannerRules& rules);

/// What LinuxCNC's two rules for short segments do to a path at its feeds.
struct LinuxcncSlowing {
  std::size_t segments = 0;
  std::size_t kinks = 0;        ///< junctions that ask for more of the acceleration than the kink ratio
  double largest_ratio = 0.0;   ///< that any junction of at most `corner_rad` asks for
  double speed_mm_per_s = 0.0;  ///< there
  double angle_rad = 0.0;
  std::uint32_t line = 0;
  std::size_t ramps = 0;  ///< segments whose speed is a ramp, as they are shorter than the ramp frequency's inverse
};

/// Turns of more than `corner_rad` are corners of the path and do not count.
[[nodiscard]] LinuxcncSlowing linuxcnc_slowing(const Path& path, const MotionLimits& limits, const PlannerRules& rules,
                                               double corner_rad);

}  // namespace shapegcode
