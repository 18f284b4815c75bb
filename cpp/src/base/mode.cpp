#include "shapegcode/mode.hpp"

#include <cmath>
#include <numbers>
#include <sstream>

#include "shapegcode/error.hpp"

namespace shapegcode {

std::complex<double> pole(const Mode& mode) {
  if (!std::isfinite(mode.frequency_hz) || !(mode.frequency_hz > 0.0)) {
    std::ostringstream message;
    message << "mode frequency " << mode.frequency_hz << " Hz, must be finite and above 0";
    throw Error(ErrorKind::argument, message.str());
  }
  if (!(mode.damping_ratio >= 0.0 && mode.damping_ratio < 1.0)) {
    std::ostringstream message;
    message << "mode at " << mode.frequency_hz << " Hz has damping ratio " << mode.damping_ratio
            << ", must be at least 0 and below 1";
    throw Error(ErrorKind::argument, message.str());
  }
  const double omega = 2.0 * std::numbers::pi * mode.frequency_hz;
  const double zeta = mode.damping_ratio;
  return {-zeta * omega, omega * std::sqrt((1.0 - zeta) * (1.0 + zeta))};
}

}  // namespace shapegcode
