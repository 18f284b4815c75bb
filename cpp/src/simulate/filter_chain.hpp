// Filters after the set-points, in order.
#pragma once

#include <vector>

#include "shapegcode/filter.hpp"

namespace shapegcode::detail {

class FilterChain {
 public:
  explicit FilterChain(const std::vector<Fir>& filters) {
    filters_.reserve(filters.size());
    for (const Fir& filter : filters) {
      filters_.emplace_back(filter, axis_count);
      tail_ += filter.duration_samples();
    }
  }

  void reset(const Vector3& position) noexcept {
    for (FirStream& filter : filters_) {
      filter.reset(values_of(position));
    }
  }
  void step(Vector3& position) noexcept {
    for (FirStream& filter : filters_) {
      filter.step(values_of(position), values_of(position));
    }
  }
  [[nodiscard]] bool empty() const noexcept { return filters_.empty(); }
  /// How many samples longer the output moves than the input.
  [[nodiscard]] int tail() const noexcept { return tail_; }

 private:
  std::vector<FirStream> filters_;
  int tail_ = 0;
};

}  // namespace shapegcode::detail
