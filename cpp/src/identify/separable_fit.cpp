#include "identify/separable_fit.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include <fmt/format.h>

#include "base/linear_algebra.hpp"

namespace shapegcode::identification {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;
using linear_algebra::triangulate;

// A column is a combination of the others if its independent part is smaller than this fraction of it.
constexpr double dependent = 1e-11;
// Steps of theta (all logarithms) and predicted gains below which the minimum is reached.
constexpr double step_floor = 1e-11;
constexpr double gain_floor = 1e-12;
constexpr double exact_response_share = 1e-26;  // of the response's sum of squares
constexpr double largest_step = 0.5;

/// The problem at one theta: the triangular factor of J for (common, theta) and what it has to follow.
struct Linearised {
  VectorXd common;
  std::vector<VectorXd> local;
  MatrixXd factor;  // upper triangle, (common+nonlinear) squared
  VectorXd target;  // its right-hand side
  double sum_of_squares = 0.0;
  bool dependent_columns = false;
};

bool has_dependent(const MatrixXd& factor, Index columns) {
  for (Index j = 0; j < columns; ++j) {
    if (!(std::abs(factor(j, j)) > dependent * factor.col(j).head(j + 1).norm())) return true;
  }
  return false;
}

/// Solves an upper triangle; zero where columns depend on each other, so that the caller can go on.
VectorXd solve_upper(const MatrixXd& factor, const VectorXd& right) {
  VectorXd x = VectorXd::Zero(factor.cols());
  for (Index i = factor.cols() - 1; i >= 0; --i) {
    const Index after = factor.cols() - 1 - i;
    const double rest = right[i] - factor.row(i).tail(after).dot(x.tail(after));
    const double pivot = factor(i, i);
    x[i] = std::abs(pivot) > dependent * factor.col(i).norm() ? rest / pivot : 0.0;
  }
  return x;
}

class Linearisation {
 public:
  explicit Linearisation(const SeparableModel& model) : model_(model), columns_(model.records()) {}

  Linearised at(const VectorXd& theta) {
    const Index local = model_.local();
    const Index common = model_.common();
    const Index derivatives = model_.derivatives();
    const Index rows = common + derivatives + 1;  // of a record's factor below the local columns
    const auto records = static_cast<Index>(model_.records());
    MatrixXd stack(records * rows, rows);
    for (std::size_t r = 0; r < model_.records(); ++r) {
      columns_[r].resize(model_.samples(r), model_.width());
      model_.fill(theta, r, columns_[r]);
      triangulate_record(r);
      stack.middleRows(static_cast<Index>(r) * rows, rows) = columns_[r].block(local, local, rows, rows);
    }
    Linearised result;
    if (common > 0) {
      MatrixXd linear(stack.rows(), common + 1);
      linear << stack.leftCols(common), stack.rightCols(1);
      triangulate(linear);
      result.dependent_columns = has_dependent(linear, common);
      result.common = solve_upper(linear.topLeftCorner(common, common), linear.col(common).head(common));
    }
    const Index nonlinear = model_.nonlinear();
    MatrixXd joint(stack.rows(), common + nonlinear + 1);
    joint.leftCols(common) = stack.leftCols(common);
    joint.rightCols(1) = stack.rightCols(1);
    for (std::size_t r = 0; r < model_.records(); ++r) {
      const MatrixXd& factor = columns_[r];  // its upper triangle by now
      VectorXd right = factor.col(factor.cols() - 1).head(local);
      if (common > 0) right -= factor.block(0, local, local, common) * result.common;
      result.dependent_columns = result.dependent_columns || has_dependent(factor, local);
      result.local.push_back(solve_upper(factor.topLeftCorner(local, local), right));
      const Index first = static_cast<Index>(r) * rows;
      joint.block(first, common, rows, nonlinear) =
          stack.block(first, common, rows, derivatives) * model_.combine(theta, result.local.back(), result.common);
    }
    triangulate(joint);
    const Index unknowns = common + nonlinear;
    result.factor = joint.topLeftCorner(unknowns, unknowns);
    result.target = joint.col(unknowns).head(unknowns);
    const Index left_over = std::min(joint.rows() - common, nonlinear + 1);
    result.sum_of_squares = joint.col(unknowns).segment(common, left_over).squaredNorm();
    return result;
  }

