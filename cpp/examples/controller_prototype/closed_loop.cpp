// Command, drive, table: what a shaper gains where the drive is not ideal. MotionController gives a set-point every
// millisecond; behind it stand drives that follow at once, or feed drives with position loop, screw and friction. The
// same corner and the same stop are run with and without the shaper.
//
//     closed_loop [--csv FILE]

#include <algorithm>
#include <array>
#include <cmath>
#include <complex>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <numbers>
#include <vector>

#include <Eigen/LU>

#include "shapegcode/controller.hpp"
#include "shapegcode/measure/contour.hpp"
#include "shapegcode/plant/feed_drive.hpp"
#include "shapegcode/plant/modal.hpp"
#include "shapegcode/shaper.hpp"

namespace {

using namespace shapegcode;

constexpr double period_s = 0.001;
constexpr double settled_mm = 0.002;
constexpr int periods_after = 1000;  // that the table is watched after the last set-point
const Mode mode_x{46.0, 0.02, 1.0};
const Mode mode_y{58.0, 0.02, 1.0};

// ZV on the grid of the set-points: half a damped period falls between two of them, so that three taps take the place
// of two. Their sum is one, and what they leave of the mode is zero.
Shaper zv_on_grid(const Mode& mode) {
  const double omega = 2.0 * std::numbers::pi * mode.frequency_hz;
  const std::complex<double> pole(-mode.damping_ratio * omega,
                                  omega * std::sqrt(1.0 - mode.damping_ratio * mode.damping_ratio));
  const double between = std::floor(std::numbers::pi / pole.imag() / period_s);
  const std::array times = {0.0, between * period_s, (between + 1.0) * period_s};
  Eigen::Matrix3d of_tap;
  for (int i = 0; i < 3; ++i) {
    const std::complex<double> left = std::exp(-pole * times[static_cast<std::size_t>(i)]);
    of_tap.col(i) << 1.0, left.real(), left.imag();
  }
  const Vector3 taps = of_tap.inverse() * Vector3(1.0, 0.0, 0.0);
  return make_shaper({times.begin(), times.end()}, {taps[0], taps[1], taps[2]});
}

// A ball screw drive with friction in its guideways, and a mode of the structure on its table.
FeedDriveParameters drive_with(const Mode& mode) {
  FeedDriveParameters drive;
  drive.motor_mass_kg = 150.0;
  drive.table_mass_kg = 400.0;
  drive.stiffness_n_per_m = 1.2e8;
  drive.damping_n_s_per_m = 1e4;
  drive.table_friction = {FrictionModel::lugre, 1500.0, 300.0, 450.0, 0.005, 0.0, 3e7, 3e4};
  drive.motor_friction.viscous_n_s_per_m = 500.0;
  drive.position_gain_per_s = 30.0;
  drive.velocity_gain_n_s_per_m = 1.65e5;
  drive.velocity_integral_time_s = 0.02;
  drive.velocity_feed_forward_ratio = 1.0;
  drive.modes = {mode};
  return drive;
}

// Drives that follow at once: what moves is the structure alone.
struct IdealDrives {
  static constexpr const char* name = "ideal";
  ModalPlant plant{{std::vector{mode_x}, std::vector{mode_y}, {}}, period_s};
  Vector3 step(const Vector3& set_point) noexcept { return plant.step(set_point); }
  [[nodiscard]] Vector3 swing() const noexcept { return plant.deflection(); }
};

struct FeedDrives {
  static constexpr const char* name = "with friction";
  FeedDriveRealTime x{drive_with(mode_x), period_s};
  FeedDriveRealTime y{drive_with(mode_y), period_s};
  Vector3 step(const Vector3& set_point) noexcept { return {x.step(set_point[0]), y.step(set_point[1]), set_point[2]}; }
  [[nodiscard]] Vector3 swing() const noexcept {
    return {x.response_mm() - x.table_mm(), y.response_mm() - y.table_mm(), 0.0};
  }
};

ControllerSettings settings_with(const Fir& shaper) {
  ControllerSettings settings;
  settings.period_s = period_s;
  settings.limits.law = AccelerationLaw::jerk_limited;
  settings.limits.max_acceleration_mm_per_s2.setConstant(5000.0);
  settings.limits.max_jerk_mm_per_s3.setConstant(1'000'000.0);
  settings.contour_tolerance_mm = 0.02;
  settings.smoothing_time_s = 0.004;
  settings.shaper = shaper;
  return settings;
}

struct Found {
  const char* drive;
  const char* command;
  double seconds = 0.0;     // until the last set-point
  double command_mm = 0.0;  // furthest of the set-points from the programmed path
  double corner_mm = 0.0;   // the same of the table, on the way
  double swing_mm = 0.0;    // largest deflection of the structure after the last set-point, of the axis with more
  double settled_s = 0.0;   // from the last set-point until the table stays near the end
  double off_mm = 0.0;      // where it stands at last
};

template <class Drives>
Found run(const char* command, const Fir& shaper, std::FILE* csv) {
  const std::vector<Segment> segments = {make_line({0, 0, 0}, {40, 0, 0}, 150.0),
                                         make_line({40, 0, 0}, {40, 40, 0}, 150.0)};
  MotionController control(settings_with(shaper));
  for (Segment segment : segments) {
    segment.stop_at_end = segment.end_mm == segments.back().end_mm;
    if (control.push(segment) != PushResult::accepted) std::abort();
  }
  const Vector3 end = segments.back().end_mm;
  ContourTracker command_contour{Path(segments)};
  ContourTracker contour = command_contour;
  Drives drives;
  Vector3 set_point = Vector3::Zero();
  Found found{Drives::name, command};
  int moving = 0;  // periods until the last set-point
  for (int after = 0, i = 0; after < periods_after; ++i) {
    // The real-time part: what a servo task does every period.
    const Activity activity = control.step({set_point.data(), axis_count});
    const Vector3 table = drives.step(set_point);

    const double off = std::abs(contour.step(table));
    found.command_mm = std::max(found.command_mm, std::abs(command_contour.step(set_point)));
    if (activity == Activity::idle) {
      ++after;
      found.swing_mm = std::max(found.swing_mm, drives.swing().cwiseAbs().maxCoeff());
      found.off_mm = (table - end).norm();
      if (found.off_mm > settled_mm) found.settled_s = after * period_s;
    } else {
      moving = i + 1;
      found.corner_mm = std::max(found.corner_mm, off);
    }
    if (csv != nullptr) {
      std::fprintf(csv, "%s,%s,%.3f,%.6f,%.6f,%.6f,%.6f\n", found.drive, command, (i + 1) * period_s, set_point[0],
                   set_point[1], table[0], table[1]);
    }
  }
  found.seconds = moving * period_s;
  return found;
}

template <class Drives>
bool compare(const Fir& shaper, std::FILE* csv) {
  const Found plain = run<Drives>("plain", Fir({0}, {1.0}), csv);
  const Found shaped = run<Drives>("shaped", shaper, csv);
  for (const Found& found : {plain, shaped}) {
    std::printf("%-14s %-8s %7.3f %12.1f %12.1f %12.3f %15.0f %10.2f\n", found.drive, found.command, found.seconds,
                1e3 * found.command_mm, 1e3 * found.corner_mm, 1e3 * found.swing_mm, 1e3 * found.settled_s,
                1e3 * found.off_mm);
  }
  return shaped.swing_mm < 0.5 * plain.swing_mm;
}

}  // namespace

