// Counts allocations and locks in the real-time forms. An executable of its own, because it replaces operator new.
#include <array>
#include <cstddef>
#include <cstdio>
#include <memory>
#include <numbers>
#include <vector>

#include "shapegcode/fanuc_model.hpp"
#include "shapegcode/filter.hpp"
#include "shapegcode/measure/contour.hpp"
#include "shapegcode/motion.hpp"
#include "shapegcode/plant/feed_drive.hpp"
#include "shapegcode/plant/linear_plant.hpp"
#include "shapegcode/plant/modal.hpp"
#include "shapegcode/plant/servo_lag.hpp"

#include "allocation_tests.hpp"
#include "feed_drives.hpp"
#include "switching_filter.hpp"

namespace {

using namespace shapegcode;

std::vector<Segment> many_segments() {
  std::vector<Segment> segments;
  Vector3 at = Vector3::Zero();
  for (int i = 0; i < 200; ++i) {
    const Vector3 end = at + Vector3(i % 3 == 0 ? 0.02 : 1.5, i % 5 == 0 ? -0.7 : 0.4, 0.1);
    segments.push_back(make_line(at, end, 60.0));
    const Vector3 after = end + Vector3(2.0, 2.0, 0.3);
    segments.push_back(make_arc(end, after, end + Vector3(0.0, 2.0, 0.0), std::numbers::pi / 2, 2, 60.0));
    at = after;
  }
  return segments;
}

}  // namespace

