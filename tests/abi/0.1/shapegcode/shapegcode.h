#ifndef SHAPEGCODE_SHAPEGCODE_H
#define SHAPEGCODE_SHAPEGCODE_H

// What is C++'s own way does not hold here.  NOLINTBEGIN(modernize-*)
#include <stddef.h>
#include <stdint.h>

// A control in C: blocks come while the machine moves, one set-point leaves per period. It is the MotionController of
// "shapegcode/controller.hpp", with the same promises.
//
//     shapegcode_settings settings;
//     shapegcode_settings_init(&settings, sizeof settings);
//     settings.limits.law = SHAPEGCODE_JERK_LIMITED;
//     for (int axis = 0; axis < 3; ++axis) settings.limits.max_acceleration_mm_per_s2[axis] = 1000.0;
//     shapegcode_controller* control;
//     char message[200];
//     if (shapegcode_controller_create(&settings, &control, message, sizeof message)) return complain(message);
//     const double corner[3] = {40.0, 0.0, 0.0};
//     shapegcode_controller_push_line(control, corner, 100.0, 1, 1);  // planning thread: feed, line, stop at the end
//     double set_point[3];
//     shapegcode_activity activity;
//     do {                                                            // real-time thread, every millisecond
//       shapegcode_controller_step(control, set_point, &activity);
//       drive(set_point);
//     } while (activity != SHAPEGCODE_IDLE);
//     shapegcode_controller_destroy(control);

#ifdef __cplusplus
extern "C" {
#endif

/// Version of this interface. While it stays, structs only grow at their ends and functions keep their meaning.
#define SHAPEGCODE_C_VERSION 1

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
  SHAPEGCODE_NO_LENGTH = 3,           ///< it moves no axis
  SHAPEGCODE_NO_FEED = 4,             ///< a feed that is not above zero, or not finite
  SHAPEGCODE_NOT_FINITE = 5,          ///< a position, centre or sweep is no number
  SHAPEGCODE_WRONG_AXES = 6,          ///< not as many following axes as the settings have
  SHAPEGCODE_AFTER_ABORT = 7,         ///< nothing is taken between abort and restart
  SHAPEGCODE_NO_ARC = 8,              ///< no radius, no sweep, no such plane, or the sweep does not lead to the end
  SHAPEGCODE_NO_TIME = 9,             ///< a dwell below zero, above 1e6 s, or no number
  SHAPEGCODE_FLUSHING = 10,           ///< between flush and flushed nothing is taken
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
  SHAPEGCODE_STOPPING = 2,  ///< decelerating for hold or abort
  SHAPEGCODE_HELD = 3,      ///< at rest after hold
  SHAPEGCODE_STARVED = 4,   ///< coming to rest: the segments ran out before one with stop_at_end. At rest it is idle
  SHAPEGCODE_ABORTED = 5    ///< at rest after abort; the path is gone
} shapegcode_activity;

/// A short English text; of an unknown code, too. Never NULL.
const char* shapegcode_activity_text(int activity);

/// Law of a change of speed.
typedef enum shapegcode_law {
  SHAPEGCODE_CONSTANT_TIME = 0,  ///< a ramp lasts the time constant, where the path leaves room for it
  SHAPEGCODE_JERK_LIMITED = 1    ///< the acceleration of the axes, smoothed by the jerk time
} shapegcode_law;

/// Limits of X, Y and Z, and the rules for corners; INFINITY switches a limit off.
typedef struct shapegcode_limits {
  int32_t law;  ///< a shapegcode_law
  double time_constant_s;
  double jerk_time_s;
  double max_feed_mm_per_s[3];
  double max_acceleration_mm_per_s2[3];
  double max_jerk_mm_per_s3[3];
  double corner_speed_difference_mm_per_s[3];
  double corner_stop_angle_rad;  ///< a corner that turns by as much or more is a stop
  double block_time_s;           ///< no segment is run off faster
  double junction_deviation_mm;  ///< a corner is passed as an arc that cuts it by so much
  double centripetal_acceleration_mm_per_s2;
  double polyline_acceleration_mm_per_s2;
  double contour_acceleration_mm_per_s2[3];
  double arc_feed_ratio;  ///< feed on arcs relative to the programmed one
} shapegcode_limits;

