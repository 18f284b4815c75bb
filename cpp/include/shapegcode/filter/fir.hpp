#pragma once

#include <cstddef>
#include <span>
#include <vector>

#include "shapegcode/samples.hpp"

namespace shapegcode {

/// The one filter type: weights on the sample grid that add up to one. An acceleration filter is a moving average, an
/// input shaper a few unequal taps, an exponential acceleration geometric ones; a cascade of them is a list of Fir.
class Fir {
 public:
  /// Taps at whole-sample delays, ascending, first >= 0. Throws Error(argument) on an empty list, unequal lengths, a
  /// negative or unsorted delay, a value that is not finite, or a sum that differs from 1 by more than 1e-9.
  Fir(std::vector<int> delays, std::vector<double> taps);
  /// Equal weights over `length` >= 1 samples; costs the same for any length. Throws Error(argument) on length < 1.
  [[nodiscard]] static Fir moving_average(int length);
  /// Geometric weights exp(-k / time_constant), cut off where less than the share `rest` of them is left and scaled to
  /// a sum of one; costs the same for any length. Its variance tends to time_constant^2. Throws Error(argument) on a
  /// time constant (in samples) that is not > 0 and finite, a share outside 0 ... 1, or more than 10 million taps.
  [[nodiscard]] static Fir exponential(double time_constant_samples, double rest = 1e-6);

  [[nodiscard]] const std::vector<int>& delays() const noexcept { return delays_; }
  [[nodiscard]] const std::vector<double>& taps() const noexcept { return taps_; }
  [[nodiscard]] bool is_moving_average() const noexcept { return moving_average_; }
  /// Ratio of each tap to the one before it where the taps are geometric; 0 otherwise.
  [[nodiscard]] double decay() const noexcept { return decay_; }
  /// Largest delay in samples: how much longer the output moves than the input.
  [[nodiscard]] int duration_samples() const noexcept;
  /// First moment of the taps in samples: the mean delay.
  [[nodiscard]] double mean_samples() const noexcept;
  /// Second central moment of the taps in samples^2: the contour cost (spec: dR/R = variance*(v/R)^2/2).
  [[nodiscard]] double variance_samples2() const noexcept;

  /// The same taps on a grid that is `factor` times as fine. Throws Error(argument) on factor < 1.
  [[nodiscard]] Fir on_finer_grid(int factor) const;

  /// Batch form of one axis: input held at its first value before and at its last value after.
  /// out.size() must be in.size() + duration_samples(). Bit-identical to FirStream. `in` and `out` must not overlap.
  /// Throws Error(argument) on an empty input or a wrong output size.
  void apply(std::span<const double> in, std::span<double> out) const;
  /// All axes; the result has duration_samples() more rows. Throws Error(argument) on an input without rows.
  [[nodiscard]] Samples apply(const Samples& in) const;
  /// All axes into the caller's memory, column-major: `in` holds in_rows x n_axes values, `out` receives
  /// (in_rows + duration_samples()) x n_axes. Throws Error(argument) on in_rows < 1 or n_axes < 0.
  void apply(const double* in, Eigen::Index in_rows, int n_axes, double* out) const;
  /// The same for row-major memory: one sample of every axis after the other. Bit-identical to `apply`.
  void apply_rows(const double* in, Eigen::Index rows, int n_axes, double* out) const;

 private:
  friend class FirStream;

  std::vector<int> delays_;
  std::vector<double> taps_;
  bool moving_average_ = false;
  // Exponential only: ratio of successive taps, that ratio to the power of their number, and the taps' sum before
  // scaling.
  double decay_ = 0.0;
  double leaving_ = 0.0;
  double weight_sum_ = 0.0;
};

/// Real-time form: one sample of every axis per step; no allocation, no exception, bounded work.
/// A value that is not finite stays in a moving average's sum until the next reset.
class FirStream {
 public:
  /// At rest at zero. Throws Error(argument) on n_axes < 1.
  FirStream(Fir fir, int n_axes);
  /// Rest at `position` (n_axes values).
  void reset(std::span<const double> position) noexcept;
  /// Filters in place: n_axes values.
  void step(std::span<double> position) noexcept;
  [[nodiscard]] const Fir& fir() const noexcept { return fir_; }

 private:
  Fir fir_;
  int n_axes_ = 0;
  std::vector<double> ring_;  // one row of n_axes values per sample; the number of rows is a power of two
  std::size_t row_mask_ = 0;
  std::size_t row_ = 0;  // samples since reset; its low bits are the row of the next sample
  std::vector<double> sum_,
      sum_error_;  // of each axis: running sum and what its rounding lost; exponential: see fir.cpp
};

}  // namespace shapegcode
