#pragma once

#include <Eigen/Core>

namespace shapegcode {

/// Number of linear axes that the core plays: X, Y, Z.
inline constexpr int axis_count = 3;

using Vector3 = Eigen::Vector3d;

/// The currency between stages: positions in mm, one row per period, one contiguous column per axis.
struct Samples {
  double period_s = 0.0;
  Eigen::MatrixXd positions_mm;  ///< (n_samples, n_axes), column-major
};

}  // namespace shapegcode
