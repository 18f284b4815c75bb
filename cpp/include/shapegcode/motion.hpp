#pragma once

#include <cstddef>
#include <cstdint>
#include <limits>
#include <memory>
#include <span>
#include <vector>

#include "shapegcode/filter.hpp"
#include "shapegcode/limits.hpp"
#include "shapegcode/path.hpp"
#include "shapegcode/samples.hpp"

namespace shapegcode {

/// One section of constant tangential acceleration.
struct SpeedPhase {
  double start_s = 0.0;  ///< time at which it begins
  double duration_s = 0.0;
  double distance_mm = 0.0;  ///< along the path at its start
  double speed_mm_per_s = 0.0;
  double acceleration_mm_per_s2 = 0.0;

  /// Distance along the path at a time within it.
  [[nodiscard]] double distance_at(double time_s) const noexcept {
    const double t = time_s - start_s;
    return distance_mm + t * (speed_mm_per_s + 0.5 * acceleration_mm_per_s2 * t);
  }
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

/// Additional speed limits of a path, mm/s; infinity: none.
struct SpeedCaps {
  std::vector<float> on_segment;   ///< of each segment
  std::vector<float> at_junction;  ///< [i]: at the start of segment i
};

/// Tangential speed profile over a whole path from rest to rest: every segment at most at its feed, every limit kept,
/// deceleration completed where a slower segment begins. O(n). Throws Error(argument) on a limit that is not positive
/// or a segment without feed, or caps that are not one per segment. `filter`: the filter after the interpolation, and
/// its tolerance.
///
/// Forward and backward passes over the segments' boundary speeds (the planner of grbl and of LinuxCNC, in v^2); then,
/// under the constant-time law, ramps are lengthened to the time constant if a neighbouring section of constant speed
/// is long enough. A jerk time smooths distance over time by a moving average of that length; the slow sections around
/// corners are lengthened by half of it on both sides, so that smoothing does not raise the speed at the corner.
///
/// With a jerk time the acceleration of an axis may exceed its limit where segments of different direction meet at
/// speed (only the corner limits apply there); on arcs `max_jerk_mm_per_s3` limits the jerk of the turn, v^3/r^2, only.
[[nodiscard]] SpeedProfile plan_speed(const Path& path, const MotionLimits& limits, const FilterTolerance& filter = {},
                                      const SpeedCaps* caps = nullptr);

/// Set-points of a path under a speed profile, one per interpolation period, from the start (first step) to the end.
/// `step` is the real-time form: no allocation, no exception, no lock, work bounded by the segments and phases within
/// one period. `interpolate` is the batch form and uses the same steps.
class Interpolator {
 public:
  /// `delay_s` >= 0: rest at the start before the motion begins; need not be a multiple of the period. Throws
  /// Error(argument) on a period <= 0, or more than 4e9 set-points.
  Interpolator(std::shared_ptr<const Path> path, std::shared_ptr<const SpeedProfile> profile, double period_s,
               double delay_s = 0.0);

  /// Next set-point, X, Y and Z. False after the last one; the position then stays at the end.
  bool step(std::span<double> out) noexcept { return step_into(out, *this); }
  bool step(Vector3& position) noexcept { return step(position, 1); }
  /// The set-point `periods` later, identical to the last of that many steps; the path is evaluated once.
  bool step(Vector3& position, std::size_t periods) noexcept;
  /// Distance along the path at the last set-point.
  [[nodiscard]] double distance_mm() const noexcept { return distance_mm_; }
  /// Segment of the last set-point.
  [[nodiscard]] std::size_t segment() const noexcept { return path_cursor_; }
  [[nodiscard]] const Segment& on() const noexcept { return on_; }
  /// Number of set-points from start to end.
  [[nodiscard]] std::size_t sample_count() const noexcept { return sample_count_; }
  [[nodiscard]] double period_s() const noexcept { return period_s_; }

 private:
  void take_segment() noexcept;

  std::shared_ptr<const Path> path_;
  std::shared_ptr<const SpeedProfile> profile_;
  FirStream smoothing_;
  bool smooths_;  // more than one sample
  double period_s_ = 0.0;
  double delay_s_ = 0.0;
  std::size_t sample_count_ = 0;
  std::size_t index_ = 0;
  std::size_t path_cursor_ = 0;
  Segment on_;                // of the path, at the cursor
  double on_begin_mm_ = 0.0;  // distance of its start and its end along the path
  double on_end_mm_ = 0.0;
  std::size_t phase_cursor_ = 0;
  double distance_mm_ = 0.0;
};

/// All set-points of a path: (n_samples, 3).
[[nodiscard]] Samples interpolate(std::shared_ptr<const Path> path, std::shared_ptr<const SpeedProfile> profile,
                                  double period_s);

}  // namespace shapegcode
