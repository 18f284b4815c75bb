#pragma once

#include <span>
#include <vector>

#include "shapegcode/filter.hpp"
#include "shapegcode/mode.hpp"

namespace shapegcode {

/// An input shaper: impulses of amplitude A_k at times t_k, ascending from t_1 = 0, with a sum of one. The times are
/// continuous; `to_fir` converts a shaper whose times lie on a sample grid to a filter. Use `make_shaper`, which checks
/// its arguments.
struct Shaper {
  std::vector<double> times_s;     ///< t_k in s, strictly ascending from exactly 0
  std::vector<double> amplitudes;  ///< A_k, one per time, sum 1 within 1e-9; may be negative

  [[nodiscard]] bool operator==(const Shaper&) const = default;
};

/// The checked Shaper. `times_s` in s and `amplitudes` (no unit), both of the same length >= 1. Throws Error(argument)
/// on an empty or unequal pair, a value that is not finite, a first time other than 0, times that do not ascend, or a
/// sum of the amplitudes that differs from 1 by more than 1e-9. Source: paper 002, eq. 4 and 9.
[[nodiscard]] Shaper make_shaper(std::vector<double> times_s, std::vector<double> amplitudes);

/// Time of the last impulse in s, by which the shaped command is longer than the unshaped one.
[[nodiscard]] double duration_s(const Shaper& shaper);

/// First moment sum A_k t_k in s: the mean delay of the shaped command.
[[nodiscard]] double mean_s(const Shaper& shaper);

/// Second central moment sum A_k (t_k - mean)^2 in s^2; radius error dR/R = variance*(v/R)^2/2 on a circle of
/// radius R at speed v. May be negative where amplitudes are.
[[nodiscard]] double variance_s2(const Shaper& shaper);

/// True if any amplitude is below zero.
[[nodiscard]] bool has_negative(const Shaper& shaper);

/// sum |A_k|: 1 for a non-negative shaper; the largest factor by which the shaper increases speed and acceleration.
[[nodiscard]] double abs_sum(const Shaper& shaper);

/// Residual vibration of `mode` after the last impulse, relative to the unshaped one: V = e^{-zeta*omega*t_N} |sum A_k
/// e^{zeta*omega*t_k} e^{j*omega_d*t_k}| (paper 002, eq. 8 sets it to zero). The rounding floor is about 1e-16*(1 +
/// omega*t_N)*sum|A_k|. Throws Error(argument) as `pole` does.
[[nodiscard]] double residual_ratio(const Shaper& shaper, const Mode& mode);

/// The shaper as a filter on samples `period_s` (s) apart. Times are never rounded: throws Error(design), naming the
/// time, if a time differs from a multiple of the period by more than 1e-9 of the larger of time and period (rounding
/// would lose the zeros), and Error(argument) if the period is not finite and positive.
[[nodiscard]] Fir to_fir(const Shaper& shaper, double period_s);

/// Smallest distance |z - 1| of a mode's z = e^{s*period} from +1 at which `grid_polynomial` accepts it: below it a
/// single mode already has sum |A_k| of some 4e4.
inline constexpr double grid_least_distance_from_one = 0.01;

/// Largest residual ratio that `grid_polynomial` returns; a design with more, due to round-off, is refused.
inline constexpr double grid_largest_residual = 1e-10;

/// Shortest shaper with impulses at whole multiples of `period_s` (s) that cancels every mode exactly: the polynomial
/// with the roots z_i = e^{s_i*period} and their conjugates, scaled to sum 1. Two periods per mode; one for a mode
/// whose z is real (half a period of it is a multiple of the grid); none for one that aliases onto an earlier one. A
/// mode above the grid's Nyquist frequency is allowed. Amplitudes may be negative and large (46/131 Hz, zeta .02: sum
/// |A_k| is 1 at 5 ms, 248 at 1 ms): check `abs_sum` before use.
///
/// Throws Error(argument) if `modes` is empty, as `pole` does, or if the period is not finite and positive;
/// Error(design) if a z_i is closer to +1 than `grid_least_distance_from_one`, or if round-off leaves a residual above
/// `grid_largest_residual`. Source: this project.
[[nodiscard]] Shaper grid_polynomial(std::span<const Mode> modes, double period_s);

// One declaration here and one definition in families.cpp per family; extra_insensitive() is in
// extra_insensitive.cpp.

/// Zero-vibration shaper of one mode: impulses at 0 and half the damped period, amplitudes 1/(1+K) and K/(1+K) with K =
/// exp(-zeta*pi/sqrt(1-zeta^2)). Throws Error(argument) as `pole` does. Source: paper 002, eq. 1-2 (Smith 1958).
[[nodiscard]] Shaper zv(const Mode& mode);

/// ZV with impulses at multiples of a period: the second impulse is divided between the two multiples around half the
/// damped period, so that the residual at the mode is exactly zero. Three non-negative impulses, or two if half the
/// damped period is a multiple. Throws Error(argument) as `pole` does or for a period that is not above 0,
/// Error(design) if the period is longer than a quarter of the damped period. Source: this project.
[[nodiscard]] Shaper zv_on_grid(const Mode& mode, double period_s);

/// Maximum number of zeros of `repeated_zv`.
inline constexpr int max_repeated_zeros = 20;

/// The ZV shaper in series with itself: `zeros` zeros at the mode, so that V and its first `zeros`-1 derivatives with
/// respect to the frequency vanish there; 1 is ZV, 2 ZVD, 3 ZVDD. `zeros`+1 non-negative impulses, half a damped period
/// apart. Throws Error(argument) as `pole` does, or if `zeros` is not from 1 to `max_repeated_zeros`. Source: Singer
/// and Seering 1990.
[[nodiscard]] Shaper repeated_zv(const Mode& mode, int zeros);

/// Modified ZV: three non-negative impulses 3/8 of the damped period apart, amplitudes (1 - 1/sqrt 2, (sqrt 2 - 1) K,
/// (1 - 1/sqrt 2) K^2) over their sum, K = exp(-zeta*3/4*pi/sqrt(1-zeta^2)). It cancels the mode and also the pole of
/// the same decay at 5/3 of its damped frequency: 1.5 times as long as ZV, and (undamped) .62 of ZV's slope of V at the
/// mode. Throws Error(argument) as `pole` does. Source: the open printer firmware Klipper, "mzv".
[[nodiscard]] Shaper mzv(const Mode& mode);

/// The second pole that `mzv` cancels, as a mode: the same decay rate, 5/3 of the damped frequency. Throws
/// Error(argument) as `pole` does.
[[nodiscard]] Mode mzv_second_zero(const Mode& mode);

/// Negative zero-vibration shaper of unity magnitude: amplitudes exactly 1, -1, 1; without damping at 0, 1/6 and 1/3 of
/// the period. The two times solve 1 - e^{-s t2} + e^{-s t3} = 0 to round-off, damped or not, not by a fitted formula.
/// Throws Error(argument) as `pole` does, Error(design) if there is no solution at high damping. Source of the family:
/// Singhose, Singer and Seering 1994; of the solution: this project.
[[nodiscard]] Shaper negative_zv(const Mode& mode);

/// The two shapers in series: cancels the modes of both; the durations add. Impulses whose times agree within 1e-12 of
/// the duration are merged. Throws Error(argument) if either is not a valid shaper. Source: paper 002, eq. 3.
[[nodiscard]] Shaper convolve(const Shaper& first, const Shaper& second);

/// Convolved ZV of one or more modes, the conventional multi-mode shaper: up to 2^n impulses. Throws Error(argument) if
/// `modes` is empty, and as `pole` does. Source: paper 002, section 2.
[[nodiscard]] Shaper convolved_zv(std::span<const Mode> modes);

/// Maximum number of humps of `extra_insensitive`.
inline constexpr int max_humps = 3;

/// An extra-insensitive shaper, with the zeros and maxima of its residual. The frequencies are natural frequencies of
/// modes with the damping ratio of the design.
struct ExtraInsensitive {
  Shaper shaper;
  std::vector<double> zeros_hz;  ///< ascending, one more than humps: V = 0
  std::vector<double> humps_hz;  ///< ascending, between the zeros: V = vibration_limit, its largest there
};

/// Extra-insensitive shaper of one mode: `humps`+2 non-negative impulses whose residual between its outermost zeros
/// rises to exactly `vibration_limit` (above 0, below 1) at each of `humps` (1 to `max_humps`) maxima. With an odd
/// number of humps the middle one lies at the mode, with two the middle zero does.
///
/// Without damping it is the Dolph-Chebyshev window over half periods, in closed form; with damping the conditions
/// themselves (sum, zeros, height and slope at every hump) are solved for amplitudes, times and frequencies by Newton's
/// method, by continuation from zero damping: exact to round-off, not a fit. Throws Error(argument) as `pole` does or
/// on a value outside its range, Error(design) if there is no such shaper with non-negative impulses: with a limit of
/// .05 the solution exists up to damping ratios of some .69, .45 and .32 for one, two and three humps.
///
/// Sources: Singhose, Seering and Singer 1994 (EI), Singhose, Porter, Tuttle and Singer 1997 (several humps); the
/// closed form and the damped solution: this project.
[[nodiscard]] ExtraInsensitive extra_insensitive(const Mode& mode, double vibration_limit, int humps);

/// Residual ratio of modes with damping ratio `damping_ratio` at each of `frequencies_hz` (natural frequencies), in
/// their order. Throws Error(argument) as `pole` does. Source: paper 002, eq. 8.
[[nodiscard]] std::vector<double> sensitivity_curve(const Shaper& shaper, double damping_ratio,
                                                    std::span<const double> frequencies_hz);

/// The largest residual over a band of frequencies.
struct WorstResidual {
  double residual_ratio;  ///< V at `frequency_hz`
  double frequency_hz;    ///< its frequency in the band
  double upper_bound;     ///< no frequency of the band has a larger V (up to rounding)
};

/// Largest residual ratio of a mode with the damping of `mode` and a natural frequency from `lowest_hz` to
/// `highest_hz`, found and proven: the band is halved until a bound on the derivatives shows that no part of it exceeds
/// the largest value found by more than 1e-6 of it, or by 1e-12. Throws Error(argument) as `pole` does or if the band
/// is not ascending (equal ends are allowed), Error(design) if the proof needs more than a million parts, as for a band
/// of many thousand periods of the shaper. Source: this project.
[[nodiscard]] WorstResidual worst_residual(const Shaper& shaper, const Mode& mode, double lowest_hz, double highest_hz);

/// A band of frequencies.
struct FrequencyBand {
  double lowest_hz;
  double highest_hz;
};

/// Upper end of the search of `insensitive_band`, in multiples of the mode's frequency.
inline constexpr double insensitivity_reach = 10.0;

/// The band around `mode` in which the residual stays at or below `vibration_limit` (above 0, below 1): its ends are
/// the nearest frequencies at which V exceeds the limit, found by steps that a bound on the derivatives proves safe.
/// Both ends are the mode's frequency if V exceeds the limit there; the upper end is at most `insensitivity_reach`
/// times it. A relative excess of 1e-9 is permitted, so that a hump that touches the limit does not end the band.
/// Throws Error(argument) as `pole` does or on a limit outside its range. Source: this project.
[[nodiscard]] FrequencyBand insensitive_band(const Shaper& shaper, const Mode& mode, double vibration_limit);

/// Insensitivity: width of `insensitive_band` over the mode's frequency (no unit); ZV has .064 and EI .399 at 5 %
/// without damping. Throws as `insensitive_band` does. Source: Singer and Seering 1990.
[[nodiscard]] double insensitivity(const Shaper& shaper, const Mode& mode, double vibration_limit);

}  // namespace shapegcode
