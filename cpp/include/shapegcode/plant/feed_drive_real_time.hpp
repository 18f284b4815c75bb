#pragma once

#include <memory>

#include "shapegcode/plant/feed_drive.hpp"

namespace shapegcode {

/// The equations of FeedDrive with fixed steps, for a controller prototype that needs its plant in bounded time: a
/// Rosenbrock method (L-stable, third order: Rodas3 of Sandu et al. 1997) whose linear systems are solved in place.
/// After construction no allocation, no lock, no exception; each step() costs the same. There is no error control:
/// docs/feed_drive.md states the error beside FeedDrive for the usual drives; twice the substeps show it for another.
class FeedDriveRealTime {
 public:
  static constexpr int default_substeps = 4;

  /// At rest at zero. `substeps` per period, 1 ... 1000. Throws Error(argument) on parameters outside their range, a
  /// period <= 0 or other substeps.
  FeedDriveRealTime(FeedDriveParameters parameters, double period_s, int substeps = default_substeps);
  ~FeedDriveRealTime();
  FeedDriveRealTime(const FeedDriveRealTime& other);
  FeedDriveRealTime& operator=(const FeedDriveRealTime& other);
  FeedDriveRealTime(FeedDriveRealTime&& other) noexcept;
  FeedDriveRealTime& operator=(FeedDriveRealTime&& other) noexcept;

  /// At rest at `position_mm`, without force in spring and bristles.
  void reset(double position_mm) noexcept;
  /// Next set-point; returns the response (table and modes, mm) at that instant. A set-point that is not finite gives
  /// a response that is not finite from then on, until reset().
  double step(double setpoint_mm) noexcept;

  // As of the last set-point.
  [[nodiscard]] double response_mm() const noexcept;  ///< table and modes
  [[nodiscard]] double table_mm() const noexcept;
  [[nodiscard]] double motor_mm() const noexcept;          ///< angle of the motor as travel
  [[nodiscard]] double friction_force_n() const noexcept;  ///< on the table, against its motion
  [[nodiscard]] double motor_force_n() const noexcept;     ///< torque of the motor as force, within its limit

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace shapegcode