int main(int argc, char** argv) {
  std::FILE* csv = nullptr;
  if (argc == 3 && std::strcmp(argv[1], "--csv") == 0) {
    csv = std::fopen(argv[2], "w");
  }
  if (argc != 1 && csv == nullptr) {
    std::fprintf(stderr, "usage: %s [--csv FILE], and the file must be writable\n", argv[0]);
    return 2;
  }
  if (csv != nullptr) std::fputs("drive,command,time_s,x_mm,y_mm,table_x_mm,table_y_mm\n", csv);
  const Fir shaper = to_fir(convolve(zv_on_grid(mode_x), zv_on_grid(mode_y)), period_s);
  std::printf("shaper of %d ms; a corner of 40 mm legs at 9 m/min, 20 um allowed, then a stop\n\n",
              shaper.duration_samples());
  std::printf("%-14s %-8s %7s %12s %12s %12s %15s %10s\n", "drives", "command", "s", "command, um", "table, um",
              "swing, um", "within 2 um, ms", "at last, um");
  const bool ideal = compare<IdealDrives>(shaper, csv);
  const bool real = compare<FeedDrives>(shaper, csv);
  const bool written = csv == nullptr || std::fclose(csv) == 0;
  if (!ideal || !real || !written) {
    std::fprintf(stderr, "%s\n",
                 written ? "the shaped command leaves half of the swing or more" : "the file is not whole");
    return 1;
  }
  return 0;
}
