/* A client as it was compiled with the header of version 1.0, which lies beside it: every struct and every function. */
#include <math.h>
#include <stdio.h>

#include "shapegcode/shapegcode.h"

static int failures = 0;

static void check(int holds, int line) {
  if (holds) return;
  ++failures;
  fprintf(stderr, "client.c:%d does not hold\n", line);
}
#define CHECK(condition) check((condition) != 0, __LINE__)
#define DONE(call) CHECK((call) == SHAPEGCODE_OK)

/* What lies behind a struct of its size must stay as it was. */
typedef struct guarded_state {
  shapegcode_state state;
  double behind;
} guarded_state;

static shapegcode_controller* make_control(void) {
  const int32_t delays[2] = {0, 9};
  const double taps[2] = {0.55, 0.45};
  const double places[2] = {0.0, 100.0};
  const shapegcode_shaper shapers[2] = {{delays, taps, 2}, {delays, taps, 2}};
  shapegcode_settings* settings = shapegcode_settings_create();
  shapegcode_controller* control = NULL;
  char message[200];
  int axis;
  DONE(shapegcode_settings_set(settings, SHAPEGCODE_PERIOD_S, 0.001));
  DONE(shapegcode_settings_set(settings, SHAPEGCODE_FOLLOWING_AXES, 1));
  DONE(shapegcode_settings_set(settings, SHAPEGCODE_WINDOW, 32));
  DONE(shapegcode_settings_set(settings, SHAPEGCODE_RETRACE_PERIODS, 500));
  for (axis = 0; axis < 4; ++axis) {
    DONE(shapegcode_settings_set_axis(settings, SHAPEGCODE_MAX_FEED, axis, 150.0));
    DONE(shapegcode_settings_set_axis(settings, SHAPEGCODE_MAX_ACCELERATION, axis, 1500.0));
    DONE(shapegcode_settings_set_axis(settings, SHAPEGCODE_MAX_JERK, axis, 60000.0));
    DONE(shapegcode_settings_set_axis(settings, SHAPEGCODE_TRAVEL_HIGH, axis, 500.0));
    DONE(shapegcode_settings_set_axis(settings, SHAPEGCODE_EMERGENCY_ACCELERATION, axis, 6000.0));
  }
  DONE(shapegcode_settings_set_following_shaper(settings, 0, places, shapers, 2));
  DONE(shapegcode_settings_set_shaper(settings, -1, &shapers[0]));
  DONE(shapegcode_controller_create(settings, &control, message, sizeof message));
  DONE(shapegcode_settings_destroy(settings));
  return control;
}

static void run(shapegcode_controller* control, int activity, double* set_point) {
  shapegcode_activity now = SHAPEGCODE_MOVING;
  int n;
  for (n = 0; n < 20000 && (int)now != activity; ++n) DONE(shapegcode_controller_step(control, set_point, &now));
  CHECK((int)now == activity);
}

static void push_all(shapegcode_controller* control) {
  const double corner[4] = {40.0, 0.0, 0.0, 30.0};
  const double end[4] = {60.0, 20.0, 0.0, 30.0};
  const shapegcode_arc arc = {{40.0, 20.0, 0.0}, 1.5707963267948966, 2};
  shapegcode_rules rules;
  DONE(shapegcode_rules_init(&rules, sizeof rules));
  rules.line = 7;
  rules.feed_of = SHAPEGCODE_FEED_OF_ALL_AXES;
  rules.max_acceleration = 1000.0;
  DONE(shapegcode_controller_push_line(control, corner, 100.0, &rules));
  DONE(shapegcode_controller_push_event(control, 3, 4));
  DONE(shapegcode_controller_push_dwell(control, 0.05));
  rules.stop_at_end = 1;
  DONE(shapegcode_controller_push_arc(control, end, &arc, 100.0, &rules));
  DONE(shapegcode_controller_push_stop(control));
}

static void operate(shapegcode_controller* control) {
  double set_point[4];
  double rates[8];
  double position[4];
  uint32_t id = 0;
  uint64_t word = 0;
  int flag = 0;
  DONE(shapegcode_controller_step_motion(control, set_point, rates, rates + 4, NULL));
  DONE(shapegcode_controller_plan(control, &flag));
  DONE(shapegcode_controller_feed_override(control, 0.8));
  DONE(shapegcode_controller_rapid_override(control, 0.5));
  DONE(shapegcode_controller_spindle(control, 0.0));
  DONE(shapegcode_controller_hold(control));
  run(control, SHAPEGCODE_HELD, set_point);
  DONE(shapegcode_controller_jog(control, 1, -20.0));
  DONE(shapegcode_controller_jog_by(control, 2, 1.0, 20.0));
  DONE(shapegcode_controller_retrace(control, 0.0));
  run(control, SHAPEGCODE_JOGGING, set_point);
  DONE(shapegcode_controller_jog(control, 1, 0.0));
  run(control, SHAPEGCODE_HELD, set_point);
  DONE(shapegcode_controller_resume(control));
  DONE(shapegcode_controller_travel(control, 0, -1.0, 500.0));
  CHECK(shapegcode_controller_offset(control, 0, 1.0) == SHAPEGCODE_NO_AXIS);
  run(control, SHAPEGCODE_HELD, set_point); /* at the stop behind the arc */
  CHECK(fabs(set_point[0] - 60.0) < 1e-9 && fabs(set_point[1] - 20.0) < 1e-9 && fabs(set_point[3] - 30.0) < 1e-9);
  DONE(shapegcode_controller_next_event(control, &id, &word, &flag));
  CHECK(flag == 1 && id == 3 && word == 4);
  DONE(shapegcode_controller_resume(control));
  run(control, SHAPEGCODE_IDLE, set_point);
  DONE(shapegcode_controller_probe(control, position));
  DONE(shapegcode_controller_flush(control));
  DONE(shapegcode_controller_step(control, set_point, NULL));
  for (flag = 0; flag == 0;) {
    DONE(shapegcode_controller_step(control, set_point, NULL));
    DONE(shapegcode_controller_flushed(control, position, &flag));
  }
  CHECK(position[0] == 60.0);
  DONE(shapegcode_controller_emergency_stop(control));
  DONE(shapegcode_controller_abort(control));
  run(control, SHAPEGCODE_ABORTED, set_point);
  DONE(shapegcode_controller_restart(control, position));
}

int main(void) {
  guarded_state guarded;
  double periods = 0.0;
  int32_t axes = 0;
  shapegcode_controller* control = make_control();
  CHECK(shapegcode_c_version() >= SHAPEGCODE_C_VERSION && shapegcode_c_version() / 1000 == 1);
  CHECK(SHAPEGCODE_C_VERSION == 1000);
  DONE(shapegcode_controller_axes(control, &axes));
  CHECK(axes == 4);
  DONE(shapegcode_controller_delay(control, &periods));
  CHECK(fabs(periods - 0.45 * 9) < 1e-9);
  push_all(control);
  operate(control);
  guarded.behind = 42.0;
  DONE(shapegcode_controller_state(control, &guarded.state, sizeof guarded.state));
  CHECK(guarded.behind == 42.0 && guarded.state.activity == SHAPEGCODE_IDLE && guarded.state.set_point[0] == 60.0);
  CHECK(shapegcode_status_text(SHAPEGCODE_NO_RECORD)[0] != '\0' &&
        shapegcode_activity_text(SHAPEGCODE_JOGGING)[0] == 'j');
  DONE(shapegcode_controller_destroy(control));
  if (failures == 0) printf("a client of version 1.0 runs\n");
  return failures == 0 ? 0 : 1;
}
