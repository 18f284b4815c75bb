#pragma once

#include <vector>

#include "shapegcode/filter/fir.hpp"
#include "shapegcode/mode.hpp"

namespace shapegcode {

/// An input shaper: amplitudes A_k at times t_k, ascending from t_1 = 0, that add up to one (spec 2). The times are
/// continuous; `to_fir` puts a shaper whose times lie on a sample grid into the filter cascade. Build one with
/// `make_shaper`, which checks it.
struct Shaper {
  std::vector<double> times_s;     ///< t_k in s, strictly ascending from exactly 0
  std::vector<double> amplitudes;  ///< A_k, one per time, sum 1 within 1e-9; may be negative

  [[nodiscard]] bool operator==(const Shaper&) const = default;
};

/// The checked Shaper. `times_s` in s and `amplitudes` (no unit), both of the same length >= 1. Throws Error(argument)
/// on an empty or unequal pair, a value that is not finite, a first time other than 0, times that do not ascend, or a
/// sum of the amplitudes that differs from 1 by more than 1e-9. Source: paper 002, eq. 4 and 9.
[[nodiscard]] Shaper make_shaper(std::vector<double> times_s, std::vector<double> amplitudes);

/// Time of the last tap in s: how much longer the shaped command moves than the unshaped one.
[[nodiscard]] double duration_s(const Shaper& shaper);

/// First moment sum A_k t_k in s: the mean delay of the shaped command.
[[nodiscard]] double mean_s(const Shaper& shaper);

/// Second central moment sum A_k (t_k - mean)^2 in s^2: the contour cost, dR/R = variance*(v/R)^2/2 on a circle of
/// radius R at speed v (spec 0). May be negative where amplitudes are.
[[nodiscard]] double variance_s2(const Shaper& shaper);

/// True if any amplitude is below zero.
[[nodiscard]] bool has_negative(const Shaper& shaper);

/// sum |A_k|: 1 for a non-negative shaper; the factor by which the shaper may magnify speed and acceleration.
[[nodiscard]] double abs_sum(const Shaper& shaper);

/// Residual vibration of `mode` after the last tap, relative to the unshaped one:
/// V = e^{-zeta*omega*t_N} |sum A_k e^{zeta*omega*t_k} e^{j*omega_d*t_k}| (spec 2; paper 002, eq. 8 sets it to zero).
/// The rounding floor is about 1e-16*(1 + omega*t_N)*sum|A_k|. Throws Error(argument) as `pole` does.
[[nodiscard]] double residual_ratio(const Shaper& shaper, const Mode& mode);

/// The shaper as a filter on samples `period_s` (s) apart. Exact or not at all: throws Error(design), naming the time,
/// if a time differs from a multiple of the period by more than 1e-9 of the larger of time and period (rounding the
/// times would undo the zeros, spec 2), and Error(argument) if the period is not finite and positive.
[[nodiscard]] Fir to_fir(const Shaper& shaper, double period_s);

}  // namespace shapegcode
