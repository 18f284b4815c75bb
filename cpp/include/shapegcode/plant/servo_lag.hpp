#pragma once

#include <algorithm>
#include <cstdint>
#include <span>

#include "shapegcode/samples.hpp"

namespace shapegcode {

/// Position loop of each axis as a first-order lag with feed-forward: x' = K (r - x) + a r', gain K in 1/s,
/// feed-forward ratio a. Its error on a circle is (1 - a^2) / K^2 v^2 / (2 r). Exact for set-points joined by straight
/// lines.
class ServoLag {
 public:
  /// At rest at zero. Throws Error(argument) on a period or gain <= 0 or a ratio outside 0 ... 1.
  ServoLag(const Vector3& position_gain_per_s, const Vector3& feed_forward_ratio, double period_s);
  /// Rest at `position`.
  void reset(const Vector3& position) noexcept;
  /// Shifts set-point and position together: a change of coordinates.
  void shift(const Vector3& by_mm) noexcept { setpoint_ += by_mm; }
  /// Next set-point in, position of the axes at that instant out: X, Y and Z.
  void step(std::span<const double> in, std::span<double> out) noexcept {
    const Vector3 position = step(Vector3(in[0], in[1], in[2]));
    std::copy_n(position.data(), axis_count, out.begin());
  }
  Vector3 step(const Vector3& setpoint) noexcept;
  /// Set-point minus position, as of the last step.
  [[nodiscard]] const Vector3& error_mm() const noexcept { return error_mm_; }

 private:
  Vector3 decay_;  // of the error in one period
  Vector3 share_;  // part of an increment that becomes error
  Vector3 setpoint_ = Vector3::Zero();
  Vector3 error_mm_ = Vector3::Zero();
  std::int64_t row_ = 0;  // set-points since reset()
};

}  // namespace shapegcode
