/* The C interface as a C99 compiler sees it: a square whose sides come while it is run, holds and override changes on
   the way; arcs; and what is refused. */
#include <math.h>
#include <stdio.h>
#include <string.h>

#include "shapegcode/shapegcode.h"

static int failures = 0;

#define CHECK(condition)                                                            \
  do {                                                                              \
    if (!(condition)) {                                                             \
      ++failures;                                                                   \
      fprintf(stderr, "%s:%d: %s does not hold\n", __FILE__, __LINE__, #condition); \
    }                                                                               \
  } while (0)

static const double period_s = 0.001;
static const double feed_mm_per_s = 100.0;
static const double tolerance_mm = 0.05;

static shapegcode_settings* plain_settings(void) {
  shapegcode_settings* settings = shapegcode_settings_create();
  int axis;
  CHECK(settings != NULL);
  CHECK(shapegcode_settings_set(settings, SHAPEGCODE_PERIOD_S, period_s) == SHAPEGCODE_OK);
  CHECK(shapegcode_settings_set(settings, SHAPEGCODE_CONTOUR_TOLERANCE_MM, tolerance_mm) == SHAPEGCODE_OK);
  for (axis = 0; axis < 3; ++axis) {
    CHECK(shapegcode_settings_set_axis(settings, SHAPEGCODE_MAX_ACCELERATION, axis, 1000.0) == SHAPEGCODE_OK);
    CHECK(shapegcode_settings_set_axis(settings, SHAPEGCODE_MAX_JERK, axis, 50000.0) == SHAPEGCODE_OK);
  }
  return settings;
}

/* Of settings that it frees. */
static shapegcode_controller* made(shapegcode_settings* settings) {
  shapegcode_controller* control = NULL;
  char message[200];
  const shapegcode_status status = shapegcode_controller_create(settings, &control, message, sizeof message);
  if (status != SHAPEGCODE_OK) fprintf(stderr, "create: %s: %s\n", shapegcode_status_text(status), message);
  CHECK(status == SHAPEGCODE_OK && control != NULL && message[0] == '\0');
  CHECK(shapegcode_settings_destroy(settings) == SHAPEGCODE_OK);
  return control;
}

static shapegcode_rules rules_of(uint32_t line, int stop_at_end) {
  shapegcode_rules rules;
  CHECK(shapegcode_rules_init(&rules, sizeof rules) == SHAPEGCODE_OK);
  rules.line = line;
  rules.stop_at_end = stop_at_end;
  return rules;
}

static shapegcode_status push_line(shapegcode_controller* control, const double* end, double feed, uint32_t line,
                                   int stop_at_end) {
  const shapegcode_rules rules = rules_of(line, stop_at_end);
  return shapegcode_controller_push_line(control, end, feed, &rules);
}

static shapegcode_status push_arc(shapegcode_controller* control, const double* end, const shapegcode_arc* arc,
                                  double feed, uint32_t line, int stop_at_end) {
  const shapegcode_rules rules = rules_of(line, stop_at_end);
  return shapegcode_controller_push_arc(control, end, arc, feed, &rules);
}

static double distance(const double* a, const double* b) { return sqrt(pow(a[0] - b[0], 2) + pow(a[1] - b[1], 2)); }

static shapegcode_state state_of(const shapegcode_controller* control) {
  shapegcode_state state;
  CHECK(shapegcode_controller_state(control, &state, sizeof state) == SHAPEGCODE_OK);
  return state;
}

/* Steps until it does that, at most so often. */
static void run(shapegcode_controller* control, double* set_point, shapegcode_activity until, int most) {
  shapegcode_activity activity;
  do {
    CHECK(shapegcode_controller_step(control, set_point, &activity) == SHAPEGCODE_OK);
  } while (activity != until && --most > 0);
  CHECK(activity == until);
}

/* What happens to the square at which period. */
static void operate(shapegcode_controller* control, int step) {
  if (step == 300) CHECK(shapegcode_controller_feed_override(control, 0.5) == SHAPEGCODE_OK);
  if (step == 600) CHECK(shapegcode_controller_hold(control) == SHAPEGCODE_OK);
  if (step == 1000) {
    CHECK(state_of(control).activity == SHAPEGCODE_HELD);
    CHECK(state_of(control).speed_mm_per_s == 0.0);
    CHECK(shapegcode_controller_resume(control) == SHAPEGCODE_OK);
    CHECK(shapegcode_controller_feed_override(control, 1.2) == SHAPEGCODE_OK);
  }
}

static void square(void) {
  static const double corners[4][3] = {{40, 0, 0}, {40, 40, 0}, {0, 40, 0}, {0, 0, 0}};
  const int32_t delays[2] = {0, 11};
  const double taps[2] = {0.516, 0.484};
  const shapegcode_shaper zv = {delays, taps, 2};
  shapegcode_settings* settings = plain_settings();
  shapegcode_controller* control;
  shapegcode_activity activity = SHAPEGCODE_MOVING;
  double set_point[3] = {0, 0, 0};
  double nearest[4] = {1e9, 1e9, 1e9, 1e9};
  double fastest = 0.0;
  int pushed = 0;
  int step = 0;
  CHECK(shapegcode_settings_set_shaper(settings, -1, &zv) == SHAPEGCODE_OK);
  control = made(settings);
  while (step < 20000 && (pushed < 4 || activity != SHAPEGCODE_IDLE)) {
    double before[3];
    int corner;
    /* Every tenth of a second a side, long before the one before is at its end. */
    if (pushed < 4 && step % 100 == 0) {
      CHECK(push_line(control, corners[pushed], feed_mm_per_s, (uint32_t)pushed + 1, pushed == 3) == SHAPEGCODE_OK);
      ++pushed;
    }
    operate(control, step);
    memcpy(before, set_point, sizeof before);
    CHECK(shapegcode_controller_step(control, set_point, &activity) == SHAPEGCODE_OK);
    fastest = fmax(fastest, distance(before, set_point) / period_s);
    for (corner = 0; corner < 4; ++corner) {
      if (step > 100) nearest[corner] = fmin(nearest[corner], distance(set_point, corners[corner]));
    }
    ++step;
  }
  CHECK(activity == SHAPEGCODE_IDLE);
  CHECK(set_point[0] == 0.0 && set_point[1] == 0.0 && set_point[2] == 0.0);
  CHECK(fastest <= 1.001 * 1.2 * feed_mm_per_s && fastest > 1.19 * feed_mm_per_s);
  for (step = 0; step < 4; ++step) CHECK(nearest[step] <= tolerance_mm);
  CHECK(state_of(control).segments_done == 4 && state_of(control).segments_waiting == 0);
  CHECK(state_of(control).starvations == 0 && state_of(control).feed_override == 1.2);
  CHECK(shapegcode_controller_destroy(control) == SHAPEGCODE_OK);
}

/* With what a drive's feed-forward wants: the second half of a move mirrors the first. */
static void feed_forward(void) {
  shapegcode_controller* control = made(plain_settings());
  const double end[3] = {10, 0, 0};
  double set_point[3];
  double velocity[3];
  double acceleration[3];
  double sum = 0.0;
  double fastest = 0.0;
  shapegcode_activity activity = SHAPEGCODE_MOVING;
  CHECK(push_line(control, end, feed_mm_per_s, 7, 1) == SHAPEGCODE_OK);
  while (activity != SHAPEGCODE_IDLE && state_of(control).steps < 10000) {
    CHECK(shapegcode_controller_step_motion(control, set_point, velocity, acceleration, &activity) == SHAPEGCODE_OK);
    sum += velocity[0] * period_s;
    fastest = fmax(fastest, velocity[0]);
  }
  CHECK(fabs(sum - end[0]) < 1e-6 && fastest <= 1.001 * feed_mm_per_s);
  CHECK(velocity[0] == 0.0 && acceleration[0] == 0.0 && set_point[0] == end[0]);
  CHECK(state_of(control).set_point_line == 7);
  CHECK(shapegcode_controller_step_motion(control, set_point, NULL, NULL, NULL) == SHAPEGCODE_OK);
  CHECK(shapegcode_controller_step_motion(control, NULL, velocity, acceleration, NULL) == SHAPEGCODE_ERROR_NULL);
  CHECK(shapegcode_controller_destroy(control) == SHAPEGCODE_OK);
}

/* Something at a corner, a dwell there, and a stop that waits. */
static void events(void) {
  shapegcode_controller* control = made(plain_settings());
  const double corner[3] = {10, 0, 0};
  const double end[3] = {10, 10, 0};
  double set_point[3];
  uint32_t id = 0;
  uint64_t word = 0;
  int has_event = 1;
  int dwelt = 0;
  CHECK(push_line(control, corner, feed_mm_per_s, 1, 0) == SHAPEGCODE_OK);
  CHECK(shapegcode_controller_push_event(control, 5, 11) == SHAPEGCODE_OK);
  CHECK(shapegcode_controller_push_dwell(control, 0.1) == SHAPEGCODE_OK);
  CHECK(shapegcode_controller_push_dwell(control, -0.1) == SHAPEGCODE_NO_TIME);
  CHECK(push_line(control, end, feed_mm_per_s, 2, 0) == SHAPEGCODE_OK);
  CHECK(shapegcode_controller_push_stop(control) == SHAPEGCODE_OK);
  while (state_of(control).activity != SHAPEGCODE_HELD && state_of(control).steps < 10000) {
    CHECK(shapegcode_controller_step(control, set_point, NULL) == SHAPEGCODE_OK);
    if (distance(set_point, corner) < 1e-9) ++dwelt;
    CHECK(shapegcode_controller_next_event(control, &id, &word, &has_event) == SHAPEGCODE_OK);
    if (has_event) CHECK(id == 5 && word == 11 && distance(set_point, corner) < 1e-9 && dwelt < 3);
  }
  CHECK(dwelt >= 100 && dwelt < 110);
  CHECK(id == 0 && !has_event && state_of(control).starvations == 0);
  CHECK(shapegcode_controller_resume(control) == SHAPEGCODE_OK);
  run(control, set_point, SHAPEGCODE_IDLE, 10);
  CHECK(distance(set_point, end) == 0.0);
  CHECK(shapegcode_controller_next_event(control, NULL, &word, &has_event) == SHAPEGCODE_ERROR_NULL);
  CHECK(shapegcode_controller_destroy(control) == SHAPEGCODE_OK);
}

/* A probe touches on the way; the way back begins where the motion has come to rest. */
static void probing(void) {
  shapegcode_controller* control = made(plain_settings());
  const double end[3] = {100, 0, 0};
  const double start[3] = {0, 0, 0};
  double set_point[3];
  double latched[3];
  double rest[3];
  int step;
  int done = 1;
  CHECK(push_line(control, end, feed_mm_per_s, 1, 1) == SHAPEGCODE_OK);
  for (step = 0; step < 300; ++step) CHECK(shapegcode_controller_step(control, set_point, NULL) == SHAPEGCODE_OK);
  CHECK(shapegcode_controller_flushed(control, rest, &done) == SHAPEGCODE_OK && !done);
  CHECK(shapegcode_controller_probe(control, latched) == SHAPEGCODE_OK);
  CHECK(distance(latched, set_point) == 0.0);
  CHECK(push_line(control, start, feed_mm_per_s, 2, 1) == SHAPEGCODE_FLUSHING);
  run(control, set_point, SHAPEGCODE_IDLE, 2000);
  CHECK(shapegcode_controller_flushed(control, rest, &done) == SHAPEGCODE_OK && done);
  CHECK(distance(rest, set_point) < 1e-9 && rest[0] > latched[0] && rest[0] < end[0] - 1.0);
  CHECK(push_line(control, start, feed_mm_per_s, 2, 1) == SHAPEGCODE_OK);
  run(control, set_point, SHAPEGCODE_IDLE, 20000);
  CHECK(distance(set_point, start) == 0.0 && state_of(control).segments_done == 1);
  CHECK(shapegcode_controller_flush(control) == SHAPEGCODE_OK);
  CHECK(shapegcode_controller_flush(NULL) == SHAPEGCODE_ERROR_NULL);
  CHECK(shapegcode_controller_probe(control, NULL) == SHAPEGCODE_ERROR_NULL);
  CHECK(shapegcode_controller_destroy(control) == SHAPEGCODE_OK);
}

static void arcs(void) {
  const double pi = 3.14159265358979323846;
  shapegcode_settings* settings = plain_settings();
  shapegcode_controller* control;
  shapegcode_arc arc = {{20, 0, 0}, 0, 2};
  const double start[3] = {0, 0, 0};
  const double end[3] = {20, 20, 5};
  double set_point[3];
  double highest = -1e9;
  double lowest = 1e9;
  shapegcode_activity activity = SHAPEGCODE_MOVING;
  CHECK(shapegcode_settings_set(settings, SHAPEGCODE_SMOOTHING_TIME_S, 0.0) == SHAPEGCODE_OK);
  control = made(settings);
  CHECK(push_arc(control, start, &arc, feed_mm_per_s, 1, 0) == SHAPEGCODE_NO_ARC); /* no sweep */
  arc.sweep_rad = 0.3;
  CHECK(push_arc(control, end, &arc, feed_mm_per_s, 1, 0) == SHAPEGCODE_NO_ARC); /* leads away */
  arc.sweep_rad = NAN;
  CHECK(push_arc(control, end, &arc, feed_mm_per_s, 1, 0) == SHAPEGCODE_NOT_FINITE);
  arc.sweep_rad = -2.0 * pi;
  CHECK(push_arc(control, start, &arc, -1.0, 1, 0) == SHAPEGCODE_NO_FEED);
  CHECK(push_arc(control, start, &arc, feed_mm_per_s, 1, 0) == SHAPEGCODE_OK); /* a circle */
  arc.sweep_rad = -0.5 * pi + 1e-5; /* rounded: the end is met all the same */
  CHECK(push_arc(control, end, &arc, feed_mm_per_s, 2, 1) == SHAPEGCODE_OK);
  while (activity != SHAPEGCODE_IDLE && state_of(control).steps < 10000) {
    CHECK(shapegcode_controller_step(control, set_point, &activity) == SHAPEGCODE_OK);
    highest = fmax(highest, set_point[1]);
    lowest = fmin(lowest, set_point[1]);
  }
  CHECK(fabs(highest - 20.0) < 0.01 && fabs(lowest + 20.0) < 0.01);
  CHECK(set_point[0] == end[0] && set_point[1] == end[1] && set_point[2] == end[2]);
  CHECK(shapegcode_controller_destroy(control) == SHAPEGCODE_OK);
}

static void following_axis(void) {
  shapegcode_settings* settings = plain_settings();
  shapegcode_controller* control;
  const double end[4] = {10, 0, 0, 90};
  const double turned[4] = {10, 0, 0, 45};
  double set_point[4];
  int32_t axes = 0;
  CHECK(shapegcode_settings_set(settings, SHAPEGCODE_FOLLOWING_AXES, 1.0) == SHAPEGCODE_OK);
  control = made(settings);
  CHECK(shapegcode_controller_axes(control, &axes) == SHAPEGCODE_OK && axes == 4);
  CHECK(push_line(control, end, feed_mm_per_s, 1, 1) == SHAPEGCODE_OK);
  CHECK(push_line(control, end, feed_mm_per_s, 2, 1) == SHAPEGCODE_NO_LENGTH);
  CHECK(push_line(control, turned, feed_mm_per_s, 2, 1) == SHAPEGCODE_OK);
  run(control, set_point, SHAPEGCODE_IDLE, 10000);
  CHECK(set_point[0] == 10.0 && set_point[3] == 45.0);
  CHECK(shapegcode_controller_destroy(control) == SHAPEGCODE_OK);
}

static void axis_that_is_not_there(void) {
  shapegcode_settings* settings = plain_settings();
  shapegcode_controller* control = NULL;
  char message[200];
  CHECK(shapegcode_settings_set(settings, SHAPEGCODE_FOLLOWING_AXES, 1.0) == SHAPEGCODE_OK);
  CHECK(shapegcode_settings_set_axis(settings, SHAPEGCODE_MAX_FEED, 4, 7.0) == SHAPEGCODE_OK);
  CHECK(shapegcode_controller_create(settings, &control, message, sizeof message) == SHAPEGCODE_ERROR_ARGUMENT);
  CHECK(control == NULL && strstr(message, "axis 4") != NULL);
  CHECK(shapegcode_settings_destroy(settings) == SHAPEGCODE_OK);
}

static void abort_and_restart(void) {
  shapegcode_controller* control = made(plain_settings());
  const double far_away[3] = {100, 0, 0};
  const double wrong[3] = {INFINITY, 0, 0};
  double set_point[3];
  CHECK(push_line(control, far_away, feed_mm_per_s, 7, 1) == SHAPEGCODE_OK);
  run(control, set_point, SHAPEGCODE_MOVING, 1);
  while (set_point[0] < 30.0 && failures == 0) run(control, set_point, SHAPEGCODE_MOVING, 1);
  CHECK(state_of(control).line == 7);
  CHECK(shapegcode_controller_abort(control) == SHAPEGCODE_OK);
  run(control, set_point, SHAPEGCODE_ABORTED, 1000);
  CHECK(set_point[0] > 30.0 && set_point[0] < 60.0);
  CHECK(push_line(control, far_away, feed_mm_per_s, 8, 1) == SHAPEGCODE_AFTER_ABORT);
  CHECK(shapegcode_controller_restart(control, wrong) == SHAPEGCODE_NOT_FINITE);
  CHECK(shapegcode_controller_restart(control, set_point) == SHAPEGCODE_OK);
  CHECK(push_line(control, far_away, feed_mm_per_s, 8, 1) == SHAPEGCODE_OK);
  run(control, set_point, SHAPEGCODE_IDLE, 10000);
  CHECK(set_point[0] == 100.0);
  CHECK(shapegcode_controller_destroy(control) == SHAPEGCODE_OK);
}

static void refused_settings(void) {
  shapegcode_settings* settings = plain_settings();
  shapegcode_controller* control = (shapegcode_controller*)&settings;
  const int32_t delays[2] = {0, 11};
  const double taps[2] = {0.5, 0.4};
  const double places[2] = {10.0, 0.0};
  const shapegcode_shaper not_one = {delays, taps, 2};
  const shapegcode_shaper no_taps = {delays, NULL, 2};
  char message[200] = "before";
  char short_message[8];
  CHECK(shapegcode_settings_set(settings, SHAPEGCODE_PERIOD_S, -1.0) == SHAPEGCODE_OK);
  CHECK(shapegcode_controller_create(settings, &control, message, sizeof message) == SHAPEGCODE_ERROR_ARGUMENT);
  CHECK(control == NULL && strstr(message, "-1") != NULL);
  CHECK(shapegcode_controller_create(settings, &control, short_message, sizeof short_message) ==
        SHAPEGCODE_ERROR_ARGUMENT);
  CHECK(strlen(short_message) == 7 && strncmp(message, short_message, 7) == 0);
  CHECK(shapegcode_controller_create(settings, &control, NULL, 0) == SHAPEGCODE_ERROR_ARGUMENT);
  CHECK(shapegcode_settings_set_shaper(settings, -1, &not_one) == SHAPEGCODE_ERROR_ARGUMENT);
  CHECK(shapegcode_settings_set_shaper(settings, 0, &no_taps) == SHAPEGCODE_ERROR_NULL);
  CHECK(shapegcode_settings_set_shaper(settings, 9, &not_one) == SHAPEGCODE_ERROR_ARGUMENT);
  CHECK(shapegcode_settings_set_following_shaper(settings, 0, places, &not_one, 1) == SHAPEGCODE_ERROR_ARGUMENT);
  CHECK(shapegcode_settings_set_following_shaper(settings, 0, NULL, &not_one, 1) == SHAPEGCODE_ERROR_NULL);
  CHECK(shapegcode_settings_set(settings, 0, 1.0) == SHAPEGCODE_ERROR_ARGUMENT);
  CHECK(shapegcode_settings_set(settings, SHAPEGCODE_FOLLOWING_AXES, 7.0) == SHAPEGCODE_ERROR_ARGUMENT);
  CHECK(shapegcode_settings_set(settings, SHAPEGCODE_WINDOW, 8.5) == SHAPEGCODE_ERROR_ARGUMENT);
  CHECK(shapegcode_settings_set(settings, SHAPEGCODE_QUEUE, NAN) == SHAPEGCODE_ERROR_ARGUMENT);
  CHECK(shapegcode_settings_set(settings, SHAPEGCODE_LAW, 2.0) == SHAPEGCODE_ERROR_ARGUMENT);
  CHECK(shapegcode_settings_set_axis(settings, SHAPEGCODE_MAX_FEED, -1, 1.0) == SHAPEGCODE_ERROR_ARGUMENT);
  CHECK(shapegcode_settings_set_axis(settings, SHAPEGCODE_TOLERANCE, 0, 1.0) == SHAPEGCODE_ERROR_ARGUMENT);
  CHECK(shapegcode_settings_set_axis(settings, SHAPEGCODE_CONTOUR_ACCELERATION, 3, 1.0) == SHAPEGCODE_ERROR_ARGUMENT);
  CHECK(shapegcode_settings_set(NULL, SHAPEGCODE_PERIOD_S, 0.001) == SHAPEGCODE_ERROR_NULL);
  CHECK(shapegcode_settings_set_axis(NULL, SHAPEGCODE_MAX_FEED, 0, 1.0) == SHAPEGCODE_ERROR_NULL);
  CHECK(shapegcode_settings_destroy(settings) == SHAPEGCODE_OK);
  CHECK(shapegcode_settings_destroy(NULL) == SHAPEGCODE_OK);
}

/* A shaper that is exchanged in motion: twice the delay, no jump. */
static void other_shapers(void) {
  static const int32_t delays[2] = {0, 20};
  static const int32_t later[2] = {0, 40};
  static const double taps[2] = {0.5, 0.5};
  const shapegcode_shaper first = {delays, taps, 2};
  const shapegcode_shaper second = {later, taps, 2};
  const shapegcode_shaper no_taps = {delays, NULL, 2};
  const double end[3] = {100, 0, 0};
  shapegcode_settings* settings = plain_settings();
  shapegcode_controller* control;
  double set_point[3];
  double before = 0.0;
  double delay;
  int step;
  for (step = 0; step < 3; ++step) {
    CHECK(shapegcode_settings_set_axis(settings, SHAPEGCODE_MAX_FEED, step, 200.0) == SHAPEGCODE_OK);
  }
  CHECK(shapegcode_settings_set_shaper(settings, -1, &first) == SHAPEGCODE_OK);
  CHECK(shapegcode_settings_add_shapers(settings, &second, 0) == SHAPEGCODE_ERROR_ARGUMENT);
  CHECK(shapegcode_settings_add_shapers(settings, &no_taps, 1) == SHAPEGCODE_ERROR_NULL);
  CHECK(shapegcode_settings_add_shapers(NULL, &second, 1) == SHAPEGCODE_ERROR_NULL);
  CHECK(shapegcode_settings_add_shapers(settings, &second, 1) == SHAPEGCODE_OK);
  CHECK(shapegcode_settings_set(settings, SHAPEGCODE_FADE_TIME_S, 0.4) == SHAPEGCODE_OK);
  control = made(settings);
  CHECK(shapegcode_controller_delay(control, &delay) == SHAPEGCODE_OK && delay == 10.0);
  CHECK(shapegcode_controller_push_line(control, end, 50.0, NULL) == SHAPEGCODE_OK);
  for (step = 0; step < 1500; ++step) {
    CHECK(shapegcode_controller_step(control, set_point, NULL) == SHAPEGCODE_OK);
    CHECK(fabs(set_point[0] - before) < 0.055);
    before = set_point[0];
    if (step == 600) {
      CHECK(shapegcode_controller_exchange_shaper(control, -1) == SHAPEGCODE_ERROR_ARGUMENT);
      CHECK(shapegcode_controller_exchange_shaper(control, 2) == SHAPEGCODE_ERROR_ARGUMENT);
      CHECK(shapegcode_controller_exchange_shaper(NULL, 1) == SHAPEGCODE_ERROR_NULL);
      CHECK(shapegcode_controller_exchange_shaper(control, 1) == SHAPEGCODE_OK);
      CHECK(state_of(control).shaper == 0);
    }
  }
  CHECK(state_of(control).shaper == 1 && state_of(control).rapid_override == 1.0);
  CHECK(shapegcode_controller_delay(control, &delay) == SHAPEGCODE_OK && delay == 20.0);
  CHECK(shapegcode_controller_destroy(control) == SHAPEGCODE_OK);
}

/* A thread, an axis by hand, an offset, soft limits, an emergency stop. */
static void beside_the_path(void) {
  shapegcode_settings* settings = plain_settings();
  shapegcode_controller* control;
  shapegcode_rules thread = rules_of(3, 1);
  const double depth[3] = {0, 0, -20};
  const double beyond[3] = {0, 0, -31};
  double set_point[3];
  int step;
  int axis;
  for (axis = 0; axis < 3; ++axis) {
    CHECK(shapegcode_settings_set_axis(settings, SHAPEGCODE_EMERGENCY_ACCELERATION, axis, 4000.0) == SHAPEGCODE_OK);
  }
  CHECK(shapegcode_settings_set_axis(settings, SHAPEGCODE_TRAVEL_LOW, 2, -30.0) == SHAPEGCODE_OK);
  CHECK(shapegcode_settings_set_axis(settings, SHAPEGCODE_OFFSET_MAX_FEED, 0, 10.0) == SHAPEGCODE_OK);
  CHECK(shapegcode_settings_set_axis(settings, SHAPEGCODE_OFFSET_MAX_ACCELERATION, 0, 200.0) == SHAPEGCODE_OK);
  CHECK(shapegcode_settings_set_axis(settings, SHAPEGCODE_OFFSET_MAX_JERK, 0, 5000.0) == SHAPEGCODE_OK);
  CHECK(shapegcode_settings_set(settings, SHAPEGCODE_SPINDLE_BANDWIDTH_HZ, 15.0) == SHAPEGCODE_OK);
  control = made(settings);
  CHECK(shapegcode_controller_push_line(control, beyond, 10.0, NULL) == SHAPEGCODE_BEYOND_TRAVEL);
  thread.feed_rate = SHAPEGCODE_SYNCHRONOUS;
  CHECK(shapegcode_controller_push_line(control, depth, 1.5, &thread) == SHAPEGCODE_OK);
  for (step = 0; step < 3000; ++step) {
    CHECK(shapegcode_controller_spindle(control, 10.0 * period_s * step) == SHAPEGCODE_OK);
    CHECK(shapegcode_controller_step(control, set_point, NULL) == SHAPEGCODE_OK);
    if (step == 1000) {
      /* In the thread: so many revolutions from a whole one. */
      const double turns = -set_point[2] / 1.5 - 10.0 * period_s * step;
      CHECK(fabs(turns - floor(turns + 0.5)) < 1e-4 && set_point[2] < -5.0);
      CHECK(fabs(state_of(control).spindle_speed - 10.0) < 1e-6 && state_of(control).line == 3);
    }
  }
  CHECK(state_of(control).activity == SHAPEGCODE_IDLE && set_point[2] == -20.0);
  CHECK(shapegcode_controller_jog(control, 2, 10.0) == SHAPEGCODE_PATH_MOVES);
  CHECK(shapegcode_controller_hold(control) == SHAPEGCODE_OK);
  run(control, set_point, SHAPEGCODE_HELD, 2);
  CHECK(shapegcode_controller_jog(control, 9, 10.0) == SHAPEGCODE_NO_AXIS);
  CHECK(shapegcode_controller_jog_by(control, 2, 1.0, 0.0) == SHAPEGCODE_NO_SPEED);
  CHECK(shapegcode_controller_jog_by(control, 2, -11.0, 5.0) == SHAPEGCODE_BEYOND_TRAVEL);
  CHECK(shapegcode_controller_jog_by(control, 2, 2.5, 50.0) == SHAPEGCODE_OK);
  run(control, set_point, SHAPEGCODE_JOGGING, 1);
  run(control, set_point, SHAPEGCODE_HELD, 1000);
  CHECK(fabs(set_point[2] + 17.5) < 1e-12);
  CHECK(shapegcode_controller_resume(control) == SHAPEGCODE_OK);
  run(control, set_point, SHAPEGCODE_IDLE, 1000);
  CHECK(fabs(set_point[2] + 20.0) < 1e-12);
  CHECK(shapegcode_controller_retrace(control, 1.0) == SHAPEGCODE_NO_RECORD);
  CHECK(shapegcode_controller_offset(control, 1, 1.0) == SHAPEGCODE_NO_AXIS);
  CHECK(shapegcode_controller_offset(control, 0, NAN) == SHAPEGCODE_NOT_FINITE);
  CHECK(shapegcode_controller_offset(control, 0, -1.0) == SHAPEGCODE_OK);
  for (step = 0; step < 1000; ++step) CHECK(shapegcode_controller_step(control, set_point, NULL) == SHAPEGCODE_OK);
  CHECK(fabs(set_point[0] + 1.0) < 1e-12 && fabs(state_of(control).offset[0] + 1.0) < 1e-12);
  CHECK(shapegcode_controller_travel(control, 3, 0.0, 1.0) == SHAPEGCODE_NO_AXIS);
  CHECK(shapegcode_controller_travel(control, 2, 1.0, 0.0) == SHAPEGCODE_ERROR_ARGUMENT);
  CHECK(shapegcode_controller_travel(control, 2, -100.0, 0.0) == SHAPEGCODE_OK);
  CHECK(shapegcode_controller_rapid_override(control, 0.5) == SHAPEGCODE_OK);
  thread.feed_rate = SHAPEGCODE_RAPID;
  CHECK(shapegcode_controller_push_line(control, beyond, feed_mm_per_s, &thread) == SHAPEGCODE_OK);
  for (step = 0; step < 100; ++step) CHECK(shapegcode_controller_step(control, set_point, NULL) == SHAPEGCODE_OK);
  CHECK(fabs(state_of(control).speed_mm_per_s - 0.5 * feed_mm_per_s) < 0.05);
  CHECK(shapegcode_controller_emergency_stop(control) == SHAPEGCODE_OK);
  run(control, set_point, SHAPEGCODE_ABORTED, 20); /* 50 mm/s at 4000 mm/s^2 */
  thread.feed_of = 9;
  CHECK(shapegcode_controller_push_line(control, beyond, 1.0, &thread) == SHAPEGCODE_ERROR_STRUCT_SIZE);
  CHECK(shapegcode_rules_init(&thread, sizeof thread + 8) == SHAPEGCODE_ERROR_STRUCT_SIZE);
  CHECK(shapegcode_controller_destroy(control) == SHAPEGCODE_OK);
}

static void refused_calls(void) {
  shapegcode_controller* control = NULL;
  shapegcode_state state;
  const double end[3] = {1, 0, 0};
  const double nowhere[3] = {NAN, 0, 0};
  CHECK(shapegcode_controller_create(NULL, &control, NULL, 0) == SHAPEGCODE_ERROR_NULL && control == NULL);
  CHECK(push_line(NULL, end, 1.0, 0, 0) == SHAPEGCODE_ERROR_NULL);
  CHECK(shapegcode_controller_step(NULL, NULL, NULL) == SHAPEGCODE_ERROR_NULL);
  CHECK(shapegcode_controller_hold(NULL) == SHAPEGCODE_ERROR_NULL);
  CHECK(shapegcode_controller_destroy(NULL) == SHAPEGCODE_OK);
  control = made(plain_settings());
  CHECK(push_line(control, NULL, 1.0, 0, 0) == SHAPEGCODE_ERROR_NULL);
  CHECK(push_line(control, nowhere, 1.0, 0, 0) == SHAPEGCODE_NOT_FINITE);
  CHECK(push_line(control, end, 0.0, 0, 0) == SHAPEGCODE_NO_FEED);
  CHECK(shapegcode_controller_state(control, &state, 3) == SHAPEGCODE_ERROR_STRUCT_SIZE);
  CHECK(push_line(control, end, 1.0, 0, 0) == SHAPEGCODE_OK);
  CHECK(shapegcode_controller_destroy(control) == SHAPEGCODE_OK);
}

static void full_queue(void) {
  shapegcode_settings* settings = plain_settings();
  shapegcode_controller* control;
  double end[3] = {0, 0, 0};
  double set_point[3];
  double periods = -1.0;
  int taken = 0;
  CHECK(shapegcode_settings_set(settings, SHAPEGCODE_WINDOW, 8) == SHAPEGCODE_OK);
  CHECK(shapegcode_settings_set(settings, SHAPEGCODE_QUEUE, 8) == SHAPEGCODE_OK);
  control = made(settings);
  do {
    end[0] = taken + 1.0;
  } while (taken < 100 && push_line(control, end, feed_mm_per_s, 0, 1) == SHAPEGCODE_OK && ++taken);
  CHECK(taken >= 8 && taken < 100);
  CHECK(push_line(control, end, feed_mm_per_s, 0, 1) == SHAPEGCODE_QUEUE_FULL);
  run(control, set_point, SHAPEGCODE_IDLE, 100000);
  CHECK(set_point[0] == taken); /* what was not taken left no trace */
  CHECK(push_line(control, end, feed_mm_per_s, 0, 1) == SHAPEGCODE_OK);
  CHECK(shapegcode_controller_delay(control, &periods) == SHAPEGCODE_OK && periods >= 0.0);
  CHECK(shapegcode_controller_destroy(control) == SHAPEGCODE_OK);
}

static void texts(void) {
  int code;
  CHECK(shapegcode_c_version() == SHAPEGCODE_C_VERSION);
  for (code = SHAPEGCODE_ERROR_INTERNAL; code <= SHAPEGCODE_NO_RECORD; ++code) {
    CHECK(strcmp(shapegcode_status_text(code), shapegcode_status_text(1000)) != 0);
  }
  for (code = SHAPEGCODE_IDLE; code <= SHAPEGCODE_JOGGING; ++code) {
    CHECK(strcmp(shapegcode_activity_text(code), shapegcode_activity_text(1000)) != 0);
  }
}

int main(void) {
  texts();
  refused_settings();
  refused_calls();
  square();
  feed_forward();
  events();
  probing();
  arcs();
  following_axis();
  axis_that_is_not_there();
  beside_the_path();
  other_shapers();
  abort_and_restart();
  full_queue();
  if (failures == 0) printf("the C interface does what its header says\n");
  return failures == 0 ? 0 : 1;
}
