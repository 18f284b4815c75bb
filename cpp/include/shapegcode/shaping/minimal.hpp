#pragma once

#include <vector>

#include "shapegcode/mode.hpp"
#include "shapegcode/shaping/shaper.hpp"

namespace shapegcode {

/// Minimal multi-mode shapers of two modes (paper 002, eq. 12-17): three impulses where the convolved ZV has four. All
/// of them with duration up to `max_duration_s` (s) and sum |A_k| up to `max_abs_sum`, ascending in duration, then in
/// the second time; `has_negative` tells which of them ask for a reversed impulse. Damped or not. An empty list means
/// that there is none in the stated range.
///
/// Complete by construction: the plane of (t2, t3) is cut into boxes, a box is discarded only where a bound on its
/// derivatives proves that it holds no solution, and Newton starts from every box that is left; residual_ratio of both
/// modes is below 1e-13 (about 1e-16 as a rule). Where a tap comes out as zero (undamped modes at an odd ratio such as
/// 1:3, which one ZV cancels) the shaper is returned without it; where the amplitudes at given times are not unique,
/// the ones with the smallest sum of squares are.
///
/// Throws Error(argument) as `pole` does, if the poles lie within 1e-6 of one another (relative; use `zv`), if
/// `max_duration_s` is not finite and positive or exceeds 100 periods of the faster mode, or if `max_abs_sum` is not
/// finite or below 1.
/// Sources: paper 002; the search and the elimination of the amplitudes: this project.
[[nodiscard]] std::vector<Shaper> minimal_two_mode(const Mode& first, const Mode& second, double max_duration_s,
                                                   double max_abs_sum = 10.0);

}  // namespace shapegcode
