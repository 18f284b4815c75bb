#pragma once

#include <Eigen/Core>

#include "shapegcode/samples.hpp"

namespace shapegcode::siemens {

/// The programmable frame: where programmed coordinates lie in those of the work offset. A coordinate that is not known
/// is NaN, and counts only where it is needed. Frames: easymanua.ls 662598 p. 56 and 1265481 p. 309.
class Frame {
 public:
  Frame() = default;
  Frame(const Eigen::Matrix3d& linear, const Vector3& offset);

  [[nodiscard]] const Eigen::Matrix3d& linear() const { return linear_; }
  [[nodiscard]] const Vector3& offset() const { return offset_; }
  /// Whether it moves, and neither turns nor scales.
  [[nodiscard]] bool is_shift() const { return is_shift_; }

  /// Both, the other one in the coordinates of this one (ATRANS, AROT ...).
  [[nodiscard]] Frame then(const Frame& other) const;
  /// In the coordinates of the work offset.
  [[nodiscard]] Vector3 apply(const Vector3& point) const;
  /// The inverse.
  [[nodiscard]] Vector3 undo(const Vector3& point) const;

 private:
  Eigen::Matrix3d linear_ = Eigen::Matrix3d::Identity();
  Eigen::Matrix3d inverse_ = Eigen::Matrix3d::Identity();
  Vector3 offset_ = Vector3::Zero();
  bool is_shift_ = true;
};

}  // namespace shapegcode::siemens
