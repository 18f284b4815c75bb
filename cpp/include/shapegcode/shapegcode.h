#ifndef SHAPEGCODE_SHAPEGCODE_H
#define SHAPEGCODE_SHAPEGCODE_H

// A header for C: idioms of C++ do not hold here.  NOLINTBEGIN(modernize-*)
#include <stddef.h>
#include <stdint.h>

// A control in C: blocks arrive while the machine moves, each period returns one set-point. It is the MotionController
// of "shapegcode/controller.hpp", with the same guarantees.
//
//     shapegcode_settings* settings = shapegcode_settings_create();
//     for (int axis = 0; axis < 3; ++axis)
//       shapegcode_settings_set_axis(settings, SHAPEGCODE_MAX_ACCELERATION, axis, 1000.0);
//     shapegcode_controller* control;
//     char message[200];
//     if (shapegcode_controller_create(settings, &control, message, sizeof message)) return complain(message);
//     shapegcode_settings_destroy(settings);
//     const double corner[3] = {40.0, 0.0, 0.0};
//     shapegcode_rules rules;
//     shapegcode_rules_init(&rules, sizeof rules);
//     rules.stop_at_end = 1;
//     shapegcode_controller_push_line(control, corner, 100.0, &rules);  // pushing thread
//     double set_point[3];
//     shapegcode_activity activity;
//     do {                                                              // real-time thread, every millisecond
//       shapegcode_controller_step(control, set_point, &activity);
//       drive(set_point);
//     } while (activity != SHAPEGCODE_IDLE);
//     shapegcode_controller_destroy(control);
//
// A program compiled with an older header of version 1 runs with a newer library: codes keep their values, only structs
// whose size is stored or passed grow, at their ends, and functions keep their meaning.

