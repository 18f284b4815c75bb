#include "simulate/axis_plant.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include <fmt/format.h>

#include "base/checks.hpp"
#include "shapegcode/error.hpp"
#include "shapegcode/fanuc_model.hpp"

namespace shapegcode::detail {
namespace {

constexpr double watched_share = 0.2;  // of the limit at its end: an oscillation passes through the band all the time

}  // namespace

AxisPlant::AxisPlant(const SimulationOptions& options)
    : period_s_(options.period_s),
      arrived_mm_(options.arrived_mm),
      modal_(options.modes, options.period_s, options.mode_tables) {
  if (!options.drives.empty() && options.drives.size() != axis_count) {
    throw Error(ErrorKind::argument,
                fmt::format("{} feed drives: must be none or one each for X, Y and Z", options.drives.size()));
  }
  // Searched at every set-point.
  static_cast<void>(require_count(options.settling_limit_s / period_s_, max_set_points, "settling limit", "periods"));
  drives_.reserve(options.drives.size());
  for (const FeedDriveParameters& drive : options.drives) {
    drives_.emplace_back(drive, options.period_s);
  }
}

void AxisPlant::reset(const Vector3& position) {
  modal_.reset(position);
  for (std::size_t i = 0; i < drives_.size(); ++i) {
    drives_[i].reset(position[static_cast<Eigen::Index>(i)]);
  }
  drive_deflection_.setZero();
  drive_peak_.setZero();
}

void AxisPlant::shift(const Vector3& by_mm) noexcept {
  modal_.shift(by_mm);
  for (std::size_t i = 0; i < drives_.size(); ++i) {
    drives_[i].shift(by_mm[static_cast<Eigen::Index>(i)]);
  }
}

Vector3 AxisPlant::step_drives(const Vector3& command) {
  Vector3 response;
  Vector3 table;
  for (std::size_t i = 0; i < drives_.size(); ++i) {
    const auto axis = static_cast<Eigen::Index>(i);
    response[axis] = drives_[i].step(command[axis]);
    table[axis] = drives_[i].table_mm();
  }
  response += modal_.step(table) - table;
  drive_deflection_ = response - command;
  drive_peak_ = drive_peak_.cwiseMax(drive_deflection_.cwiseAbs());
  return response;
}

void AxisPlant::reset_peak() noexcept {
  modal_.reset_peak();
  drive_peak_ = drive_deflection_.cwiseAbs();
}

// Largest vibration of each table against its motor from the period on in which the motor has arrived; what the motor
// holds it by in the end (friction, backlash) is no vibration.
Vector3 AxisPlant::vibration_behind_motors(const Vector3& command, double limit_s) const {
  AxisPlant plant = *this;
  const auto periods = static_cast<std::size_t>(whole_periods(limit_s / period_s_));
  std::vector<Vector3> vibration(periods);
  std::array<std::size_t, axis_count> arrived{};
  for (std::size_t k = 0; k < periods; ++k) {
    const Vector3 response = plant.step(command);
    for (std::size_t i = 0; i < drives_.size(); ++i) {
      const auto axis = static_cast<Eigen::Index>(i);
      const double motor = plant.drives_[i].motor_mm();
      vibration[k][axis] = response[axis] - motor;
      if (std::abs(motor - command[axis]) > arrived_mm_) {
        arrived[i] = k + 1;
      }
    }
  }
  Vector3 largest = Vector3::Zero();
  for (std::size_t i = 0; i < drives_.size(); ++i) {
    const auto axis = static_cast<Eigen::Index>(i);
    // One that never arrives has swung all the time.
    for (std::size_t k = arrived[i] < periods ? arrived[i] : 0; k < periods; ++k) {
      largest[axis] = std::max(largest[axis], std::abs(vibration[k][axis] - vibration.back()[axis]));
    }
  }
  return largest;
}

AtRest AxisPlant::at_rest(const Vector3& command, double band_mm, double limit_s) const {
  AtRest result;
  if (drives_.empty()) {
    result.residual_mm = modal_.residual_peak();
    if (!(band_mm > 0.0)) {
      return result;
    }
  }
  if (!drives_.empty() && arrived_mm_ > 0.0) {
    result.residual_mm = vibration_behind_motors(command, limit_s);
    if (!(band_mm > 0.0)) {
      return result;
    }
  }
  AxisPlant plant = *this;
  const double periods = whole_periods(limit_s / period_s_);
  for (double k = 1.0; k <= periods; ++k) {
    plant.reset_peak();
    plant.step(command);
    const Vector3 peak = plant.peak();
    if (!drives_.empty() && arrived_mm_ <= 0.0) {
      result.residual_mm = result.residual_mm.cwiseMax(peak);
    }
    for (Eigen::Index axis = 0; axis < axis_count && band_mm > 0.0; ++axis) {
      if (peak[axis] > band_mm) {
        result.settling_s[axis] =
            k <= (1.0 - watched_share) * periods ? k * period_s_ : std::numeric_limits<double>::infinity();
      }
    }
  }
  return result;
}

}  // namespace shapegcode::detail
