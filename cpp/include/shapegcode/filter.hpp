#pragma once

#include <cstddef>
#include <span>
#include <vector>

#include "shapegcode/samples.hpp"

namespace shapegcode {

/// FIR filter: weights on the sample grid with a sum of one. An acceleration filter is a moving average, an input
/// shaper has a few unequal taps, an exponential acceleration has geometric taps; a cascade is a list of Fir.
class Fir {
 public:
  /// Taps at whole-sample delays, ascending, first >= 0. Throws Error(argument) on an empty list, unequal lengths, a
  /// negative or unsorted delay, one beyond 1e8 samples, a value that is not finite, or a sum that differs from 1 by
  /// more than 1e-9.
  Fir(std::vector<int> delays, std::vector<double> taps);
  /// Equal weights over `length` >= 1 samples; costs the same for any length. Throws Error(argument) on length < 1 or >
  /// 1e8.
  [[nodiscard]] static Fir moving_average(int length);
  /// Geometric weights exp(-k / time_constant), cut off where less than the ratio `rest` of their sum remains and
  /// scaled to a sum of one; costs the same for any length. Its variance tends to time_constant^2. Throws
  /// Error(argument) on a time constant (in samples) that is not > 0 and finite, a ratio outside 0 ... 1, or more than
  /// 10 million taps.
  [[nodiscard]] static Fir exponential(double time_constant_samples, double rest = 1e-6);

  [[nodiscard]] const std::vector<int>& delays() const noexcept { return delays_; }
  [[nodiscard]] const std::vector<double>& taps() const noexcept { return taps_; }
  [[nodiscard]] bool is_moving_average() const noexcept { return moving_average_; }
  /// Ratio of each tap to the previous one if the taps are geometric; 0 otherwise.
  [[nodiscard]] double decay() const noexcept { return decay_; }
  /// Largest delay in samples: how much longer the output moves than the input.
  [[nodiscard]] int duration_samples() const noexcept;
  /// First moment of the taps in samples: the mean delay.
  [[nodiscard]] double mean_samples() const noexcept;
  /// Second central moment of the taps in samples^2; radius error of a circle: dR/R = variance*(v/R)^2/2.
  [[nodiscard]] double variance_samples2() const noexcept;

  /// The same taps on a grid `factor` times as fine. Throws Error(argument) on factor < 1 or a delay beyond 1e8
  /// samples.
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
  /// The same for row-major memory: sample after sample, each with all axes. Bit-identical to `apply`.
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

/// Real-time form of Fir: one sample of every axis per step; no allocation, no exception, bounded work. A value that is
/// not finite stays in a moving average's sum until the next reset.
class FirStream {
 public:
  /// At rest at zero. Throws Error(argument) on n_axes < 1.
  FirStream(Fir fir, int n_axes);
  /// Rest at `position` (n_axes values).
  void reset(std::span<const double> position) noexcept;
  /// n_axes values in, as many out; both may be the same memory.
  void step(std::span<const double> in, std::span<double> out) noexcept;
  [[nodiscard]] const Fir& fir() const noexcept { return fir_; }

 private:
  Fir fir_;
  int n_axes_ = 0;
  std::vector<double> ring_;  // one row of n_axes values per sample; the number of rows is a power of two
  std::size_t row_mask_ = 0;
  std::size_t row_ = 0;  // samples since reset; its low bits are the row of the next sample
  std::vector<double> sum_,
      sum_error_;  // of each axis: running sum and its round-off; exponential: see fir.cpp
};

/// A set of filters on one grid, with a varying choice among them. Each increment of the input is replaced by the whole
/// impulse train of the filter that its place selects (scatter form). Every train is completed, so every
/// increment keeps the zeros of its own filter, however often the filters change. Taking the output from another filter
/// at a switch (gather form) would cut off the trains in progress.
///
/// A *place* selects the filter: place k is filter k of the set; place k + w (0 < w < 1) gives the part 1 - w of the
/// increment to filter k and w to filter k + 1. A zero of both filters is kept; for zeros at different frequencies a
/// small residual remains in between. Places outside the set are replaced by its nearest end.
class VaryingFir {
 public:
  /// Throws Error(argument) on an empty set.
  explicit VaryingFir(std::vector<Fir> set);

