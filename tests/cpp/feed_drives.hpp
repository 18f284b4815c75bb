// Feed drives that several tests use.
#pragma once

#include <cmath>
#include <numbers>
#include <vector>

#include "shapegcode/plant/feed_drive.hpp"

namespace feed_drives {

/// A drive of a machining centre of middle size; two-mass resonance near 170 Hz, velocity loop near 50 Hz.
inline shapegcode::FeedDriveParameters linear() {
  shapegcode::FeedDriveParameters drive;
  drive.motor_mass_kg = 150.0;
  drive.table_mass_kg = 400.0;
  drive.stiffness_n_per_m = 1.2e8;
  drive.damping_n_s_per_m = 1e4;
  drive.table_friction.viscous_n_s_per_m = 1500.0;
  drive.motor_friction.viscous_n_s_per_m = 500.0;
  drive.position_gain_per_s = 30.0;
  drive.velocity_gain_n_s_per_m = 1.65e5;
  drive.velocity_integral_time_s = 0.02;
  drive.modes = {{46.0, 0.02, 1.0}};
  return drive;
}

inline shapegcode::FrictionParameters lugre() {
  return {shapegcode::FrictionModel::lugre, 1500.0, 300.0, 450.0, 0.005, 0.0, 3e7, 3e4};
}

inline shapegcode::FrictionParameters stribeck() {
  return {shapegcode::FrictionModel::stribeck, 1500.0, 300.0, 450.0, 0.005, 1e-4, 0.0, 0.0};
}

inline shapegcode::FeedDriveParameters with_friction() {
  shapegcode::FeedDriveParameters drive = linear();
  drive.table_friction = lugre();
  return drive;
}

/// One axis of a circle of 20 mm at 100 mm/s, from rest, one set-point per ms.
inline std::vector<double> circle_mm(int count) {
  std::vector<double> setpoints;
  double way = 0.0;
  for (int i = 1; i <= count; ++i) {
    way += 0.1 * std::fmin(i / 50.0, 1.0);
    setpoints.push_back(20.0 * std::sin(way / 20.0));
  }
  return setpoints;
}

}  // namespace feed_drives
