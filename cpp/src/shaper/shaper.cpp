#include "shapegcode/shaper.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <complex>
#include <cstddef>
#include <functional>
#include <limits>
#include <numeric>
#include <string>
#include <utility>

#include "base/checks.hpp"
#include "shapegcode/error.hpp"

namespace shapegcode {

namespace {

constexpr double sum_tolerance = 1e-9;
constexpr double grid_tolerance = 1e-9;

[[noreturn]] void reject(const std::string& message) { throw Error(ErrorKind::argument, message); }

}  // namespace

Shaper make_shaper(std::vector<double> times_s, std::vector<double> amplitudes) {
  if (times_s.empty() || times_s.size() != amplitudes.size()) {
    reject(fmt::format("a shaper needs as many amplitudes as times, at least one: {} times, {} amplitudes",
                       times_s.size(), amplitudes.size()));
  }
  for (std::size_t k = 0; k < times_s.size(); ++k) {
    if (!std::isfinite(times_s[k]) || !std::isfinite(amplitudes[k])) {
      reject(fmt::format("tap {} of the shaper is not finite: time {:.12g} s, amplitude {:.12g}", k + 1, times_s[k],
                         amplitudes[k]));
    }
    if (k > 0 && times_s[k] <= times_s[k - 1]) {
      reject(fmt::format("the times of a shaper ascend: tap {} at {:.12g} s follows {:.12g} s", k + 1, times_s[k],
                         times_s[k - 1]));
    }
  }
  if (times_s.front() != 0.0) {
    reject(fmt::format("the first time of a shaper is 0: it is {:.12g} s", times_s.front()));
  }
  const double sum = std::accumulate(amplitudes.begin(), amplitudes.end(), 0.0);
  if (!(std::abs(sum - 1.0) <= sum_tolerance)) {
    reject(fmt::format("the amplitudes of a shaper add up to 1: they add up to {:.12g}, tolerance {:g}", sum,
                       sum_tolerance));
  }
  return Shaper{std::move(times_s), std::move(amplitudes)};
}

double duration_s(const Shaper& shaper) { return shaper.times_s.back(); }

double mean_s(const Shaper& shaper) {
  return std::inner_product(shaper.times_s.begin(), shaper.times_s.end(), shaper.amplitudes.begin(), 0.0);
}

double variance_s2(const Shaper& shaper) {
  const double mean = mean_s(shaper);
  return std::inner_product(
      shaper.times_s.begin(), shaper.times_s.end(), shaper.amplitudes.begin(), 0.0, std::plus<>{},
      [mean](double time, double amplitude) { return amplitude * (time - mean) * (time - mean); });
}

bool has_negative(const Shaper& shaper) {
  return std::ranges::any_of(shaper.amplitudes, [](double amplitude) { return amplitude < 0.0; });
}

double abs_sum(const Shaper& shaper) {
  return std::transform_reduce(shaper.amplitudes.begin(), shaper.amplitudes.end(), 0.0, std::plus<>{},
                               [](double amplitude) { return std::abs(amplitude); });
}

double residual_ratio(const Shaper& shaper, const Mode& mode) {
  const std::complex<double> s = pole(mode);
  const double last = duration_s(shaper);
  std::complex<double> sum = 0.0;
  for (std::size_t k = 0; k < shaper.times_s.size(); ++k) {
    // the decay of tap k until the last one: same as the formula, but it cannot overflow
    const double decay = std::exp(s.real() * (last - shaper.times_s[k]));
    sum += shaper.amplitudes[k] * std::polar(decay, s.imag() * shaper.times_s[k]);
  }
  return std::abs(sum);
}

Fir to_fir(const Shaper& shaper, double period_s) {
  require_period(period_s, "period of a shaper's grid");
  std::vector<int> delays;
  delays.reserve(shaper.times_s.size());
  for (const double time : shaper.times_s) {
    const double multiple = std::round(time / period_s);
    const double offset = time - multiple * period_s;
    if (!(std::abs(offset) <= grid_tolerance * std::max(time, period_s))) {
      throw Error(
          ErrorKind::design,
          fmt::format("the shaper's tap at {:.12g} ms is not on the grid of {:.12g} ms: it lies {:.12g} ms from "
                      "the nearest multiple; design the shaper on this grid (zv_on_grid)",
                      time * 1e3, period_s * 1e3, offset * 1e3));
    }
    if (multiple > static_cast<double>(std::numeric_limits<int>::max())) {
      reject(fmt::format("the shaper's tap at {:.12g} s is {:.12g} periods of {:.12g} s late: too many", time, multiple,
                         period_s));
    }
    delays.push_back(static_cast<int>(multiple));
  }
  return Fir(std::move(delays), shaper.amplitudes);
}

}  // namespace shapegcode