  [[nodiscard]] const std::vector<Fir>& set() const noexcept { return set_; }
  /// Largest delay of the set in samples: how much longer the output moves than the input.
  [[nodiscard]] int duration_samples() const noexcept;
  /// Mean delay, the average of the set, in samples.
  [[nodiscard]] double mean_samples() const noexcept;
  /// Largest second central moment of the set in samples^2.
  [[nodiscard]] double variance_samples2() const noexcept;
  /// The same set on a grid `factor` times as fine. Throws Error(argument) on factor < 1.
  [[nodiscard]] VaryingFir on_finer_grid(int factor) const;

  /// Batch form, all axes: `place` holds one value per row of `in` for the increment that leads to that row (the first
  /// is not used). Input held at its first value before and at its last after; the result has duration_samples() more
  /// rows. Bit-identical to VaryingFirStream. Throws Error(argument) on an input without rows, another number of
  /// places, or a place that is not finite.
  [[nodiscard]] Samples apply(const Samples& in, std::span<const double> place) const;
  /// One output value of one axis, if the caller stores the input: `newest` points at the input of that row and `place`
  /// at its place; the duration_samples() rows before it must precede both in memory. A place that is not a number
  /// counts as 0.
  [[nodiscard]] double value(const double* newest, const double* place) const noexcept;

 private:
  std::vector<Fir> set_;
  std::vector<double> to_come_;  // filter, delay: part of an increment still to come after this delay
};

/// Real-time form: one sample of every axis per step; no allocation, no exception, bounded work. When the input has
/// been at rest for longer than the longest filter, the output equals it exactly.
class VaryingFirStream {
 public:
  /// At rest at zero. Throws Error(argument) on n_axes < 1.
  VaryingFirStream(VaryingFir fir, int n_axes);
  /// Rest at `position` (n_axes values).
  void reset(std::span<const double> position) noexcept;
  /// n_axes values in, as many out; both may be the same memory. The increment since the last step goes to the filter
  /// at `place`; a place that is not a number counts as 0.
  void step(std::span<const double> in, std::span<double> out, double place) noexcept;
  [[nodiscard]] const VaryingFir& fir() const noexcept { return fir_; }

 private:
  /// Travel of an axis still to come, and the round-off of its sum.
  struct Lag {
    double sum = 0.0;
    double error = 0.0;
    void add(double value) noexcept;
  };
  /// Adds the impulse train of `share` of the present increments to the pending ones.
  void begin_train(const Fir& fir, double share) noexcept;

  VaryingFir fir_;
  std::vector<double>
      pending_;  // pending increments, one row of n_axes values per sample; the number of rows is a power of two
  std::size_t row_mask_ = 0;
  std::size_t row_ = 0;
  std::size_t at_rest_ = 0;  // samples since the input last moved
  std::vector<double> last_, increment_;
  std::vector<Lag> lag_;
};

/// A set of filters along an axis: the position of the input selects the valid one.
class FollowingFir {
 public:
  /// Filter k of `fir` is valid where axis `axis` (0, 1, 2) is at `position_mm[k]`; between two positions each
  /// increment is divided between their filters, beyond the ends the nearest filter is valid. Throws Error(argument) on
  /// an invalid axis, a number of positions other than that of filters, or positions that are not finite and strictly
  /// ascending.
  FollowingFir(VaryingFir fir, int axis, std::vector<double> position_mm);

  [[nodiscard]] const VaryingFir& fir() const noexcept { return fir_; }
  [[nodiscard]] int axis() const noexcept { return axis_; }
  [[nodiscard]] const std::vector<double>& position_mm() const noexcept { return position_mm_; }
  /// Place in the set for a position of the axis.
  [[nodiscard]] double place(double position_mm) const noexcept;
  /// The same on a grid `factor` times as fine. Throws Error(argument) on factor < 1.
  [[nodiscard]] FollowingFir on_finer_grid(int factor) const;
  /// Filters a command of at least axis() + 1 axes; the middle of each increment selects its filter. Throws
  /// Error(argument) as VaryingFir::apply does, or if the axis is not in the samples.
  [[nodiscard]] Samples apply(const Samples& in) const;

 private:
  VaryingFir fir_;
  int axis_;
  std::vector<double> position_mm_;
};

}  // namespace shapegcode
