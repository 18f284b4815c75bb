#include "shapegcode/measure/sections.hpp"

#include <fmt/format.h>

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <limits>

#include "base/refuse.hpp"
#include "shapegcode/error.hpp"

namespace shapegcode {
namespace {

using detail::refuse;

using Eigen::Matrix3d;
using Eigen::Vector2d;

constexpr int max_newton_steps = 100;
constexpr int max_fit_steps = 200;
// Points give no circle if their spread across a line is below this fraction of that along it.
constexpr double straight_share = 1e-12;

// Centre and radius, about the points' own mean.
using Circle = Eigen::Vector3d;

Circle pratt_fit(std::span<const Vector2d> points, const Vector2d& mean) {
  double mxx = 0.0;
  double myy = 0.0;
  double mxy = 0.0;
  double mxz = 0.0;
  double myz = 0.0;
  double mzz = 0.0;
  for (const Vector2d& point : points) {
    const Vector2d p = point - mean;
    const double z = p.squaredNorm();
    mxx += p.x() * p.x();
    myy += p.y() * p.y();
    mxy += p.x() * p.y();
    mxz += p.x() * z;
    myz += p.y() * z;
    mzz += z * z;
  }
  const auto n = static_cast<double>(points.size());
  mxx /= n, myy /= n, mxy /= n, mxz /= n, myz /= n, mzz /= n;
  const double mz = mxx + myy;
  const double covariance = mxx * myy - mxy * mxy;
  if (!(covariance > straight_share * mz * mz)) {
    refuse("the points lie on a line: no circle fits them");
  }
  const double variance_z = mzz - mz * mz;
  // The smallest root of the characteristic polynomial, found from 0 on.
  const double a2 = 4.0 * covariance - 3.0 * mz * mz - mzz;
  const double a1 = variance_z * mz + 4.0 * covariance * mz - mxz * mxz - myz * myz;
  const double a0 = mxz * (mxz * myy - myz * mxy) + myz * (myz * mxx - mxz * mxy) - variance_z * covariance;
  double root = 0.0;
  double value = a0;
  for (int i = 0; i < max_newton_steps; ++i) {
    const double slope = a1 + root * (2.0 * a2 + 16.0 * root * root);
    const double next = root - value / slope;
    if (next == root || !std::isfinite(next)) break;
    const double next_value = a0 + next * (a1 + next * (a2 + 4.0 * next * next));
    if (std::abs(next_value) >= std::abs(value)) break;
    root = next;
    value = next_value;
  }
  const double determinant = root * root - root * mz + covariance;
  const Vector2d centre = Vector2d(mxz * (myy - root) - myz * mxy, myz * (mxx - root) - mxz * mxy) / determinant / 2.0;
  return {centre.x(), centre.y(), std::sqrt(centre.squaredNorm() + mz + 2.0 * root)};
}

struct Normal {
  Matrix3d matrix = Matrix3d::Zero();
  Circle gradient = Circle::Zero();
  double sum_of_squares = 0.0;
};

Normal normal_equations(std::span<const Vector2d> points, const Vector2d& mean, const Circle& circle) {
  Normal normal;
  for (const Vector2d& point : points) {
    const Vector2d from_centre = point - mean - circle.head<2>();
    const double distance = from_centre.norm();
    const double residual = distance - circle[2];
    Circle row(0.0, 0.0, -1.0);
    if (distance > 0.0) row.head<2>() = -from_centre / distance;
    normal.matrix += row * row.transpose();
    normal.gradient += row * residual;
    normal.sum_of_squares += residual * residual;
  }
  return normal;
}

}  // namespace

CircleFit fit_circle(std::span<const Vector2d> points_mm) {
  if (points_mm.size() < 3) {
    refuse("{} points given, a circle needs at least 3", points_mm.size());
  }
  const auto bad = std::ranges::find_if(points_mm, [](const Vector2d& point) { return !point.allFinite(); });
  if (bad != points_mm.end()) refuse("point {} is not finite", bad - points_mm.begin());
  Vector2d mean = Vector2d::Zero();
  for (const Vector2d& point : points_mm) mean += point;
  mean /= static_cast<double>(points_mm.size());

  Circle circle = pratt_fit(points_mm, mean);
  Normal normal = normal_equations(points_mm, mean, circle);
  double damping = 0.0;
  int steps = 0;
  while (true) {
    Matrix3d damped = normal.matrix;
    damped.diagonal() *= 1.0 + damping;
    const Circle step = -damped.ldlt().solve(normal.gradient);
    if (!step.allFinite()) throw Error(ErrorKind::numeric, "the circle fit met a singular system");
    const double size = 1.0 + circle.cwiseAbs().maxCoeff();
    const bool small = step.cwiseAbs().maxCoeff() <= 4.0 * std::numeric_limits<double>::epsilon() * size;
    const Circle next = circle + step;
    const Normal next_normal = normal_equations(points_mm, mean, next);
    if (next_normal.sum_of_squares < normal.sum_of_squares) {
      circle = next;
      normal = next_normal;
      damping *= 0.1;
    } else {
      // Where only rounding is left no step gets any better.
      if (small || step.cwiseAbs().maxCoeff() <= 1e-12 * size) break;
      damping = std::max(10.0 * damping, 1e-4);
    }
    if (small) break;
    if (++steps > max_fit_steps) {
      throw Error(ErrorKind::numeric, fmt::format("the circle fit did not converge in {} steps", max_fit_steps));
    }
  }
  CircleFit fit;
  fit.centre_mm = mean + circle.head<2>();
  fit.radius_mm = circle[2];
  double least = std::numeric_limits<double>::infinity();
  double largest = -least;
  for (const Vector2d& point : points_mm) {
    const double residual = (point - fit.centre_mm).norm() - fit.radius_mm;
    least = std::min(least, residual);
    largest = std::max(largest, residual);
  }
  fit.form_mm = largest - least;
  fit.rms_mm = std::sqrt(normal.sum_of_squares / static_cast<double>(points_mm.size()));
  return fit;
}

}  // namespace shapegcode
