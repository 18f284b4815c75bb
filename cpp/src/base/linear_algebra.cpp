#include "base/linear_algebra.hpp"

#include <utility>

namespace shapegcode::linear_algebra {

Eigen::VectorXd least_norm_solution(const Eigen::MatrixXd& matrix, const Eigen::VectorXd& right, double threshold) {
  Eigen::CompleteOrthogonalDecomposition<Eigen::MatrixXd> solver;
  if (threshold > 0.0) solver.setThreshold(threshold);
  solver.compute(matrix);
  return solver.solve(right);
}

Eigen::VectorXd least_squares(const Eigen::MatrixXd& matrix, const Eigen::VectorXd& right) {
  return Eigen::ColPivHouseholderQR<Eigen::MatrixXd>(matrix).solve(right);
}

Eigen::VectorXd solve(const Eigen::MatrixXd& matrix, const Eigen::VectorXd& right) {
  return matrix.partialPivLu().solve(right);
}

Eigen::MatrixXd solve(const Eigen::MatrixXd& matrix, const Eigen::MatrixXd& right) {
  return matrix.partialPivLu().solve(right);
}

void triangulate(Eigen::MatrixXd& matrix) {
  const Eigen::HouseholderQR<Eigen::Ref<Eigen::MatrixXd>> qr(matrix);
  for (Eigen::Index j = 0; j < matrix.cols(); ++j) {
    const Eigen::Index below = matrix.rows() - j - 1;
    if (below > 0) {
      matrix.col(j).tail(below).setZero();
    }
  }
}

Eigen::MatrixXd orthonormalise(Eigen::MatrixXd& columns) {
  const Eigen::HouseholderQR<Eigen::Ref<Eigen::MatrixXd>> qr(columns);
  Eigen::MatrixXd factor = columns.topRows(columns.cols()).triangularView<Eigen::Upper>();
  Eigen::MatrixXd basis = qr.householderQ() * Eigen::MatrixXd::Identity(columns.rows(), columns.cols());
  columns = std::move(basis);
  return factor;
}

Eigen::VectorXcd eigenvalues(const Eigen::MatrixXd& matrix) { return matrix.eigenvalues(); }

SymmetricEigen symmetric_eigen(const Eigen::MatrixXd& matrix) {
  const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> solver(matrix);
  return {solver.eigenvalues(), solver.eigenvectors()};
}

}  // namespace shapegcode::linear_algebra
