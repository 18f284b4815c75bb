#include "shapegcode/shaper.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <complex>
#include <cstddef>
#include <utility>
#include <vector>

#include "base/checks.hpp"
#include "shapegcode/error.hpp"

namespace shapegcode {

namespace {

// Two z closer than this count as one root, and a smaller imaginary part as zero: the error is below the round-off of
// the amplitudes.
constexpr double same_root = 1e-14;

/// z = e^{s*period}, and 1 - z without the cancellation of the plain difference.
struct GridRoot {
  std::complex<double> z;
  std::complex<double> one_minus_z;
};

GridRoot grid_root(const Mode& mode, double period_s) {
  const std::complex<double> s = pole(mode);
  // whole turns change nothing, and without them sin and cos see a small angle
  const double angle = std::remainder(s.imag() * period_s, 2.0 * std::acos(-1.0));
  const double radius = std::exp(s.real() * period_s);
  const double half_sine = std::sin(0.5 * angle);
  return {std::polar(radius, angle),
          {2.0 * radius * half_sine * half_sine - std::expm1(s.real() * period_s), -radius * std::sin(angle)}};
}

/// Coefficients in powers of one period's delay, scaled to sum 1.
std::vector<double> factor(const GridRoot& root) {
  if (std::abs(root.z.imag()) <= same_root) {
    return {1.0 / root.one_minus_z.real(), -root.z.real() / root.one_minus_z.real()};
  }
  const double scale = 1.0 / std::norm(root.one_minus_z);
  return {scale, -2.0 * root.z.real() * scale, std::norm(root.z) * scale};
}

std::vector<double> multiply(const std::vector<double>& a, const std::vector<double>& b) {
  std::vector<double> product(a.size() + b.size() - 1, 0.0);
  for (std::size_t i = 0; i < a.size(); ++i) {
    for (std::size_t k = 0; k < b.size(); ++k) {
      product[i + k] += a[i] * b[k];
    }
  }
  return product;
}

[[noreturn]] void refuse_root(const Mode& mode, double period_s, const GridRoot& root) {
  throw Error(ErrorKind::design,
              fmt::format("mode {:g} Hz cannot be cancelled on a {:g} ms grid: z = {:.3f}{:+.3f}j lies {:.1e} from +1, "
                          "limit {:g}; choose another block period",
                          mode.frequency_hz, period_s * 1e3, root.z.real(), root.z.imag(), std::abs(root.one_minus_z),
                          grid_least_distance_from_one));
}

}  // namespace

Shaper grid_polynomial(std::span<const Mode> modes, double period_s) {
  if (modes.empty()) {
    throw Error(ErrorKind::argument, "a grid shaper needs at least one mode: 0 given");
  }
  require_period(period_s, "period of a shaper's grid");
  std::vector<double> amplitudes{1.0};
  std::vector<std::complex<double>> cancelled;
  for (const Mode& mode : modes) {
    const GridRoot root = grid_root(mode, period_s);
    if (std::abs(root.one_minus_z) < grid_least_distance_from_one) {
      refuse_root(mode, period_s, root);
    }
    const bool known = std::ranges::any_of(cancelled, [&root](const std::complex<double>& z) {
      return std::abs(z - root.z) <= same_root || std::abs(std::conj(z) - root.z) <= same_root;
    });
    if (!known) {
      cancelled.push_back(root.z);
      amplitudes = multiply(amplitudes, factor(root));
    }
  }
  std::vector<double> times(amplitudes.size());
  for (std::size_t k = 0; k < times.size(); ++k) {
    times[k] = static_cast<double>(k) * period_s;
  }
  // make_shaper judges the sum absolutely; taps that are 1e9 times larger than their sum fail below with their reason
  Shaper shaper{std::move(times), std::move(amplitudes)};
  for (const Mode& mode : modes) {
    const double residual = residual_ratio(shaper, mode);
    if (!(residual <= grid_largest_residual)) {
      throw Error(
          ErrorKind::design,
          fmt::format("the polynomial of {} modes on a {:g} ms grid has sum |a| = {:g}, so that rounding leaves "
                      "{:g} of mode {:g} Hz, limit {:g}; choose a longer period",
                      modes.size(), period_s * 1e3, abs_sum(shaper), residual, mode.frequency_hz,
                      grid_largest_residual));
    }
  }
  return make_shaper(std::move(shaper.times_s), std::move(shaper.amplitudes));
}

}  // namespace shapegcode
