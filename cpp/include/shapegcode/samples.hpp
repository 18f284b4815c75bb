#pragma once

#include <span>

#include <Eigen/Core>

namespace shapegcode {

/// Number of linear axes that the core plays: X, Y, Z.
inline constexpr int axis_count = 3;

using Vector3 = Eigen::Vector3d;

/// The values of a position, as `step` of the real-time forms takes and gives them.
[[nodiscard]] inline std::span<double> values_of(Vector3& position) noexcept { return {position.data(), axis_count}; }
[[nodiscard]] inline std::span<const double> values_of(const Vector3& position) noexcept {
  return {position.data(), axis_count};
}

/// The currency between stages: positions in mm, one row per period, one contiguous column per axis.
struct Samples {
  double period_s = 0.0;
  Eigen::MatrixXd positions_mm;  ///< (n_samples, n_axes), column-major
};

}  // namespace shapegcode
