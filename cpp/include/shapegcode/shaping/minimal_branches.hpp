#pragma once

#include <cstddef>
#include <span>
#include <vector>

#include "shapegcode/mode.hpp"

namespace shapegcode {

/// The minimal shapers of two modes over the ratio of their frequencies, joined to curves (paper 002, fig. 2 and 3).
struct MinimalBranches {
  std::vector<double> ratios;      ///< as given, n_ratios of them
  std::size_t branches = 0;        ///< number of curves, ordered by the ratio at which they begin, then by duration
  std::vector<double> times_s;     ///< (branches, n_ratios, 3) in row-major order; NaN where a curve has no shaper
  std::vector<double> amplitudes;  ///< the same shape; NaN in the same places
};

/// All minimal two-mode shapers of `first` and a second mode of `ratio` times its frequency and damping
/// `second_damping`, for each of `ratios`, joined across the ratios by continuation: from the last two shapers of a
/// curve Newton goes in small steps to the next ratio, and what it finds there is looked up in the complete list of
/// `minimal_two_mode`.
///
/// A curve has a gap where its amplitudes exceed `max_abs_sum` (about the ratios at which their sum is zero), its
/// duration `max_duration_s` (s), or the shaper has fewer taps: the continuation goes on through the gap without being
/// listed. A curve ends where two taps meet, where it meets another one and turns back, or where Newton fails at
/// several steps in turn; where two curves touch, their tails may be exchanged. A ratio within 1e-6 of 1 (equal
/// damping) has no shaper.
///
/// Throws Error(argument) if `ratios` is empty, not ascending or not finite and positive, and as `minimal_two_mode`
/// does at each ratio. Sources: paper 002; the continuation: this project.
[[nodiscard]] MinimalBranches minimal_branches(const Mode& first, double second_damping, std::span<const double> ratios,
                                               double max_duration_s, double max_abs_sum = 10.0);

}  // namespace shapegcode
