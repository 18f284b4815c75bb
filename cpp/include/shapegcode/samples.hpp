#pragma once

#include <algorithm>
#include <span>

#include <Eigen/Core>

namespace shapegcode {

/// Number of linear axes of the core: X, Y, Z.
inline constexpr int axis_count = 3;

using Vector3 = Eigen::Vector3d;

/// The values of a position, as used by `step` of the real-time forms.
[[nodiscard]] inline std::span<double> values_of(Vector3& position) noexcept { return {position.data(), axis_count}; }
[[nodiscard]] inline std::span<const double> values_of(const Vector3& position) noexcept {
  return {position.data(), axis_count};
}

/// `step` of an interpolator into the caller's memory: X, Y and Z.
template <class PositionSource>
bool step_into(std::span<double> out, PositionSource& source) noexcept {
  Vector3 position = Vector3::Zero();
  const bool moving = source.step(position);
  std::copy_n(position.data(), axis_count, out.begin());
  return moving;
}

/// Samples of a motion: positions in mm, one row per period, one contiguous column per axis.
struct Samples {
  double period_s = 0.0;
  Eigen::MatrixXd positions_mm;  ///< (n_samples, n_axes), column-major
};

}  // namespace shapegcode
