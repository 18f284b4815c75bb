#pragma once

#include <Eigen/Dense>
#include <algorithm>
#include <array>
#include <cmath>
#include <complex>
#include <cstddef>
#include <optional>
#include <span>

// How the amplitudes are eliminated for any number of modes. The conditions are linear in the amplitudes A and each
// column of their matrix M depends on the time of its own tap alone, so near times t the solutions at t + d obey
//     M(t) A + M'(t) w = (second order),  w_k = d_k A_k,  sum A = 1:
// 2n+1 linear equations in the n+1 amplitudes and the n products w. Without the second-order rest their solution is a
// Newton step that needs no amplitudes to start from; with a bound on the rest it says where solutions can lie, or
// that a whole box of times holds none.

namespace shapegcode::minimal {

/// A shaper as the searches see it: its free times t_2 ... t_{n+1} in radians of the fastest mode, and all amplitudes.
template <int N>
struct Taps {
  Eigen::Matrix<double, N, 1> phases;
  Eigen::Matrix<double, N + 1, 1> amplitudes;
};

/// The conditions of N modes on N+1 taps, linearised in the times.
template <int N>
class System {
 public:
  static constexpr int size = 2 * N + 1;
  using Phases = Eigen::Matrix<double, N, 1>;
  using Amplitudes = Eigen::Matrix<double, N + 1, 1>;
  using Square = Eigen::Matrix<double, size, size>;
  using Vector = Eigen::Matrix<double, size, 1>;

  /// `poles` in rad/s, N of them; `omega` (rad/s) is the largest magnitude: the unit of every phase.
  System(std::span<const std::complex<double>> poles, double omega) {
    for (std::size_t i = 0; i < N; ++i) {
      poles_[i] = poles[i] / omega;
    }
  }

  /// Pole of mode i per radian of the fastest one, and its magnitude.
  [[nodiscard]] std::complex<double> pole(int i) const { return poles_[static_cast<std::size_t>(i)]; }
  [[nodiscard]] double speed(int i) const { return std::abs(poles_[static_cast<std::size_t>(i)]); }

  /// The matrix of the note above at `phases`: the modes' real and imaginary rows, scaled so that an entry at the phase
  /// `end` has size one (as in residual_ratio), then the sum of the amplitudes. Columns: A, then w.
  void fill(const Phases& phases, double end, Square& matrix) const {
    for (int i = 0; i < N; ++i) {
      const std::complex<double>& s = poles_[static_cast<std::size_t>(i)];
      matrix(2 * i, 0) = std::exp(s.real() * end);
      matrix(2 * i + 1, 0) = 0.0;
      for (int k = 0; k < N; ++k) {
        const double size_now = std::exp(s.real() * (end - phases(k)));
        const double re = size_now * std::cos(s.imag() * phases(k));
        const double im = -size_now * std::sin(s.imag() * phases(k));
        matrix(2 * i, k + 1) = re;
        matrix(2 * i + 1, k + 1) = im;
        matrix(2 * i, N + 1 + k) = s.imag() * im - s.real() * re;
        matrix(2 * i + 1, N + 1 + k) = -s.imag() * re - s.real() * im;
      }
    }
    matrix.row(2 * N).template head<N + 1>().setOnes();
    matrix.row(2 * N).template tail<N>().setZero();
  }

  /// Newton from `start`; nothing if it does not converge or leaves [-margin, limit + margin]. The taps come sorted,
  /// the first at zero.
  [[nodiscard]] std::optional<Taps<N>> newton(const Phases& start, double limit, int steps = 40) const {
    constexpr double margin = 1.0;        // rad
    constexpr double longest_step = 0.7;  // rad: farther the linearisation says nothing
    constexpr double converged = 1e-9;    // rad; the step after it is exact to rounding
    Phases phases = start;
    Square matrix;
    Eigen::PartialPivLU<Square> solver;
    Vector x;
    bool last = false;
    for (int step = 0; step < steps; ++step) {
      fill(phases, std::max(phases.maxCoeff(), 0.0), matrix);
      solver.compute(matrix);
      x = solver.solve(Vector::Unit(size - 1));
      double largest = 0.0;
      for (int k = 0; k < N; ++k) {
        const double change = x(N + 1 + k) / x(k + 1);
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
        return sorted(phases, amplitudes_at(phases));
      }
      last = largest < converged;
    }
    return std::nullopt;
  }

  /// Whether the conditions determine the taps: no tap is superfluous and no other solution lies infinitely near.
  [[nodiscard]] bool isolated(const Taps<N>& taps) const {
    constexpr double singular = 1e-9;
    Square matrix;
    fill(taps.phases, taps.phases(N - 1), matrix);
    matrix.template rightCols<N>() *= taps.amplitudes.template tail<N>().asDiagonal();
    const Square inverse = Eigen::PartialPivLU<Square>(matrix).inverse();
    const double condition =
        matrix.cwiseAbs().colwise().sum().maxCoeff() * inverse.cwiseAbs().colwise().sum().maxCoeff();
    return std::abs(taps.amplitudes(0)) > singular && condition * singular < 1.0;  // false for a condition of NaN
  }

  /// The amplitudes at converged times: w is rounding then.
  [[nodiscard]] Amplitudes amplitudes_at(const Phases& phases) const {
    Square matrix;
    fill(phases, std::max(phases.maxCoeff(), 0.0), matrix);
    const Vector x = Eigen::PartialPivLU<Square>(matrix).solve(Vector::Unit(size - 1));
    return x.template head<N + 1>();
  }

 private:
  /// A tap before the first one only means that the shaper starts there.
  [[nodiscard]] static Taps<N> sorted(const Phases& phases, const Amplitudes& amplitudes) {
    std::array<std::pair<double, double>, N + 1> taps;
    taps[0] = {0.0, amplitudes(0)};
    for (int k = 0; k < N; ++k) {
      taps[static_cast<std::size_t>(k) + 1] = {phases(k), amplitudes(k + 1)};
    }
    std::ranges::sort(taps);
    Taps<N> out;
    for (int k = 0; k <= N; ++k) {
      const auto& [phase, amplitude] = taps[static_cast<std::size_t>(k)];
      out.amplitudes(k) = amplitude;
      if (k > 0) {
        out.phases(k - 1) = phase - taps[0].first;
      }
    }
    return out;
  }

  std::array<std::complex<double>, N> poles_;
};

}  // namespace shapegcode::minimal
