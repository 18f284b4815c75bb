#pragma once

#include <cmath>
#include <cstdint>

namespace shapegcode {

// Geometrically decaying values end as denormals, which take a hundred times as long to compute with and may never
// reach zero because of rounding. A state below this size, in any unit, is set to zero: this is invisible in all
// figures and changes no larger value.
inline constexpr double min_state = 1e-100;

/// Batch and streaming forms look after the same samples, so that they agree to the last bit.
inline constexpr std::int64_t rows_between_looks = 64;

[[nodiscard]] inline double state_or_none(double state) noexcept { return std::abs(state) < min_state ? 0.0 : state; }

}  // namespace shapegcode
