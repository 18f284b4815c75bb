/* The same in C: blocks come while the machine moves, the operator turns the override and presses feed hold. */

#include <stdio.h>

#include "shapegcode/shapegcode.h"

enum { sides = 20 };

/* Corners of a square spiral, 2 mm between its turns. */
static void corner(int i, double* end) {
  const double low = 2.0 * (i / 4);
  const double high = 40.0 - low;
  end[0] = i % 4 < 2 ? high : low;
  end[1] = i % 4 == 0 ? low : i % 4 == 3 ? low + 2.0 : high;
  end[2] = 0.0;
}

static shapegcode_controller* make_control(void) {
  const int32_t delays[2] = {0, 11};
  const double taps[2] = {0.516, 0.484};
  const shapegcode_shaper zv = {delays, taps, 2}; /* of 46 Hz on the grid of 1 ms */
  shapegcode_settings* settings = shapegcode_settings_create();
  shapegcode_controller* control;
  char message[200];
  int axis;
  if (settings == NULL) return NULL;
  for (axis = 0; axis < 3; ++axis) {
    shapegcode_settings_set_axis(settings, SHAPEGCODE_MAX_ACCELERATION, axis, 2000.0);
    shapegcode_settings_set_axis(settings, SHAPEGCODE_MAX_JERK, axis, 100000.0);
  }
  shapegcode_settings_set(settings, SHAPEGCODE_CONTOUR_TOLERANCE_MM, 0.05);
  shapegcode_settings_set_shaper(settings, -1, &zv);
  if (shapegcode_controller_create(settings, &control, message, sizeof message) != SHAPEGCODE_OK) {
    fprintf(stderr, "%s\n", message);
  }
  shapegcode_settings_destroy(settings);
  return control;
}

int main(void) {
  shapegcode_controller* control = make_control();
  shapegcode_activity activity = SHAPEGCODE_IDLE;
  shapegcode_rules rules;
  shapegcode_state state;
  double end[3];
  double set_point[3];
  int pushed = 0;
  int held = 0;
  int period;
  if (control == NULL) return 1;
  shapegcode_rules_init(&rules, sizeof rules);
  for (period = 0; pushed < sides || activity != SHAPEGCODE_IDLE; ++period) {
    /* The planning thread: a side begins where the one before ended; the last one stops. */
    if (pushed < sides && period % 100 == 0) {
      corner(pushed, end);
      rules.line = (uint32_t)pushed + 1;
      rules.stop_at_end = pushed + 1 == sides;
      if (shapegcode_controller_push_line(control, end, 150.0, &rules) == SHAPEGCODE_OK) ++pushed;
    }
    /* The operator. */
    if (period == 500) shapegcode_controller_feed_override(control, 0.5);
    if (period == 1500) shapegcode_controller_feed_override(control, 1.2);
    if (period == 2000) shapegcode_controller_hold(control);
    if (period == 2500) shapegcode_controller_resume(control);
    /* The real-time thread, every millisecond: to the drives with it. */
    shapegcode_controller_step(control, set_point, &activity);
    held += activity == SHAPEGCODE_HELD;
  }

  shapegcode_controller_state(control, &state, sizeof state);
  shapegcode_controller_destroy(control);
  printf("%d sides in %.3f s, %.3f s of them held; at X %.3f Y %.3f\n", (int)state.segments_done,
         (double)state.steps * 0.001, held * 0.001, set_point[0], set_point[1]);
  return set_point[0] == end[0] && set_point[1] == end[1] && state.segments_done == sides && held > 0 ? 0 : 1;
}
