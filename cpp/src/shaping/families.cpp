#include "shapegcode/shaping/families.hpp"

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

}  // namespace

Shaper zv(const Mode& mode) {
  const std::complex<double> s = pole(mode);
  const double half_period = std::numbers::pi / s.imag();
  const double decay = std::exp(s.real() * half_period);
  return make_shaper({0.0, half_period}, {1.0 / (1.0 + decay), decay / (1.0 + decay)});
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
