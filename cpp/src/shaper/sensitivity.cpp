#include "shapegcode/shaper.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <complex>
#include <cstddef>
#include <numbers>
#include <queue>
#include <vector>

#include "shapegcode/error.hpp"

// At the angular frequency w the residual is |S(w)|, S(w) = sum A_k e^{w q_k}, q_k = -zeta (t_N - t_k) + j eta t_k with
// eta = sqrt(1-zeta^2). A factor e^{-j tau w} changes no |S|, so with r_k = q_k - j tau
//     |S(w+h)| <= |S + h S'_tau| + h^2/2 * sum |A_k| |r_k|^2 e^{w_low Re q_k}
// for any tau; the tau that turns S' into the direction of S makes the bound as tight as V itself at a maximum.

namespace shapegcode {

namespace {

using Complex = std::complex<double>;

constexpr double relative_gap = 1e-6;
constexpr double absolute_gap = 1e-12;
constexpr std::size_t max_parts = 1'000'000;
constexpr double touching = 1e-9;        // of the limit: a hump of exactly that height does not end the band
constexpr double smallest_step = 1e-12;  // of the mode's frequency
constexpr int max_steps = 1'000'000;

/// The first terms of S at one frequency, turned by the best tau.
struct Expansion {
  Complex value;
  Complex slope;
  double curvature_bound;  ///< of |S''| from `lowest` upwards
};

class Residual {
 public:
  Residual(const Shaper& shaper, double damping_ratio)
      : amplitudes_(shaper.amplitudes),
        end_(shaper.times_s.back() * std::sqrt((1.0 - damping_ratio) * (1.0 + damping_ratio))) {
    const double eta = std::sqrt((1.0 - damping_ratio) * (1.0 + damping_ratio));
    exponents_.reserve(shaper.times_s.size());
    for (const double time : shaper.times_s) {
      exponents_.emplace_back(-damping_ratio * (shaper.times_s.back() - time), eta * time);
    }
  }

  /// At `omega`, valid for the bound from `lowest` (at most `omega`) upwards.
  [[nodiscard]] Expansion at(double omega, double lowest) const {
    Complex value = 0.0;
    Complex slope = 0.0;
    for (std::size_t k = 0; k < exponents_.size(); ++k) {
      const Complex term = amplitudes_[k] * std::exp(omega * exponents_[k]);
      value += term;
      slope += exponents_[k] * term;
    }
    const double size = std::norm(value);
    const double tau = size > 0.0 ? std::clamp(std::imag(slope * std::conj(value)) / size, 0.0, end_) : 0.5 * end_;
    double bound = 0.0;
    for (std::size_t k = 0; k < exponents_.size(); ++k) {
      bound += std::abs(amplitudes_[k]) * std::norm(exponents_[k] - Complex(0.0, tau)) *
               std::exp(lowest * exponents_[k].real());
    }
    return {value, slope - Complex(0.0, tau) * value, bound};
  }

 private:
  std::vector<double> amplitudes_;
  double end_;
  std::vector<Complex> exponents_;
};

/// A part of the band and the most that V can be in it.
struct Part {
  double lowest;
  double highest;
  double bound;

