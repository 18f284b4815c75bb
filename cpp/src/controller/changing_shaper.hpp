// Acceleration and jerk added by the changes of a shaper that depends on a position.
#pragma once

#include <span>
#include <vector>

#include "shapegcode/filter.hpp"

namespace shapegcode {

/// Of a chain with a tap at every delay.
[[nodiscard]] inline double tap_of(const Fir& chain, std::size_t delay) noexcept {
  return delay < chain.taps().size() ? chain.taps()[delay] : 0.0;
}

/// An increment keeps the filter of the position where it begins. So an axis of speed v has, behind filters h(x) that
/// change along the path x, besides the response to its own acceleration one to v dx/dt with the taps dh/dx: at most
/// `acceleration_per_mm` v dx/dt, and of jerk `jerk_per_mm_s` v dx/dt and `acceleration_per_mm` dx/dt times the
/// acceleration before the filters.
struct ChangeCost {
  double gain = 1.0;  ///< largest sum over all delays of the largest tap of those filters that act together
  double acceleration_per_mm = 0.0;
  double jerk_per_mm_s = 0.0;
};

/// `chains`: all that an axis goes through with each filter of the set, a tap at every delay; `position_mm`: where
/// these are valid; `fastest_mm_per_s`: how fast the followed axis is at most.
[[nodiscard]] ChangeCost cost_of_change(std::span<const Fir> chains, std::span<const double> position_mm,
                                        double period_s, double fastest_mm_per_s);

}  // namespace shapegcode
