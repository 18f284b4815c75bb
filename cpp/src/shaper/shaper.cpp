#include "shapegcode/shaper.hpp"

#include <algorithm>
#include <cmath>
#include <complex>
#include <cstddef>
#include <functional>
#include <limits>
#include <numeric>
#include <sstream>
#include <string>
#include <utility>

#include "base/checks.hpp"
#include "shapegcode/error.hpp"

namespace shapegcode {

namespace {

constexpr double sum_tolerance = 1e-9;
constexpr double grid_tolerance = 1e-9;

[[noreturn]] void reject(const std::ostringstream& message) { throw Error(ErrorKind::argument, message.str()); }

std::ostringstream precise_message() {
  std::ostringstream message;
  message.precision(12);
  return message;
}

}  // namespace

Shaper make_shaper(std::vector<double> times_s, std::vector<double> amplitudes) {
  auto message = precise_message();
  if (times_s.empty() || times_s.size() != amplitudes.size()) {
    message << "a shaper needs as many amplitudes as times, at least one: " << times_s.size() << " times, "
            << amplitudes.size() << " amplitudes";
    reject(message);
  }
  for (std::size_t k = 0; k < times_s.size(); ++k) {
    if (!std::isfinite(times_s[k]) || !std::isfinite(amplitudes[k])) {
      message << "tap " << k + 1 << " of the shaper is not finite: time " << times_s[k] << " s, amplitude "
              << amplitudes[k];
      reject(message);
    }
    if (k > 0 && times_s[k] <= times_s[k - 1]) {
      message << "the times of a shaper ascend: tap " << k + 1 << " at " << times_s[k] << " s follows "
              << times_s[k - 1] << " s";
      reject(message);
    }
  }
  if (times_s.front() != 0.0) {
    message << "the first time of a shaper is 0: it is " << times_s.front() << " s";
    reject(message);
  }
  const double sum = std::accumulate(amplitudes.begin(), amplitudes.end(), 0.0);
  if (!(std::abs(sum - 1.0) <= sum_tolerance)) {
    message << "the amplitudes of a shaper add up to 1: they add up to " << sum << ", tolerance " << sum_tolerance;
    reject(message);
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
  auto message = precise_message();
  require_period(period_s, "period of a shaper's grid");
  std::vector<int> delays;
  delays.reserve(shaper.times_s.size());
  for (const double time : shaper.times_s) {
    const double multiple = std::round(time / period_s);
    const double offset = time - multiple * period_s;
    if (!(std::abs(offset) <= grid_tolerance * std::max(time, period_s))) {
      message << "the shaper's tap at " << time * 1e3 << " ms is not on the grid of " << period_s * 1e3
              << " ms: it lies " << offset * 1e3 << " ms from the nearest multiple; design the shaper on this grid";
      throw Error(ErrorKind::design, message.str());
    }
    if (multiple > static_cast<double>(std::numeric_limits<int>::max())) {
      message << "the shaper's tap at " << time << " s is " << multiple << " periods of " << period_s
              << " s late: too many";
      reject(message);
    }
    delays.push_back(static_cast<int>(multiple));
  }
  return Fir(std::move(delays), shaper.amplitudes);
}

}  // namespace shapegcode
