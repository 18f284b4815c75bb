#pragma once

#include <array>
#include <cstddef>

#include "shapegcode/filter.hpp"
#include "shapegcode/mode.hpp"
#include "shapegcode/shaper.hpp"

namespace shapegcode::linuxcnc {

/// The families by the number that stands at the pin `family`.
enum class Family { zv = 0, zvd = 1, zvdd = 2, mzv = 3, ei = 4, ei2 = 5, ei3 = 6 };

/// What the pins of a component ask for.
struct Wish {
  static constexpr std::size_t max_modes = 3;

  bool enable = false;
  int family = 0;
  std::array<double, max_modes> frequency_hz{};  ///< 0: no mode
  std::array<double, max_modes> damping_ratio{};
};

/// What EI shapers leave of a mode at most.
inline constexpr double vibration_limit = 0.05;
/// A mode must be slower than this share of the thread's rate: then every tap keeps its sign on the grid.
inline constexpr double highest_share_of_rate = 0.25;
inline constexpr double longest_shaper_s = 2.0;

/// A shaper of one mode with its taps at multiples of `period_s`. A tap between two multiples becomes one at either,
/// with the two weights that leave the mode the same response, and all are scaled to a sum of one: so a zero at the
/// mode stays exact, and a residual there becomes smaller by that scale. Throws Error(argument) as `pole` does,
/// Error(design) on a mode above `highest_share_of_rate`. Source: this project.
[[nodiscard]] Shaper on_grid(const Shaper& shaper, const Mode& mode, double period_s);

/// The filter that the pins ask for, for samples `period_s` apart: the shapers of all modes in series, or nothing but
/// the input if it is not enabled. Throws Error(argument) on a family or a mode that is none, or if there is no mode,
/// Error(design) where the family has no such shaper, the thread is too slow for it, or it is longer than
/// `longest_shaper_s`.
[[nodiscard]] Fir design(const Wish& wish, double period_s);

}  // namespace shapegcode::linuxcnc
