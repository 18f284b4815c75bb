// Blocks come while the machine moves, the operator turns the override and presses feed hold. One loop stands for the
// planning thread, the operator's and the real-time one; `push` and `step` may run in two of their own.

#include <array>
#include <cstdio>

#include "shapegcode/controller.hpp"

namespace {

using namespace shapegcode;

constexpr int sides = 20;

// Corners of a square spiral, 2 mm between its turns.
Vector3 corner(int i) {
  const double low = 2.0 * (i / 4);
  const double high = 40.0 - low;
  const std::array<Vector3, 4> turn = {Vector3(high, low, 0), Vector3(high, high, 0), Vector3(low, high, 0),
                                       Vector3(low, low + 2.0, 0)};
  return turn[static_cast<std::size_t>(i % 4)];
}

}  // namespace

int main() {
  ControllerSettings settings;
  settings.limits.law = AccelerationLaw::jerk_limited;
  settings.limits.max_acceleration_mm_per_s2.setConstant(2000.0);
  settings.limits.max_jerk_mm_per_s3.setConstant(100000.0);
  settings.contour_tolerance_mm = 0.05;
  settings.shaper = Fir({0, 11}, {0.516, 0.484});  // ZV of 46 Hz on the grid of 1 ms
  MotionController control(settings);

  Vector3 at = Vector3::Zero();
  std::array<double, 3> set_point{};
  Activity activity = Activity::idle;
  int pushed = 0;
  int held = 0;
  for (int period = 0; pushed < sides || activity != Activity::idle; ++period) {
    // The planning thread: the next block whenever one is ready. `queue_full` would mean: the same one again later.
    if (pushed < sides && period % 100 == 0) {
      Segment side = make_line(at, corner(pushed), 150.0, static_cast<std::uint32_t>(pushed + 1));
      side.stop_at_end = pushed + 1 == sides;  // the last one: coming to rest behind it is no starvation
      if (control.push(side) == PushResult::accepted) {
        at = side.end_mm;
        ++pushed;
      }
    }
    // The operator.
    if (period == 500) control.feed_override(0.5);
    if (period == 1500) control.feed_override(1.2);
    if (period == 2000) control.hold();
    if (period == 2500) control.resume();
    // The real-time thread, every millisecond: to the drives with it.
    activity = control.step(set_point);
    held += activity == Activity::held ? 1 : 0;
  }

  const ControllerState state = control.state();
  std::printf("%llu sides in %.3f s, %.3f s of them held; starved %llu times; at X %.3f Y %.3f\n",
              static_cast<unsigned long long>(state.segments_done),
              static_cast<double>(state.steps) * settings.period_s, held * settings.period_s,
              static_cast<unsigned long long>(state.starvations), set_point[0], set_point[1]);
  const bool is_there = set_point[0] == at[0] && set_point[1] == at[1];
  return is_there && state.segments_done == sides && held > 0 ? 0 : 1;
}
