// Filters as plain rows of taps, for what is computed of several in a row.
#pragma once

#include <cstddef>
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

/// One filter behind the other.
inline std::vector<double> convolved(const std::vector<double>& first, const std::vector<double>& second) {
  std::vector<double> both(first.size() + second.size() - 1, 0.0);
  for (std::size_t i = 0; i < first.size(); ++i) {
    for (std::size_t k = 0; k < second.size(); ++k) both[i + k] += first[i] * second[k];
  }
  return both;
}

}  // namespace shapegcode
