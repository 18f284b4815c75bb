#pragma once

#include <array>
#include <cmath>
#include <complex>

// A mode as one complex state: z' = s z + f with the pole s = -zeta omega + j omega_d gives the displacement
// Im(z)/omega_d, the velocity Im(s z)/omega_d and the acceleration Im(s^2 z)/omega_d + f of x'' + 2 zeta omega x' +
// omega^2 x = f. With the force linear between samples the state goes from sample to sample by
// z+ = advance z + now f + next f+, and w = dz/ds by the derivatives of these three.

namespace shapegcode::identification {

struct OnePole {
  std::complex<double> advance, now, next;
  std::complex<double> d_advance, d_now, d_next;  // d/ds
};

/// phi_1 = (e^x - 1)/x, phi_2 = (e^x - 1 - x)/x^2 and their derivatives.
[[nodiscard]] inline std::array<std::complex<double>, 4> phi_functions(std::complex<double> x) {
  if (std::abs(x) < 1.0) {
    std::complex<double> power = 1.0;  // x^j/(j+1)!
    std::complex<double> first, second, d_first, d_second;
    for (int j = 0; j < 22; ++j) {
      const std::complex<double> next_power = power / (j + 2.0);
      first += power;
      second += next_power;
      // d/dx of x^(j+1)/(j+2)! and x^(j+1)/(j+3)!
      d_first += (j + 1.0) * next_power;
      d_second += (j + 1.0) * next_power / (j + 3.0);
      power = next_power * x;
    }
    return {first, second, d_first, d_second};
  }
  const std::complex<double> e = std::exp(x);
  const std::complex<double> first = (e - 1.0) / x;
  const std::complex<double> second = (first - 1.0) / x;
  return {first, second, (e - first) / x, ((e - first) / x - second) / x};
}

/// Transition over `period_s` of the pole `s` (rad/s).
[[nodiscard]] inline OnePole one_pole(std::complex<double> s, double period_s) {
  const auto [first, second, d_first, d_second] = phi_functions(s * period_s);
  const std::complex<double> advance = std::exp(s * period_s);
  return {advance,
          period_s * (first - second),
          period_s * second,
          period_s * advance,
          period_s * period_s * (d_first - d_second),
          period_s * period_s * d_second};
}

/// Pole of a mode, and what the response takes of its state: Im(take * z), and how these change with ln omega, ln zeta.
struct ModeTerms {
  std::complex<double> pole, take;
  std::array<std::complex<double>, 2> d_pole, d_take;
};

/// `order`: 0 displacement, 1 velocity, 2 acceleration (to which the force itself is added).
[[nodiscard]] inline ModeTerms mode_terms(double omega, double zeta, int order) {
  const double root = std::sqrt(1.0 - zeta * zeta);
  const double damped = omega * root;
  const std::complex<double> s(-zeta * omega, damped);
  const std::complex<double> power = order == 0 ? 1.0 : (order == 1 ? s : s * s);
  const std::complex<double> d_power = order == 0 ? 0.0 : (order == 1 ? 1.0 : 2.0 * s);
  ModeTerms terms{s, power / damped, {s, {-zeta * omega, -zeta * zeta * omega / root}}, {}};
  const std::array<double, 2> d_damped{damped, -omega * zeta * zeta / root};
  for (std::size_t p = 0; p < 2; ++p) {
    terms.d_take[p] = d_power * terms.d_pole[p] / damped - power * d_damped[p] / (damped * damped);
  }
  return terms;
}

}  // namespace shapegcode::identification
