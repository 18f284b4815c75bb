#pragma once

#include <array>
#include <complex>
#include <cstddef>
#include <optional>

#include "shapegcode/samples.hpp"

// Lines, arcs and helices of other controls' programs: by centre, radius, opening angle, intermediate point, tangent.
// In their plane points are complex numbers. Lengths in mm, angles in rad unless a name says degrees. What is no arc
// throws an Error without a line. Sources for a SINUMERIK: CR= easymanua.ls 1265481 p. 192; CIP, CT and the pole as
// centre 592300 pp. 156 and 157; AR= and TURN= 662598 p. 78.
namespace shapegcode::dialect {

using Complex = std::complex<double>;

/// First and second axis of a plane, and the axis perpendicular to it.
struct PlaneAxes {
  std::size_t first = 0;
  std::size_t second = 1;
  std::size_t normal = 2;
};

/// Of G17, G18, G19: `plane` is 17, 18 or 19.
[[nodiscard]] constexpr PlaneAxes axes_of(int plane) {
  constexpr std::array<PlaneAxes, 3> all = {{{0, 1, 2}, {2, 0, 1}, {1, 2, 0}}};
  return all[static_cast<std::size_t>(plane - 17)];
}

/// A point in its plane.
[[nodiscard]] Complex in_plane(const Vector3& point, int plane);

/// A point that is moved in its plane.
[[nodiscard]] Vector3 moved_to(Vector3 point, int plane, Complex to);

/// Sweep of an arc, turn = 1 counter-clockwise, -1 clockwise; a whole circle where start and end are one.
[[nodiscard]] double sweep_of(Complex start, Complex end, Complex centre, int turn);

/// Centre of an arc by its radius, negative: of more than half a turn.
[[nodiscard]] Complex centre_by_radius(Complex start, Complex end, double radius, int turn);

/// A line, an arc or a helix.
struct PathElement {
  Vector3 start = Vector3::Zero();
  Vector3 end = Vector3::Zero();
  std::optional<Vector3> centre;  ///< of an arc; none: a line
  int plane = 17;                 ///< 17, 18 or 19
  double sweep_rad = 0.0;         ///< of an arc, counter-clockwise positive, seen against the axis perpendicular to it

  /// Along the path, with the motion perpendicular to the plane.
  [[nodiscard]] double length_mm() const;
  /// The point after this share of its length.
  [[nodiscard]] Vector3 point_at(double share) const;
  /// The part between two shares of its length.
  [[nodiscard]] PathElement part(double begin, double end_share) const;
  /// Unit vector along the path; zeros where it has no length.
  [[nodiscard]] Vector3 direction_at(double share) const;
};

[[nodiscard]] PathElement arc_by_centre(const Vector3& start, const Vector3& end, Complex centre, int plane, int turn,
                                        double tolerance_mm);
/// By its radius, negative: of more than half a turn.
[[nodiscard]] PathElement arc_by_radius(const Vector3& start, const Vector3& end, double radius, int plane, int turn,
                                        double tolerance_mm);
/// By its end and its opening angle, AR=.
[[nodiscard]] PathElement arc_by_angle(const Vector3& start, const Vector3& end, double angle_deg, int plane, int turn);
/// From start to end through a point between them.
[[nodiscard]] PathElement arc_through(const Vector3& start, const Vector3& middle, const Vector3& end);
/// The arc to an end that goes on in the direction of the path before it; a line where it leads straight on.
[[nodiscard]] PathElement tangential_arc(const Vector3& start, const Vector3& end, const Vector3& direction, int plane);

}  // namespace shapegcode::dialect
