#include <doctest/doctest.h>

#include <array>
#include <cmath>
#include <complex>
#include <numbers>
#include <span>
#include <vector>

#include "identify/one_pole.hpp"
#include "shapegcode/error.hpp"
#include "shapegcode/identify/modal_fit.hpp"

using shapegcode::Error;
using shapegcode::ModalFit;
using shapegcode::ModalFitOptions;
using shapegcode::NaturalModes;
using shapegcode::Quantity;
using shapegcode::TapSignals;
using Complex = std::complex<double>;

namespace {

constexpr double period_s = 5e-4;

std::vector<double> tap(int n) {
  std::vector<double> force(static_cast<std::size_t>(n), 0.0);
  for (int k = 1; k < 6; ++k) force[static_cast<std::size_t>(3 + k)] = 200.0 * std::sin(std::numbers::pi * k / 6.0);
  return force;
}

/// State of one mode of 1 kg by Runge-Kutta with many steps per sample: displacement, velocity, acceleration.
std::array<std::vector<double>, 3> integrated(const std::vector<double>& force, double omega, double zeta) {
  constexpr int steps = 40;
  constexpr double h = period_s / steps;
  std::array<std::vector<double>, 3> motion;
  double x = 0.0;
  double v = 0.0;
  const auto rate = [&](double at_x, double at_v, double f) {
    return f - 2.0 * zeta * omega * at_v - omega * omega * at_x;
  };
  for (std::size_t k = 0; k < force.size(); ++k) {
    motion[0].push_back(x);
    motion[1].push_back(v);
    motion[2].push_back(rate(x, v, force[k]));
    if (k + 1 == force.size()) break;
    const double slope = (force[k + 1] - force[k]) / steps;
    for (int i = 0; i < steps; ++i) {
      const double f0 = force[k] + i * slope;
      const double fm = f0 + 0.5 * slope;
      const double f1 = f0 + slope;
      const double k1x = v, k1v = rate(x, v, f0);
      const double k2x = v + 0.5 * h * k1v, k2v = rate(x + 0.5 * h * k1x, v + 0.5 * h * k1v, fm);
      const double k3x = v + 0.5 * h * k2v, k3v = rate(x + 0.5 * h * k2x, v + 0.5 * h * k2v, fm);
      const double k4x = v + h * k3v, k4v = rate(x + h * k3x, v + h * k3v, f1);
      x += h / 6.0 * (k1x + 2.0 * k2x + 2.0 * k3x + k4x);
      v += h / 6.0 * (k1v + 2.0 * k2v + 2.0 * k3v + k4v);
    }
  }
  return motion;
}

}  // namespace

TEST_CASE("modal fit: transitions and their derivatives, by series and in closed form alike") {
  for (const double size : {1e-6, 0.3, 0.999, 1.001, 3.0}) {
    const Complex s = std::polar(size, 1.7) / period_s;
    const auto here = shapegcode::identification::one_pole(s, period_s);
    const Complex step = 1e-5 * s;
    const auto above = shapegcode::identification::one_pole(s + step, period_s);
    const auto below = shapegcode::identification::one_pole(s - step, period_s);
    const auto close = [](Complex value, Complex expected) {
      return std::abs(value - expected) < 1e-5 * std::abs(expected);
    };
    CHECK(close(here.d_advance, (above.advance - below.advance) / (2.0 * step)));
    if (size > 0.1) {
      CHECK(close(here.d_now, (above.now - below.now) / (2.0 * step)));
      CHECK(close(here.d_next, (above.next - below.next) / (2.0 * step)));
      // The steady state under a force of 1 N is -1/s.
      CHECK(close(here.now + here.next, (here.advance - 1.0) / s));
    } else {
      CHECK(close(here.now, 0.5 * period_s));
      CHECK(close(here.next, 0.5 * period_s));
      CHECK(close(here.d_now, period_s * period_s / 3.0));
      CHECK(close(here.d_next, period_s * period_s / 6.0));
    }
  }
}

