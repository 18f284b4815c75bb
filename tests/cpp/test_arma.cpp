#include <doctest/doctest.h>

#include <algorithm>
#include <cmath>
#include <complex>
#include <numbers>
#include <span>
#include <vector>

#include "shapegcode/error.hpp"
#include "shapegcode/identify/arma.hpp"

using shapegcode::Arma;
using shapegcode::Error;
using shapegcode::NaturalModes;
using Complex = std::complex<double>;

namespace {

/// Decaying cosine of amplitude 1.
std::vector<double> decay(double omega, double zeta, double phase, double period_s, int n) {
  std::vector<double> values;
  for (int k = 0; k < n; ++k) {
    const double t = k * period_s;
    values.push_back(std::exp(-zeta * omega * t) * std::cos(omega * std::sqrt(1.0 - zeta * zeta) * t + phase));
  }
  return values;
}

/// y = B/A u by its definition.
std::vector<double> filtered(const std::vector<double>& b, const std::vector<double>& phi,
                             const std::vector<double>& u) {
  std::vector<double> y(u.size(), 0.0);
  for (std::size_t k = 0; k < u.size(); ++k) {
    for (std::size_t j = 0; j < b.size() && j <= k; ++j) y[k] += b[j] * u[k - j];
    for (std::size_t i = 0; i < phi.size() && i < k; ++i) y[k] += phi[i] * y[k - 1 - i];
  }
  return y;
}

/// Force of a tap: half a sine, then nothing.
std::vector<double> tap(int start, int width, int n) {
  std::vector<double> force(static_cast<std::size_t>(n), 0.0);
  for (int k = 1; k < width; ++k) force[static_cast<std::size_t>(start + k)] = std::sin(std::numbers::pi * k / width);
  return force;
}

constexpr double omega = 300.0, zeta = 0.04, period_s = 5e-4;

}  // namespace

TEST_CASE("arma: modes of poles are those the poles were made of") {
  const Complex s(-zeta * omega, omega * std::sqrt(1.0 - zeta * zeta));
  const Complex fast(-50.0, 4000.0);
  const std::vector<Complex> poles{std::exp(fast * period_s),
                                   std::conj(std::exp(fast * period_s)),
                                   std::exp(s * period_s),
                                   std::conj(std::exp(s * period_s)),
                                   0.9,           // real: no mode
                                   -0.9,          // at Nyquist: none
                                   {0.0, 1.0},    // undamped: none
                                   {0.0, 1.01}};  // unstable: none
  const NaturalModes modes = shapegcode::poles_to_modes(poles, period_s);
  REQUIRE(modes.omega_rad_s.size() == 2);
  CHECK(modes.omega_rad_s[0] == doctest::Approx(omega).epsilon(1e-12));
  CHECK(modes.damping_ratio[0] == doctest::Approx(zeta).epsilon(1e-12));
  CHECK(modes.omega_rad_s[1] == doctest::Approx(std::abs(fast)).epsilon(1e-12));
  CHECK(modes.damping_ratio[1] == doctest::Approx(50.0 / std::abs(fast)).epsilon(1e-12));
  CHECK_THROWS_AS((void)shapegcode::poles_to_modes(poles, 0.0), Error);
}

TEST_CASE("arma: decays give the poles they were made with, jointly") {
  const double radius = std::exp(-zeta * omega * period_s);
  const double angle = omega * std::sqrt(1.0 - zeta * zeta) * period_s;
  const auto first = decay(omega, zeta, 0.3, period_s, 400);
  const auto second = decay(omega, zeta, -1.2, period_s, 300);
  const std::vector<std::span<const double>> records{first, second};
  for (const bool plain : {false, true}) {
    const Arma arma = shapegcode::arma_decay(records, 1, plain);
    CHECK(arma.converged);
    CHECK(arma.phi[0] == doctest::Approx(2.0 * radius * std::cos(angle)).epsilon(1e-11));
    CHECK(arma.phi[1] == doctest::Approx(-radius * radius).epsilon(1e-11));
    REQUIRE(arma.numerator.rows() == 2);
    // The first two samples as the numerator makes them: y0 = b0, y1 = b1 + phi1 y0.
    CHECK(arma.numerator(1, 0) == doctest::Approx(second[0]));
    CHECK(arma.numerator(1, 1) == doctest::Approx(second[1] - arma.phi[0] * second[0]));
    CHECK(arma.theta(0, 0) == doctest::Approx(-arma.numerator(0, 1) / arma.numerator(0, 0)));
    CHECK(arma.residual_rms[0] < 1e-10);
  }
}

