#include <doctest/doctest.h>

#include <cmath>
#include <numbers>
#include <span>
#include <vector>

#include "shapegcode/error.hpp"
#include "shapegcode/identify/modal_fit.hpp"

using shapegcode::DecayFit;

namespace {

constexpr double period_s = 1e-3;
constexpr double two_pi = 2.0 * std::numbers::pi;

double cosine(double frequency_hz, double zeta, double amplitude, double phase, double t) {
  const double omega = two_pi * frequency_hz;
  return amplitude * std::exp(-zeta * omega * t) * std::cos(omega * std::sqrt(1.0 - zeta * zeta) * t + phase);
}

}  // namespace

TEST_CASE("decay fit: a rapid stop with 46 and 131 Hz, two records") {
  std::vector<double> first;
  std::vector<double> second;
  for (int k = 0; k < 800; ++k) {
    const double t = k * period_s;
    first.push_back(cosine(46.0, 0.03, 2.0, 0.5, t) + cosine(131.0, 0.02, 0.6, -1.0, t) + 0.1);
    second.push_back(cosine(46.0, 0.03, 1.0, 2.5, t) + cosine(131.0, 0.02, 0.9, 0.2, t) - 0.2);
  }
  const std::vector<std::span<const double>> records{first, second};
  const shapegcode::NaturalModes start{{two_pi * 45.0, two_pi * 133.0}, {0.05, 0.01}};
  const DecayFit fit = shapegcode::fit_decay(records, period_s, start, {});
  CHECK(fit.quality.converged);
  CHECK(fit.omega_rad_s[0] == doctest::Approx(two_pi * 46.0).epsilon(1e-9));
  CHECK(fit.omega_rad_s[1] == doctest::Approx(two_pi * 131.0).epsilon(1e-9));
  CHECK(fit.damping_ratio[0] == doctest::Approx(0.03).epsilon(1e-9));
  CHECK(fit.damping_ratio[1] == doctest::Approx(0.02).epsilon(1e-9));
  CHECK(fit.amplitude(0, 0) == doctest::Approx(2.0));
  CHECK(fit.amplitude(1, 1) == doctest::Approx(0.9));
  CHECK(fit.phase_rad(1, 0) == doctest::Approx(2.5));
  CHECK(fit.phase_rad(0, 1) == doctest::Approx(-1.0));
  CHECK(fit.offset[0] == doctest::Approx(0.1));
  CHECK(fit.offset[1] == doctest::Approx(-0.2));
  CHECK(fit.quality.parameters == 14);
  CHECK(fit.covariance.rows() == 4);
  const std::vector<std::span<const double>> short_records{std::span(first).first(6)};
  CHECK_THROWS_AS((void)shapegcode::fit_decay(short_records, period_s, start, {}), shapegcode::Error);
}
