#include "shaper/minimal/minimal_system.hpp"

#include <algorithm>
#include <cmath>

namespace shapegcode::minimal {

System::System(std::span<const std::complex<double>> poles, double omega) : modes_(static_cast<int>(poles.size())) {
  for (std::size_t i = 0; i < poles.size(); ++i) {
    poles_[i] = poles[i] / omega;
    speeds_[i] = std::abs(poles_[i]);
  }
}

void System::fill(const Phases& phases, double end, Square& matrix) const {
  const int n = modes_;
  matrix.resize(unknowns(), unknowns());
  for (int i = 0; i < n; ++i) {
    const std::complex<double>& s = poles_[static_cast<std::size_t>(i)];
    matrix(2 * i, 0) = std::exp(s.real() * end);
    matrix(2 * i + 1, 0) = 0.0;
    for (int k = 0; k < n; ++k) {
      const double size_now = std::exp(s.real() * (end - phases(k)));
      const double re = size_now * std::cos(s.imag() * phases(k));
      const double im = -size_now * std::sin(s.imag() * phases(k));
      matrix(2 * i, k + 1) = re;
      matrix(2 * i + 1, k + 1) = im;
      matrix(2 * i, n + 1 + k) = s.imag() * im - s.real() * re;
      matrix(2 * i + 1, n + 1 + k) = -s.imag() * re - s.real() * im;
    }
  }
  for (int k = 0; k <= 2 * n; ++k) {
    matrix(2 * n, k) = k <= n ? 1.0 : 0.0;
  }
}

bool System::linearised(const Phases& phases, Vector& x) const {
  Square matrix;
  fill(phases, std::max(phases.maxCoeff(), 0.0), matrix);
  x = Vector::Unit(unknowns(), unknowns() - 1);
  return solve(matrix, x);
}

std::optional<Taps> System::newton(const Phases& start, double limit, int steps) const {
  constexpr double margin = 1.0;        // rad
  constexpr double longest_step = 0.7;  // rad: farther the linearisation says nothing
  constexpr double converged = 1e-9;    // rad; the step after it is exact to rounding
  Phases phases = start;
  Vector x;
  bool last = false;
  for (int step = 0; step < steps; ++step) {
    if (!linearised(phases, x)) {
      return std::nullopt;
    }
    double largest = 0.0;
    for (int k = 0; k < modes_; ++k) {
      const double change = x(modes_ + 1 + k) / x(k + 1);
      if (!std::isfinite(change)) {
        return std::nullopt;
      }
      largest = std::max(largest, std::abs(change));
      phases(k) += std::clamp(change, -longest_step, longest_step);
    }
    if (phases.minCoeff() < -margin || phases.maxCoeff() > limit + margin) {
      return std::nullopt;
    }
    if (last) {
      if (!linearised(phases, x)) {
        return std::nullopt;
      }
      return sorted(phases, x);  // at converged times w is rounding
    }
    last = largest < converged;
  }
  return std::nullopt;
}

bool System::isolated(const Taps& taps) const {
  constexpr double singular = 1e-9;
  Square matrix;
  fill(taps.phases, taps.phases(modes_ - 1), matrix);
  for (int k = 0; k < modes_; ++k) {
    matrix.col(modes_ + 1 + k) *= taps.amplitudes(k + 1);
  }
  const auto largest_column_sum = [](const Square& each) { return each.cwiseAbs().colwise().sum().maxCoeff(); };
  const double before = largest_column_sum(matrix);
  if (!invert(matrix)) {
    return false;
  }
  const double condition = before * largest_column_sum(matrix);
  return std::abs(taps.amplitudes(0)) > singular && condition * singular < 1.0;  // false for a condition of NaN
}

/// A tap before the first one only means that the shaper starts there.
Taps System::sorted(const Phases& phases, const Vector& x) const {
  std::array<int, max_modes + 1> order{};  // of the taps; the first one's phase is 0
  const auto phase = [&phases](int tap) { return tap == 0 ? 0.0 : phases(tap - 1); };
  for (int k = 1; k <= modes_; ++k) {
    std::size_t at = static_cast<std::size_t>(k);
    for (; at > 0 && phase(k) < phase(order[at - 1]); --at) {
      order[at] = order[at - 1];
    }
    order[at] = k;
  }
  Taps out{Phases(modes_), Amplitudes(modes_ + 1)};
  for (int k = 0; k <= modes_; ++k) {
    const int tap = order[static_cast<std::size_t>(k)];
    out.amplitudes(k) = x(tap);
    if (k > 0) {
      out.phases(k - 1) = phase(tap) - phase(order[0]);
    }
  }
  return out;
}

}  // namespace shapegcode::minimal
