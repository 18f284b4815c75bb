// A controller's interpolation task in miniature: look-ahead once, then every period one set-point from the
// interpolator through the input shaper to the servo command, with the machine's modes and the feed drive of X beside
// it to see the effect.
// Everything is allocated before the loop; inside it only the noexcept real-time forms run.

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <memory>
#include <numbers>
#include <vector>

#include "shapegcode/filter.hpp"
#include "shapegcode/motion.hpp"
#include "shapegcode/plant/feed_drive.hpp"
#include "shapegcode/plant/modal.hpp"
#include "shapegcode/shaper.hpp"

namespace {

using namespace shapegcode;

constexpr double period_s = 0.005;  // the shaper's zeros are exact on this grid
const Mode mode_x{46.0, 0.02, 1.0};
const Mode mode_y{131.0, 0.02, 1.0};

// Line, quarter arc, line at 12 m/min.
std::shared_ptr<const Path> make_path() {
  constexpr double feed_mm_per_s = 200.0;
  std::vector<Segment> segments;
  segments.push_back(make_line({0, 0, 0}, {20, 0, 0}, feed_mm_per_s));
  segments.push_back(make_arc({20, 0, 0}, {40, 20, 0}, {20, 20, 0}, 0.5 * std::numbers::pi, 2, feed_mm_per_s));
  segments.push_back(make_line({40, 20, 0}, {40, 40, 0}, feed_mm_per_s));
  return std::make_shared<const Path>(std::move(segments));
}

// Ball screw drive of X with friction and the mode of X on its table.
FeedDriveParameters drive_x() {
  FeedDriveParameters drive;
  drive.motor_mass_kg = 2200.0;
  drive.table_mass_kg = 400.0;
  drive.stiffness_n_per_m = 1.5e8;
  drive.damping_n_s_per_m = 2.2e4;
  drive.position_gain_per_s = 30.0;
  drive.velocity_gain_n_s_per_m = 6.5e5;
  drive.velocity_integral_time_s = 0.02;
  drive.velocity_feed_forward_ratio = 1.0;
  drive.table_friction = {FrictionModel::lugre, 1500.0, 300.0, 400.0, 0.005, 0.0, 3e7, 3e4};
  drive.modes = {mode_x};
  return drive;
}

// How far the response of X leaves its set-points on the way, in um.
double follow(const std::shared_ptr<const Path>& path, const std::shared_ptr<const SpeedProfile>& profile,
              const Fir& shaper) {
  constexpr int substeps = 20;
  Interpolator interpolator(path, profile, period_s);
  FirStream stream(shaper, axis_count);
  FeedDriveRealTime drive(drive_x(), period_s, substeps);
  Vector3 setpoint = (*path)[0].start_mm;
  stream.reset(values_of(setpoint));
  drive.reset(setpoint[0]);
  double largest = 0.0;
  while (interpolator.step(setpoint)) {
    stream.step(values_of(setpoint), values_of(setpoint));
    largest = std::max(largest, std::abs(drive.step(setpoint[0]) - setpoint[0]));
  }
  return largest * 1e3;
}

// Largest vibration after the stop, in um.
Vector3 run(const std::shared_ptr<const Path>& path, const std::shared_ptr<const SpeedProfile>& profile,
            const Fir& shaper) {
  Interpolator interpolator(path, profile, period_s);
  FirStream stream(shaper, axis_count);
  ModalPlant plant({std::vector<Mode>{mode_x}, std::vector<Mode>{mode_y}, {}}, period_s);
  Vector3 setpoint = (*path)[0].start_mm;
  stream.reset(values_of(setpoint));
  plant.reset(setpoint);
  const std::size_t periods = interpolator.sample_count() + static_cast<std::size_t>(shaper.duration_samples());
  for (std::size_t i = 0; i < periods; ++i) {
    interpolator.step(setpoint);
    stream.step(values_of(setpoint), values_of(setpoint));
    plant.step(setpoint);
  }
  return plant.residual_peak() * 1e3;
}

}  // namespace

int main() {
  MotionLimits limits;
  limits.time_constant_s = 0.05;
  const auto path = make_path();
  const auto profile = std::make_shared<const SpeedProfile>(plan_speed(*path, limits));
  const Shaper design = grid_polynomial(std::array{mode_x, mode_y}, period_s);
  const Vector3 plain = run(path, profile, Fir({0}, {1.0}));
  const Vector3 shaped = run(path, profile, to_fir(design, period_s));
  std::printf("residual vibration: X %.2f -> %.4f um, Y %.2f -> %.4f um; shaper of %.0f ms\n", plain[0], shaped[0],
              plain[1], shaped[1], duration_s(design) * 1e3);
  const double plain_um = follow(path, profile, Fir({0}, {1.0}));
  const double shaped_um = follow(path, profile, to_fir(design, period_s));
  std::printf("feed drive of X off its set-points: %.0f -> %.0f um\n", plain_um, shaped_um);
  const bool quiet = shaped.maxCoeff() < 1e-3 && plain.minCoeff() >= 0.0 && plain[0] > 1.0;
  if (!quiet) {
    std::fprintf(stderr, "the shaped command still excites the modes\n");
  }
  return quiet ? 0 : 1;
}
