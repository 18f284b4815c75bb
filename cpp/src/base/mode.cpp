#include "shapegcode/mode.hpp"

#include <cmath>
#include <numbers>

#include "base/refuse.hpp"

namespace shapegcode {

std::complex<double> pole(const Mode& mode) {
  if (!std::isfinite(mode.frequency_hz) || !(mode.frequency_hz > 0.0)) {
    detail::refuse("mode frequency {} Hz, must be finite and above 0", mode.frequency_hz);
  }
  if (!(mode.damping_ratio >= 0.0 && mode.damping_ratio < 1.0)) {
    detail::refuse("mode at {} Hz has damping ratio {}, must be at least 0 and below 1", mode.frequency_hz,
                   mode.damping_ratio);
  }
  const double omega = 2.0 * std::numbers::pi * mode.frequency_hz;
  const double zeta = mode.damping_ratio;
  return {-zeta * omega, omega * std::sqrt((1.0 - zeta) * (1.0 + zeta))};
}

}  // namespace shapegcode
