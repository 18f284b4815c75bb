#pragma once

#include <functional>
#include <memory>

#include <Eigen/Core>

namespace shapegcode {

/// Right-hand side and Jacobian of y' = f(t, y) for the inner loop: no allocation, no copies.
class OdeSystem {
 public:
  OdeSystem() = default;
  virtual ~OdeSystem() = default;
  OdeSystem(const OdeSystem&) = delete;
  OdeSystem& operator=(const OdeSystem&) = delete;
  OdeSystem(OdeSystem&&) = delete;
  OdeSystem& operator=(OdeSystem&&) = delete;

  /// Writes f(t, y) into `rate`.
  virtual void rate(double t, const double* y, double* rate) = 0;
  /// Writes df/dy column by column into `matrix`, which comes filled with zeros.
  virtual void jacobian(double t, const double* y, double* matrix) = 0;
  /// Writes the magnitude of each unknown that the relative tolerance is taken of: |y|, unless a problem knows better
  /// (a position may be large where only its distance from another counts).
  virtual void magnitudes(double t, const double* y, Eigen::Ref<Eigen::VectorXd> magnitude);
};

/// A stiff initial value problem y' = f(t, y), solved by backward differentiation (CVODE) with an analytic Jacobian.
/// The only class behind which SUNDIALS is used.
class OdeSolver {
 public:
  /// Writes f(t, y) into `rate` (already of y's size).
  using Rhs =
      std::function<void(double t, const Eigen::Ref<const Eigen::VectorXd>& y, Eigen::Ref<Eigen::VectorXd> rate)>;
  /// Writes df/dy into `jacobian`, which comes filled with zeros; row = equation, column = unknown.
  using Jacobian =
      std::function<void(double t, const Eigen::Ref<const Eigen::VectorXd>& y, Eigen::Ref<Eigen::MatrixXd> jacobian)>;

  /// `rtol` relative tolerance, `atol` absolute tolerance in the units of y. Throws Error(argument) on an empty or
  /// not finite y0, an empty function or a tolerance that is not above 0 (atol: not below 0).
  OdeSolver(Rhs rhs, Jacobian jacobian, const Eigen::VectorXd& y0, double t0, double rtol, double atol);
  /// One absolute tolerance per unknown, for states of different units.
  OdeSolver(Rhs rhs, Jacobian jacobian, const Eigen::VectorXd& y0, double t0, double rtol, const Eigen::VectorXd& atol);
  /// The same without std::function in the inner loop; `system` must outlive the solver.
  OdeSolver(OdeSystem& system, const Eigen::VectorXd& y0, double t0, double rtol, const Eigen::VectorXd& atol);
  ~OdeSolver();
  OdeSolver(OdeSolver&&) noexcept;
  OdeSolver& operator=(OdeSolver&&) noexcept;
  OdeSolver(const OdeSolver&) = delete;
  OdeSolver& operator=(const OdeSolver&) = delete;

  /// State at `t` >= time(). With `stop_exactly` f is never asked beyond `t` (use it up to a set-point change, then
  /// restart); without it the solver may step past `t` and interpolate back, which is faster.
  /// Throws what `rhs` or `jacobian` threw; Error(numeric) with CVODE's flag and the time when the solver fails;
  /// Error(argument) if `t` lies before time(). After a failure only restart() continues.
  const Eigen::VectorXd& advance(double t, bool stop_exactly = true);
  /// Continues at time() from `y`: call it where f jumps (running on over a jump ends in CV_ERR_FAILURE). CVODE forgets
  /// its history, as it must, and searches a first step again. Handing it one was measured and saves little: on a feed
  /// drive 10 % of the evaluations, none of the steps. Where f has only kinks do not restart: the history is worth more
  /// (a fifth of the evaluations at a quarter of the error, docs/concepts/feed_drive.md).
  void restart(const Eigen::VectorXd& y);
  /// The same with another time, e.g. for the next run of the same plant.
  void restart(const Eigen::VectorXd& y, double t);
  /// No step is longer than this (s) from now on. Half the distance between two stops makes the steps fit between them:
  /// a short last step before a stop costs more than it covers. Throws Error(argument) on a value <= 0.
  void limit_step(double longest);

  [[nodiscard]] double time() const noexcept;
  [[nodiscard]] const Eigen::VectorXd& state() const noexcept;
  /// Internal steps and evaluations of f since construction: for tests and reports.
  [[nodiscard]] long steps() const noexcept;
  [[nodiscard]] long rhs_evaluations() const noexcept;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace shapegcode
