#include "shapegcode/minimal_shapers.hpp"

#include <Eigen/Dense>
#include <algorithm>
#include <array>
#include <cmath>
#include <complex>
#include <limits>
#include <numbers>
#include <optional>
#include <sstream>

#include <fmt/format.h>

#include "shapegcode/error.hpp"

#include "shaper/minimal/minimal_system.hpp"
#include "shaper/minimal/search_limits.hpp"

namespace shapegcode {

namespace {

using minimal::same_pole;

constexpr double same_time = 1e-4;      // rad of the faster mode: Newton's answer and a listed shaper are one
constexpr double smallest_gap = 1e-3;   // rad between two taps
constexpr double phase_step = 0.02;     // rad by which the second mode may turn within a shaper from step to step
constexpr double smallest_step = 1e-4;  // of the ratio
constexpr double farthest = 0.1;        // rad from where the curve is expected
constexpr int max_failures = 3;         // times in turn that not even the smallest step has an answer of Newton

/// Times of the second and third impulse, s.
using Times = Eigen::Vector2d;

struct Curve {
  std::vector<std::optional<std::size_t>> shapers;  ///< per ratio: index into the list there
  Times now;
  std::optional<Times> before;
  double ratio_now = 0.0;
  double ratio_before = 0.0;
  int failures = 0;
  bool ended = false;

  [[nodiscard]] Times expected(double ratio) const {
    return before ? Times(now + (now - *before) * (ratio - ratio_now) / (ratio_now - ratio_before)) : now;
  }

  void advance(double ratio, const Times& times) {
    before = now;
    ratio_before = ratio_now;
    now = times;
    ratio_now = ratio;
    failures = 0;
  }
};

void check_ratios(std::span<const double> ratios) {
  std::string message;
  if (ratios.empty()) {
    message = "a map over the frequency ratio needs at least one ratio: 0 given";
  } else {
    const auto bad = std::ranges::find_if(ratios, [](double each) { return !(std::isfinite(each) && each > 0.0); });
    const auto falling = std::ranges::adjacent_find(ratios, [](double a, double b) { return !(a < b); });
    if (bad != ratios.end()) {
      message = fmt::format("frequency ratios are finite and above 0: one is {:.12g}", *bad);
    } else if (falling != ratios.end()) {
      message = fmt::format("frequency ratios ascend: {:.12g} follows {:.12g}", *(falling + 1), *falling);
    } else {
      return;
    }
  }
  throw Error(ErrorKind::argument, message);
}

class Tracer {
 public:
  Tracer(const Mode& first, double second_damping, std::span<const double> ratios, double max_duration_s,
         double max_abs_sum)
      : first_(first),
        second_damping_(second_damping),
        ratios_(ratios),
        max_duration_s_(max_duration_s),
        max_abs_sum_(max_abs_sum) {}

  [[nodiscard]] MinimalBranches run() {
    for (std::size_t at = 0; at < ratios_.size(); ++at) {
      const Mode second{first_.frequency_hz * ratios_[at], second_damping_};
      const std::array<std::complex<double>, 2> poles{pole(first_), pole(second)};
      const double omega = std::max(std::abs(poles[0]), std::abs(poles[1]));
      std::vector<Shaper> list;
      if (std::abs(poles[0] - poles[1]) > same_pole * omega) {
        list = minimal_two_mode(first_, second, max_duration_s_, max_abs_sum_);
        std::erase_if(list, [](const Shaper& each) { return each.times_s.size() != 3; });
      }
      step(at, list, omega);
      lists_.push_back(std::move(list));
    }
    return result();
  }

 private:
  void step(std::size_t at, const std::vector<Shaper>& list, double omega) {
    std::vector<bool> taken(list.size(), false);
    for (Curve& curve : curves_) {
      if (!curve.ended) {
        go_on(curve, at, list, taken, omega);
      }
    }
    for (std::size_t i = 0; i < list.size(); ++i) {
      if (!taken[i]) {
        Curve curve;
        curve.shapers.resize(ratios_.size());
        curve.shapers[at] = i;
        curve.now = Times(list[i].times_s[1], list[i].times_s[2]);
        curve.ratio_now = ratios_[at];
        curves_.push_back(std::move(curve));
      }
    }
  }

