// The shortest use of the library: a path, the machine's modes, and set-points that do not shake them.

#include <cstdio>
#include <utility>
#include <vector>

#include "shapegcode/prototype.hpp"

int main() {
  using namespace shapegcode;
  constexpr double period_s = 0.005;
  const std::vector modes = {Mode{46.0, 0.02, 1.0}, Mode{131.0, 0.02, 1.0}};  // Hz, damping ratio, participation

  // Once, before the motion: look-ahead over two lines at 12 m/min, from rest to rest.
  Path path({make_line({0, 0, 0}, {40, 0, 0}, 200.0), make_line({40, 0, 0}, {40, 40, 0}, 200.0)});
  ShapedMotion motion(std::move(path), MotionLimits{}, modes, period_s);

  // Your interpolation task, every 5 ms; the modes stand in for the machine.
  ModalPlant machine({modes, modes, {}}, period_s);
  Vector3 set_point = Vector3::Zero();
  Vector3 table = Vector3::Zero();
  machine.reset(set_point);
  while (motion.step(values_of(set_point))) {
    machine.step(values_of(set_point), values_of(table));
  }

  const Vector3 left_um = machine.residual_peak() * 1e3;
  std::printf("%zu set-points, the table at X %.3f Y %.3f; left after the stop: X %.4f um, Y %.4f um\n",
              motion.sample_count(), table[0], table[1], left_um[0], left_um[1]);
  return left_um.maxCoeff() < 1e-3 ? 0 : 1;
}
