#pragma once

#include <cstddef>
#include <span>
#include <vector>

#include "shapegcode/identify/modal_fit.hpp"

namespace shapegcode::identification {

/// A sampled force between its samples: linear over each of `steps` parts of a period. Only the periods in which it is
/// not zero are stored.
class HeldForce {
 public:
  /// `force_n` must stay as long as this.
  HeldForce(std::span<const double> force_n, ForceHold hold);

  [[nodiscard]] std::size_t steps() const noexcept { return steps_; }
  /// Force at the beginnings of the parts of the period behind sample `k`, and at the end of the last: steps() + 1
  /// values; none where the force is zero throughout.
  [[nodiscard]] std::span<const double> within(std::size_t k) const noexcept {
    if (k < begin_ || k >= end_) return {};
    return {fine_.data() + (k - begin_) * steps_, steps_ + 1};
  }
  /// How many samples before its own a sample of the force acts.
  [[nodiscard]] static std::size_t reach(ForceHold hold) noexcept;
  /// The blow at sample `k` in N; 0 unless the force is held as impulses.
  [[nodiscard]] double blow(std::size_t k) const noexcept { return k < blows_.size() ? blows_[k] : 0.0; }

 private:
  std::size_t steps_ = 1;
  std::size_t begin_ = 0;  // periods [begin, end)
  std::size_t end_ = 0;
  std::vector<double> fine_;
  std::span<const double> blows_;  // of the caller
};

/// First and last + 1 sample with a force; equal if there is none.
struct PulseRange {
  std::size_t begin = 0;
  std::size_t end = 0;
  [[nodiscard]] std::size_t size() const noexcept { return end - begin; }
};
[[nodiscard]] PulseRange pulse_of(std::span<const double> force_n) noexcept;

}  // namespace shapegcode::identification