int main() {
  // The count itself works: a test that cannot fail is none.
  if (const char* unseen = interposer::blind_spot()) {
    std::printf("not counted: %s\n", unseen);
    return 1;
  }

  const std::vector<Segment> segments = many_segments();
  const auto path = std::make_shared<const Path>(segments);
  MotionLimits limits;
  limits.jerk_time_s = 0.02;
  limits.corner_speed_difference_mm_per_s = Vector3::Constant(10.0);
  const auto profile = std::make_shared<const SpeedProfile>(plan_speed(*path, limits));
  Vector3 position = Vector3::Zero();
  double sink = 0.0;

  Interpolator interpolator(path, profile, 1e-3);
  expect_none("Interpolator::step", [&] {
    long steps = 0;
    for (; interpolator.step(position); ++steps) sink += position.sum() + interpolator.distance_mm();
    for (int i = 0; i < 100; ++i) interpolator.step(position);  // past the end
    return steps;
  });

  for (const BlockEnd end : {BlockEnd::ceil, BlockEnd::carry}) {
    BlockInterpolator blocks(segments, 1e-3, end, 0.9);
    expect_none(end == BlockEnd::ceil ? "BlockInterpolator::step ceil" : "BlockInterpolator::step carry", [&] {
      long steps = 0;
      for (; blocks.step(position); ++steps) sink += position.sum();
      blocks.step(position);
      return steps;
    });
  }

  for (const Fir& fir :
       {Fir::moving_average(50), Fir({0, 3, 7}, {0.5, 0.2, 0.3}), Fir({0}, {1.0}), Fir::exponential(50.0)}) {
    FirStream stream(fir, 3);
    expect_none("FirStream::step", [&] {
      position = Vector3(1.0, 2.0, 3.0);
      stream.reset({position.data(), 3});
      for (int i = 0; i < 5000; ++i) {
        position = Vector3(1.0 + i, 2.0, 3.0 - 0.5 * i);
        stream.step(values_of(position), values_of(position));
        sink += position.sum();
      }
      return 5000L;
    });
  }

  const FollowingFir following(VaryingFir({Fir({0, 4}, {0.5, 0.5}), Fir({0, 2, 5}, {0.3, 0.4, 0.3})}), 0, {0.0, 400.0});
  VaryingFirStream varying(following.fir(), 3);
  expect_none("VaryingFirStream::step", [&] {
    varying.reset({position.data(), 3});
    for (int i = 0; i < 5000; ++i) {
      position = Vector3(0.1 * i, 2.0, 3.0 - 0.5 * i);
      varying.step(values_of(position), values_of(position), following.place(position[0]));
      sink += position.sum();
    }
    return 5000L;
  });

  linuxcnc::SwitchingFilter switching(3);
  switching.offer(std::make_unique<linuxcnc::OfferedFilter>(Fir({0, 3, 7}, {0.5, 0.2, 0.3}), 3, 1));
  expect_none("SwitchingFilter::step", [&] {
    for (int i = 0; i < 5000; ++i) {
      position = Vector3(1.0 + i, 2.0, 3.0 - 0.5 * i);
      switching.step(values_of(position), values_of(position), 20.0);
      sink += position.sum();
    }
    if (switching.active().wish != 1) std::printf("SwitchingFilter did not switch\n"), ++failures;
    return 5000L;
  });

  FanucModel controller;
  controller.rapid_bell_time_s = 0.03;
  RapidInterpolator rapid({0.0, 0.0, 0.0}, {300.0, -20.0, 5.0}, controller);
  expect_none("RapidInterpolator::step", [&] {
    long steps = 0;
    for (; rapid.step(position); ++steps) sink += position.sum();
    rapid.step(position);
    return steps;
  });

  ServoLag servo(Vector3::Constant(30.0), Vector3::Constant(0.5), 1e-3);
  expect_none("ServoLag::step", [&] {
    servo.reset(Vector3::Zero());
    for (int i = 0; i < 5000; ++i) sink += servo.step(Vector3(0.1 * i, 0.001 * i * i, 0.0)).sum();
    return 5000L;
  });

  AxisModes modes;
  modes[0] = {{46.0, 0.02, 1.0}, {210.0, 0.05, 0.2}};
  modes[1] = {{131.0, 0.02, 1.0}};
  ModalPlant plant(modes, 1e-3);
  expect_none("ModalPlant::step", [&] {
    plant.reset(Vector3::Zero());
    for (int i = 0; i < 5000; ++i) {
      sink += plant.step(Vector3(0.1 * i, 0.001 * i * i, 0.0)).sum() + plant.peak().sum() + plant.deflection().sum();
    }
    plant.reset_peak();
    return 5000L;
  });

  LinearPlant linear({Eigen::MatrixXd::Constant(6, 6, -1.0), Eigen::MatrixXd::Ones(6, 2), Eigen::MatrixXd::Ones(3, 6),
                      Eigen::MatrixXd::Ones(3, 2)},
                     1e-3);
  std::array<double, 2> input{};
  std::array<double, 3> output{};
  expect_none("LinearPlant::step", [&] {
    for (int i = 0; i < 5000; ++i) {
      input[static_cast<std::size_t>(i % 2)] = 0.1 * i;
      linear.step(input, output);
      sink += output[0] + linear.output().sum();
    }
    return 5000L;
  });

  AxisModeTables tables;
  tables[0] = {{2, {0.0, 200.0, 400.0}, {52.0, 46.0, 41.0}, {}}};
  ModalPlant varying_plant(modes, 1e-3, tables);
  expect_none("ModalPlant::step varying", [&] {
    varying_plant.reset(Vector3::Zero());
    for (int i = 0; i < 5000; ++i) {
      sink += varying_plant.step(Vector3(0.001 * i * i, 0.0, 0.1 * i)).sum() + varying_plant.peak().sum();
    }
    return 5000L;
  });

  FeedDriveParameters drive_parameters = feed_drives::with_friction();
  drive_parameters.motor_friction = feed_drives::stribeck();
  drive_parameters.backlash_m = 5e-6;
  FeedDriveRealTime drive(drive_parameters, 1e-3);
  expect_none("FeedDriveRealTime::step", [&] {
    drive.reset(0.0);
    for (int i = 0; i < 5000; ++i) {
      const double jump = i % 1000 == 500 ? 5.0 : 0.0;  // it divides its steps there
      sink += drive.step(0.00001 * i * i + jump) + drive.motor_mm() + drive.friction_force_n();
    }
    return 5000L;
  });

  ContourTracker tracker(*path);
  Interpolator along(path, profile, 1e-3);
  expect_none("ContourTracker::step", [&] {
    long steps = 0;
    for (; along.step(position); ++steps) sink += tracker.step(position + Vector3(0.001, 0.0, 0.0));
    return steps;
  });

  check_motion_controller();
  check_program_items();
  check_c_interface();
  if (failures != 0) std::printf("%d real-time form(s) allocate, lock or did not run\n", failures);
  return failures == 0 && sink == sink ? 0 : 1;
}