TEST_CASE("arma: a driven filter is found again, and only the iterated squares bear noise") {
  const NaturalModes modes{{300.0, 900.0}, {0.04, 0.02}};
  std::vector<double> phi{0.0, 0.0, 0.0, 0.0};
  std::vector<double> a{1.0};
  for (std::size_t m = 0; m < 2; ++m) {
    const double radius = std::exp(-modes.damping_ratio[m] * modes.omega_rad_s[m] * period_s);
    const double angle =
        modes.omega_rad_s[m] * std::sqrt(1.0 - modes.damping_ratio[m] * modes.damping_ratio[m]) * period_s;
    const std::vector<double> factor{1.0, -2.0 * radius * std::cos(angle), radius * radius};
    std::vector<double> product(a.size() + 2, 0.0);
    for (std::size_t i = 0; i < a.size(); ++i) {
      for (std::size_t j = 0; j < 3; ++j) product[i + j] += a[i] * factor[j];
    }
    a = product;
  }
  for (std::size_t i = 0; i < 4; ++i) phi[i] = -a[i + 1];
  const std::vector<double> b{0.2, -0.3, 0.25, -0.3, 0.15};
  const auto force = tap(5, 8, 1500);
  auto response = filtered(b, phi, force);
  const std::vector<shapegcode::TapSignals> taps{{force, response}};
  const Arma exact = shapegcode::arma_driven(taps, 2);
  for (Eigen::Index i = 0; i < 4; ++i) {
    CHECK(exact.phi[i] == doctest::Approx(phi[static_cast<std::size_t>(i)]).epsilon(1e-7));
  }
  for (Eigen::Index j = 0; j < 5; ++j) {
    CHECK(std::abs(exact.numerator(0, j) - b[static_cast<std::size_t>(j)]) < 1e-6);
  }

  unsigned state = 12345;
  for (double& value : response) {
    double sum = 0.0;  // twelve uniform numbers: nearly normal
    for (int i = 0; i < 12; ++i) {
      state = state * 1664525U + 1013904223U;
      sum += static_cast<double>(state >> 8U) / 16777216.0 - 0.5;
    }
    value += 0.01 * sum;
  }
  const std::vector<shapegcode::TapSignals> noisy{{force, response}};
  const NaturalModes found = shapegcode::poles_to_modes(shapegcode::arma_driven(noisy, 2).poles, period_s);
  REQUIRE(found.omega_rad_s.size() == 2);
  const NaturalModes plain = shapegcode::poles_to_modes(shapegcode::arma_driven(noisy, 2, true).poles, period_s);
  for (std::size_t m = 0; m < 2; ++m) {
    CHECK(found.omega_rad_s[m] == doctest::Approx(modes.omega_rad_s[m]).epsilon(2e-3));
    CHECK(found.damping_ratio[m] == doctest::Approx(modes.damping_ratio[m]).epsilon(0.05));
  }
  const bool plain_is_good = plain.omega_rad_s.size() == 2 && std::abs(plain.damping_ratio[0] / 0.04 - 1.0) < 0.05;
  CHECK_FALSE(plain_is_good);
}

TEST_CASE("arma: poles of every order of the chart, with delays of one sample and of several") {
  for (const double step_s : {5e-4, 2e-5}) {
    auto sum = decay(omega, zeta, 0.3, step_s, 4000);
    const auto other = decay(2.5 * omega, 0.02, 0.0, step_s, 4000);
    for (std::size_t k = 0; k < sum.size(); ++k) sum[k] += 0.5 * other[k];
    const std::vector<std::span<const double>> records{sum};
    const auto poles = shapegcode::stabilisation_poles(records, 4);
    REQUIRE(poles.size() == 4);
    for (std::size_t n = 0; n < 4; ++n) CHECK(poles[n].size() == 2 * (n + 1));
    const NaturalModes modes = shapegcode::poles_to_modes(poles[1], step_s);
    REQUIRE(modes.omega_rad_s.size() == 2);
    CHECK(modes.omega_rad_s[0] == doctest::Approx(omega).epsilon(0.02));
    CHECK(modes.omega_rad_s[1] == doctest::Approx(2.5 * omega).epsilon(0.02));
  }
}

TEST_CASE("arma: refusals") {
  const auto force = tap(5, 8, 100);
  const std::vector<double> none(100, 0.0);
  const std::vector<double> shorter(99, 0.0);
  auto holed = force;
  holed[3] = std::nan("");
  using Taps = std::vector<shapegcode::TapSignals>;
  CHECK_THROWS_AS((void)shapegcode::arma_driven(Taps{}, 1), Error);
  CHECK_THROWS_AS((void)shapegcode::arma_driven(Taps{{none, force}}, 1), Error);
  CHECK_THROWS_AS((void)shapegcode::arma_driven(Taps{{force, shorter}}, 1), Error);
  CHECK_THROWS_AS((void)shapegcode::arma_driven(Taps{{force, holed}}, 1), Error);
  CHECK_THROWS_AS((void)shapegcode::arma_driven(Taps{{force, force}}, 0), Error);
  CHECK_THROWS_AS((void)shapegcode::arma_driven(Taps{{force, force}}, 51), Error);
  CHECK_THROWS_AS((void)shapegcode::stabilisation_poles(Taps{{force, force}}, 12), Error);
}
