#ifndef SHAPEGCODE_SHAPEGCODE_H
#define SHAPEGCODE_SHAPEGCODE_H

// A header for C: idioms of C++ do not hold here.  NOLINTBEGIN(modernize-*)
#include <stddef.h>
#include <stdint.h>

// A control in C: blocks come while the machine moves, one set-point leaves per period. It is the MotionController of
// "shapegcode/controller.hpp", with the same promises.
//
//     shapegcode_settings* settings = shapegcode_settings_create();
//     for (int axis = 0; axis < 3; ++axis) shapegcode_settings_set_axis(settings, SHAPEGCODE_MAX_ACCELERATION, axis,
//     1000.0); shapegcode_controller* control; char message[200]; if (shapegcode_controller_create(settings, &control,
//     message, sizeof message)) return complain(message); shapegcode_settings_destroy(settings); const double corner[3]
//     = {40.0, 0.0, 0.0}; shapegcode_rules rules; shapegcode_rules_init(&rules, sizeof rules); rules.stop_at_end = 1;
//     shapegcode_controller_push_line(control, corner, 100.0, &rules);  // planning thread
//     double set_point[3];
//     shapegcode_activity activity;
//     do {                                                              // real-time thread, every millisecond
//       shapegcode_controller_step(control, set_point, &activity);
//       drive(set_point);
//     } while (activity != SHAPEGCODE_IDLE);
//     shapegcode_controller_destroy(control);
//
// A program that was compiled with an older header of version 1 runs with a newer library: codes keep their values,
// structs grow at their ends and say how large they are, and functions keep their meaning.

