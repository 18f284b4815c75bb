#pragma once

#include <cstddef>
#include <span>
#include <vector>

namespace shapegcode {

/// Finds, for one axis, the correction c of a command before shaping that brings the shaped command (or the plant's
/// response to it) back to the programmed path: it minimises |e + f*c|^2 + sum_k w_k (c_k - 2 c_{k-1} + c_{k-2})^2,
/// where f is the kernel from the command before shaping to what shall follow the path and e the deviation without
/// correction (spec 5).
///
/// The error is counted as far as the correction reaches, so the normal matrix is a banded Toeplitz matrix whatever the
/// length of the window: its Cholesky factor is worked out once, until its rows no longer change, and every window then
/// costs two substitutions. Unequal weights cost a factorisation of their own. What is solved window by window is
/// carried on: corrections already given out stay as they are, and the next window starts from them.
class ContourSolver {
 public:
  /// `kernel`: taps at delays 0, 1, ... samples, sum other than 0; `smoothness` > 0: the weight w. Throws
  /// Error(argument) on an empty or not finite kernel or another smoothness.
  ContourSolver(std::vector<double> kernel, double smoothness);

  /// Delay of the kernel's last tap: samples by which a correction acts beyond its own place.
  [[nodiscard]] std::size_t reach() const noexcept { return kernel_.size() - 1; }
  [[nodiscard]] const std::vector<double>& kernel() const noexcept { return kernel_; }

  /// Corrections of one window. `correction` holds reach()+2 values that stay (what was given out before the window,
  /// zero where nothing was) and then the m unknowns; `error` e at the m unknowns and at the reach() samples behind
  /// them, without any correction. `stiffness`: empty, or m+2 factors of the smoothness, one per second difference.
  /// Throws Error(argument) on sizes that do not fit. O(m*reach), with stiffness O(m*reach^2).
  void solve(std::span<const double> error, std::span<double> correction, std::span<const double> stiffness = {});

 private:
  void extend_factor(std::size_t rows);
  void factor_and_solve(std::span<const double> stiffness, std::span<double> x);

  std::vector<double> kernel_;
  std::vector<std::size_t> taps_;  // delays at which the kernel is not zero
  double smoothness_;
  std::size_t band_;            // half bandwidth of the normal matrix
  std::vector<double> column_;  // its first column
  /// Rows of the factor, band_+1 values each: l(i, i-band_) ... l(i, i-1), 1/l(i, i).
  std::vector<double> factor_;
  std::size_t factor_rows_ = 0;
  bool settled_ = false;  // the last row stands for all that follow
  std::vector<double> work_;
  std::vector<double> own_factor_;  // with stiffness
};

}  // namespace shapegcode
