#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "shapegcode/mode.hpp"
#include "shapegcode/shaper.hpp"

namespace shapegcode {

/// Minimal multi-mode shapers of two modes (paper 002, eq. 12-17): three impulses where the convolved ZV has four. All
/// of them with duration up to `max_duration_s` (s) and sum |A_k| up to `max_abs_sum`, ascending in duration, then in
/// the second time; `has_negative` is true for those with a negative impulse. Damped or not. An empty list means that
/// there is none in the stated range.
///
/// Complete by construction: the plane of (t2, t3) is divided into boxes, a box is discarded only if a bound on its
/// derivatives proves that it contains no solution, and Newton starts from every remaining box; residual_ratio of both
/// modes is below 1e-13 (usually about 1e-16). An impulse of zero amplitude (undamped modes at an odd ratio such as
/// 1:3, which one ZV cancels) is omitted. If the amplitudes at given times are not unique, those with the smallest sum
/// of squares are returned.
///
/// Throws Error(argument) as `pole` does, if the poles lie within 1e-6 of one another (relative; use `zv`), if
/// `max_duration_s` is not finite and positive or exceeds 100 periods of the faster mode, or if `max_abs_sum` is not
/// finite or below 1.
/// Sources: paper 002; the search and the elimination of the amplitudes: this project.
[[nodiscard]] std::vector<Shaper> minimal_two_mode(const Mode& first, const Mode& second, double max_duration_s,
                                                   double max_abs_sum = 10.0);

/// Limits of the search of `minimal_shapers` for three modes or more.
struct MinimalOptions {
  double max_abs_sum = 10.0;         ///< largest sum |A_k|, at least 1
  int max_starts = 100'000;          ///< Newton starts; fewer are used once every solution was found three times
  std::int64_t max_boxes = 400'000;  ///< boxes of times that the proof may examine; 0: no proof
};

/// The minimal shapers of some modes, and whether there may be others.
struct MinimalShapers {
  std::vector<Shaper> shapers;    ///< ascending in duration, then in the times
  bool complete = false;          ///< every box was decided: there is no other up to the largest duration
  double complete_up_to_s = 0.0;  ///< the same up to this duration; 0: nothing is proven
  double max_duration_s = 0.0;    ///< range of the search: largest duration
  double max_abs_sum = 0.0;       ///< range of the search: largest sum |A_k|
  std::int64_t boxes = 0;         ///< boxes examined
  std::int64_t unresolved = 0;  ///< boxes too small to halve further that could not be decided (solutions not isolated)
  int starts = 0;               ///< Newton starts
  int converged = 0;            ///< number of starts that reached a shaper in the range
  int found_once = 0;  ///< shapers reached by one start only; found_once/converged estimates the ratio of starts that
                       ///< would reach a shaper not yet listed (Good 1953)
};

/// Minimal multi-mode shapers (paper 002, eq. 4-11): n+1 impulses for n = 1 ... 6 modes, damped or not. All that were
/// found with duration up to `max_duration_s` (s) and sum |A_k| up to `options.max_abs_sum`; residual_ratio of every
/// mode is at most 1e-12 (usually 1e-16 to 1e-14). Shapers with fewer impulses that cancel all modes are also listed.
///
/// One mode is closed form, two are `minimal_two_mode`: both complete. Three and more are searched twice: by Newton
/// from many low-discrepancy starts and from mirror images, and by halving boxes of times until a bound on derivatives
/// proves each empty or shrinks it to one solution. The boxes are taken in ascending duration, so that
/// `complete_up_to_s` grows with `max_boxes`. Usually they decide three modes up to the duration of the convolved ZV,
/// four up to half of it or more. Bounds are evaluated in floating point and ignore rounding. Where solutions are not
/// isolated (undamped modes at odd ratios, which one ZV cancels) boxes remain unresolved.
///
/// Throws Error(argument) as `pole` does, on no mode or more than 6, if two poles lie within 1e-6 of one another
/// (relative), if `max_duration_s` is not finite and positive or exceeds 100 periods of the fastest mode, if
/// `max_abs_sum` is not finite or below 1, or if `max_starts` or `max_boxes` is negative.
/// Sources: paper 002; the searches: this project.
[[nodiscard]] MinimalShapers minimal_shapers(std::span<const Mode> modes, double max_duration_s,
                                             const MinimalOptions& options = {});

/// The minimal shapers of two modes over the ratio of their frequencies, joined into curves (paper 002, fig. 2 and 3).
struct MinimalBranches {
  std::vector<double> ratios;      ///< as given, n_ratios of them
  std::size_t branches = 0;        ///< number of curves, ordered by the ratio at which they begin, then by duration
  std::vector<double> times_s;     ///< (branches, n_ratios, 3) in row-major order; NaN where a curve has no shaper
  std::vector<double> amplitudes;  ///< the same shape; NaN in the same places
};

/// All minimal two-mode shapers of `first` and a second mode of `ratio` times its frequency and damping
/// `second_damping`, for each of `ratios`, joined across the ratios by continuation: from the last two shapers of a
/// curve Newton proceeds in small steps to the next ratio, and its solution there is matched with the complete list of
/// `minimal_two_mode`.
///
/// A curve has a gap where its amplitudes exceed `max_abs_sum` (about the ratios at which their sum is zero), its
/// duration `max_duration_s` (s), or the shaper has fewer impulses: the continuation proceeds through the gap without
/// being listed. A curve ends where two impulses coincide, where it meets another one and turns back, or where Newton
/// fails at several steps in succession; where two curves touch, their ends may be exchanged. A ratio within 1e-6 of 1
/// (equal damping) has no shaper.
///
/// Throws Error(argument) if `ratios` is empty, not ascending or not finite and positive, and as `minimal_two_mode`
/// does at each ratio. Sources: paper 002; the continuation: this project.
[[nodiscard]] MinimalBranches minimal_branches(const Mode& first, double second_damping, std::span<const double> ratios,
                                               double max_duration_s, double max_abs_sum = 10.0);

}  // namespace shapegcode
