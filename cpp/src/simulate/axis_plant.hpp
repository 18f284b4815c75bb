// The plant of three axes: modes, or feed drives with modes. The choice is made only here.
#pragma once

#include <vector>

#include "shapegcode/plant/feed_drive.hpp"
#include "shapegcode/plant/modal.hpp"
#include "shapegcode/simulation.hpp"

namespace shapegcode::detail {

/// What follows if the command rests from now on.
struct AtRest {
  Vector3 residual_mm = Vector3::Zero();  ///< largest |response - command|
  Vector3 settling_s = Vector3::Zero();   ///< until it stays within the band; infinite: see at_rest
};

/// A copy is a plant of its own in the same state.
class AxisPlant {
 public:
  /// Of the options period, modes with their tables, or drives. Throws Error(argument) on what the plant refuses, or
  /// drives that are not three.
  explicit AxisPlant(const SimulationOptions& options);

  /// At rest at `position`.
  void reset(const Vector3& position);
  /// Moves command and response alike: a change of coordinates.
  void shift(const Vector3& by_mm) noexcept;
  /// Next set-point; returns the response. Throws Error(numeric) where a drive's integrator fails.
  Vector3 step(const Vector3& command) { return drives_.empty() ? modal_.step(command) : step_drives(command); }
  /// Largest |response - command| per axis since the last reset() or reset_peak(): of modes between set-points too, of
  /// drives at the set-points.
  [[nodiscard]] Vector3 peak() const noexcept { return drives_.empty() ? modal_.peak() : drive_peak_; }
  void reset_peak() noexcept;
  /// Modes: residual in closed form. Drives: at the set-points of `limit_s`. The settling time (whole periods; not
  /// looked for without a band) is looked for over `limit_s`, and infinite if the band is left in the last fifth of it.
  [[nodiscard]] AtRest at_rest(const Vector3& command, double band_mm, double limit_s) const;
  /// None: modes.
  [[nodiscard]] const std::vector<FeedDrive>& drives() const noexcept { return drives_; }

 private:
  Vector3 step_drives(const Vector3& command);
  [[nodiscard]] Vector3 vibration_behind_motors(const Vector3& command, double limit_s) const;

  double period_s_;
  double arrived_mm_;
  ModalPlant modal_;
  std::vector<FeedDrive> drives_;
  Vector3 drive_deflection_ = Vector3::Zero();
  Vector3 drive_peak_ = Vector3::Zero();
};

}  // namespace shapegcode::detail
