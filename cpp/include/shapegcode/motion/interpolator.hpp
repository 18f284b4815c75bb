#pragma once

#include <cstddef>
#include <memory>

#include "shapegcode/filter/fir.hpp"
#include "shapegcode/motion/speed_profile.hpp"
#include "shapegcode/path/path.hpp"

namespace shapegcode {

/// Set-points of a path under a speed profile, one per interpolation period, from the start (first step) to the end.
/// `step` is the real-time form: no allocation, no exception, no lock, work bounded by the segments and phases that one
/// period passes over. `interpolate` is the batch form and made of the same steps.
class Interpolator {
 public:
  /// `delay_s` >= 0: rest at the start before the motion begins; need not be a multiple of the period. Throws
  /// Error(argument) on a period <= 0.
  Interpolator(std::shared_ptr<const Path> path, std::shared_ptr<const SpeedProfile> profile, double period_s,
               double delay_s = 0.0);

  /// Next set-point. False once the last set-point was given; `position` then stays at the end.
  bool step(Vector3& position) noexcept;
  /// Distance along the path at the set-point last given.
  [[nodiscard]] double distance_mm() const noexcept { return distance_mm_; }
  /// Segment of the set-point last given.
  [[nodiscard]] std::size_t segment() const noexcept { return path_cursor_; }
  /// Number of set-points from start to end.
  [[nodiscard]] std::size_t sample_count() const noexcept { return sample_count_; }
  [[nodiscard]] double period_s() const noexcept { return period_s_; }

 private:
  std::shared_ptr<const Path> path_;
  std::shared_ptr<const SpeedProfile> profile_;
  FirStream smoothing_;
  double period_s_ = 0.0;
  double delay_s_ = 0.0;
  std::size_t sample_count_ = 0;
  std::size_t index_ = 0;
  std::size_t path_cursor_ = 0;
  std::size_t phase_cursor_ = 0;
  double distance_mm_ = 0.0;
};

/// All set-points of a path: (n_samples, 3).
[[nodiscard]] Samples interpolate(std::shared_ptr<const Path> path, std::shared_ptr<const SpeedProfile> profile,
                                  double period_s);

}  // namespace shapegcode
