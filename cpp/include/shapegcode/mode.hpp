#pragma once

#include <complex>

namespace shapegcode {

/// One vibration mode of one axis, base-excited by the axis command.
struct Mode {
  double frequency_hz = 0.0;   ///< undamped natural frequency
  double damping_ratio = 0.0;  ///< 0 <= zeta < 1
  double participation = 1.0;  ///< share of this mode's relative deflection in the response
};

/// Pole s = -zeta*omega + j*omega*sqrt(1-zeta^2) in rad/s. Throws Error(argument) if frequency or damping is not
/// finite, frequency <= 0 or damping outside [0, 1).
[[nodiscard]] std::complex<double> pole(const Mode& mode);

}  // namespace shapegcode