 private:
  /// Local columns that never change are factorised once; what they can follow is then taken out of the others.
  void triangulate_record(std::size_t r) {
    MatrixXd& columns = columns_[r];
    const Index local = model_.local();
    if (local == 0 || !model_.local_is_constant()) {
      triangulate(columns);
      return;
    }
    if (bases_.size() <= r) {
      MatrixXd own = columns.leftCols(local);
      factors_.push_back(linear_algebra::orthonormalise(own));
      bases_.push_back(std::move(own));
    }
    const Index others = columns.cols() - local;
    MatrixXd rest = columns.rightCols(others);
    const MatrixXd followed = bases_[r].transpose() * rest;
    rest.noalias() -= bases_[r] * followed;
    triangulate(rest);
    columns.topLeftCorner(local, local) = factors_[r];
    columns.topRightCorner(local, others) = followed;
    columns.block(local, local, others, others) = rest.topRows(others);
  }

  const SeparableModel& model_;
  std::vector<MatrixXd> columns_;
  std::vector<MatrixXd> bases_;    // per record, orthonormal, of the local columns
  std::vector<MatrixXd> factors_;  // and their triangular factors
};

/// The step of theta that minimises |target - factor*step|^2 + damping*|scaled step|^2.
VectorXd damped_step(const MatrixXd& factor, const VectorXd& target, double damping) {
  const Index n = factor.cols();
  MatrixXd stacked = MatrixXd::Zero(2 * n, n + 1);
  stacked.topLeftCorner(n, n) = factor;
  stacked.col(n).head(n) = target;
  for (Index j = 0; j < n; ++j) stacked(n + j, j) = std::sqrt(damping) * factor.col(j).norm();
  triangulate(stacked);
  return solve_upper(stacked.topLeftCorner(n, n), stacked.col(n).head(n));
}

/// Fills what only the final theta needs.
void complete(const SeparableModel& model, const Linearised& at, SeparableFit& fit) {
  const Index local = model.local();
  const Index common = model.common();
  const Index unknowns = common + model.nonlinear();
  fit.common = at.common;
  fit.local = at.local;
  const MatrixXd inverse =
      at.factor.triangularView<Eigen::Upper>().solve(MatrixXd::Identity(unknowns, unknowns)).eval();
  fit.inverse_gram = inverse * inverse.transpose();
  fit.sum_of_squares = 0.0;
  for (std::size_t r = 0; r < model.records(); ++r) {
    MatrixXd columns(model.samples(r), model.width());
    model.fill(fit.theta, r, columns);
    VectorXd fitted = columns.leftCols(local) * at.local[r];
    if (common > 0) fitted += columns.middleCols(local, common) * at.common;
    VectorXd residual = columns.col(model.width() - 1) - fitted;
    fit.sum_of_squares += residual.squaredNorm();
    MatrixXd jacobian(model.samples(r), unknowns);
    jacobian.leftCols(common) = columns.middleCols(local, common);
    jacobian.rightCols(model.nonlinear()) =
        columns.middleCols(local + common, model.derivatives()) * model.combine(fit.theta, at.local[r], at.common);
    if (local > 0) {
      MatrixXd basis = columns.leftCols(local);
      static_cast<void>(linear_algebra::orthonormalise(basis));
      jacobian -= basis * (basis.transpose() * jacobian).eval();
    }
    fit.jacobian.push_back(std::move(jacobian));
    fit.fitted.push_back(std::move(fitted));
    fit.residual.push_back(std::move(residual));
  }
}

/// Whether the search ended well, and if not, why.
void conclude(bool at_bound, bool has_dependent_columns, SeparableFit& fit) {
  if (at_bound) {
    fit.converged = false;
    fit.reason = "a frequency or damping ratio ran to the end of its range";
  } else if (!fit.converged) {
    fit.reason = fmt::format("no minimum after {} steps", fit.iterations);
  }
  if (has_dependent_columns) {
    fit.converged = false;
    fit.reason = "two modes cannot be told apart, or one has no share in the response";
  }
}

}  // namespace

