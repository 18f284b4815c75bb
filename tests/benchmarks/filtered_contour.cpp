// How far winding paths are left behind shapers, and what that costs: `filtered_contour PATHS`.
#include <algorithm>
#include <array>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <utility>
#include <vector>

#include "winding_path.hpp"

using namespace shapegcode;

namespace {

constexpr std::array<double, 3> accelerations{1000.0, 2000.0, 5000.0};
constexpr std::array<double, 2> jerks_per_s{40.0, 200.0};  // the jerk limit, as so many times that of the acceleration

ControllerSettings settings_of(double acceleration, double jerk_per_s, double tolerance_mm,
                               const ControllerShaper& shaper) {
  ControllerSettings settings;
  settings.limits.law = AccelerationLaw::jerk_limited;
  settings.limits.max_feed_mm_per_s.setConstant(200.0);
  settings.limits.max_acceleration_mm_per_s2.setConstant(acceleration);
  settings.limits.max_jerk_mm_per_s3.setConstant(acceleration * jerk_per_s);
  settings.contour_tolerance_mm = tolerance_mm;
  settings.shaper = shaper;
  settings.plans_in_step = true;
  return settings;
}

// How far a contour correction overshoots the ends of a line of 20 mm.
double overshoot_mm(ControllerSettings settings) {
  settings.contour_correction = true;
  MotionController control(settings);
  Segment line = make_line({0, 0, 0}, {20, 0, 0}, 150);
  line.stop_at_end = true;
  control.push(line);
  std::vector<double> point(axis_count);
  double farthest = 0.0;
  while (control.step(point) != Activity::idle) farthest = std::max({farthest, -point[0], point[0] - 20.0});
  return farthest;
}

}  // namespace

int main(int count, char** words) {
  const auto paths = static_cast<std::uint64_t>(count > 1 ? std::atoi(words[1]) : 40);
  const Fir zv46({0, 10, 11}, {0.5157, 0.06, 0.4243});
  const std::vector<std::pair<const char*, ControllerShaper>> shapers{
      {"none", Fir({0}, {1.0})},
      {"ZV 46 Hz", zv46},
      {"of X, Y, Z", std::vector<Fir>{zv46, Fir({0, 5, 6}, {0.51, 0.22, 0.27}), Fir({0}, {1.0})}}};
  std::printf("acceleration  tolerance  shaper      farthest / tolerance  beyond it  mean time s\n");
  for (const double acceleration : accelerations) {
    for (const double tolerance_mm : {0.005, 0.02, 0.05}) {
      for (const auto& [name, shaper] : shapers) {
        double farthest = 0.0;
        double time_s = 0.0;
        int beyond = 0;
        for (std::uint64_t seed = 0; seed < paths; ++seed) {
          const ControllerSettings settings = settings_of(acceleration, jerks_per_s[seed % 2], tolerance_mm, shaper);
          const tests::WindingRun run = tests::run_winding_path(settings, seed);
          farthest = std::max(farthest, run.farthest_mm / tolerance_mm);
          time_s += run.time_s / static_cast<double>(paths);
          beyond += !run.ended || run.farthest_mm > 1.01 * tolerance_mm ? 1 : 0;
        }
        std::printf("%12.0f  %9.3f  %-10s  %20.3f  %9d  %11.3f\n", acceleration, tolerance_mm, name, farthest, beyond,
                    time_s);
      }
    }
  }
  std::printf("\nacceleration  jerk      overshoot of the contour correction, um\n");
  for (const double acceleration : accelerations) {
    for (const double jerk_per_s : jerks_per_s) {
      const double overshoot_um = 1e3 * overshoot_mm(settings_of(acceleration, jerk_per_s, 0.02, zv46));
      std::printf("%12.0f  %8.0f  %.1f\n", acceleration, acceleration * jerk_per_s, overshoot_um);
    }
  }
}
