#pragma once

#include <Eigen/Dense>

// The linear equations of the searches: at most 13 unknowns, millions of times. Their number is known at run time only,
// so that the searches are compiled once for any number of modes; nothing is allocated.

namespace shapegcode::minimal {

inline constexpr int max_modes = 6;
inline constexpr int max_unknowns = 2 * max_modes + 1;

using Square = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::ColMajor, max_unknowns, max_unknowns>;
using Vector = Eigen::Matrix<double, Eigen::Dynamic, 1, Eigen::ColMajor, max_unknowns, 1>;

/// Replaces a matrix by its inverse; false, and the matrix is of no use, where it is singular or not finite.
[[nodiscard]] bool invert(Square& matrix) noexcept;

/// Replaces `right` by the solution of matrix*x = right; the matrix is overwritten. False as `invert` says.
[[nodiscard]] bool solve(Square& matrix, Vector& right) noexcept;

}  // namespace shapegcode::minimal