TEST_CASE("modal fit: the response is that of the differential equation") {
  const auto force = tap(300);
  const auto expected = integrated(force, 400.0, 0.05);
  for (const Quantity quantity : {Quantity::displacement, Quantity::velocity, Quantity::acceleration}) {
    const std::vector<double> unit{1.0};
    const auto response = shapegcode::modal_response(force, period_s, {{400.0}, {0.05}}, unit, quantity);
    const auto& exact = expected[static_cast<std::size_t>(quantity)];
    double largest = 0.0;
    double error = 0.0;
    for (std::size_t k = 0; k < exact.size(); ++k) {
      largest = std::max(largest, std::abs(exact[k]));
      error = std::max(error, std::abs(response[static_cast<Eigen::Index>(k)] - exact[k]));
    }
    CHECK(error < 1e-9 * largest);
  }
}

TEST_CASE("modal fit: two records without noise give the modes exactly, one residue negative") {
  const auto force = tap(600);
  auto stronger = force;
  for (double& value : stronger) value *= 1.7;
  const auto slow = integrated(force, 400.0, 0.05)[2];
  const auto fast = integrated(force, 900.0, 0.02)[2];
  std::vector<double> first(slow.size());
  std::vector<double> second(slow.size());
  for (std::size_t k = 0; k < slow.size(); ++k) {
    first[k] = 0.2 * slow[k] - 0.05 * fast[k] + 3.0;
    second[k] = 1.7 * (0.2 * slow[k] - 0.05 * fast[k]) - 1.0;
  }
  const std::vector<TapSignals> taps{{force, first}, {stronger, second}};
  const ModalFit fit = shapegcode::fit_modes(taps, period_s, {{420.0, 870.0}, {0.08, 0.01}}, {});
  CHECK(fit.quality.converged);
  CHECK(fit.quality.reason.empty());
  CHECK(fit.omega_rad_s[0] == doctest::Approx(400.0).epsilon(1e-8));
  CHECK(fit.omega_rad_s[1] == doctest::Approx(900.0).epsilon(1e-8));
  CHECK(fit.damping_ratio[0] == doctest::Approx(0.05).epsilon(1e-8));
  CHECK(fit.damping_ratio[1] == doctest::Approx(0.02).epsilon(1e-8));
  CHECK(fit.inverse_mass[0] == doctest::Approx(0.2).epsilon(1e-8));
  CHECK(fit.inverse_mass[1] == doctest::Approx(-0.05).epsilon(1e-8));
  CHECK(fit.offset[0] == doctest::Approx(3.0));
  CHECK(fit.offset[1] == doctest::Approx(-1.0));
  CHECK(fit.quality.parameters == 8);
  CHECK(fit.quality.samples == 1200);
  CHECK(fit.covariance.rows() == 6);
}

TEST_CASE("modal fit: not converging is told, not thrown") {
  const auto force = tap(600);
  const auto response = integrated(force, 400.0, 0.05)[2];
  const std::vector<TapSignals> taps{{force, response}};
  ModalFitOptions hasty;
  hasty.most_iterations = 2;
  const ModalFit fit = shapegcode::fit_modes(taps, period_s, {{440.0}, {0.2}}, hasty);
  CHECK_FALSE(fit.quality.converged);
  CHECK_FALSE(fit.quality.reason.empty());
}

TEST_CASE("modal fit: refusals") {
  const auto force = tap(50);
  const std::vector<TapSignals> taps{{force, force}};
  const NaturalModes start{{400.0}, {0.05}};
  ModalFitOptions noise;
  noise.force_noise_n = -1.0;
  CHECK_THROWS_AS((void)shapegcode::fit_modes(taps, 0.0, start, {}), Error);
  CHECK_THROWS_AS((void)shapegcode::fit_modes(taps, period_s, {}, {}), Error);
  CHECK_THROWS_AS((void)shapegcode::fit_modes(taps, period_s, {{400.0}, {}}, {}), Error);
  CHECK_THROWS_AS((void)shapegcode::fit_modes(taps, period_s, {{7000.0}, {0.05}}, {}), Error);
  CHECK_THROWS_AS((void)shapegcode::fit_modes(taps, period_s, {{400.0}, {0.0}}, {}), Error);
  CHECK_THROWS_AS((void)shapegcode::fit_modes(taps, period_s, start, noise), Error);
  const std::vector<double> two{1.0, 2.0};
  CHECK_THROWS_AS((void)shapegcode::modal_response(force, period_s, start, two, Quantity::velocity), Error);
  const std::vector<double> one{1.0};
  CHECK_THROWS_WITH_AS((void)shapegcode::modal_response(std::vector<double>{0.0, std::nan("")}, period_s, start, one,
                                                        Quantity::velocity),
                       "force is not finite at entry 1", Error);
}
