// Three threads: one plans, one steps by the clock, and the operator's turns the override and holds.

#include <array>
#include <atomic>
#include <chrono>
#include <cstdio>
#include <thread>

#include "machine.hpp"

using namespace shapegcode;
using namespace std::chrono_literals;

int main() {
  const Machine machine;
  MotionController control(settings_of(machine));  // plans_in_step is false
  std::atomic<bool> ends = false;

  std::thread planner([&] {
    Vector3 at = Vector3::Zero();
    int pushed = 0;
    while (!ends) {
      for (; pushed < 40; ++pushed) {  // ten turns of a square
        const std::array<Vector3, 4> corners = {Vector3(40, 0, 0), Vector3(40, 40, 0), Vector3(0, 40, 0),
                                                Vector3(0, 0, 0)};
        Segment side = make_line(at, corners[static_cast<std::size_t>(pushed % 4)], 100.0);
        side.stop_at_end = pushed == 39;
        if (control.push(side) != PushResult::accepted) break;
        at = side.end_mm;
      }
      if (!control.plan()) std::this_thread::sleep_for(5ms);
    }
  });

  std::thread real_time([&] {
    MotionSetPoint out;
    auto deadline = std::chrono::steady_clock::now();
    while (!ends) {
      std::this_thread::sleep_until(deadline += 1ms);
      control.step(out);  // position, velocity, acceleration: to the drives
    }
  });

  // The operator: looks at the state, which any thread may.
  const auto wait_for = [&](Activity activity) {
    while (control.state().activity != activity) std::this_thread::sleep_for(10ms);
    const ControllerState state = control.state();
    std::printf("%-8s at X %6.2f Y %6.2f\n", text_of(state.activity), state.set_point[0], state.set_point[1]);
  };
  wait_for(Activity::moving);
  std::this_thread::sleep_for(1s);
  control.hold();
  wait_for(Activity::held);
  control.feed_override(2.0);
  control.resume();
  wait_for(Activity::idle);
  ends = true;
  real_time.join();
  planner.join();
  return control.state().segments_done == 40 ? 0 : 1;
}