  [[nodiscard]] bool operator<(const Part& other) const { return bound < other.bound; }
};

/// Largest step in the direction of `sign` that cannot take |S| above `limit`; 0 if it is there already.
double safe_step(const Residual& residual, double omega, double sign, double limit, double longest) {
  // the bound on the curvature holds from the lower end of the step upwards
  const Expansion here = residual.at(omega, sign > 0.0 ? omega : std::max(0.0, omega - longest));
  const auto safe = [&](double h) {
    return std::abs(here.value + sign * h * here.slope) + 0.5 * h * h * here.curvature_bound <= limit;
  };
  if (!safe(0.0)) {
    return 0.0;
  }
  if (safe(longest)) {
    return longest;
  }
  double inside = 0.0;  // the bound is convex in h, so what is safe is one interval
  double outside = longest;
  for (int halving = 0; halving < 60 && outside - inside > 1e-3 * outside; ++halving) {
    const double middle = 0.5 * (inside + outside);
    (safe(middle) ? inside : outside) = middle;
  }
  return inside;
}

}  // namespace

std::vector<double> sensitivity_curve(const Shaper& shaper, double damping_ratio,
                                      std::span<const double> frequencies_hz) {
  std::vector<double> out;
  out.reserve(frequencies_hz.size());
  for (const double frequency_hz : frequencies_hz) {
    out.push_back(residual_ratio(shaper, {frequency_hz, damping_ratio}));
  }
  return out;
}

WorstResidual worst_residual(const Shaper& shaper, const Mode& mode, double lowest_hz, double highest_hz) {
  static_cast<void>(pole({lowest_hz, mode.damping_ratio}));
  static_cast<void>(pole({highest_hz, mode.damping_ratio}));
  if (lowest_hz > highest_hz) {
    throw Error(ErrorKind::argument,
                fmt::format("a band of frequencies ascends: it goes from {:g} Hz to {:g} Hz", lowest_hz, highest_hz));
  }
  const Residual residual(shaper, mode.damping_ratio);
  constexpr double turn = 2.0 * std::numbers::pi;
  WorstResidual worst{residual_ratio(shaper, {lowest_hz, mode.damping_ratio}), lowest_hz, 0.0};
  const auto look = [&worst](double value, double omega) {
    if (value > worst.residual_ratio) {
      worst.residual_ratio = value;
      worst.frequency_hz = omega / turn;
    }
  };
  look(residual_ratio(shaper, {highest_hz, mode.damping_ratio}), turn * highest_hz);
  std::priority_queue<Part> parts;
  const auto add = [&](double lowest, double highest) {
    const double middle = 0.5 * (lowest + highest);
    const double half = 0.5 * (highest - lowest);
    const Expansion here = residual.at(middle, lowest);
    look(std::abs(here.value), middle);
    const double bound = std::max(std::abs(here.value + half * here.slope), std::abs(here.value - half * here.slope)) +
                         0.5 * half * half * here.curvature_bound;
    parts.push({lowest, highest, bound});
  };
  add(turn * lowest_hz, turn * highest_hz);
  while (parts.top().bound > worst.residual_ratio + std::max(relative_gap * worst.residual_ratio, absolute_gap)) {
    if (parts.size() > max_parts) {
      throw Error(
          ErrorKind::design,
          fmt::format("the worst residual from {:g} Hz to {:g} Hz lies between {:g} and {:g}: more than {} parts "
                      "of the band are needed to say more",
                      lowest_hz, highest_hz, worst.residual_ratio, parts.top().bound, max_parts));
    }
    const Part part = parts.top();
    parts.pop();
    const double middle = 0.5 * (part.lowest + part.highest);
    add(part.lowest, middle);
    add(middle, part.highest);
  }
  worst.upper_bound = std::max(worst.residual_ratio, parts.top().bound);
  return worst;
}

FrequencyBand insensitive_band(const Shaper& shaper, const Mode& mode, double vibration_limit) {
  static_cast<void>(pole(mode));
  if (!(vibration_limit > 0.0 && vibration_limit < 1.0)) {
    throw Error(
        ErrorKind::argument,
        fmt::format("the vibration limit of an insensitivity is {:g}, must be above 0 and below 1", vibration_limit));
  }
  const Residual residual(shaper, mode.damping_ratio);
  constexpr double turn = 2.0 * std::numbers::pi;
  const double limit = vibration_limit * (1.0 + touching);
  const double nominal = turn * mode.frequency_hz;
  const auto walk = [&](double sign, double last) {
    double omega = nominal;
    for (int count = 0; count < max_steps; ++count) {
      const double left = sign * (last - omega);
      const double step = safe_step(residual, omega, sign, limit, std::min(left, 0.25 * omega));
      omega += sign * step;
      if (step <= smallest_step * nominal) {
        break;
      }
    }
    return omega / turn;
  };
  return {walk(-1.0, 0.0), walk(1.0, insensitivity_reach * nominal)};
}

double insensitivity(const Shaper& shaper, const Mode& mode, double vibration_limit) {
  const FrequencyBand band = insensitive_band(shaper, mode, vibration_limit);
  return (band.highest_hz - band.lowest_hz) / mode.frequency_hz;
}

}  // namespace shapegcode