#ifdef __cplusplus
extern "C" {
#endif

/// Version of this interface: 1000 times the major one, by which it breaks, and the minor one, by which it grows.
#define SHAPEGCODE_C_VERSION 1001

/// The version that the library was built with.
int shapegcode_c_version(void);

/// Axes that may follow X, Y and Z, and axes in all.
#define SHAPEGCODE_MOST_FOLLOWING_AXES 6
#define SHAPEGCODE_MOST_AXES 9

/// Answer of a function. Above zero: a segment was not taken. Below zero: a mistake in the call, nothing was done.
typedef enum shapegcode_status {
  SHAPEGCODE_OK = 0,
  SHAPEGCODE_QUEUE_FULL = 1,          ///< push it again later
  SHAPEGCODE_NOT_CONNECTED = 2,       ///< it does not start where the one before ended
  SHAPEGCODE_NO_LENGTH = 3,           ///< it moves no axis by more than 1e-9 mm or degrees
  SHAPEGCODE_NO_FEED = 4,             ///< a feed that is not above zero, or not finite
  SHAPEGCODE_NOT_FINITE = 5,          ///< a position, centre or sweep is no number
  SHAPEGCODE_WRONG_AXES = 6,          ///< not as many following axes as the settings have
  SHAPEGCODE_AFTER_ABORT = 7,         ///< nothing is taken between abort and restart
  SHAPEGCODE_NO_ARC = 8,              ///< no radius, no sweep, no such plane, or the sweep does not lead to the end
  SHAPEGCODE_NO_TIME = 9,             ///< a dwell below zero, above 1e6 s, or no number
  SHAPEGCODE_FLUSHING = 10,           ///< between flush and flushed nothing is taken
  SHAPEGCODE_BEYOND_TRAVEL = 11,      ///< it leads out of the travel of an axis
  SHAPEGCODE_BAD_LIMIT = 12,          ///< a limit of the rules is not above zero
  SHAPEGCODE_NOT_STRAIGHT = 13,       ///< bound to the spindle, and no line
  SHAPEGCODE_PATH_MOVES = 14,         ///< an axis is jogged while the path is held, flushed or aborted and rests
  SHAPEGCODE_NO_AXIS = 15,            ///< there is no such axis, or it has no such limits
  SHAPEGCODE_NO_SPEED = 16,           ///< the speed of a jog by a distance is not above zero
  SHAPEGCODE_NO_RECORD = 17,          ///< no periods are kept for retrace
  SHAPEGCODE_ERROR_ARGUMENT = -1,     ///< a value is outside its range; create writes which, and the limit
  SHAPEGCODE_ERROR_NULL = -2,         ///< a pointer is NULL that must not be
  SHAPEGCODE_ERROR_STRUCT_SIZE = -3,  ///< a struct that was not initialised, or is of a newer header than the library
  SHAPEGCODE_ERROR_OUT_OF_MEMORY = -4,
  SHAPEGCODE_ERROR_INTERNAL = -5  ///< a defect of the library
} shapegcode_status;

/// A short English text; of an unknown code, too. Never NULL.
const char* shapegcode_status_text(int code);

/// What a control does in a period.
typedef enum shapegcode_activity {
  SHAPEGCODE_IDLE = 0,      ///< at rest, nothing left to do
  SHAPEGCODE_MOVING = 1,    ///< along the path, or the shaper is still giving out what it holds
  SHAPEGCODE_STOPPING = 2,  ///< decelerating for hold, flush or abort
  SHAPEGCODE_HELD = 3,      ///< at rest after hold, or at a stop that was pushed
  SHAPEGCODE_STARVED = 4,   ///< coming to rest: the segments ran out before one with stop_at_end. At rest it is idle
  SHAPEGCODE_ABORTED = 5,   ///< at rest after abort; the path is gone
  SHAPEGCODE_JOGGING = 6    ///< away from where the path rests, or back onto it
} shapegcode_activity;

/// A short English text; of an unknown code, too. Never NULL.
const char* shapegcode_activity_text(int activity);

/// Law of a change of speed.
typedef enum shapegcode_law {
  SHAPEGCODE_CONSTANT_TIME = 0,  ///< a ramp lasts the time constant, where the path leaves room for it
  SHAPEGCODE_JERK_LIMITED = 1    ///< the acceleration of the axes, smoothed by the jerk time
} shapegcode_law;

/// What a control is made of; INFINITY: no limit.
typedef struct shapegcode_settings shapegcode_settings;

/// A number of the control.
typedef enum shapegcode_number {
  SHAPEGCODE_PERIOD_S = 1,
  SHAPEGCODE_FOLLOWING_AXES = 2,        ///< axes that follow X, Y and Z, 0 to 6
  SHAPEGCODE_CONTOUR_TOLERANCE_MM = 3,  ///< of rounded corners, smoothing and shaper
  SHAPEGCODE_SMOOTHING_TIME_S = 4,      ///< length of each of two moving averages; 0: none
  SHAPEGCODE_CONTOUR_CORRECTION = 5,    ///< 1: take back what smoothing and shaper cut off arcs
  SHAPEGCODE_WINDOW = 6,                ///< segments that the look-ahead sees, 8 at least
  SHAPEGCODE_QUEUE = 7,          ///< segments that may wait in all; rounded up to a power of two, and holds the window
  SHAPEGCODE_PLANS_IN_STEP = 8,  ///< 1: step() plans for itself, every 8 to 32 periods; 0: another thread calls plan()
  SHAPEGCODE_LEAD_PERIODS = 9,   ///< that plan() is ahead of the motion
  SHAPEGCODE_LAW = 10,           ///< a shapegcode_law
  SHAPEGCODE_TIME_CONSTANT_S = 11,
  SHAPEGCODE_JERK_TIME_S = 12,
  SHAPEGCODE_CORNER_STOP_ANGLE_RAD = 13,  ///< a corner that turns by as much or more is a stop
  SHAPEGCODE_BLOCK_TIME_S = 14,           ///< no segment is run off faster
  SHAPEGCODE_JUNCTION_DEVIATION_MM = 15,  ///< a corner is passed as an arc that cuts it by so much
  SHAPEGCODE_CENTRIPETAL_ACCELERATION = 16,
  SHAPEGCODE_POLYLINE_ACCELERATION = 17,
  SHAPEGCODE_ARC_FEED_RATIO = 18,        ///< feed on arcs relative to the programmed one
  SHAPEGCODE_SPINDLE_BANDWIDTH_HZ = 19,  ///< with which a spindle is followed
  SHAPEGCODE_RETRACE_PERIODS = 20,       ///< periods of motion that are kept for retrace
  SHAPEGCODE_FADE_TIME_S = 21            ///< from one shaper to another that it is exchanged for
} shapegcode_number;

/// A number of an axis, in its unit (mm or degrees) and s.
typedef enum shapegcode_axis_number {
  SHAPEGCODE_MAX_FEED = 1,
  SHAPEGCODE_MAX_ACCELERATION = 2,  ///< of X, Y or Z: makes the law the jerk-limited one
  SHAPEGCODE_MAX_JERK = 3,
  SHAPEGCODE_CORNER_SPEED_DIFFERENCE = 4,  ///< of X, Y and Z alone
  SHAPEGCODE_CONTOUR_ACCELERATION = 5,     ///< of X, Y and Z alone
  SHAPEGCODE_TOLERANCE = 6,                ///< of a following axis, where its speed along the path changes at once
  SHAPEGCODE_TRAVEL_LOW = 7,
  SHAPEGCODE_TRAVEL_HIGH = 8,
  SHAPEGCODE_EMERGENCY_ACCELERATION = 9,  ///< one of them: every axis brakes with its own, or its highest one
  SHAPEGCODE_OFFSET_MAX_FEED = 10,        ///< of the offset, which the path leaves to it
  SHAPEGCODE_OFFSET_MAX_ACCELERATION = 11,
  SHAPEGCODE_OFFSET_MAX_JERK = 12,
  SHAPEGCODE_BACKLASH = 13  ///< taken up by the offset
} shapegcode_axis_number;

/// A shaper on the grid of the period: taps that add up to one (within 1e-9) at ascending delays in periods.
typedef struct shapegcode_shaper {
  const int32_t* delays;
  const double* taps;
  size_t count;
} shapegcode_shaper;

/// No limits, no shaper, 1 ms, a contour tolerance of 0.05 mm. NULL: out of memory.
shapegcode_settings* shapegcode_settings_create(void);

/// NULL is none.
shapegcode_status shapegcode_settings_destroy(shapegcode_settings* settings);

/// SHAPEGCODE_ERROR_ARGUMENT: there is no such number, or the value is none of its kind; create looks at the range.
shapegcode_status shapegcode_settings_set(shapegcode_settings* settings, int number, double value);

/// Likewise of an axis: 0 to 2, or 3 and more for those that follow.
shapegcode_status shapegcode_settings_set_axis(shapegcode_settings* settings, int number, int axis, double value);

/// A shaper for all axes (`axis` -1) or for one; copied.
shapegcode_status shapegcode_settings_set_shaper(shapegcode_settings* settings, int axis,
                                                 const shapegcode_shaper* shaper);

/// What the shaper, number 0, may be exchanged for in motion, numbers 1 and up in the order in which they are added:
/// one shaper for all axes (`count` 1), or one for each; copied.
shapegcode_status shapegcode_settings_add_shapers(shapegcode_settings* settings, const shapegcode_shaper* shapers,
                                                  size_t count);

/// Shapers for all axes, each valid where `axis` (0 to 2) is at its position, mm, ascending; copied.
shapegcode_status shapegcode_settings_set_following_shaper(shapegcode_settings* settings, int axis,
                                                           const double* positions_mm, const shapegcode_shaper* shapers,
                                                           size_t count);

/// A snapshot for a user interface.
typedef struct shapegcode_state {
  int32_t activity;  ///< a shapegcode_activity
  int32_t axes;
  double set_point[SHAPEGCODE_MOST_AXES];  ///< last one given; mm, or the unit of a following axis
  double speed_mm_per_s;                   ///< along the path, before smoothing and shaper
  double distance_mm;                      ///< since the last rest
  double feed_override;
  uint64_t line;  ///< of the segment that is being run
  uint64_t segments_done;
  uint64_t segments_waiting;
  uint64_t steps;
  uint64_t starvations;          ///< how often the segments ran out
  uint64_t late_plans;           ///< how often the motion slowed down because nothing further was planned in time
  uint64_t travel_stops;         ///< how often it was held because the path would have left the travel
  double set_point_distance_mm;  ///< `distance_mm` and `line` of the set-point that was given, which has come through
  uint64_t set_point_line;       ///< smoothing and shaper: shapegcode_controller_delay() periods later, rounded
  double spindle_speed;          ///< revolutions per s
  double spindle_error_mm;       ///< of a synchronous segment: the motion less what the angle asks for
  double offset[SHAPEGCODE_MOST_AXES];  ///< of the axes, before smoothing and shaper
  uint64_t shaper;                      ///< number of the one that acts, or that is being faded to
  double rapid_override;
} shapegcode_state;

/// A control. One thread may push, one may step, one may plan, any may call the rest but create, destroy and restart.
typedef struct shapegcode_controller shapegcode_controller;

/// Makes a control at rest at zero. On any answer but SHAPEGCODE_OK `*controller` is NULL and `message` (may be NULL)
/// holds what is wrong, with value and limit, cut off at `message_size` characters and always ended.
shapegcode_status shapegcode_controller_create(const shapegcode_settings* settings, shapegcode_controller** controller,
                                               char* message, size_t message_size);

/// Frees a control; NULL is none.
shapegcode_status shapegcode_controller_destroy(shapegcode_controller* controller);

/// Axes of a set-point: three and those that follow.
shapegcode_status shapegcode_controller_axes(const shapegcode_controller* controller, int32_t* axes);

/// What a feed counts in, and what changes it.
typedef enum shapegcode_feed_rate {
  SHAPEGCODE_PER_TIME = 0,        ///< per s; the feed override
  SHAPEGCODE_RAPID = 1,           ///< per s; the rapid override
  SHAPEGCODE_PER_REVOLUTION = 2,  ///< per revolution of the spindle; the feed override
  SHAPEGCODE_SYNCHRONOUS = 3      ///< likewise, bound to the angle of the spindle from rest to rest; no override
} shapegcode_feed_rate;

/// What a feed is of, where X, Y and Z move together with axes that follow.
typedef enum shapegcode_feed_of {
  SHAPEGCODE_FEED_OF_PATH = 0,      ///< X, Y and Z along their path; where these rest, the axis that moves the furthest
  SHAPEGCODE_FEED_OF_ALL_AXES = 1,  ///< the root of the squares of all, degrees counted as mm
  SHAPEGCODE_FEED_OF_DOMINANT = 2,  ///< that of X, Y and Z along their path and the others which moves the furthest
  SHAPEGCODE_FEED_OF_TIME = 3       ///< inverse time: the segment lasts one over the feed, s or revolutions
} shapegcode_feed_of;

/// How a segment is run. Always begin with shapegcode_rules_init().
typedef struct shapegcode_rules {
  uint64_t struct_size;     ///< written by shapegcode_rules_init(); tells the library how much of the struct there is
  uint32_t line;            ///< what the state shows while it is run
  int32_t stop_at_end;      ///< 1: an exact stop; on the last segment of a program it says that none is missing
  int32_t feed_rate;        ///< a shapegcode_feed_rate
  int32_t feed_of;          ///< a shapegcode_feed_of
  double max_acceleration;  ///< along its path, beside the limits of the axes
  double max_jerk;
} shapegcode_rules;

/// Line 0, no stop, a feed per s along the path, no limits. `struct_size` is sizeof(shapegcode_rules).
shapegcode_status shapegcode_rules_init(shapegcode_rules* rules, size_t struct_size);

/// A straight move from the end of the segment before (at first: from where create or restart put it) to `end`, of as
/// many values as there are axes. From the planning thread: never blocks, does not allocate. `rules` may be NULL: those
/// that shapegcode_rules_init() writes.
shapegcode_status shapegcode_controller_push_line(shapegcode_controller* controller, const double* end,
                                                  double feed_mm_per_s, const shapegcode_rules* rules);

/// How an arc or helix turns.
typedef struct shapegcode_arc {
  double centre_mm[3];  ///< its value along `normal` has no say
  double sweep_rad;     ///< above zero: X towards Y about Z, Y towards Z about X, Z towards X about Y
  int32_t normal;       ///< axis across its plane: 0 X, 1 Y, 2 Z
} shapegcode_arc;

/// The same along an arc or a helix. A sweep that misses the end by up to 0.01 mm is turned to meet it; radii at start
/// and end that differ are joined by a linear change.
shapegcode_status shapegcode_controller_push_arc(shapegcode_controller* controller, const double* end,
                                                 const shapegcode_arc* arc, double feed_mm_per_s,
                                                 const shapegcode_rules* rules);

/// An event behind the segment that was pushed last, from the planning thread; as many may wait as segments.
shapegcode_status shapegcode_controller_push_event(shapegcode_controller* controller, uint32_t id, uint64_t word);

/// Likewise a dwell: what leaves the control rests there for so long. A hold in it restarts it.
shapegcode_status shapegcode_controller_push_dwell(shapegcode_controller* controller, double time_s);

/// Likewise a programmed stop (M00): at rest there the control is held until resume.
shapegcode_status shapegcode_controller_push_stop(shapegcode_controller* controller);

/// The events that the motion reached with the last step, one by one, from the thread that steps; `*has_event` is 0 if
/// there is none more. A junction that is passed is reached when its place has come through smoothing and shaper
/// (shapegcode_controller_delay(), rounded), one at which the motion rests when the set-points come to rest.
shapegcode_status shapegcode_controller_next_event(shapegcode_controller* controller, uint32_t* id, uint64_t* word,
                                                   int* has_event);

/// The next set-point, of as many values as there are axes, and what the control does (`activity` may be NULL). From
/// the real-time thread: no allocation, no lock; bounded work, but for the planning with `plans_in_step`.
shapegcode_status shapegcode_controller_step(shapegcode_controller* controller, double* set_point,
                                             shapegcode_activity* activity);

/// The same with the velocity and acceleration of each axis at the set-point, for a drive's feed-forward (per s and
/// s^2; each may be NULL): they have come through the same smoothing and shaper.
shapegcode_status shapegcode_controller_step_motion(shapegcode_controller* controller, double* set_point,
                                                    double* velocity, double* acceleration,
                                                    shapegcode_activity* activity);

/// Plans on until enough lies ahead of the motion: from one thread, the pushing or another one, where `plans_in_step`
/// is 0. Does not allocate. `has_worked` (may be NULL) is 0 if there was nothing to do: call it again after some
/// periods.
shapegcode_status shapegcode_controller_plan(shapegcode_controller* controller, int* has_worked);

/// Ratio of the programmed feeds; what is outside of 0 to 2 is taken as the nearer end. It acts on what is not planned
/// yet: after 8 to 32 periods and the lead; 0 is a hold.
shapegcode_status shapegcode_controller_feed_override(shapegcode_controller* controller, double ratio);

/// The same of rapids, which the feed override leaves alone. One that is 0 stops a motion that it acts on.
shapegcode_status shapegcode_controller_rapid_override(shapegcode_controller* controller, double ratio);

/// Fades to a shaper of the settings by its number, from the next period on, or when an earlier fade or a synchronous
/// segment ends; a synchronous segment waits for it. From any thread.
shapegcode_status shapegcode_controller_exchange_shaper(shapegcode_controller* controller, int number);

/// Where the spindle is in this period, in revolutions that go on counting; from the thread that steps, in front of
/// every step.
shapegcode_status shapegcode_controller_spindle(shapegcode_controller* controller, double revolutions);

/// Come to rest along the path.
shapegcode_status shapegcode_controller_hold(shapegcode_controller* controller);

/// Go on after hold.
shapegcode_status shapegcode_controller_resume(shapegcode_controller* controller);

/// Come to rest along the path and forget the rest of it; when it rests, flushed makes it go on from there.
shapegcode_status shapegcode_controller_flush(shapegcode_controller* controller);

/// From the planning thread, after flush: `*done` is 1 and `position` where the motion rests, from where on segments
/// are taken again; 0: it does not rest yet, or plan is at work, or there was no flush.
shapegcode_status shapegcode_controller_flushed(shapegcode_controller* controller, double* position, int* done);

/// A probe has touched, in the period of the last step: gives its set-point and flushes. From the thread that steps.
shapegcode_status shapegcode_controller_probe(shapegcode_controller* controller, double* latched);

/// Come to rest along the path and forget the rest of it, until restart.
shapegcode_status shapegcode_controller_abort(shapegcode_controller* controller);

/// Likewise with all that SHAPEGCODE_EMERGENCY_ACCELERATION allows, whatever the jerk.
shapegcode_status shapegcode_controller_emergency_stop(shapegcode_controller* controller);

/// Moves an axis by hand while the path rests: after hold, at a stop that was pushed, after flush until flushed, after
/// abort; unit per s with a sign, 0: to rest. From any thread, but one for each axis. It comes to rest at the end of
/// the travel. resume leads back onto the path, then that goes on; flushed and restart begin at the new place.
shapegcode_status shapegcode_controller_jog(shapegcode_controller* controller, int axis, double speed);

/// Likewise by a distance; those that are given before it ends add up.
shapegcode_status shapegcode_controller_jog_by(shapegcode_controller* controller, int axis, double distance,
                                               double speed);

/// Back along the path by so many mm from where it rests, as far as it is kept; less than before: forward. When a jog
/// may; resume leads to where the path rests, then it goes on.
shapegcode_status shapegcode_controller_retrace(shapegcode_controller* controller, double distance_mm);

/// An offset to which the axis goes within limits of its own, at rest and while the path is run. From any thread.
shapegcode_status shapegcode_controller_offset(shapegcode_controller* controller, int axis, double value);

/// Where an axis may be from now on. Where the path that is planned would leave it, the control is held, with the stop
/// that is planned. From any thread.
shapegcode_status shapegcode_controller_travel(shapegcode_controller* controller, int axis, double low, double high);

/// At rest at a position (as many values as there are axes), the queue empty. Not while another thread pushes or steps.
shapegcode_status shapegcode_controller_restart(shapegcode_controller* controller, const double* position);

/// `struct_size` is sizeof(shapegcode_state).
shapegcode_status shapegcode_controller_state(const shapegcode_controller* controller, shapegcode_state* state,
                                              size_t struct_size);

/// Mean delay of correction, smoothing and shaper.
shapegcode_status shapegcode_controller_delay(const shapegcode_controller* controller, double* periods);

#ifdef __cplusplus
}
#endif
// NOLINTEND(modernize-*)

#endif
