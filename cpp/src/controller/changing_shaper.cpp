#include "controller/changing_shaper.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>

namespace shapegcode {

ChangeCost cost_of_change(std::span<const Fir> chains, std::span<const double> position_mm, double period_s,
                          double fastest_mm_per_s) {
  std::size_t longest = 0;
  for (const Fir& chain : chains) longest = std::max(longest, chain.taps().size());
  const double reach_mm = fastest_mm_per_s * static_cast<double>(longest) * period_s;
  ChangeCost cost;
  for (std::size_t first = 0; first + 1 < chains.size(); ++first) {
    // The filters of all positions that the axis can pass during one increment, if it starts after the first.
    std::size_t last = first + 1;
    while (last + 1 < chains.size() && position_mm[last] < position_mm[first + 1] + reach_mm) ++last;
    ChangeCost here{0.0, 0.0, 0.0};
    for (std::size_t delay = 0; delay <= longest; ++delay) {
      double tap = 0.0;
      double slope = 0.0;
      double step = 0.0;
      for (std::size_t k = first; k <= last; ++k) {
        tap = std::max(tap, std::abs(tap_of(chains[k], delay)));
        if (k == last) break;
        const double travel_mm = position_mm[k + 1] - position_mm[k];
        const double now = (tap_of(chains[k + 1], delay) - tap_of(chains[k], delay)) / travel_mm;
        const double before =
            delay > 0 ? (tap_of(chains[k + 1], delay - 1) - tap_of(chains[k], delay - 1)) / travel_mm : 0.0;
        slope = std::max(slope, std::abs(now));
        step = std::max(step, std::abs(now - before));
      }
      here.gain += tap;
      here.acceleration_per_mm += slope;
      here.jerk_per_mm_s += step / period_s;
    }
    cost.gain = std::max(cost.gain, here.gain);
    cost.acceleration_per_mm = std::max(cost.acceleration_per_mm, here.acceleration_per_mm);
    cost.jerk_per_mm_s = std::max(cost.jerk_per_mm_s, here.jerk_per_mm_s);
  }
  return cost;
}

}  // namespace shapegcode
