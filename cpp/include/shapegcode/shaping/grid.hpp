#pragma once

#include <span>

#include "shapegcode/mode.hpp"
#include "shapegcode/shaping/shaper.hpp"

namespace shapegcode {

/// Smallest distance |z - 1| of a mode's z = e^{s*period} from +1 at which `grid_polynomial` accepts it: below it a
/// single mode already has sum |A_k| of some 4e4.
inline constexpr double grid_least_distance_from_one = 0.01;

/// Largest residual ratio that `grid_polynomial` returns; a design whose rounding leaves more is refused.
inline constexpr double grid_largest_residual = 1e-10;

/// Shortest shaper with taps at whole multiples of `period_s` (s) that cancels every mode exactly there: the polynomial
/// with the roots z_i = e^{s_i*period} and their conjugates, scaled to sum 1. Two periods per mode; one for a mode
/// whose z is real (half a period of it is a multiple of the grid); none for one that aliases onto an earlier one. A
/// mode above the grid's Nyquist frequency is fine. Amplitudes may be negative and large (46/131 Hz, zeta .02: sum
/// |A_k| is 1 at 5 ms, 248 at 1 ms): look at `abs_sum` before use.
///
/// Throws Error(argument) if `modes` is empty, as `pole` does, or if the period is not finite and positive;
/// Error(design) if a z_i is closer to +1 than `grid_least_distance_from_one`, or if rounding leaves more than
/// `grid_largest_residual`. Source: this project (spec 2, grid-exact shapers).
[[nodiscard]] Shaper grid_polynomial(std::span<const Mode> modes, double period_s);

}  // namespace shapegcode
