#pragma once

#include <span>

#include "shapegcode/mode.hpp"
#include "shapegcode/shaping/shaper.hpp"

namespace shapegcode {

// One declaration here and one definition in families.cpp per family; those with a tolerated residual are in
// extra_insensitive.hpp.

/// Zero-vibration shaper of one mode: taps at 0 and half the damped period, amplitudes 1/(1+K) and K/(1+K) with
/// K = exp(-zeta*pi/sqrt(1-zeta^2)). Throws Error(argument) as `pole` does. Source: paper 002, eq. 1-2 (Smith 1958).
[[nodiscard]] Shaper zv(const Mode& mode);

/// Most zeros that `repeated_zv` places at a mode.
inline constexpr int most_repeated_zeros = 20;

/// The ZV shaper in series with itself: `zeros` zeros at the mode, so that V and its first `zeros`-1 derivatives with
/// respect to the frequency vanish there; 1 is ZV, 2 ZVD, 3 ZVDD. `zeros`+1 non-negative taps, half a damped period
/// apart. Throws Error(argument) as `pole` does, or if `zeros` is not from 1 to `most_repeated_zeros`. Source: Singer
/// and Seering 1990.
[[nodiscard]] Shaper repeated_zv(const Mode& mode, int zeros);

/// Modified ZV: three non-negative taps 3/8 of the damped period apart, amplitudes (1 - 1/sqrt 2, (sqrt 2 - 1) K,
/// (1 - 1/sqrt 2) K^2) over their sum, K = exp(-zeta*3/4*pi/sqrt(1-zeta^2)). It cancels the mode and also the pole of
/// the same decay at 5/3 of its damped frequency: half as long again as ZV, and (undamped) .62 of ZV's slope of V at
/// the mode. Throws Error(argument) as `pole` does. Source: the open printer firmware Klipper, "mzv".
[[nodiscard]] Shaper mzv(const Mode& mode);

/// The second pole that `mzv` cancels, as a mode: the same decay rate, 5/3 of the damped frequency. Throws
/// Error(argument) as `pole` does.
[[nodiscard]] Mode mzv_second_zero(const Mode& mode);

/// Negative zero-vibration shaper of unity magnitude: amplitudes exactly 1, -1, 1; without damping at 0, 1/6 and 1/3 of
/// the period. The two times solve 1 - e^{-s t2} + e^{-s t3} = 0 to rounding, damped or not, not by a fitted formula.
/// Throws Error(argument) as `pole` does, Error(design) where the solution ends at high damping. Source of the family:
/// Singhose, Singer and Seering 1994; of the solution: this project.
[[nodiscard]] Shaper negative_zv(const Mode& mode);

/// The two shapers in series: cancels what either cancels and lasts as long as both together. Taps whose times agree
/// within 1e-12 of the duration are merged. Throws Error(argument) if either is not a valid shaper. Source: paper 002,
/// eq. 3.
[[nodiscard]] Shaper convolve(const Shaper& first, const Shaper& second);

/// Convolved ZV of one or more modes, the conventional multi-mode shaper: 2^n taps. Throws Error(argument) if `modes`
/// is empty, and as `pole` does. Source: paper 002, section 2.
[[nodiscard]] Shaper convolved_zv(std::span<const Mode> modes);

}  // namespace shapegcode
