#include "identify/held_force.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>

namespace shapegcode::identification {
namespace {

// Sinc of 24 samples either way in a Kaiser window with 80 dB: flat up to .45 of the sampling rate. Its linear parts
// lose (pi f/(32 rate))^2/3, .05 % at .4 of the rate.
constexpr std::size_t sinc_reach = 24;
constexpr std::size_t sinc_steps = 32;
constexpr double kaiser_beta = 7.86;

double bessel_i0(double x) {
  double sum = 1.0;
  double term = 1.0;
  for (int k = 1; term > 1e-17 * sum; ++k) {
    term *= 0.25 * x * x / (static_cast<double>(k) * k);
    sum += term;
  }
  return sum;
}

using Kernel = std::array<double, sinc_reach * sinc_steps + 1>;

// From the middle outwards.
const Kernel& sinc_kernel() {
  static const Kernel kernel = [] {
    Kernel values{};
    values[0] = 1.0;
    for (std::size_t i = 1; i < values.size(); ++i) {
      const double t = static_cast<double>(i) / sinc_steps;
      const double x = std::numbers::pi * t;
      const double window = bessel_i0(kaiser_beta * std::sqrt(1.0 - (t / sinc_reach) * (t / sinc_reach)));
      values[i] = i % sinc_steps == 0 ? 0.0 : std::sin(x) / x * window / bessel_i0(kaiser_beta);
    }
    return values;
  }();
  return kernel;
}

}  // namespace

PulseRange pulse_of(std::span<const double> force_n) noexcept {
  const auto acts = [](double value) { return value != 0.0; };
  const auto first = std::find_if(force_n.begin(), force_n.end(), acts);
  if (first == force_n.end()) return {};
  const auto behind = std::find_if(force_n.rbegin(), force_n.rend(), acts).base();
  return {static_cast<std::size_t>(first - force_n.begin()), static_cast<std::size_t>(behind - force_n.begin())};
}

std::size_t HeldForce::reach(ForceHold hold) noexcept { return hold == ForceHold::band_limited ? sinc_reach : 1; }

HeldForce::HeldForce(std::span<const double> force_n, ForceHold hold)
    : steps_(hold == ForceHold::band_limited ? sinc_steps : 1) {
  if (hold == ForceHold::impulse) {
    blows_ = force_n;
    return;
  }
  const PulseRange pulse = pulse_of(force_n);
  if (pulse.size() == 0) return;
  const std::size_t reaches = reach(hold);
  begin_ = pulse.begin - std::min(pulse.begin, reaches);
  end_ = std::min(pulse.end - 1 + reaches, force_n.size() - 1);
  if (end_ <= begin_) {
    end_ = begin_;
    return;
  }
  fine_.assign((end_ - begin_) * steps_ + 1, 0.0);
  if (hold == ForceHold::linear) {
    std::copy_n(force_n.begin() + static_cast<std::ptrdiff_t>(begin_), fine_.size(), fine_.begin());
    return;
  }
  const Kernel& kernel = sinc_kernel();
  for (std::size_t j = pulse.begin; j < pulse.end; ++j) {
    const auto middle = static_cast<std::ptrdiff_t>((j - begin_) * steps_);
    const auto last = static_cast<std::ptrdiff_t>(kernel.size()) - 1;
    const std::ptrdiff_t from = std::max<std::ptrdiff_t>(0, middle - last);
    const std::ptrdiff_t to = std::min(static_cast<std::ptrdiff_t>(fine_.size()) - 1, middle + last);
    for (std::ptrdiff_t i = from; i <= to; ++i) {
      fine_[static_cast<std::size_t>(i)] += force_n[j] * kernel[static_cast<std::size_t>(std::abs(i - middle))];
    }
  }
}

}  // namespace shapegcode::identification
