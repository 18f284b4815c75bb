// A controller's interpolation task in miniature: every period one position per axis goes through the acceleration
// filter and the input shaper in place, and leaves as the servo command. Everything is allocated before the loop.

#include <array>
#include <cmath>
#include <cstddef>
#include <cstdio>

#include "shapegcode/filter/fir.hpp"

namespace {

constexpr double period_s = 0.001;
constexpr std::size_t n_axes = 2;
using Position = std::array<double, n_axes>;

// The motion to be shaped: 100 mm along a 3-4-5 direction at 3000 mm/min, without any acceleration limit.
constexpr Position target_mm = {60.0, 80.0};
constexpr double feed_mm_per_s = 50.0;
constexpr double length_mm = 100.0;

Position interpolate(int period) {
  const double travelled_mm = std::fmin(feed_mm_per_s * period_s * period, length_mm);
  return {target_mm[0] * travelled_mm / length_mm, target_mm[1] * travelled_mm / length_mm};
}

// Zero-vibration shaper of an undamped 25 Hz mode: two equal impulses, half a vibration period (20 samples) apart.
shapegcode::Fir zero_vibration_25_hz() { return shapegcode::Fir({0, 20}, {0.5, 0.5}); }

}  // namespace

int main() {
  shapegcode::FirStream acceleration(shapegcode::Fir::moving_average(32), static_cast<int>(n_axes));
  shapegcode::FirStream shaper(zero_vibration_25_hz(), static_cast<int>(n_axes));
  const Position start_mm = {0.0, 0.0};
  acceleration.reset(start_mm);
  shaper.reset(start_mm);

  const int motion_periods = static_cast<int>(std::lround(length_mm / (feed_mm_per_s * period_s)));
  const int settling_periods = acceleration.fir().duration_samples() + shaper.fir().duration_samples();
  Position command_mm = start_mm;
  double largest_step_mm = 0.0;
  for (int period = 1; period <= motion_periods + settling_periods; ++period) {
    const Position previous_mm = command_mm;
    command_mm = interpolate(period);
    acceleration.step(command_mm);
    shaper.step(command_mm);
    largest_step_mm =
        std::fmax(largest_step_mm, std::hypot(command_mm[0] - previous_mm[0], command_mm[1] - previous_mm[1]));
  }

  const double miss_mm = std::hypot(command_mm[0] - target_mm[0], command_mm[1] - target_mm[1]);
  std::printf("%d periods of %.0f ms, %d of them settling: command (%.6f, %.6f) mm, highest speed %.3f mm/s\n",
              motion_periods + settling_periods, period_s * 1e3, settling_periods, command_mm[0], command_mm[1],
              largest_step_mm / period_s);
  const bool arrived = miss_mm < 1e-9 && std::fabs(largest_step_mm / period_s - feed_mm_per_s) < 1e-6;
  if (!arrived) {
    std::fprintf(stderr, "the command ends %.3e mm off the target, or its speed is not the feed\n", miss_mm);
  }
  return arrived ? 0 : 1;
}
