#pragma once

#include <vector>

#include "shapegcode/mode.hpp"
#include "shapegcode/shaping/shaper.hpp"

namespace shapegcode {

/// Most humps of `extra_insensitive`.
inline constexpr int most_humps = 3;

/// An extra-insensitive shaper and where its residual vanishes and peaks. The frequencies are natural frequencies of
/// modes with the damping ratio of the design.
struct ExtraInsensitive {
  Shaper shaper;
  std::vector<double> zeros_hz;  ///< ascending, one more than humps: V = 0
  std::vector<double> humps_hz;  ///< ascending, between the zeros: V = vibration_limit, its largest there
};

/// Extra-insensitive shaper of one mode: non-negative taps, `humps`+2 of them, whose residual between its outermost
/// zeros rises to exactly `vibration_limit` (above 0, below 1) at each of `humps` (1 to `most_humps`) maxima. With an
/// odd number of humps the middle one lies at the mode, with two the middle zero does.
///
/// Without damping it is the Dolph-Chebyshev window over half periods, in closed form; with damping the conditions
/// themselves (sum, zeros, height and slope at every hump) are solved for amplitudes, times and frequencies by Newton's
/// method, followed from zero damping: exact to rounding, not a fit. Throws Error(argument) as `pole` does or on a
/// value outside its range, Error(design) where no such shaper with non-negative taps is reached: with a limit of .05
/// the solution ends at a damping ratio of some .69, .45 and .32 for one, two and three humps.
///
/// Sources: Singhose, Seering and Singer 1994 (EI), Singhose, Porter, Tuttle and Singer 1997 (several humps); the
/// closed form and the damped solution: this project.
[[nodiscard]] ExtraInsensitive extra_insensitive(const Mode& mode, double vibration_limit, int humps);

}  // namespace shapegcode
