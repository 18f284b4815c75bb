#pragma once

#include <span>
#include <vector>

#include "shapegcode/mode.hpp"
#include "shapegcode/shaping/shaper.hpp"

namespace shapegcode {

/// Residual ratio of modes with damping ratio `damping_ratio` at each of `frequencies_hz` (natural frequencies), in
/// their order. Throws Error(argument) as `pole` does. Source: spec 2.
[[nodiscard]] std::vector<double> sensitivity_curve(const Shaper& shaper, double damping_ratio,
                                                    std::span<const double> frequencies_hz);

/// The largest residual over a band of frequencies.
struct WorstResidual {
  double residual_ratio;  ///< V at `frequency_hz`
  double frequency_hz;    ///< where in the band it was found
  double upper_bound;     ///< no frequency of the band has a larger V (up to rounding)
};

/// Largest residual ratio of a mode with the damping of `mode` and a natural frequency from `lowest_hz` to
/// `highest_hz`, found and proven: the band is halved until a bound on the derivatives shows that no part of it exceeds
/// what was found by more than 1e-6 of it, or by 1e-12. Throws Error(argument) as `pole` does or if the band is not
/// ascending (equal ends are fine), Error(design) if the proof needs more than a million parts, as a band of many
/// thousand periods of the shaper would. Source: this project.
[[nodiscard]] WorstResidual worst_residual(const Shaper& shaper, const Mode& mode, double lowest_hz, double highest_hz);

/// A band of frequencies.
struct FrequencyBand {
  double lowest_hz;
  double highest_hz;
};

/// How far upwards `insensitive_band` looks, in frequencies of the mode.
inline constexpr double insensitivity_reach = 10.0;

/// The band around `mode` in which the residual stays at or below `vibration_limit` (above 0, below 1): its ends are
/// where V leaves the limit for the first time, found by steps that a bound on the derivatives proves safe. Both ends
/// are the mode's frequency if V exceeds the limit there; the upper end is at most `insensitivity_reach` times it. The
/// limit is forgiven 1e-9 of itself, so that a hump that touches it does not end the band. Throws Error(argument) as
/// `pole` does or on a limit outside its range. Source: this project.
[[nodiscard]] FrequencyBand insensitive_band(const Shaper& shaper, const Mode& mode, double vibration_limit);

/// Insensitivity: width of `insensitive_band` over the mode's frequency (no unit); ZV has .064 and EI .399 at 5 %
/// without damping. Throws as `insensitive_band` does. Source: Singer and Seering 1990.
[[nodiscard]] double insensitivity(const Shaper& shaper, const Mode& mode, double vibration_limit);

}  // namespace shapegcode
