#pragma once

#include <cstdint>
#include <span>

#include <Eigen/Core>

namespace shapegcode {

/// A linear plant x' = A*x + B*u, y = C*x + D*u: n states, m inputs, p outputs, in any consistent units (time in s).
struct StateSpace {
  Eigen::MatrixXd a;  ///< (n, n)
  Eigen::MatrixXd b;  ///< (n, m)
  Eigen::MatrixXd c;  ///< (p, n)
  Eigen::MatrixXd d;  ///< (p, m)
};

/// Change of the state over a period in which the input changes linearly from u0 to u1 (first-order hold): x1 =
/// state*x0 + from_input*u0 + to_input*u1. No approximation.
struct HeldPeriod {
  Eigen::MatrixXd state;       ///< (n, n)
  Eigen::MatrixXd from_input;  ///< (n, m)
  Eigen::MatrixXd to_input;    ///< (n, m)
};

/// Matrix exponential, also of stiff, singular and badly scaled matrices: balanced by powers of two (B. N. Parlett and
/// C. Reinsch, Numer. Math. 13, 1969), then scaling and squaring (N. J. Higham, SIAM J. Matrix Anal. Appl. 26, 2005).
/// Errors are about 1e-15 of the larger of 1 and the result, in the balanced scale, also with rates of 1e6. Throws
/// Error(argument) if it is not square or not finite, Error(numeric) if the exponential is not.
[[nodiscard]] Eigen::MatrixXd matrix_exponential(const Eigen::MatrixXd& matrix);

/// The period's matrices as blocks of the exponential of [[A, B, 0], [0, 0, 1/period], [0, 0, 0]]*period (C. F. Van
/// Loan, IEEE Trans. Automat. Contr. 23, 1978): no inverse of A is taken, so A may be singular.
/// Throws as matrix_exponential, and Error(argument) on sizes that do not fit or period_s <= 0.
[[nodiscard]] HeldPeriod first_order_hold(const Eigen::MatrixXd& a, const Eigen::MatrixXd& b, double period_s);

/// Propagates a linear plant exactly from sample to sample for an input that is linear between them, as a servo's
/// set-points are. Real-time safe after construction: step() allocates nothing, throws nothing and always takes the
/// same work.
class LinearPlant {
 public:
  /// At rest in x = 0 with input 0. Throws Error(argument) on sizes that do not fit, no state, no input or no output, a
  /// value that is not finite, or period_s <= 0; Error(numeric) if the plant overflows within a period.
  LinearPlant(StateSpace plant, double period_s);

  /// State at the instant at which the input is `input`. Throws Error(argument) on a wrong size or a value that is not
  /// finite.
  void reset(const Eigen::VectorXd& state, const Eigen::VectorXd& input);
  /// The steady state under a constant input: A*x + B*u = 0. If integrators leave it undetermined, it is the state
  /// nearest to `near` (an axis keeps its position), with distances in the balanced scale of A. Throws Error(argument)
  /// if there is none (the input makes an integrator grow), and as reset().
  void reset_at_rest(const Eigen::VectorXd& input);
  void reset_at_rest(const Eigen::VectorXd& input, const Eigen::VectorXd& near);

  /// One period later, at which the input is `in`: inputs() values in, outputs() out.
  void step(std::span<const double> in, std::span<double> out) noexcept;
  /// The same for a whole record, (n_samples, inputs()): the plant is put to rest for the first row, or to `state` with
  /// that input, and row k of the result, (n_samples, outputs()), is the output at row k. Identical to step(), to the
  /// last bit; the plant stays at the last row. Throws Error(argument) on a wrong shape or a value that is not finite.
  [[nodiscard]] Eigen::MatrixXd respond(const Eigen::MatrixXd& inputs);
  [[nodiscard]] Eigen::MatrixXd respond(const Eigen::MatrixXd& inputs, const Eigen::VectorXd& state);

  /// State and output at the last sample.
  [[nodiscard]] Eigen::VectorXd state() const { return joint_.head(order()); }
  [[nodiscard]] const Eigen::VectorXd& output() const noexcept { return output_; }
  [[nodiscard]] Eigen::Index order() const noexcept { return plant_.a.rows(); }
  [[nodiscard]] Eigen::Index inputs() const noexcept { return plant_.b.cols(); }
  [[nodiscard]] Eigen::Index outputs() const noexcept { return plant_.c.rows(); }
  [[nodiscard]] double period_s() const noexcept { return period_s_; }

 private:
  void check_inputs(const Eigen::MatrixXd& inputs) const;
  [[nodiscard]] Eigen::MatrixXd run(const Eigen::MatrixXd& inputs);

  StateSpace plant_;
  double period_s_;
  Eigen::MatrixXd over_period_;  // (n, n + 2m): state, from_input, to_input side by side
  Eigen::VectorXd joint_;        // x, u of the last sample, u of the next
  Eigen::VectorXd next_;         // x under construction
  Eigen::VectorXd output_;
  std::int64_t row_ = 0;  // samples since reset()
};

}  // namespace shapegcode
