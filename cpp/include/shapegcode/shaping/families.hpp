#pragma once

#include <span>

#include "shapegcode/mode.hpp"
#include "shapegcode/shaping/shaper.hpp"

namespace shapegcode {

// One declaration here and one definition in families.cpp per family.

/// Zero-vibration shaper of one mode: taps at 0 and half the damped period, amplitudes 1/(1+K) and K/(1+K) with
/// K = exp(-zeta*pi/sqrt(1-zeta^2)). Throws Error(argument) as `pole` does. Source: paper 002, eq. 1-2 (Smith 1958).
[[nodiscard]] Shaper zv(const Mode& mode);

/// The two shapers in series: cancels what either cancels and lasts as long as both together. Taps whose times agree
/// within 1e-12 of the duration are merged. Throws Error(argument) if either is not a valid shaper. Source: paper 002,
/// eq. 3.
[[nodiscard]] Shaper convolve(const Shaper& first, const Shaper& second);

/// Convolved ZV of one or more modes, the conventional multi-mode shaper: 2^n taps. Throws Error(argument) if `modes`
/// is empty, and as `pole` does. Source: paper 002, section 2.
[[nodiscard]] Shaper convolved_zv(std::span<const Mode> modes);

}  // namespace shapegcode
