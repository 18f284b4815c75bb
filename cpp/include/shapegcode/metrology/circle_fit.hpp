#pragma once

#include <Eigen/Core>
#include <span>

namespace shapegcode {

/// The circle of least squares of radial distance through points.
struct CircleFit {
  Eigen::Vector2d centre_mm = Eigen::Vector2d::Zero();
  double radius_mm = 0.0;
  double form_mm = 0.0;  ///< largest less smallest radial distance from the circle
  double rms_mm = 0.0;   ///< root mean square of the radial distances
};

/// Geometric fit: the start is Pratt's algebraic fit (Chernov, Circular and Linear Regression, 2010, section 5.6),
/// which also holds on short arcs; Gauss-Newton steps with Levenberg's damping follow. Throws Error(argument) on fewer
/// than three points or points on a line, Error(numeric) if the steps do not converge.
[[nodiscard]] CircleFit fit_circle(std::span<const Eigen::Vector2d> points_mm);

}  // namespace shapegcode
