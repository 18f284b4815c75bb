// Private: the axes of an arc's plane, and computations with them.
#pragma once

#include <cmath>

#include "shapegcode/samples.hpp"

namespace shapegcode {

/// The plane across the axis `normal`: seen from its positive end, `a` turns towards `b` by a positive angle (X to Y
/// about Z, Y to Z about X, Z to X about Y).
struct ArcFrame {
  int normal;
  int a;
  int b;

  constexpr explicit ArcFrame(int normal_axis) noexcept
      : normal(normal_axis), a((normal_axis + 1) % 3), b((normal_axis + 2) % 3) {}

  /// The two coordinates in the plane.
  [[nodiscard]] Eigen::Vector2d project(const Vector3& p) const noexcept { return {p[a], p[b]}; }

  /// The point of these two coordinates at the height of `height`.
  [[nodiscard]] Vector3 lift(const Eigen::Vector2d& in_plane, const Vector3& height) const noexcept {
    Vector3 p = height;
    p[a] = in_plane.x();
    p[b] = in_plane.y();
    return p;
  }

  /// From `from` to `to`, in the plane.
  [[nodiscard]] Eigen::Vector2d offset(const Vector3& from, const Vector3& to) const noexcept {
    return {to[a] - from[a], to[b] - from[b]};
  }

  /// Of the point from the centre, in the plane.
  [[nodiscard]] double radius(const Vector3& p, const Vector3& centre) const noexcept {
    return std::hypot(p[a] - centre[a], p[b] - centre[b]);
  }

  /// Where the point stands as seen from the centre, counted from axis `a`.
  [[nodiscard]] double angle_rad(const Vector3& p, const Vector3& centre) const noexcept {
    return std::atan2(p[b] - centre[b], p[a] - centre[a]);
  }

  /// The point of the circle at that angle, in the plane.
  [[nodiscard]] Eigen::Vector2d at_angle(const Vector3& centre, double radius, double angle_rad) const noexcept {
    return {centre[a] + radius * std::cos(angle_rad), centre[b] + radius * std::sin(angle_rad)};
  }

  /// A direction at that angle from its parts: along the circle, outwards, and along the axis.
  [[nodiscard]] Vector3 direction(double angle_rad, double along, double outwards, double up) const noexcept {
    Vector3 direction;
    direction[a] = -along * std::sin(angle_rad) + outwards * std::cos(angle_rad);
    direction[b] = along * std::cos(angle_rad) + outwards * std::sin(angle_rad);
    direction[normal] = up;
    return direction;
  }
};

}  // namespace shapegcode
