// Private: interpretation of words and marks by the settings of a control, used in several places.
#pragma once

#include <array>
#include <cmath>
#include <cstddef>
#include <optional>

#include "shapegcode/program.hpp"

namespace shapegcode::detail {

inline constexpr double mm_per_inch = 25.4;

/// Length in mm of the unit that G20 or G21 names.
[[nodiscard]] constexpr double unit_mm(int units) noexcept { return units == 20 ? mm_per_inch : 1.0; }

/// Least increment of coordinates in G20 or G21, in inch or mm.
[[nodiscard]] constexpr double min_increment(const ReaderOptions& options, int units) noexcept {
  return units == 20 ? options.least_increment_inch : options.least_increment_mm;
}

/// Digits behind the decimal point that the least increment of G20 or G21 leaves to a coordinate.
[[nodiscard]] inline int length_decimals(const ReaderOptions& options, int units) noexcept {
  return static_cast<int>(std::lround(-std::log10(min_increment(options, units))));
}

/// Whether the blocks of skip switch 1 ... 9 are left out; empty: not known.
[[nodiscard]] inline std::optional<bool> block_skip(const ReaderOptions& options, int skip_switch) noexcept {
  return options.block_skip[static_cast<std::size_t>(skip_switch - 1)];
}

}  // namespace shapegcode::detail
