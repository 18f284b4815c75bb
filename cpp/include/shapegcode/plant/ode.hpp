#pragma once

#include <functional>
#include <memory>

#include <Eigen/Core>

namespace shapegcode {

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
  /// Continues at time() from `y`: call it where f or its inputs jump (running on over a jump ends in CV_ERR_FAILURE).
  /// CVODE forgets its history, as it must, and searches a first step again: handing it the step accepted after the
  /// last restart was measured and saves nothing (5 % of the evaluations, at 10-25 % more steps).
  void restart(const Eigen::VectorXd& y);
  /// The same with another time, e.g. for the next run of the same plant.
  void restart(const Eigen::VectorXd& y, double t);

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
