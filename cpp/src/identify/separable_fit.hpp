#pragma once

#include <Eigen/Dense>
#include <cstddef>
#include <string>
#include <vector>

// Least squares of a model that is linear in most of its parameters: response = local*b + common*c + error, whose
// columns depend on the nonlinear parameters theta. The linear ones are eliminated record by record with a QR, so only
// theta is searched (variable projection in Kaufman's form: Golub, Pereyra, Inverse Problems 19, 2003), by
// Levenberg-Marquardt on exact derivatives.

namespace shapegcode::identification {

class SeparableModel {
 public:
  virtual ~SeparableModel() = default;
  [[nodiscard]] virtual std::size_t records() const = 0;
  [[nodiscard]] virtual Eigen::Index samples(std::size_t record) const = 0;
  /// Linear parameters of each record alone, those of all records, derivative columns, nonlinear parameters.
  [[nodiscard]] virtual Eigen::Index local() const = 0;
  [[nodiscard]] virtual Eigen::Index common() const = 0;
  [[nodiscard]] virtual Eigen::Index derivatives() const = 0;
  [[nodiscard]] virtual Eigen::Index nonlinear() const = 0;
  /// Fills (samples x width()): local | common | derivative columns | response.
  virtual void fill(const Eigen::VectorXd& theta, std::size_t record, Eigen::MatrixXd& columns) const = 0;
  /// Whether the local columns are the same at every theta.
  [[nodiscard]] virtual bool local_is_constant() const = 0;
  /// What the derivative columns are multiplied with (derivatives() x nonlinear()) to be d response/d theta.
  [[nodiscard]] virtual Eigen::MatrixXd combine(const Eigen::VectorXd& theta, const Eigen::VectorXd& local_values,
                                                const Eigen::VectorXd& common_values) const = 0;
  /// Brings theta back into its range; true if it had left it.
  virtual bool clamp(Eigen::VectorXd& theta) const = 0;

  [[nodiscard]] Eigen::Index width() const { return local() + common() + derivatives() + 1; }

 protected:
  SeparableModel() = default;
  SeparableModel(const SeparableModel&) = default;
  SeparableModel(SeparableModel&&) = default;
  SeparableModel& operator=(const SeparableModel&) = default;
  SeparableModel& operator=(SeparableModel&&) = default;
};

struct SeparableFit {
  Eigen::VectorXd theta;
  Eigen::VectorXd common;
  std::vector<Eigen::VectorXd> local;  // per record
  /// Inverse of J'J for (common, theta), the local parameters eliminated.
  Eigen::MatrixXd inverse_gram;
  /// Per record the columns of J for (common, theta), what local parameters can follow taken out.
  std::vector<Eigen::MatrixXd> jacobian;
  /// J'J of rows that are expectations, not samples, where the model has such; else of size 0.
  Eigen::MatrixXd expectations;
  std::vector<Eigen::VectorXd> fitted;
  std::vector<Eigen::VectorXd> residual;
  double sum_of_squares = 0.0;
  int iterations = 0;
  bool converged = false;
  std::string reason;  // why not converged
};

/// Levenberg-Marquardt from `theta` with at most `most_iterations` evaluations. Not reaching a minimum is reported in
/// the result; theta is then the best that was seen.
[[nodiscard]] SeparableFit fit_separable(const SeparableModel& model, Eigen::VectorXd theta, int most_iterations);

/// Covariance of (common, theta) for residuals that are correlated over time in the same way in all records
/// (stationary): their autocorrelation, tapered to zero at 2*sqrt(samples) lags (Bartlett; Newey, West 1987).
[[nodiscard]] Eigen::MatrixXd coloured_covariance(const SeparableFit& fit, double degrees_of_freedom);

/// Autocorrelation (no unit) of all residuals at a lag of one sample.
[[nodiscard]] double lag_one_autocorrelation(const std::vector<Eigen::VectorXd>& residual);

}  // namespace shapegcode::identification