  /// Takes the curve to the next ratio in small steps and looks up where it has come.
  void go_on(Curve& curve, std::size_t at, const std::vector<Shaper>& list, std::vector<bool>& taken,
             double omega) const {
    const double target = ratios_[at];
    const double longest =
        std::max(smallest_step, phase_step / (2.0 * std::numbers::pi * first_.frequency_hz * max_duration_s_));
    const double shortest = longest / 256.0;  // a curve that has just begun may be as steep as a square root
    double step = curve.before ? longest : shortest;
    double reached = curve.ratio_now;
    while (reached < target) {
      const double next = reached + step < target - 0.5 * shortest ? reached + step : target;
      if (advance(curve, next)) {
        reached = next;
        step = std::min(2.0 * step, longest);
      } else if (step > shortest) {
        step *= 0.5;
      } else {  // no answer here: try behind it
        curve.ended = ++curve.failures > max_failures;
        reached += longest;
        step = longest;
      }
      if (curve.ended) {
        return;
      }
    }
    if (curve.ratio_now != target) {
      return;
    }
    const Times times = curve.now;
    for (std::size_t i = 0; i < list.size(); ++i) {
      const Times listed(list[i].times_s[1], list[i].times_s[2]);
      if ((times - listed).cwiseAbs().maxCoeff() * omega < same_time) {
        if (taken[i]) {  // two curves have met: one of them ends here
          curve.ended = true;
          return;
        }
        taken[i] = true;
        curve.shapers[at] = i;
        break;
      }
    }
  }

  /// One step of the continuation; false if Newton has no answer there. Ends the curve where two taps meet.
  [[nodiscard]] bool advance(Curve& curve, double ratio) const {
    const std::array<std::complex<double>, 2> poles{pole(first_), pole({first_.frequency_hz * ratio, second_damping_})};
    const double omega = std::max(std::abs(poles[0]), std::abs(poles[1]));
    const Times expected = curve.expected(ratio);
    const auto taps = minimal::System(poles, omega).newton(expected * omega, 2.0 * max_duration_s_ * omega);
    if (!taps || (taps->phases - expected * omega).cwiseAbs().maxCoeff() > farthest) {
      return false;
    }
    curve.ended = taps->phases(0) < smallest_gap || taps->phases(1) - taps->phases(0) < smallest_gap;
    curve.advance(ratio, taps->phases / omega);
    return true;
  }

  [[nodiscard]] MinimalBranches result() const {
    MinimalBranches out;
    out.ratios.assign(ratios_.begin(), ratios_.end());
    out.branches = curves_.size();
    const std::size_t size = curves_.size() * ratios_.size() * 3;
    out.times_s.assign(size, std::numeric_limits<double>::quiet_NaN());
    out.amplitudes = out.times_s;
    for (std::size_t c = 0; c < curves_.size(); ++c) {
      for (std::size_t at = 0; at < ratios_.size(); ++at) {
        if (const auto index = curves_[c].shapers[at]) {
          const Shaper& shaper = lists_[at][*index];
          const auto where = static_cast<std::ptrdiff_t>((c * ratios_.size() + at) * 3);
          std::ranges::copy(shaper.times_s, out.times_s.begin() + where);
          std::ranges::copy(shaper.amplitudes, out.amplitudes.begin() + where);
        }
      }
    }
    return out;
  }

  Mode first_;
  double second_damping_;
  std::span<const double> ratios_;
  double max_duration_s_;
  double max_abs_sum_;
  std::vector<std::vector<Shaper>> lists_;  ///< per ratio
  std::vector<Curve> curves_;
};

}  // namespace

MinimalBranches minimal_branches(const Mode& first, double second_damping, std::span<const double> ratios,
                                 double max_duration_s, double max_abs_sum) {
  check_ratios(ratios);
  return Tracer(first, second_damping, ratios, max_duration_s, max_abs_sum).run();
}

}  // namespace shapegcode
