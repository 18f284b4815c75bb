#include "shapegcode/shaper.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <complex>
#include <cstddef>
#include <numbers>
#include <utility>
#include <vector>

#include "shapegcode/error.hpp"

namespace shapegcode {

namespace {

constexpr double merge_tolerance = 1e-12;  // of the duration
constexpr double mzv_spacing = 0.375;      // of the damped period
constexpr double damping_step = 0.02;      // of the range from no damping to the mode's
constexpr int zero_newton_steps = 30;
constexpr double newton_converged = 1e-15;

/// Two phases omega*t2 < omega*t3 at which the impulses 1, -1, 1 have zero residual at the mode.
struct NegativePhases {
  double second;
  double third;
};

/// Newton on 1 - e^{-s t2} + e^{-s t3} = 0 for a pole `s` of unit size, from `start`.
NegativePhases negative_phases(const std::complex<double>& s, NegativePhases start) {
  for (int step = 0; step < zero_newton_steps; ++step) {
    const std::complex<double> x = std::exp(-s * start.second);
    const std::complex<double> y = std::exp(-s * start.third);
    const std::complex<double> error = 1.0 - x + y;
    const std::complex<double> by_second = s * x;
    const std::complex<double> by_third = -s * y;
    // error + by_second*d2 + by_third*d3 = 0: two real equations by Cramer's rule
    const double determinant = std::imag(std::conj(by_second) * by_third);
    const double d2 = -std::imag(std::conj(error) * by_third) / determinant;
    const double d3 = std::imag(std::conj(error) * by_second) / determinant;
    start.second += d2;
    start.third += d3;
    if (!(std::abs(d2) + std::abs(d3) > newton_converged * start.third)) {
      break;
    }
  }
  return start;
}

}  // namespace

Shaper zv(const Mode& mode) {
  const std::complex<double> s = pole(mode);
  const double half_period = std::numbers::pi / s.imag();
  const double decay = std::exp(s.real() * half_period);
  return make_shaper({0.0, half_period}, {1.0 / (1.0 + decay), decay / (1.0 + decay)});
}

Shaper zv_on_grid(const Mode& mode, double period_s) {
  if (!(period_s > 0.0) || !std::isfinite(period_s)) {
    throw Error(ErrorKind::argument, fmt::format("period is {} s: it must be above 0", period_s));
  }
  const Shaper anywhere = zv(mode);
  const double half_period = anywhere.times_s.back();
  if (period_s > 0.5 * half_period) {
    throw Error(ErrorKind::design,
                fmt::format("period is {} s: a quarter of the damped period of {} Hz, {:.6g} s, is the longest for ZV",
                            period_s, mode.frequency_hz, 0.5 * half_period));
  }
  const double steps = half_period / period_s;
  constexpr double on_grid = 1e-9;
  if (std::abs(steps - std::round(steps)) < on_grid) {
    return make_shaper({0.0, std::round(steps) * period_s}, anywhere.amplitudes);
  }
  const double before = std::floor(steps) * period_s;
  const double behind = (std::floor(steps) + 1.0) * period_s;
  const std::complex<double> s = pole(mode);
  // Vibration of the two impulses beside half the period, seen back at time 0, is real and negative.
  const std::complex<double> first = std::exp(-s * before);
  const std::complex<double> second = std::exp(-s * behind);
  const double ratio = -first.imag() / second.imag();
  const double first_one = -(first.real() + ratio * second.real());
  const double sum = first_one + 1.0 + ratio;
  return make_shaper({0.0, before, behind}, {first_one / sum, 1.0 / sum, ratio / sum});
}

Shaper repeated_zv(const Mode& mode, int zeros) {
  if (zeros < 1 || zeros > max_repeated_zeros) {
    throw Error(ErrorKind::argument,
                fmt::format("a ZV shaper has 1 to {} zeros at its mode: {} asked for", max_repeated_zeros, zeros));
  }
  const Shaper once = zv(mode);
  Shaper shaper = once;
  for (int k = 1; k < zeros; ++k) {
    shaper = convolve(shaper, once);
  }
  for (std::size_t k = 0; k < shaper.times_s.size(); ++k) {
    shaper.times_s[k] = static_cast<double>(k) * once.times_s[1];  // without the rounding of repeated sums
  }
  return shaper;
}

Shaper mzv(const Mode& mode) {
  const std::complex<double> s = pole(mode);
  const double spacing = mzv_spacing * 2.0 * std::numbers::pi / s.imag();
  const double decay = std::exp(s.real() * spacing);
  const double outer = 1.0 - 1.0 / std::numbers::sqrt2;
  const std::vector<double> weights{outer, (std::numbers::sqrt2 - 1.0) * decay, outer * decay * decay};
  const double sum = weights[0] + weights[1] + weights[2];
  return make_shaper({0.0, spacing, 2.0 * spacing}, {weights[0] / sum, weights[1] / sum, weights[2] / sum});
}

Mode mzv_second_zero(const Mode& mode) {
  const std::complex<double> s = pole(mode);
  // taps 3/8 of a period apart: the phase 135 degrees between them recurs, mirrored, as 225 degrees
  const double size = std::hypot(s.real(), 5.0 / 3.0 * s.imag());
  return {size / (2.0 * std::numbers::pi), -s.real() / size, mode.participation};
}

Shaper negative_zv(const Mode& mode) {
  const double omega = std::abs(pole(mode));
  const int steps = std::max(1, static_cast<int>(std::ceil(mode.damping_ratio / damping_step)));
  NegativePhases phases{std::numbers::pi / 3.0, 2.0 * std::numbers::pi / 3.0};
  for (int step = 1; step <= steps; ++step) {
    const double zeta = mode.damping_ratio * step / steps;
    phases = negative_phases({-zeta, std::sqrt((1.0 - zeta) * (1.0 + zeta))}, phases);
  }
  Shaper shaper{{0.0, phases.second / omega, phases.third / omega}, {1.0, -1.0, 1.0}};
  constexpr double largest_residual = 1e-13;
  if (!(phases.second > 0.0 && phases.second < phases.third && phases.third < 2.0 * std::numbers::pi &&
        residual_ratio(shaper, mode) <= largest_residual)) {
    throw Error(ErrorKind::design, fmt::format("no shaper of taps 1, -1, 1 was found for the mode at {:g} Hz: damping "
                                               "ratio {:g} is too high for it",
                                               mode.frequency_hz, mode.damping_ratio));
  }
  return shaper;
}

Shaper convolve(const Shaper& first, const Shaper& second) {
  const Shaper a = make_shaper(first.times_s, first.amplitudes);
  const Shaper b = make_shaper(second.times_s, second.amplitudes);
  std::vector<std::pair<double, double>> taps;
  taps.reserve(a.times_s.size() * b.times_s.size());
  for (std::size_t i = 0; i < a.times_s.size(); ++i) {
    for (std::size_t k = 0; k < b.times_s.size(); ++k) {
      taps.emplace_back(a.times_s[i] + b.times_s[k], a.amplitudes[i] * b.amplitudes[k]);
    }
  }
  std::ranges::sort(taps);
  const double same = merge_tolerance * taps.back().first;
  std::vector<double> times;
  std::vector<double> amplitudes;
  for (const auto& [time, amplitude] : taps) {
    if (!times.empty() && time - times.back() <= same) {
      amplitudes.back() += amplitude;
    } else {
      times.push_back(time);
      amplitudes.push_back(amplitude);
    }
  }
  return make_shaper(std::move(times), std::move(amplitudes));
}

Shaper convolved_zv(std::span<const Mode> modes) {
  if (modes.empty()) {
    throw Error(ErrorKind::argument, "a convolved shaper needs at least one mode: 0 given");
  }
  Shaper shaper = zv(modes.front());
  for (const Mode& mode : modes.subspan(1)) {
    shaper = convolve(shaper, zv(mode));
  }
  return shaper;
}

}  // namespace shapegcode
