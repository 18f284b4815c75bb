#pragma once

#include <array>
#include <vector>

#include "shapegcode/filter/fir.hpp"
#include "shapegcode/motion/controller.hpp"
#include "shapegcode/samples.hpp"

namespace shapegcode {

/// Shape of one rapid in whole interpolation periods, per axis: the way is run off evenly in `travel` periods and
/// smoothed by a moving average over `ramp` and one over `bell` periods, so it takes the sum of the three. A short
/// rapid has travel = ramp.
struct RapidShape {
  std::array<int, axis_count> travel = {};
  std::array<int, axis_count> ramp = {};
  int bell = 0;
  double even_s = 0.0;         ///< what the way would take at its rate all along; non-linear: of the slowest axis
  double rate_mm_per_s = 0.0;  ///< reached; linear: tangential; non-linear: of the axis that takes longest
};

/// Paper 004, eq. 6 to 16, with rates and accelerations per axis: linear v = min_i(1420_i L/d_i) and
/// a = min_i(1420_i/1620_i L/d_i); non-linear each axis for itself. Axes without travel have 0 periods. Throws
/// Error(argument) on a rapid of more than 1e8 periods.
[[nodiscard]] RapidShape rapid_shape(const Vector3& travel_mm, const ControllerModel& model);

/// Time of a rapid from rest to rest without the wait for in-position; 0 without travel.
[[nodiscard]] double rapid_time_s(const Vector3& travel_mm, const ControllerModel& model);

/// Wait for in-position behind a rapid. `measured`: the largest constant of an axis that moves. `servo_lag`: closed
/// form of the position error e' = (1 - a) x' - K e (gain K, feed-forward a) at the end of the command, which decays to
/// the width w in ln(e / w) / K; whole periods.
[[nodiscard]] double in_position_wait_s(const Vector3& travel_mm, const ControllerModel& model);

/// The same behind any command: `error_mm` is what the servo loop lags at its end, `moved` the axes that moved.
[[nodiscard]] double in_position_wait_s(const Vector3& error_mm, const std::array<bool, axis_count>& moved,
                                        const ControllerModel& model);

/// Set-points of a rapid, one per period, the start first. Its periods are found by trial, not by the closed form.
class RapidPlayer {
 public:
  /// Throws Error(argument) on a model that `check` refuses.
  RapidPlayer(const Vector3& start_mm, const Vector3& end_mm, const ControllerModel& model);
  /// Next set-point; false once the end was given.
  bool step(Vector3& position) noexcept;
  /// Periods from rest to rest.
  [[nodiscard]] int period_count() const noexcept { return count_; }

 private:
  struct Axis {
    int travel = 0;
    std::vector<FirStream> filters;
  };
  Vector3 start_mm_;
  Vector3 travel_mm_;
  Vector3 end_mm_;
  std::array<Axis, axis_count> axes_;
  int index_ = 0;
  int count_ = 0;
};

/// All set-points of a rapid, (n, 3).
[[nodiscard]] Samples rapid_samples(const Vector3& start_mm, const Vector3& end_mm, const ControllerModel& model);

}  // namespace shapegcode