#ifdef __cplusplus
extern "C" {
#endif

/// Version of this interface: 1000 times the major version (incompatible changes) plus the minor version (additions).
#define SHAPEGCODE_C_VERSION 1001

/// The version of the library.
int shapegcode_c_version(void);

/// Maximum number of following axes after X, Y and Z, and of all axes.
#define SHAPEGCODE_MOST_FOLLOWING_AXES 6
#define SHAPEGCODE_MOST_AXES 9

/// Result of a function. Above zero: a request was not accepted. Below zero: an error in the call, nothing was done.
typedef enum shapegcode_status {
  SHAPEGCODE_OK = 0,
  SHAPEGCODE_QUEUE_FULL = 1,       ///< push it again later
  SHAPEGCODE_NOT_CONNECTED = 2,    ///< it does not start where the one before ended
  SHAPEGCODE_NO_LENGTH = 3,        ///< it moves no axis by more than 1e-9 mm or degrees
  SHAPEGCODE_NO_FEED = 4,          ///< a feed that is not above zero, or not finite
  SHAPEGCODE_NOT_FINITE = 5,       ///< a number is not finite, or a distance of retrace is below zero
  SHAPEGCODE_WRONG_AXES = 6,       ///< not as many following axes as the settings have
  SHAPEGCODE_AFTER_ABORT = 7,      ///< nothing is accepted between abort and restart
  SHAPEGCODE_NO_ARC = 8,           ///< no radius, no sweep, no such plane, or the sweep does not lead to the end
  SHAPEGCODE_NO_TIME = 9,          ///< a dwell below zero, above 1e6 s, or not a number
  SHAPEGCODE_FLUSHING = 10,        ///< between flush and flushed nothing is accepted
  SHAPEGCODE_BEYOND_TRAVEL = 11,   ///< it leads out of the travel of an axis
  SHAPEGCODE_BAD_LIMIT = 12,       ///< a limit of the rules is not above zero
  SHAPEGCODE_NOT_STRAIGHT = 13,    ///< synchronous with the spindle, but not a line
  SHAPEGCODE_PATH_MOVES = 14,      ///< a jog is only accepted while the path is held, flushed or aborted, and at rest
  SHAPEGCODE_NO_AXIS = 15,         ///< there is no such axis, or it has no such limits
  SHAPEGCODE_NO_SPEED = 16,        ///< the speed of a jog by a distance is not above zero
  SHAPEGCODE_NO_RECORD = 17,       ///< no periods are stored for retrace
  SHAPEGCODE_ERROR_ARGUMENT = -1,  ///< a value is outside its range; the message of create names it and the limit
  SHAPEGCODE_ERROR_NULL = -2,      ///< a required pointer is NULL
  SHAPEGCODE_ERROR_STRUCT_SIZE = -3,  ///< a struct is not initialised, has an unknown feed_rate or feed_of, or is from
                                      ///< a newer header than the library
  SHAPEGCODE_ERROR_OUT_OF_MEMORY = -4,
  SHAPEGCODE_ERROR_INTERNAL = -5  ///< a defect of the library
} shapegcode_status;

/// A short English text; of an unknown code, too. Never NULL.
const char* shapegcode_status_text(int code);

/// What a control does in a period.
typedef enum shapegcode_activity {
  SHAPEGCODE_IDLE = 0,      ///< at rest, nothing left to do
  SHAPEGCODE_MOVING = 1,    ///< along the path, or the shaper's output is not yet at rest
  SHAPEGCODE_STOPPING = 2,  ///< decelerating for hold, flush or abort
  SHAPEGCODE_HELD = 3,      ///< at rest after hold, or at a programmed stop
  SHAPEGCODE_STARVED = 4,   ///< decelerating: the queue ran empty, its last segment has no stop_at_end. Idle at rest
  SHAPEGCODE_ABORTED = 5,   ///< at rest after abort or emergency_stop; the path is discarded
  SHAPEGCODE_JOGGING = 6    ///< an axis moves away from the position where the path rests, or back to it
} shapegcode_activity;

/// A short English text; of an unknown code, too. Never NULL.
const char* shapegcode_activity_text(int activity);

/// Law of a change of speed.
typedef enum shapegcode_law {
  SHAPEGCODE_CONSTANT_TIME = 0,  ///< a ramp lasts the time constant, if the path is long enough
  SHAPEGCODE_JERK_LIMITED = 1    ///< the acceleration of the axes, smoothed by the jerk time
} shapegcode_law;

/// Settings of a control; INFINITY: no limit.
typedef struct shapegcode_settings shapegcode_settings;

/// A number of the control.
typedef enum shapegcode_number {
  SHAPEGCODE_PERIOD_S = 1,
  SHAPEGCODE_FOLLOWING_AXES = 2,        ///< axes that follow X, Y and Z, 0 to 6
  SHAPEGCODE_CONTOUR_TOLERANCE_MM = 3,  ///< of rounded corners, smoothing and shaper; 0 only without the latter two
  SHAPEGCODE_SMOOTHING_TIME_S = 4,      ///< duration of each of two moving averages; 0: none
  SHAPEGCODE_CONTOUR_CORRECTION = 5,    ///< 1: compensate the radius error of arcs by smoothing and shaper
  SHAPEGCODE_WINDOW = 6,                ///< segments in the look-ahead window, 8 at least
  SHAPEGCODE_QUEUE = 7,          ///< segments in the whole queue, including the window; rounded up to a power of two
  SHAPEGCODE_PLANS_IN_STEP = 8,  ///< 1: step() also plans, every 8 to 32 periods; 0: another thread calls plan()
  SHAPEGCODE_LEAD_PERIODS = 9,   ///< by which plan() is ahead of the motion
  SHAPEGCODE_LAW = 10,           ///< a shapegcode_law
  SHAPEGCODE_TIME_CONSTANT_S = 11,
  SHAPEGCODE_JERK_TIME_S = 12,
  SHAPEGCODE_CORNER_STOP_ANGLE_RAD = 13,  ///< a corner that turns by this angle or more is a stop
  SHAPEGCODE_BLOCK_TIME_S = 14,           ///< minimum duration of a segment
  SHAPEGCODE_JUNCTION_DEVIATION_MM = 15,  ///< a corner is as fast as an arc that cuts it by this distance
  SHAPEGCODE_CENTRIPETAL_ACCELERATION = 16,
  SHAPEGCODE_POLYLINE_ACCELERATION = 17,
  SHAPEGCODE_ARC_FEED_RATIO = 18,        ///< feed on arcs relative to the programmed one
  SHAPEGCODE_SPINDLE_BANDWIDTH_HZ = 19,  ///< bandwidth for following a spindle
  SHAPEGCODE_RETRACE_PERIODS = 20,       ///< periods of motion stored for retrace
  SHAPEGCODE_FADE_TIME_S = 21            ///< from one shaper to its replacement
} shapegcode_number;

/// A number of an axis, in its unit (mm or degrees) and s.
typedef enum shapegcode_axis_number {
  SHAPEGCODE_MAX_FEED = 1,
  SHAPEGCODE_MAX_ACCELERATION = 2,  ///< of X, Y or Z: makes the law the jerk-limited one
  SHAPEGCODE_MAX_JERK = 3,
  SHAPEGCODE_CORNER_SPEED_DIFFERENCE = 4,  ///< of X, Y and Z alone
  SHAPEGCODE_CONTOUR_ACCELERATION = 5,     ///< of X, Y and Z alone
  SHAPEGCODE_TOLERANCE = 6,                ///< of a following axis, where its speed along the path changes abruptly
  SHAPEGCODE_TRAVEL_LOW = 7,
  SHAPEGCODE_TRAVEL_HIGH = 8,
  SHAPEGCODE_EMERGENCY_ACCELERATION =
      9,  ///< if set for any axis: every axis decelerates with this value, or else its maximum acceleration
  SHAPEGCODE_OFFSET_MAX_FEED = 10,  ///< of the offset; reduces the limits of the path
  SHAPEGCODE_OFFSET_MAX_ACCELERATION = 11,
  SHAPEGCODE_OFFSET_MAX_JERK = 12,
  SHAPEGCODE_BACKLASH = 13  ///< compensated by the offset
} shapegcode_axis_number;

/// A shaper on the grid of the period: taps with a sum of one (within 1e-9) at ascending delays in periods.
typedef struct shapegcode_shaper {
  const int32_t* delays;
  const double* taps;
  size_t count;
} shapegcode_shaper;

/// Creates settings: ramps of 50 ms (SHAPEGCODE_CONSTANT_TIME), no other limits, no shaper, 1 ms, a contour tolerance
/// of 0.05 mm. NULL: out of memory.
shapegcode_settings* shapegcode_settings_create(void);

/// Frees settings; NULL is allowed.
shapegcode_status shapegcode_settings_destroy(shapegcode_settings* settings);

/// Sets a number. SHAPEGCODE_ERROR_ARGUMENT: no such number, or a value of the wrong kind; create checks the range.
shapegcode_status shapegcode_settings_set(shapegcode_settings* settings, int number, double value);

/// Likewise for an axis: 0 to 2, or 3 and more for following axes.
shapegcode_status shapegcode_settings_set_axis(shapegcode_settings* settings, int number, int axis, double value);

/// Sets the shaper of all axes (`axis` -1) or of one; copied.
shapegcode_status shapegcode_settings_set_shaper(shapegcode_settings* settings, int axis,
                                                 const shapegcode_shaper* shaper);

/// Adds a replacement for the shaper (number 0) in motion, with numbers 1 and up in the order of the calls: one shaper
/// for all axes (`count` 1), or one for each; copied.
shapegcode_status shapegcode_settings_add_shapers(shapegcode_settings* settings, const shapegcode_shaper* shapers,
                                                  size_t count);

/// Sets shapers of all axes, each valid where `axis` (0 to 2) is at its position, mm, ascending; copied.
shapegcode_status shapegcode_settings_set_following_shaper(shapegcode_settings* settings, int axis,
                                                           const double* positions_mm, const shapegcode_shaper* shapers,
                                                           size_t count);

/// A snapshot for a user interface.
typedef struct shapegcode_state {
  int32_t activity;  ///< a shapegcode_activity
  int32_t axes;
  double set_point[SHAPEGCODE_MOST_AXES];  ///< the last one; mm, or the unit of a following axis
  double speed_mm_per_s;                   ///< along the path, before smoothing and shaper
  double distance_mm;                      ///< since the last rest
  double feed_override;
  uint64_t line;  ///< of the present segment
  uint64_t segments_done;
  uint64_t segments_waiting;
  uint64_t steps;
  uint64_t starvations;          ///< how often the queue ran empty
  uint64_t late_plans;           ///< how often the motion slowed down because no section was planned in time
  uint64_t travel_stops;         ///< how often the control was held because the path would have left the travel
  double set_point_distance_mm;  ///< `distance_mm` at the last set-point, which lags by shapegcode_controller_delay()
  uint64_t set_point_line;       ///< `line` at the last set-point, likewise
  double spindle_speed;          ///< revolutions per s
  double spindle_error_mm;       ///< of a synchronous segment: the motion less that required by the spindle angle
  double offset[SHAPEGCODE_MOST_AXES];  ///< of the axes, before smoothing and shaper
  uint64_t shaper;                      ///< number of the active one, or of the one being faded to
  double rapid_override;
} shapegcode_state;

/// A control. One thread may push, one may step, one may plan, any may call the rest except create, destroy and
/// restart, unless stated otherwise.
typedef struct shapegcode_controller shapegcode_controller;

/// Makes a control at rest at zero. On any result but SHAPEGCODE_OK `*controller` is NULL and `message` (may be NULL)
/// names the error, with value and limit, truncated to `message_size` bytes including the terminating zero.
shapegcode_status shapegcode_controller_create(const shapegcode_settings* settings, shapegcode_controller** controller,
                                               char* message, size_t message_size);

/// Frees a control; NULL is allowed.
shapegcode_status shapegcode_controller_destroy(shapegcode_controller* controller);

/// Number of axes of a set-point: three and the following axes.
shapegcode_status shapegcode_controller_axes(const shapegcode_controller* controller, int32_t* axes);

/// Unit of a feed, and the override that applies.
typedef enum shapegcode_feed_rate {
  SHAPEGCODE_PER_TIME = 0,        ///< per s; the feed override
  SHAPEGCODE_RAPID = 1,           ///< per s; the rapid override
  SHAPEGCODE_PER_REVOLUTION = 2,  ///< per revolution of the spindle; the feed override
  SHAPEGCODE_SYNCHRONOUS = 3      ///< likewise, synchronous with the spindle angle from rest to rest; no override
} shapegcode_feed_rate;

/// To which motion a feed refers if X, Y and Z move together with following axes.
typedef enum shapegcode_feed_of {
  SHAPEGCODE_FEED_OF_PATH = 0,      ///< X, Y and Z along their path; if these rest, the axis with the longest travel
  SHAPEGCODE_FEED_OF_ALL_AXES = 1,  ///< the root of the sum of squares of all axes, degrees counted as mm
  SHAPEGCODE_FEED_OF_DOMINANT = 2,  ///< X, Y and Z along their path, or the following axis with a longer travel
  SHAPEGCODE_FEED_OF_TIME = 3       ///< inverse time: the segment lasts one over the feed, s or revolutions
} shapegcode_feed_of;

/// Rules for running a segment. Always begin with shapegcode_rules_init().
typedef struct shapegcode_rules {
  uint64_t struct_size;     ///< written by shapegcode_rules_init(); the size of the struct for the library
  uint32_t line;            ///< shown by the state while the segment runs
  int32_t stop_at_end;      ///< 1: an exact stop; marks the last segment of a program, after which none is missing
  int32_t feed_rate;        ///< a shapegcode_feed_rate
  int32_t feed_of;          ///< a shapegcode_feed_of
  double max_acceleration;  ///< along its path, besides the limits of the axes
  double max_jerk;
} shapegcode_rules;

/// Sets line 0, no stop, a feed per s along the path, no limits. `struct_size` is sizeof(shapegcode_rules).
shapegcode_status shapegcode_rules_init(shapegcode_rules* rules, size_t struct_size);

/// Appends a straight move from the end of the previous segment (at first: from the position of create or restart) to
/// `end`, with one value per axis. From the pushing thread: never blocks, does not allocate. `rules` may be NULL:
/// those of shapegcode_rules_init().
shapegcode_status shapegcode_controller_push_line(shapegcode_controller* controller, const double* end,
                                                  double feed_mm_per_s, const shapegcode_rules* rules);

/// How an arc or helix turns.
typedef struct shapegcode_arc {
  double centre_mm[3];  ///< its value along `normal` has no effect
  double sweep_rad;     ///< above zero: X towards Y about Z, Y towards Z about X, Z towards X about Y
  int32_t normal;       ///< axis perpendicular to its plane: 0 X, 1 Y, 2 Z
} shapegcode_arc;

/// The same along an arc or a helix. A sweep that misses the end by up to 0.01 mm is adjusted to meet it; if the radii
/// at start and end differ, the radius changes linearly.
shapegcode_status shapegcode_controller_push_arc(shapegcode_controller* controller, const double* end,
                                                 const shapegcode_arc* arc, double feed_mm_per_s,
                                                 const shapegcode_rules* rules);

/// Appends an event after the segment pushed last, from the pushing thread; as many events may wait as segments.
shapegcode_status shapegcode_controller_push_event(shapegcode_controller* controller, uint32_t id, uint64_t word);

/// Likewise a dwell: the set-points rest there for this time. A hold during the dwell restarts it.
shapegcode_status shapegcode_controller_push_dwell(shapegcode_controller* controller, double time_s);

/// Likewise a programmed stop (M00): the control comes to rest there and is held until resume.
shapegcode_status shapegcode_controller_push_stop(shapegcode_controller* controller);

/// Returns the events reached with the last step, one by one, from the stepping thread; `*has_event` is 0 if there are
/// no more. A junction passed in motion is reached when its position has come through smoothing and shaper
/// (shapegcode_controller_delay(), rounded); a junction at which the motion stops, when the set-points come to rest.
shapegcode_status shapegcode_controller_next_event(shapegcode_controller* controller, uint32_t* id, uint64_t* word,
                                                   int* has_event);

/// Returns the next set-point, with one value per axis, and the activity of the control (`activity` may be NULL). From
/// the real-time thread: no allocation, no lock; bounded work, except planning with `plans_in_step`.
shapegcode_status shapegcode_controller_step(shapegcode_controller* controller, double* set_point,
                                             shapegcode_activity* activity);

/// The same with the velocity and acceleration of each axis at the set-point, for a drive's feed-forward (per s and
/// s^2; each may be NULL): they have come through the same smoothing and shaper.
shapegcode_status shapegcode_controller_step_motion(shapegcode_controller* controller, double* set_point,
                                                    double* velocity, double* acceleration,
                                                    shapegcode_activity* activity);

/// Plans until enough motion lies ahead: from one thread, the pushing or another one, where `plans_in_step` is 0. Does
/// not allocate. `has_worked` (may be NULL) is 0 if there was nothing to do: call it again after some periods.
shapegcode_status shapegcode_controller_plan(shapegcode_controller* controller, int* has_worked);

/// Sets the feed override, a ratio; a value outside of 0 to 2 is limited to this range. It acts on motion not yet
/// planned: after 8 to 32 periods and the lead; 0 is a hold.
shapegcode_status shapegcode_controller_feed_override(shapegcode_controller* controller, double ratio);

/// The same for rapids, on which the feed override has no effect. 0 stops a rapid.
shapegcode_status shapegcode_controller_rapid_override(shapegcode_controller* controller, double ratio);

/// Fades to a shaper of the settings by its number, from the next period on or after an earlier fade or a synchronous
/// segment; a synchronous segment waits for the fade. From any thread.
shapegcode_status shapegcode_controller_exchange_shaper(shapegcode_controller* controller, int number);

/// Spindle position in this period, in continuously counted revolutions; from the stepping thread, before every step.
shapegcode_status shapegcode_controller_spindle(shapegcode_controller* controller, double revolutions);

/// Decelerates to rest along the path.
shapegcode_status shapegcode_controller_hold(shapegcode_controller* controller);

/// Continues after hold or a programmed stop.
shapegcode_status shapegcode_controller_resume(shapegcode_controller* controller);

/// Decelerates to rest along the path and discards the rest of it; at rest, flushed lets new segments start there.
shapegcode_status shapegcode_controller_flush(shapegcode_controller* controller);

/// Completes a flush, from the pushing thread: `*done` is 1 and `position` the position of rest, from which segments
/// are accepted again; 0: it is not yet at rest, or plan is running, or there was no flush.
shapegcode_status shapegcode_controller_flushed(shapegcode_controller* controller, double* position, int* done);

/// Reports a probe contact in the period of the last step: returns its set-point and flushes. From the stepping thread.
shapegcode_status shapegcode_controller_probe(shapegcode_controller* controller, double* latched);

/// Decelerates to rest along the path and discards the rest of it; nothing is accepted until restart.
shapegcode_status shapegcode_controller_abort(shapegcode_controller* controller);

/// Likewise with SHAPEGCODE_EMERGENCY_ACCELERATION, without a jerk limit.
shapegcode_status shapegcode_controller_emergency_stop(shapegcode_controller* controller);

/// Jogs an axis while the path rests: after hold, at a programmed stop, after flush until flushed, after abort; unit
/// per s with a sign, 0: stop. From any thread, but one thread for each axis. The axis stops at the end of its travel.
/// resume first leads back to the path, then continues it; flushed and restart begin at the new position.
shapegcode_status shapegcode_controller_jog(shapegcode_controller* controller, int axis, double speed);

/// Likewise by a distance; further distances before its end are added.
shapegcode_status shapegcode_controller_jog_by(shapegcode_controller* controller, int axis, double distance,
                                               double speed);

/// Moves back along the path by this distance from its position of rest, as far as periods are stored, at half
/// the original speed; a smaller distance than before: forward. Allowed when a jog is; resume returns to the position
/// of rest, then continues.
shapegcode_status shapegcode_controller_retrace(shapegcode_controller* controller, double distance_mm);

/// Sets an offset, which the axis approaches within the limits of the offset, at rest and in motion. From any thread.
shapegcode_status shapegcode_controller_offset(shapegcode_controller* controller, int axis, double value);

/// Sets the travel range of an axis. If the path to be run next would leave it, the control is held and stops where the
/// motion already planned ends. From any thread.
shapegcode_status shapegcode_controller_travel(shapegcode_controller* controller, int axis, double low, double high);

/// Sets the control at rest at a position (one value per axis), with an empty queue. Not while another thread pushes,
/// plans or steps.
shapegcode_status shapegcode_controller_restart(shapegcode_controller* controller, const double* position);

/// Returns a snapshot. `struct_size` is sizeof(shapegcode_state).
shapegcode_status shapegcode_controller_state(const shapegcode_controller* controller, shapegcode_state* state,
                                              size_t struct_size);

/// Mean delay of correction, smoothing and the shaper requested last, in periods.
shapegcode_status shapegcode_controller_delay(const shapegcode_controller* controller, double* periods);

#ifdef __cplusplus
}
#endif
// NOLINTEND(modernize-*)

#endif
