#include "shapegcode/plant/modal.hpp"

#include <cmath>
#include <complex>

namespace shapegcode {

ModeTransition mode_transition(const Mode& mode, double time_s) {
  const std::complex<double> s = pole(mode);
  const double decay = std::exp(s.real() * time_s);
  const double cosine = decay * std::cos(s.imag() * time_s);
  const double sine = decay * std::sin(s.imag() * time_s) / s.imag();
  return {cosine - s.real() * sine, sine, -std::norm(s) * sine, cosine + s.real() * sine};
}

}  // namespace shapegcode
