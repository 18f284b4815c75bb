// Filters as dense rows of taps, for computations on cascades.
#pragma once

#include <cstddef>
#include <numeric>
#include <utility>
#include <vector>

#include "shapegcode/filter.hpp"

namespace shapegcode {

/// Taps at delays 0, 1, ... samples.
inline std::vector<double> dense_taps(const Fir& fir) {
  std::vector<double> taps(static_cast<std::size_t>(fir.duration_samples()) + 1, 0.0);
  for (std::size_t k = 0; k < fir.taps().size(); ++k) {
    taps[static_cast<std::size_t>(fir.delays()[k])] += fir.taps()[k];
  }
  return taps;
}

/// One filter behind the other, with a tap at every delay.
inline Fir convolved(const Fir& first, const Fir& second) {
  const std::vector<double> taps = dense_taps(first);
  const std::vector<double> others = dense_taps(second);
  std::vector<double> both(taps.size() + others.size() - 1, 0.0);
  for (std::size_t i = 0; i < taps.size(); ++i) {
    for (std::size_t k = 0; k < others.size(); ++k) both[i + k] += taps[i] * others[k];
  }
  std::vector<int> delays(both.size());
  std::iota(delays.begin(), delays.end(), 0);
  return Fir(std::move(delays), std::move(both));
}

}  // namespace shapegcode
