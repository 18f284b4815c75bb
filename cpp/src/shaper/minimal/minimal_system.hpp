#pragma once

#include <Eigen/Dense>
#include <array>
#include <complex>
#include <cstddef>
#include <optional>
#include <span>

#include "shaper/minimal/small_square.hpp"

// How the amplitudes are eliminated for any number of modes. The conditions are linear in the amplitudes A and each
// column of their matrix M depends on the time of its own tap alone, so near times t the solutions at t + d obey
//     M(t) A + M'(t) w = (second order),  w_k = d_k A_k,  sum A = 1:
// 2n+1 linear equations in the n+1 amplitudes and the n products w. Without the second-order rest their solution is a
// Newton step that needs no amplitudes to start from; with a bound on the rest it says where solutions can lie, or
// that a whole box of times holds none.

namespace shapegcode::minimal {

using Phases = Eigen::Matrix<double, Eigen::Dynamic, 1, Eigen::ColMajor, max_modes, 1>;
using Amplitudes = Eigen::Matrix<double, Eigen::Dynamic, 1, Eigen::ColMajor, max_modes + 1, 1>;

/// A shaper as the searches see it: its n free times t_2 ... t_{n+1} in radians of the fastest mode, and all n+1
/// amplitudes.
struct Taps {
  Phases phases;
  Amplitudes amplitudes;
};

/// The conditions of n modes on n+1 taps, linearised in the times.
class System {
 public:
  /// `poles` in rad/s, 1 to max_modes of them; `omega` (rad/s) is the largest magnitude: the unit of every phase.
  System(std::span<const std::complex<double>> poles, double omega);

  [[nodiscard]] int modes() const noexcept { return modes_; }
  [[nodiscard]] int unknowns() const noexcept { return 2 * modes_ + 1; }
  /// Pole of mode i per radian of the fastest one, and its magnitude.
  [[nodiscard]] std::complex<double> pole(int i) const { return poles_[static_cast<std::size_t>(i)]; }
  [[nodiscard]] double speed(int i) const { return speeds_[static_cast<std::size_t>(i)]; }

  /// The matrix of the note above at `phases`: the modes' real and imaginary rows, scaled so that an entry at the phase
  /// `end` has size one (as in residual_ratio), then the sum of the amplitudes. Columns: A, then w.
  void fill(const Phases& phases, double end, Square& matrix) const;

  /// Newton from `start`; nothing if it does not converge or leaves [-margin, limit + margin]. The taps come sorted,
  /// the first at zero.
  [[nodiscard]] std::optional<Taps> newton(const Phases& start, double limit, int steps = 40) const;

  /// Whether the conditions determine the taps: no tap is superfluous and no other solution lies infinitely near.
  [[nodiscard]] bool isolated(const Taps& taps) const;

 private:
  /// A and w of the linearisation at `phases`; false where it is singular.
  [[nodiscard]] bool linearised(const Phases& phases, Vector& x) const;
  [[nodiscard]] Taps sorted(const Phases& phases, const Vector& x) const;

  int modes_;
  std::array<std::complex<double>, max_modes> poles_;
  std::array<double, max_modes> speeds_{};
};

}  // namespace shapegcode::minimal
