#pragma once

#include <cstddef>
#include <vector>

namespace shapegcode {

/// One stretch of constant tangential acceleration.
struct SpeedPhase {
  double start_s = 0.0;  ///< time at which it begins
  double duration_s = 0.0;
  double distance_mm = 0.0;  ///< along the path at its begin
  double speed_mm_per_s = 0.0;
  double acceleration_mm_per_s2 = 0.0;
};

/// Distance along a path as a function of time. Constant after construction.
class SpeedProfile {
 public:
  SpeedProfile() = default;
  /// `length_mm` is the distance reached at the end, to the last bit.
  SpeedProfile(std::vector<SpeedPhase> phases, double length_mm, double jerk_time_s);

  [[nodiscard]] const std::vector<SpeedPhase>& phases() const noexcept { return phases_; }
  /// Time of the ramps alone, without the smoothing by the jerk time.
  [[nodiscard]] double ramp_duration_s() const noexcept { return duration_s_; }
  [[nodiscard]] double jerk_time_s() const noexcept { return jerk_time_s_; }
  /// Whole time: ramps plus smoothing.
  [[nodiscard]] double duration_s() const noexcept { return duration_s_ + jerk_time_s_; }
  [[nodiscard]] double length_mm() const noexcept { return length_mm_; }
  /// Distance at a time, before smoothing; `cursor` as in Path::point.
  [[nodiscard]] double distance_mm(double time_s, std::size_t& cursor) const noexcept;
  /// Tangential speed at a time, before smoothing.
  [[nodiscard]] double speed_mm_per_s(double time_s, std::size_t& cursor) const noexcept;
  /// Time at which a distance is reached, before smoothing.
  [[nodiscard]] double time_s(double distance_mm, std::size_t& cursor) const noexcept;

 private:
  void seek(double time_s, std::size_t& cursor) const noexcept;

  std::vector<SpeedPhase> phases_;
  double duration_s_ = 0.0;
  double length_mm_ = 0.0;
  double jerk_time_s_ = 0.0;
};

}  // namespace shapegcode
