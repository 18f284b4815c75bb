#pragma once

#include <Eigen/Core>
#include <cmath>
#include <optional>
#include <vector>

#include "shapegcode/path.hpp"

// Lines and circles in the plane perpendicular to one axis, for cutter compensation and corner words. Lengths in mm,
// angles in rad; "left" is seen from the positive side of the normal axis.
namespace shapegcode::plane {

inline constexpr double pi = std::numbers::pi;
/// Programmed blocks that do not join by more than this are no path.
inline constexpr double join_mm = 1e-6;

using Vector2 = Eigen::Vector2d;

/// Under this two points are one: far under any least increment, far over double rounding.
inline constexpr double coincident_mm = 1e-7;
/// Curves that miss each other by no more than this touch.
inline constexpr double touch_mm = 1e-6;

/// Components of `p` in the plane: axes normal+1, normal+2.
[[nodiscard]] Vector2 in_plane(const Vector3& p, int normal);
/// The point of the plane at `p` whose height on the normal axis is that of `height`.
[[nodiscard]] Vector3 in_space(const Vector2& p, const Vector3& height, int normal);

[[nodiscard]] inline Vector2 left_of(const Vector2& direction) { return {-direction.y(), direction.x()}; }
[[nodiscard]] inline double cross(const Vector2& a, const Vector2& b) { return a.x() * b.y() - a.y() * b.x(); }
[[nodiscard]] inline double angle_of(const Vector2& v) { return std::atan2(v.y(), v.x()); }

/// A block seen in the plane.
struct Curve {
  bool arc = false;
  Vector2 start = Vector2::Zero();
  Vector2 end = Vector2::Zero();
  Vector2 start_direction = Vector2::Zero();  ///< unit tangents, zero without motion in the plane
  Vector2 end_direction = Vector2::Zero();
  Vector2 centre = Vector2::Zero();
  double start_radius_mm = 0.0;
  double end_radius_mm = 0.0;
  double sweep_rad = 0.0;  ///< positive turns left
  double length_mm = 0.0;  ///< in the plane

  [[nodiscard]] bool moves() const { return length_mm > coincident_mm; }
  [[nodiscard]] double sense() const { return sweep_rad < 0.0 ? -1.0 : 1.0; }
};

/// `segment` in the plane across `normal`; an arc must turn about that axis.
[[nodiscard]] Curve curve_of(const Segment& segment, int normal);

/// The unbounded line or circle that runs at `left_mm` to the left of one end of a block.
struct Locus {
  bool circle = false;
  Vector2 anchor = Vector2::Zero();     ///< its point across the block's end
  Vector2 direction = Vector2::Zero();  ///< unit tangent at the anchor, in the sense of the block
  Vector2 centre = Vector2::Zero();     ///< circle only
  double radius_mm = 0.0;               ///< circle only; negative where the offset passes the centre
  double sense = 1.0;                   ///< circle only: -1 clockwise

  /// Signed curvature 1/mm, positive to the left.
  [[nodiscard]] double curvature() const { return circle ? sense / radius_mm : 0.0; }
};
[[nodiscard]] Locus offset_at_end(const Curve& curve, double left_mm);
[[nodiscard]] Locus offset_at_start(const Curve& curve, double left_mm);

/// Points common to two loci: none, one (touching) or two.
[[nodiscard]] std::vector<Vector2> intersections(const Locus& a, const Locus& b);

/// Travel from the anchor to `p` along the locus, in mm on a line and in rad on a circle, forwards (`sense` +1) or
/// backwards (-1). On a circle the angle lies in [0, 2 pi), but a hair behind the anchor is a hair below zero.
[[nodiscard]] double travel(const Locus& locus, const Vector2& p, double sense);

/// Where two offset curves cross inside a corner.
struct Crossing {
  Vector2 point = Vector2::Zero();
  double before = 0.0;  ///< travel back from the anchor of the first curve: mm on a line, rad on a circle
  double after = 0.0;   ///< travel on from the anchor of the second
};

/// The crossing reached first from the corner, back along `a` and on along `b`; none if the curves do not meet.
[[nodiscard]] std::optional<Crossing> inner_crossing(const Locus& a, const Locus& b);

/// Angle by which the direction turns at the corner, in (-pi, pi], positive to the left.
[[nodiscard]] double turn_at(const Curve& a, const Curve& b);

}  // namespace shapegcode::plane
