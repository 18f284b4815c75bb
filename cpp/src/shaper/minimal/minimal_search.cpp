#include <algorithm>
#include <cmath>
#include <complex>
#include <cstddef>
#include <numbers>
#include <utility>
#include <vector>

#include "base/refuse.hpp"
#include "shapegcode/error.hpp"
#include "shapegcode/minimal_shapers.hpp"
#include "shaper/minimal/minimal_boxes.hpp"
#include "shaper/minimal/minimal_starts.hpp"
#include "shaper/minimal/minimal_system.hpp"
#include "shaper/minimal/search_limits.hpp"

namespace shapegcode {

namespace {

using detail::refuse;
using minimal::duration_slack;
using minimal::max_modes;
using minimal::most_periods;
using minimal::same_pole;

constexpr double apart = 1e-4;                     // rad of the fastest mode: closer taps are one
constexpr double largest_listed_residual = 1e-12;  // of a listed shaper

using Poles = std::vector<std::complex<double>>;

double largest_size(const Poles& poles) {
  return std::abs(*std::ranges::max_element(poles, {}, [](const std::complex<double>& s) { return std::abs(s); }));
}

void check_apart(std::span<const Mode> modes, const Poles& poles) {
  for (std::size_t i = 0; i < poles.size(); ++i) {
    for (std::size_t j = i + 1; j < poles.size(); ++j) {
      const double size = std::max(std::abs(poles[i]), std::abs(poles[j]));
      if (std::abs(poles[i] - poles[j]) <= same_pole * size) {
        refuse(
            "modes {:.12g} Hz and {:.12g} Hz are the same: their poles differ by {:.12g} of their size, limit {:.12g}; "
            "name them once",
            modes[i].frequency_hz, modes[j].frequency_hz, std::abs(poles[i] - poles[j]) / size, same_pole);
      }
    }
  }
}

Poles checked_poles(std::span<const Mode> modes, double max_duration_s, const MinimalOptions& options) {
  if (modes.empty() || modes.size() > max_modes) {
    refuse("minimal shapers are searched for 1 to {} modes: {} given", max_modes, modes.size());
  }
  Poles poles;
  for (const Mode& mode : modes) {
    poles.push_back(pole(mode));
  }
  check_apart(modes, poles);
  const double longest = most_periods * 2.0 * std::numbers::pi / largest_size(poles);
  if (!std::isfinite(max_duration_s) || max_duration_s <= 0.0 || max_duration_s > longest) {
    refuse(
        "the largest duration is positive and at most {:.12g} periods of the fastest mode ({:.12g} s): it is {:.12g} s",
        most_periods, longest, max_duration_s);
  }
  if (!std::isfinite(options.max_abs_sum) || options.max_abs_sum < 1.0) {
    refuse("the largest sum |a| is at least 1: it is {:.12g}", options.max_abs_sum);
  }
  if (options.max_starts < 0 || options.max_boxes < 0) {
    refuse("the numbers of starts and boxes are at least 0: they are {} and {}", options.max_starts, options.max_boxes);
  }
  return poles;
}

/// One mode: two taps half a damped period apart, or any multiple of it; even ones have a negative tap and need
/// damping.
std::vector<Shaper> one_mode(const std::complex<double>& s, double max_duration_s, double max_abs_sum) {
  std::vector<Shaper> out;
  const double half_period = std::numbers::pi / s.imag();
  for (int count = 1; count * half_period <= max_duration_s * (1.0 + duration_slack); ++count) {
    const double time = count * half_period;
    const double second = (count % 2 == 1 ? 1.0 : -1.0) * std::exp(s.real() * time);
    const double sum = 1.0 + second;
    if (1.0 + std::abs(second) <= max_abs_sum * (1.0 + duration_slack) * sum) {
      out.push_back({{0.0, time}, {1.0 / sum, second / sum}});
    }
  }
  return out;
}

bool serves(const Shaper& shaper, std::span<const Mode> modes) {
  return std::ranges::all_of(
      modes, [&shaper](const Mode& mode) { return residual_ratio(shaper, mode) <= largest_listed_residual; });
}

Shaper as_shaper(const minimal::Taps& taps, double omega) {
  Shaper out{{0.0}, {taps.amplitudes(0)}};
  for (Eigen::Index k = 0; k < taps.phases.size(); ++k) {
    out.times_s.push_back(taps.phases(k) / omega);
    out.amplitudes.push_back(taps.amplitudes(k + 1));
  }
  return out;
}

void search(std::span<const Mode> modes, const Poles& poles, const MinimalOptions& options, MinimalShapers& result) {
  const double omega = largest_size(poles);
  const minimal::System system(poles, omega);
  const minimal::Region region{result.max_duration_s * omega * (1.0 + duration_slack), options.max_abs_sum, apart};
  minimal::Collection collection(system, region);
  const minimal::StartCounts starts = minimal::search_from_starts(system, region, options.max_starts, collection);
  const minimal::BoxCounts boxes = minimal::BoxSearch(system, region, options.max_boxes, collection).run();
  for (const minimal::Taps& taps : collection.taps()) {
    Shaper shaper = as_shaper(taps, omega);
    if (serves(shaper, modes)) {
      result.shapers.push_back(std::move(shaper));
    }
  }
  result.starts = starts.starts;
  result.converged = starts.converged;
  result.found_once = starts.found_once;
  result.boxes = boxes.boxes;
  result.unresolved = boxes.unresolved;
  result.complete_up_to_s = std::min(result.max_duration_s, boxes.decided_up_to / omega);
}

/// Shapers with fewer taps serve every mode only by the modes' good fortune; they are among those of all modes but one.
void add_reduced(std::span<const Mode> modes, const MinimalOptions& options, MinimalShapers& result) {
  const auto fastest = std::ranges::max_element(modes, {}, &Mode::frequency_hz);
  std::vector<Mode> others(modes.begin(), modes.end());
  others.erase(others.begin() + (fastest - modes.begin()));
  // the others' fastest mode is slower, so that the duration stays within its limit
  MinimalShapers fewer = minimal_shapers(others, result.max_duration_s, options);
  for (Shaper& shaper : fewer.shapers) {
    if (serves(shaper, modes)) {
      result.shapers.push_back(std::move(shaper));
    }
  }
  result.complete_up_to_s = std::min(result.complete_up_to_s, fewer.complete_up_to_s);
}

}  // namespace

MinimalShapers minimal_shapers(std::span<const Mode> modes, double max_duration_s, const MinimalOptions& options) {
  const Poles poles = checked_poles(modes, max_duration_s, options);
  MinimalShapers result;
  result.max_duration_s = max_duration_s;
  result.max_abs_sum = options.max_abs_sum;
  if (modes.size() <= 2) {
    result.shapers = modes.size() == 1 ? one_mode(poles[0], max_duration_s, options.max_abs_sum)
                                       : minimal_two_mode(modes[0], modes[1], max_duration_s, options.max_abs_sum);
    result.complete_up_to_s = max_duration_s;
  } else {
    search(modes, poles, options, result);
    add_reduced(modes, options, result);
    std::ranges::sort(result.shapers, [](const Shaper& a, const Shaper& b) {
      const double end = std::max(duration_s(a), duration_s(b));
      return std::abs(duration_s(a) - duration_s(b)) > duration_slack * end ? duration_s(a) < duration_s(b)
                                                                            : a.times_s < b.times_s;
    });
  }
  result.complete = result.complete_up_to_s >= max_duration_s;
  return result;
}

}  // namespace shapegcode
