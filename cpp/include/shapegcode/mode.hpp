#pragma once

#include <array>
#include <complex>

namespace shapegcode {

/// One vibration mode that moves one axis, base-excited by the command of that axis or of others.
struct Mode {
  double frequency_hz = 0.0;   ///< undamped natural frequency
  double damping_ratio = 0.0;  ///< 0 <= zeta < 1
  double participation = 1.0;  ///< factor of this mode's relative deflection in the response
  /// Factors of the accelerations of X, Y and Z that excite it; all zero: the axis which it moves, with factor one.
  std::array<double, 3> excited_by{};

  /// Whether `excited_by` states the exciting axes.
  [[nodiscard]] constexpr bool crosses() const noexcept {
    return excited_by[0] != 0.0 || excited_by[1] != 0.0 || excited_by[2] != 0.0;
  }
};

/// Pole s = -zeta*omega + j*omega*sqrt(1-zeta^2) in rad/s. Throws Error(argument) if frequency or damping is not
/// finite, frequency <= 0 or damping outside [0, 1).
[[nodiscard]] std::complex<double> pole(const Mode& mode);

}  // namespace shapegcode
