// The C interface in allocation_tests: what it adds to push and step allocates and locks nothing, refused or not.
#include <cstdint>
#include <numbers>

#include "allocation_tests.hpp"
#include "shapegcode/shapegcode.h"

namespace {

shapegcode_controller* make_control() {
  shapegcode_settings* settings = shapegcode_settings_create();
  for (int axis = 0; axis < 3; ++axis)
    shapegcode_settings_set_axis(settings, SHAPEGCODE_MAX_ACCELERATION, axis, 2000.0);
  shapegcode_settings_set(settings, SHAPEGCODE_WINDOW, 8);
  shapegcode_settings_set(settings, SHAPEGCODE_QUEUE, 8);
  shapegcode_controller* control = nullptr;
  shapegcode_controller_create(settings, &control, nullptr, 0);
  shapegcode_settings_destroy(settings);
  return control;
}

/// To and fro: a line there, half a circle back, until the queue is full; then what is refused.
long push_all(shapegcode_controller* control, long& taken) {
  const double there[3] = {20.0, 0.0, 0.0};
  const double back[3] = {0.0, 0.0, 0.0};
  const shapegcode_arc half = {{10.0, 0.0, 0.0}, std::numbers::pi, 2};
  const shapegcode_arc none = {{0.0, 0.0, 0.0}, 0.0, 5};
  const auto next = [&] {
    return taken % 2 == 0 ? shapegcode_controller_push_line(control, there, 100.0, nullptr)
                          : shapegcode_controller_push_arc(control, back, &half, 100.0, nullptr);
  };
  while (next() == SHAPEGCODE_OK) ++taken;
  long refused = next() == SHAPEGCODE_QUEUE_FULL ? 1 : 0;
  refused += shapegcode_controller_push_arc(control, there, &none, 100.0, nullptr) == SHAPEGCODE_NO_ARC ? 1 : 0;
  refused += shapegcode_controller_push_line(control, nullptr, 100.0, nullptr) == SHAPEGCODE_ERROR_NULL ? 1 : 0;
  return refused;
}

}  // namespace

void check_c_interface() {
  shapegcode_controller* control = make_control();
  expect(control != nullptr, "the C interface makes a control");
  if (control == nullptr) return;
  long taken = 0;
  long refused = 0;
  expect_none("shapegcode_controller_push and _step", [&] {
    long steps = 0;
    for (; steps < 5000; ++steps) {
      double set_point[3];
      shapegcode_state state;
      if (steps % 50 == 0) refused += push_all(control, taken);
      if (steps == 1000) shapegcode_controller_hold(control);
      if (steps == 1500) shapegcode_controller_resume(control);
      double rates[6];
      if (steps % 2 == 0) {
        shapegcode_controller_step(control, set_point, nullptr);
      } else {
        shapegcode_controller_step_motion(control, set_point, rates, rates + 3, nullptr);
      }
      shapegcode_controller_state(control, &state, sizeof state);
    }
    return steps;
  });
  expect(taken > 20 && refused == 300, "segments were taken and refused in C");
  shapegcode_controller_destroy(control);
}
