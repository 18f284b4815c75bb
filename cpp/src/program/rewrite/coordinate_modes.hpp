// Private: scaling G51, mirror G51.1 and rotation G68 as one map from programmed to work coordinates.
#pragma once

#include <array>

#include "shapegcode/path.hpp"

namespace shapegcode::detail {

/// The control's order: mirror, then scaling, then rotation.
struct CoordinateModes {
  std::array<bool, axis_count> mirror = {false, false, false};
  Vector3 mirror_at = Vector3::Zero();
  bool scaling = false;
  Vector3 scale_centre = Vector3::Zero();
  Vector3 scale = Vector3::Ones();
  bool rotation = false;
  int rotation_normal = 2;
  Vector3 rotation_centre = Vector3::Zero();  ///< behind mirror and scaling
  double rotation_rad = 0.0;

  [[nodiscard]] bool active() const noexcept { return rotation || scaling || mirror[0] || mirror[1] || mirror[2]; }
  /// Whether the coordinate of an axis is changed, alone or together with another.
  [[nodiscard]] bool acts_on(int axis) const noexcept;
  /// Whether the axis is mixed with another one.
  [[nodiscard]] bool mixes(int axis) const noexcept { return rotation && axis != rotation_normal; }
  [[nodiscard]] Vector3 apply(const Vector3& programmed) const noexcept {
    return rotate(scaled_and_mirrored(programmed), 1.0);
  }
  [[nodiscard]] Vector3 undo(const Vector3& work) const noexcept;
  /// Mirror and scaling alone.
  [[nodiscard]] Vector3 scaled_and_mirrored(const Vector3& programmed) const noexcept;
  /// Factor of a length along an axis, signed, without the rotation.
  [[nodiscard]] double factor(int axis) const noexcept;
  /// Whether the sense of turning in a plane is reversed.
  [[nodiscard]] bool flips(int normal) const noexcept;
  /// A programmed segment in work coordinates. Throws Error(program) where an arc would become an ellipse.
  [[nodiscard]] Segment apply(const Segment& programmed, std::uint32_t line) const;

 private:
  [[nodiscard]] Vector3 rotate(const Vector3& point, double sense) const noexcept;
};

}  // namespace shapegcode::detail
