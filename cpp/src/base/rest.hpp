#pragma once

#include <cmath>
#include <cstdint>

namespace shapegcode {

// What decays geometrically ends among the smallest numbers, where an operation takes a hundred times as long and
// rounding can hold it for ever. A state below this size, in whatever unit, is none: no figure shows it, and nothing
// that starts above it is changed.
inline constexpr double min_state = 1e-100;

/// Batch and streaming forms look after the same samples, so that they agree to the last bit.
inline constexpr std::int64_t rows_between_looks = 64;

[[nodiscard]] inline double state_or_none(double state) noexcept { return std::abs(state) < min_state ? 0.0 : state; }

}  // namespace shapegcode