SeparableFit fit_separable(const SeparableModel& model, VectorXd theta, int most_iterations) {
  Linearisation linearisation(model);
  SeparableFit fit;
  model.clamp(theta);
  fit.theta = std::move(theta);
  Linearised at = linearisation.at(fit.theta);
  const Index common = model.common();
  const Index nonlinear = model.nonlinear();
  double response_squares = 0.0;
  for (std::size_t r = 0; r < model.records(); ++r) {
    MatrixXd columns(model.samples(r), model.width());
    model.fill(fit.theta, r, columns);
    response_squares += columns.col(model.width() - 1).squaredNorm();
  }
  double damping = 1e-3;
  bool at_bound = false;
  for (fit.iterations = 1; fit.iterations < most_iterations; ++fit.iterations) {
    const MatrixXd factor = at.factor.bottomRightCorner(nonlinear, nonlinear);
    const VectorXd target = at.target.tail(nonlinear);
    if (target.squaredNorm() <= gain_floor * at.sum_of_squares ||
        at.sum_of_squares <= exact_response_share * response_squares) {
      fit.converged = true;
      break;
    }
    VectorXd step = damped_step(factor, target, damping);
    const double largest = step.cwiseAbs().maxCoeff();
    if (!std::isfinite(largest)) break;
    if (largest > largest_step) step *= largest_step / largest;
    VectorXd tried = fit.theta + step;
    const bool left = model.clamp(tried);
    const double moved = (tried - fit.theta).cwiseAbs().maxCoeff();
    Linearised next = linearisation.at(tried);
    // Near the minimum only rounding decides which of two sums is smaller.
    if (next.sum_of_squares <= at.sum_of_squares * (1.0 + 1e-13)) {
      at = std::move(next);
      fit.theta = std::move(tried);
      at_bound = left;
      damping = damping > 1e-12 ? 0.1 * damping : 0.0;
      if (moved <= step_floor) {
        fit.converged = true;
        break;
      }
    } else {
      if (moved <= step_floor) {
        fit.converged = true;
        break;
      }
      damping = std::max(10.0 * damping, 1e-6);
    }
  }
  conclude(at_bound, at.dependent_columns || has_dependent(at.factor, common + nonlinear), fit);
  complete(model, at, fit);
  return fit;
}

MatrixXd coloured_covariance(const SeparableFit& fit, double degrees_of_freedom) {
  double samples = 0.0;
  for (const VectorXd& residual : fit.residual) samples += static_cast<double>(residual.size());
  const auto lags = static_cast<Index>(2.0 * std::sqrt(samples / static_cast<double>(fit.residual.size())));
  const Index unknowns = fit.inverse_gram.rows();
  MatrixXd middle = MatrixXd::Zero(unknowns, unknowns);
  for (Index lag = 0; lag <= lags; ++lag) {
    double product = 0.0;
    MatrixXd columns = MatrixXd::Zero(unknowns, unknowns);
    for (std::size_t r = 0; r < fit.residual.size(); ++r) {
      const Index overlap = fit.residual[r].size() - lag;
      if (overlap <= 0) continue;
      product += fit.residual[r].head(overlap).dot(fit.residual[r].tail(overlap));
      columns.noalias() += fit.jacobian[r].topRows(overlap).transpose() * fit.jacobian[r].bottomRows(overlap);
    }
    const double taper = 1.0 - static_cast<double>(lag) / static_cast<double>(lags + 1);
    const double weight = taper * product / degrees_of_freedom;
    middle += lag == 0 ? (weight * columns).eval() : (weight * (columns + columns.transpose())).eval();
  }
  if (fit.expectations.size() > 0) middle += fit.sum_of_squares / degrees_of_freedom * fit.expectations;
  return fit.inverse_gram * middle * fit.inverse_gram;
}

double lag_one_autocorrelation(const std::vector<VectorXd>& residual) {
  double product = 0.0;
  double squares = 0.0;
  for (const VectorXd& errors : residual) {
    product += errors.head(errors.size() - 1).dot(errors.tail(errors.size() - 1));
    squares += errors.squaredNorm();
  }
  return squares > 0.0 ? product / squares : 0.0;
}

}  // namespace shapegcode::identification
