#pragma once

#include <Eigen/Dense>

// Decompositions of dynamic matrices, each compiled once, because instantiating them in several sources dominates the
// compile time. The results are those of the Eigen class of the same name.

namespace shapegcode::linear_algebra {

/// The solution of least norm of a least-squares problem (complete orthogonal decomposition). `threshold`: pivots below
/// this share of the largest count as zero; 0: what rounding leaves.
[[nodiscard]] Eigen::VectorXd least_norm_solution(const Eigen::MatrixXd& matrix, const Eigen::VectorXd& right,
                                                  double threshold = 0.0);

/// The solution of a least-squares problem (column-pivoting QR).
[[nodiscard]] Eigen::VectorXd least_squares(const Eigen::MatrixXd& matrix, const Eigen::VectorXd& right);

/// The solution of matrix*x = right for a square matrix (LU, partial pivoting); not finite where it is singular.
[[nodiscard]] Eigen::VectorXd solve(const Eigen::MatrixXd& matrix, const Eigen::VectorXd& right);
[[nodiscard]] Eigen::MatrixXd solve(const Eigen::MatrixXd& matrix, const Eigen::MatrixXd& right);

/// Replaces a matrix by the triangular factor of its QR decomposition, zeros below.
void triangulate(Eigen::MatrixXd& matrix);

/// Replaces columns, not more of them than rows, by an orthonormal basis of them; returns the triangular factor that
/// makes the columns from it.
[[nodiscard]] Eigen::MatrixXd orthonormalise(Eigen::MatrixXd& columns);

/// The eigenvalues of a real square matrix, in no order.
[[nodiscard]] Eigen::VectorXcd eigenvalues(const Eigen::MatrixXd& matrix);

/// Of a symmetric matrix, whose lower triangle is read: values ascending, and their orthonormal vectors as columns.
struct SymmetricEigen {
  Eigen::VectorXd values;
  Eigen::MatrixXd vectors;
};
[[nodiscard]] SymmetricEigen symmetric_eigen(const Eigen::MatrixXd& matrix);

}  // namespace shapegcode::linear_algebra
