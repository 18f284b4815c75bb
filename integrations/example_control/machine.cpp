#include "machine.hpp"

#include <cmath>

#include "shapegcode/shaper.hpp"

using namespace shapegcode;

ControllerSettings settings_of(const Machine& machine) {
  ControllerSettings settings;
  settings.period_s = machine.period_s;
  settings.limits.law = AccelerationLaw::jerk_limited;
  settings.limits.max_feed_mm_per_s.setConstant(machine.max_speed_mm_per_s);
  settings.limits.max_acceleration_mm_per_s2.setConstant(machine.max_acceleration_mm_per_s2);
  settings.limits.max_jerk_mm_per_s3.setConstant(machine.max_jerk_mm_per_s3);
  settings.contour_tolerance_mm = machine.contour_tolerance_mm;
  const Shaper of_x = zv_on_grid(machine.modes[0], machine.period_s);
  const Shaper of_y = zv_on_grid(machine.modes[1], machine.period_s);
  settings.shaper = to_fir(convolve(of_x, of_y), machine.period_s);
  settings.plans_in_step = false;  // a thread of its own does
  return settings;
}

FeedDriveParameters drive_of(const Machine& machine, int axis) {
  FeedDriveParameters drive;
  drive.motor_mass_kg = 150.0;
  drive.table_mass_kg = 400.0;
  drive.stiffness_n_per_m = 1.2e8;
  drive.damping_n_s_per_m = 1e4;
  drive.motor_friction.viscous_n_s_per_m = 500.0;
  drive.position_gain_per_s = 30.0;
  drive.velocity_gain_n_s_per_m = 1.65e5;
  drive.velocity_integral_time_s = 0.02;
  if (machine.has_friction) drive.table_friction = {FrictionModel::lugre, 1500.0, 300.0, 450.0, 0.005, 0.0, 3e7, 3e4};
  if (axis < static_cast<int>(machine.modes.size())) drive.modes = {machine.modes[static_cast<std::size_t>(axis)]};
  return drive;
}

Drive::Drive(const Machine& machine, int axis)
    : drive_(drive_of(machine, axis), machine.period_s), feed_forward_ratio_(machine.feed_forward_ratio) {
  const FeedDriveParameters drive = drive_of(machine, axis);
  position_gain_per_s_ = drive.position_gain_per_s;
  lag_by_acceleration_s_ = (drive.motor_mass_kg + drive.table_mass_kg) / drive.velocity_gain_n_s_per_m;
  lag_by_velocity_ = drive.motor_friction.viscous_n_s_per_m / drive.velocity_gain_n_s_per_m;
  integral_share_ = 1.0 - std::exp(-machine.period_s / drive.velocity_integral_time_s);
}
