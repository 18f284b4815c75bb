#include "shapegcode/shaper.hpp"

#include <fmt/format.h>

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <complex>
#include <cstddef>
#include <limits>
#include <numbers>
#include <utility>

#include "base/linear_algebra.hpp"
#include "shapegcode/error.hpp"

// With the nominal frequency as unit the residual at frequency w is |S(w)|,
//     S(w) = sum A_k e^{w q_k},   q_k = -zeta (t_N - t_k) + j sqrt(1-zeta^2) t_k,
// and the unknowns are the amplitudes, the times after the first, and the frequencies of zeros and humps, which
// alternate: zero, hump, zero ... The middle one of them is at the nominal frequency, w = 1, by definition.

namespace shapegcode {

namespace {

using Complex = std::complex<double>;

constexpr double largest_damping_step = 0.02;
constexpr double smallest_damping_step = 1e-6;
constexpr int newton_steps = 25;
constexpr double rounding = 1e-14;   // of the residual at a hump, whose height is one of the conditions
constexpr double converged = 1e-12;  // of the conditions, which are all of unit size

struct Unknowns {
  Eigen::VectorXd amplitudes;   ///< humps + 2
  Eigen::VectorXd times;        ///< humps + 2, the first is 0; radians of the nominal frequency
  Eigen::VectorXd frequencies;  ///< 2*humps + 1: zero, hump ... zero; the middle one is 1
};

/// The solution without damping: T_{humps+1}(b cos(theta/2)) with theta = pi*w, scaled so that its ripple is the limit.
Unknowns chebyshev(double limit, int humps) {
  const int degree = humps + 1;
  const double b = std::cosh(std::acosh(1.0 / limit) / degree);
  Unknowns out{Eigen::VectorXd(degree + 1), Eigen::VectorXd(degree + 1), Eigen::VectorXd(2 * humps + 1)};
  for (int i = 0; i < out.frequencies.size(); ++i) {
    const double cosine = std::cos((i + 1) * std::numbers::pi / (2.0 * degree)) / b;
    out.frequencies(i) = 2.0 * std::acos(cosine) / std::numbers::pi;
  }
  Eigen::VectorXcd polynomial = Eigen::VectorXcd::Zero(degree + 1);
  polynomial(0) = 1.0;
  for (int i = 0; i < degree; ++i) {
    const Complex root = std::polar(1.0, std::numbers::pi * out.frequencies(2 * i));
    for (int k = i + 1; k > 0; --k) {
      polynomial(k) -= root * polynomial(k - 1);
    }
  }
  out.amplitudes = polynomial.real() / polynomial.real().sum();
  out.times = Eigen::VectorXd::LinSpaced(degree + 1, 0.0, degree * std::numbers::pi);
  return out;
}

/// S and dS/dw at one frequency, with their derivatives with respect to amplitudes and times.
struct BandResidual {
  Complex value;
  Complex slope;
  Complex curvature;
  Eigen::VectorXcd value_by_amplitude;
  Eigen::VectorXcd slope_by_amplitude;
  Eigen::VectorXcd value_by_time;
  Eigen::VectorXcd slope_by_time;
};

BandResidual residual(const Unknowns& x, double zeta, double w) {
  const Complex direction(0.0, std::sqrt((1.0 - zeta) * (1.0 + zeta)));
  const Eigen::Index count = x.amplitudes.size();
  const Eigen::VectorXcd q =
      (-zeta * (x.times(count - 1) - x.times.array())).cast<Complex>() + direction * x.times.array().cast<Complex>();
  BandResidual out;
  out.value_by_amplitude = (w * q.array()).exp();
  out.slope_by_amplitude = q.array() * out.value_by_amplitude.array();
  const Eigen::VectorXcd terms = x.amplitudes.cast<Complex>().array() * out.value_by_amplitude.array();
  out.value = terms.sum();
  out.slope = (q.array() * terms.array()).sum();
  out.curvature = (q.array().square() * terms.array()).sum();
  // a change of any q_k by dq changes S by w*dq*term and dS/dw by (1 + w*q)*dq*term
  const Eigen::VectorXcd grown = (1.0 + w * q.array()) * terms.array();
  out.value_by_time = w * (zeta + direction) * terms;
  out.slope_by_time = (zeta + direction) * grown;
  // the last time also moves the instant at which everything is judged
  out.value_by_time(count - 1) -= w * zeta * out.value;
  out.slope_by_time(count - 1) -= zeta * grown.sum();
  return out;
}

/// One Newton step; returns the largest condition before it. Infinity where the step is not finite.
double newton_step(Unknowns& x, double zeta, double limit) {
  const Eigen::Index taps = x.amplitudes.size();
  const Eigen::Index frequencies = x.frequencies.size();
  const Eigen::Index middle = frequencies / 2;
  const Eigen::Index size = 2 * taps - 1 + frequencies - 1;
  Eigen::MatrixXd jacobian = Eigen::MatrixXd::Zero(size, size);
  Eigen::VectorXd error(size);
  error(0) = x.amplitudes.sum() - 1.0;
  jacobian.row(0).head(taps).setOnes();
  for (Eigen::Index i = 0; i < frequencies; ++i) {
    const BandResidual r = residual(x, zeta, x.frequencies(i));
    const bool zero = i % 2 == 0;
    // a zero: S = 0, both parts. A hump: |S|^2 = limit^2, and d|S|^2/dw = 0, both over limit^2.
    const Complex factor = std::conj(r.value) / (limit * limit);
    const Eigen::Index row = 2 * i + 1;
    const auto fill = [&](Eigen::Index column, const Complex& by_value, const Complex& by_slope) {
      if (zero) {
        jacobian(row, column) = by_value.real();
        jacobian(row + 1, column) = by_value.imag();
      } else {
        jacobian(row, column) = 2.0 * std::real(factor * by_value);
        jacobian(row + 1, column) =
            std::real(factor * by_slope) + std::real(std::conj(by_value) * r.slope) / (limit * limit);
      }
    };
    error(row) = zero ? r.value.real() : std::norm(r.value) / (limit * limit) - 1.0;
    error(row + 1) = zero ? r.value.imag() : std::real(factor * r.slope);
    for (Eigen::Index k = 0; k < taps; ++k) {
      fill(k, r.value_by_amplitude(k), r.slope_by_amplitude(k));
      if (k > 0) {
        fill(taps + k - 1, r.value_by_time(k), r.slope_by_time(k));
      }
    }
    if (i != middle) {
      fill(2 * taps - 1 + (i < middle ? i : i - 1), r.slope, r.curvature);
    }
  }
  const Eigen::VectorXd change = linear_algebra::solve(jacobian, error);
  if (!change.allFinite()) {
    return std::numeric_limits<double>::infinity();
  }
  x.amplitudes -= change.head(taps);
  x.times.tail(taps - 1) -= change.segment(taps, taps - 1);
  x.frequencies.head(middle) -= change.segment(2 * taps - 1, middle);
  x.frequencies.tail(middle) -= change.tail(middle);
  return error.cwiseAbs().maxCoeff();
}

/// Newton to rounding; false if it does not get there or ends at something that is no such shaper.
bool solve(Unknowns& x, double zeta, double limit) {
  const double enough = converged + rounding / limit;
  double last = std::numeric_limits<double>::infinity();
  for (int step = 0; step < newton_steps; ++step) {
    const double size = newton_step(x, zeta, limit);
    if (!(size < 1e6)) {
      return false;
    }
    if (size < enough && size >= 0.5 * last) {
      break;
    }
    last = size;
  }
  const auto ascending = [](const Eigen::VectorXd& values) {
    return std::ranges::is_sorted(values.begin(), values.end(), std::ranges::less_equal{});
  };
  return last < enough && ascending(x.times) && ascending(x.frequencies) && x.frequencies(0) > 0.0 &&
         x.amplitudes.minCoeff() >= 0.0;
}

std::vector<double> every_second(const Eigen::VectorXd& values, Eigen::Index first, double scale) {
  std::vector<double> out;
  for (Eigen::Index i = first; i < values.size(); i += 2) {
    out.push_back(values(i) * scale);
  }
  return out;
}

}  // namespace

ExtraInsensitive extra_insensitive(const Mode& mode, double vibration_limit, int humps) {
  const double omega = std::abs(pole(mode));
  if (!(vibration_limit > 0.0 && vibration_limit < 1.0)) {
    throw Error(ErrorKind::argument,
                fmt::format("the vibration limit of an extra-insensitive shaper is {:g}, must be above 0 and below 1",
                            vibration_limit));
  }
  if (humps < 1 || humps > max_humps) {
    throw Error(ErrorKind::argument,
                fmt::format("an extra-insensitive shaper has 1 to {} humps: {} asked for", max_humps, humps));
  }
  Unknowns x = chebyshev(vibration_limit, humps);
  double zeta = 0.0;
  double step = largest_damping_step;
  while (zeta < mode.damping_ratio) {
    Unknowns next = x;
    const double to = std::min(zeta + step, mode.damping_ratio);
    if (solve(next, to, vibration_limit)) {
      x = std::move(next);
      zeta = to;
      step = std::min(2.0 * step, largest_damping_step);
      continue;
    }
    step *= 0.5;
    if (step < smallest_damping_step) {
      throw Error(ErrorKind::design,
                  fmt::format("no extra-insensitive shaper with {} humps of {:g} was found for the mode at {:g} Hz, "
                              "damping ratio {:g}: its solution ends near damping ratio {:g}",
                              humps, vibration_limit, mode.frequency_hz, mode.damping_ratio, zeta));
    }
  }
  x.amplitudes /= x.amplitudes.sum();
  const Eigen::VectorXd times = x.times / omega;
  Shaper shaper = make_shaper({times.begin(), times.end()}, {x.amplitudes.begin(), x.amplitudes.end()});
  return {std::move(shaper), every_second(x.frequencies, 0, mode.frequency_hz),
          every_second(x.frequencies, 1, mode.frequency_hz)};
}

}  // namespace shapegcode
