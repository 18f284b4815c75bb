// A corner, one set-point every millisecond.

#include <array>
#include <cstdio>

#include "shapegcode/controller.hpp"

int main() {
  using namespace shapegcode;
  ControllerSettings settings;
  settings.limits.law = AccelerationLaw::jerk_limited;
  settings.limits.max_acceleration_mm_per_s2.setConstant(3000.0);
  settings.limits.max_jerk_mm_per_s3.setConstant(100'000.0);
  MotionController control(settings);
  Segment last = make_line({40, 0, 0}, {40, 40, 0}, 100.0);  // mm, mm/s
  last.stop_at_end = true;
  control.push(make_line({0, 0, 0}, {40, 0, 0}, 100.0));
  control.push(last);

  std::array<double, 3> set_point{};
  int periods = 0;
  while (control.step(set_point) != Activity::idle) ++periods;  // to the drives with it

  std::printf("%d ms, at X %.3f Y %.3f\n", periods, set_point[0], set_point[1]);
  return set_point[0] == 40.0 && set_point[1] == 40.0 ? 0 : 1;
}
