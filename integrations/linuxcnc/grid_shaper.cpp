#include "grid_shaper.hpp"

#include <algorithm>
#include <cmath>
#include <complex>
#include <cstddef>
#include <map>
#include <numbers>
#include <optional>
#include <utility>
#include <vector>

#include <fmt/format.h>

#include "shapegcode/error.hpp"

namespace shapegcode::linuxcnc {

namespace {

constexpr double on_sample = 1e-9;  // of a period: nearer to a sample than this is there

/// The shaper of one mode on the grid. Repeated zeros are one zero in series with itself, so that each stays exact.
Shaper of_one(Family family, const Mode& mode, double period_s) {
  const auto repeated = [&](int zeros) {
    const Shaper once = on_grid(zv(mode), mode, period_s);
    Shaper shaper = once;
    for (int k = 1; k < zeros; ++k) shaper = convolve(shaper, once);
    return shaper;
  };
  const auto with_humps = [&](int humps) {
    return on_grid(extra_insensitive(mode, vibration_limit, humps).shaper, mode, period_s);
  };
  switch (family) {
    case Family::zv:
      return repeated(1);
    case Family::zvd:
      return repeated(2);
    case Family::zvdd:
      return repeated(3);
    case Family::mzv:
      return on_grid(mzv(mode), mode, period_s);
    case Family::ei:
      return with_humps(1);
    case Family::ei2:
      return with_humps(2);
    case Family::ei3:
      return with_humps(3);
  }
  throw Error(ErrorKind::argument,
              fmt::format("family {} is none: 0 ZV, 1 ZVD, 2 ZVDD, 3 MZV, 4 EI, 5 and 6 EI with two and three humps",
                          static_cast<int>(family)));
}

}  // namespace

Shaper on_grid(const Shaper& shaper, const Mode& mode, double period_s) {
  const std::complex<double> s = pole(mode);
  const double highest_hz = highest_share_of_rate / period_s;
  if (!(s.imag() / (2.0 * std::numbers::pi) <= highest_hz)) {
    throw Error(ErrorKind::design, fmt::format("a mode at {:g} Hz is too fast for a thread of {:g} ms: at most {:g} Hz",
                                               mode.frequency_hz, 1e3 * period_s, highest_hz));
  }
  const std::complex<double> one_sample = std::exp(-s * period_s);
  std::map<int, double> taps;
  double sum = 0.0;
  for (std::size_t k = 0; k < shaper.times_s.size(); ++k) {
    const double samples = shaper.times_s[k] / period_s;
    if (!(samples * period_s <= longest_shaper_s)) {
      throw Error(ErrorKind::design, fmt::format("the shaper of a mode at {:g} Hz lasts {:g} s, at most {:g} s",
                                                 mode.frequency_hz, shaper.times_s.back(), longest_shaper_s));
    }
    double before = std::floor(samples + on_sample);
    const double within = std::max(samples - before, 0.0);
    // weights of the sample before and of the one behind: before + behind*q = q^within, both sides complex
    const std::complex<double> delayed = std::exp(-s * within * period_s);
    const double behind = within <= on_sample ? 0.0 : delayed.imag() / one_sample.imag();
    const double ahead = within <= on_sample ? 1.0 : delayed.real() - behind * one_sample.real();
    const auto sample = static_cast<int>(before);
    taps[sample] += shaper.amplitudes[k] * ahead;
    if (behind != 0.0) taps[sample + 1] += shaper.amplitudes[k] * behind;
    sum += shaper.amplitudes[k] * (ahead + behind);
  }
  std::vector<double> times;
  std::vector<double> amplitudes;
  for (const auto& [sample, weight] : taps) {
    times.push_back(sample * period_s);
    amplitudes.push_back(weight / sum);
  }
  return make_shaper(std::move(times), std::move(amplitudes));
}

Fir design(const Wish& wish, double period_s) {
  if (!wish.enable) return Fir({0}, {1.0});
  std::optional<Shaper> shaper;
  for (std::size_t k = 0; k < Wish::max_modes; ++k) {
    if (wish.frequency_hz[k] == 0.0) continue;
    const Mode mode{wish.frequency_hz[k], wish.damping_ratio[k], 1.0};
    const Shaper of_mode = of_one(static_cast<Family>(wish.family), mode, period_s);
    shaper = shaper ? convolve(*shaper, of_mode) : of_mode;
  }
  if (!shaper) throw Error(ErrorKind::argument, "no mode is given: every frequency is 0");
  if (!(duration_s(*shaper) <= longest_shaper_s)) {
    throw Error(ErrorKind::design, fmt::format("the shapers of all modes last {:g} s together, at most {:g} s",
                                               duration_s(*shaper), longest_shaper_s));
  }
  return to_fir(*shaper, period_s);
}

}  // namespace shapegcode::linuxcnc