/// Limits of an axis that follows the path, in its own unit (mm or degrees) and seconds; INFINITY: none.
typedef struct shapegcode_following_limits {
  double max_feed;
  double max_acceleration;
  double max_jerk;
} shapegcode_following_limits;

/// A shaper on the grid of the period: taps that add up to one (within 1e-9) at ascending delays in periods.
typedef struct shapegcode_shaper {
  const int32_t* delays;
  const double* taps;
  size_t count;
} shapegcode_shaper;

/// What a control is made of. Always begin with shapegcode_settings_init().
typedef struct shapegcode_settings {
  size_t struct_size;  ///< written by shapegcode_settings_init(); tells the library how much of the struct there is
  double period_s;
  shapegcode_limits limits;
  shapegcode_following_limits following[SHAPEGCODE_MOST_FOLLOWING_AXES];
  size_t following_count;
  double contour_tolerance_mm;       ///< of rounded corners, smoothing and shaper; INFINITY: any
  double smoothing_time_s;           ///< length of each of two moving averages; 0: none
  const shapegcode_shaper* shapers;  ///< copied by create
  size_t shaper_count;               ///< 0: none; 1: one for all axes; else one for each axis
  int32_t contour_correction;        ///< 1: take back what smoothing and shaper cut off arcs
  size_t window;                     ///< segments that the look-ahead sees, 8 at least
  size_t queue;           ///< segments that may wait in all; rounded up to a power of two, and holds the window
  int32_t plans_in_step;  ///< 1: step() plans for itself, every 8 to 32 periods; 0: another thread calls plan()
  int32_t lead_periods;   ///< that plan() is ahead of the motion
  double following_tolerance[SHAPEGCODE_MOST_FOLLOWING_AXES];  ///< where the speed of such an axis changes at once
} shapegcode_settings;

/// Writes the defaults: no limits, no shaper, 1 ms, a contour tolerance of 0.05 mm. `struct_size` is
/// sizeof(shapegcode_settings).
shapegcode_status shapegcode_settings_init(shapegcode_settings* settings, size_t struct_size);

/// A snapshot for a user interface.
typedef struct shapegcode_state {
  int32_t activity;  ///< a shapegcode_activity
  int32_t axes;
  double set_point[SHAPEGCODE_MOST_AXES];  ///< last one given; mm, or the unit of a following axis
  double speed_mm_per_s;                   ///< along the path, before smoothing and shaper
  double distance_mm;                      ///< since the last rest
  double feed_override;
  uint64_t segments_done;
  uint64_t segments_waiting;
  uint64_t steps;
  uint64_t starvations;          ///< how often the segments ran out
  uint32_t line;                 ///< of the segment that is being run
  uint64_t late_plans;           ///< how often the motion slowed down because nothing further was planned in time
  double set_point_distance_mm;  ///< `distance_mm` and `line` of the set-point that was given, which has come through
  uint64_t set_point_line;       ///< smoothing and shaper: shapegcode_controller_delay() periods later, rounded
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

/// A straight move from the end of the segment before (at first: from where create or restart put it) to `end`, of as
/// many values as there are axes. From the planning thread: never blocks, does not allocate. `line` is what the state
/// shows while it is run; `stop_at_end` not zero: an exact stop.
shapegcode_status shapegcode_controller_push_line(shapegcode_controller* controller, const double* end,
                                                  double feed_mm_per_s, uint32_t line, int stop_at_end);

/// How an arc or helix turns.
typedef struct shapegcode_arc {
  double centre_mm[3];  ///< its value along `normal` has no say
  double sweep_rad;     ///< above zero: X towards Y about Z, Y towards Z about X, Z towards X about Y
  int32_t normal;       ///< axis across its plane: 0 X, 1 Y, 2 Z
} shapegcode_arc;

/// The same along an arc or a helix. A sweep that misses the end by up to 0.01 mm is turned to meet it; radii at start
/// and end that differ are joined by a linear change.
shapegcode_status shapegcode_controller_push_arc(shapegcode_controller* controller, const double* end,
                                                 const shapegcode_arc* arc, double feed_mm_per_s, uint32_t line,
                                                 int stop_at_end);

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
