// Private to milling: a step of the tool, from which grid and closed form measure distances.
#pragma once

#include <Eigen/Core>
#include <algorithm>
#include <cmath>

namespace shapegcode {

/// A short travel of the tool's axis in the XY plane, a line or an arc of less than half a turn, and the distance from
/// it. A line is an arc without curvature; coordinates count from the start, so that large arcs lose no digits.
class ToolStep {
 public:
  /// `curvature_per_mm` > 0 turns left, < 0 right, 0 is a line. Start and end may be the same point.
  ToolStep(const Eigen::Vector2d& from, const Eigen::Vector2d& to, double curvature_per_mm = 0.0)
      : from_(from), chord_(to - from), curvature_(curvature_per_mm) {
    const double length = chord_.norm();
    if (length > 0.0) {
      const Eigen::Vector2d along = chord_ / length;
      const double sine = std::clamp(0.5 * length * curvature_, -1.0, 1.0);
      const double cosine = std::sqrt(1.0 - sine * sine);
      const Eigen::Vector2d left(-along.y(), along.x());
      start_tangent_ = cosine * along - sine * left;
      end_tangent_ = cosine * along + sine * left;
    } else {
      curvature_ = 0.0;  // a line across the X axis without length: beside it only where this is the distance, too
      start_tangent_ = end_tangent_ = Eigen::Vector2d::UnitX();
    }
  }

  [[nodiscard]] const Eigen::Vector2d& from() const noexcept { return from_; }
  [[nodiscard]] const Eigen::Vector2d& chord() const noexcept { return chord_; }
  [[nodiscard]] double curvature() const noexcept { return curvature_; }
  [[nodiscard]] const Eigen::Vector2d& start_tangent() const noexcept { return start_tangent_; }

  /// What the distance is made of at a point (x, y) from the start. Beside the arc (weight 1) it is
  /// |offset / (1 + sqrt(square))|, where `square` is the squared ratio of the point's distance from the arc's centre
  /// to its radius; elsewhere (weight 0) it is the root of `end`, the squared distance of the nearer end. In between,
  /// for 1 nm, both are the same. A weight instead of a choice keeps rows of a grid free of branches.
  template <typename Scalar>
  struct Parts {
    Scalar offset;
    Scalar square;
    Scalar end;
    Scalar beside;

    /// The squared distance; `root` is that of `square`, 1 on a line.
    [[nodiscard]] Scalar squared(Scalar root) const noexcept {
      const Scalar aside = offset / (Scalar(1) + root);
      return end + beside * (aside * aside - end);
    }
  };

  /// The constants of a step as the kernels want them: double for single points, float for rows of a grid.
  template <typename Scalar>
  struct Shape {
    explicit Shape(const ToolStep& step)
        : curvature(static_cast<Scalar>(step.curvature_)),
          t0x(static_cast<Scalar>(step.start_tangent_.x())),
          t0y(static_cast<Scalar>(step.start_tangent_.y())),
          t1x(static_cast<Scalar>(step.end_tangent_.x())),
          t1y(static_cast<Scalar>(step.end_tangent_.y())),
          cx(static_cast<Scalar>(step.chord_.x())),
          cy(static_cast<Scalar>(step.chord_.y())) {}

    [[nodiscard]] Parts<Scalar> parts(Scalar x, Scalar y) const noexcept {
      const Scalar squared = x * x + y * y;
      const Scalar ex = x - cx;
      const Scalar ey = y - cy;
      const Scalar offset = curvature * squared - Scalar(2) * (y * t0x - x * t0y);
      const Scalar square = std::abs(Scalar(1) + curvature * offset);  // below 0 by rounding only
      const Scalar end = std::min(squared, ex * ex + ey * ey);
      const Scalar within = std::min(x * t0x + y * t0y, -(ex * t1x + ey * t1y));  // mm from the nearer end's normal
      const Scalar beside = std::min(std::max(within * Scalar(1e6), Scalar(0)), Scalar(1));
      return {offset, square, end, beside};
    }

    Scalar curvature, t0x, t0y, t1x, t1y, cx, cy;
  };

  /// Distance of a point from the step, mm.
  [[nodiscard]] double distance_mm(const Eigen::Vector2d& point) const noexcept {
    const Eigen::Vector2d v = point - from_;
    const Parts<double> p = Shape<double>(*this).parts(v.x(), v.y());
    return std::sqrt(p.squared(std::sqrt(p.square)));
  }

 private:
  Eigen::Vector2d from_;
  Eigen::Vector2d chord_;
  double curvature_;
  Eigen::Vector2d start_tangent_;
  Eigen::Vector2d end_tangent_;
};

}  // namespace shapegcode
