#include <doctest/doctest.h>

#include <cmath>
#include <numbers>
#include <vector>

#include "shapegcode/error.hpp"
#include "shapegcode/identify/equivalent_mass.hpp"

using shapegcode::EquivalentMass;
using shapegcode::EquivalentOscillator;
using shapegcode::Error;
using shapegcode::MassProblem;

namespace {

constexpr EquivalentOscillator reference{5.0, 20.0, 4000.0};

/// Largest error of the displacement after an initial velocity of 1 m/s, against the closed form.
double error_after_start(double period_s, double theta) {
  const std::vector<double> none(static_cast<std::size_t>(std::lround(1.0 / period_s)), 0.0);
  const auto motion = shapegcode::wilson_theta(reference, none, period_s, theta, 0.0, 1.0);
  const double omega_d = std::sqrt(796.0);
  double error = 0.0;
  for (Eigen::Index k = 0; k < motion.displacement_m.size(); ++k) {
    const double t = static_cast<double>(k) * period_s;
    error = std::max(error, std::abs(motion.displacement_m[k] - std::exp(-2.0 * t) * std::sin(omega_d * t) / omega_d));
  }
  return error;
}

}  // namespace

TEST_CASE("equivalent mass: Wilson theta converges with the square of the step") {
  for (const double theta : {1.0, 1.4, 2.0}) {
    const double coarse = error_after_start(1e-3, theta);
    const double fine = error_after_start(5e-4, theta);
    CHECK(coarse < 1e-4);
    CHECK(coarse / fine == doctest::Approx(4.0).epsilon(0.05));
  }
}

TEST_CASE("equivalent mass: a constant force ends at force over stiffness, and rests if it started there") {
  const std::vector<double> force(2000, 10.0);
  const auto motion = shapegcode::wilson_theta(reference, force, 0.005);
  CHECK(motion.displacement_m[1999] == doctest::Approx(10.0 / 4000.0).epsilon(1e-6));
  const auto resting = shapegcode::wilson_theta(reference, force, 0.005, 1.4, 10.0 / 4000.0);
  CHECK(resting.acceleration_m_per_s2.cwiseAbs().maxCoeff() < 1e-12);
}

TEST_CASE("equivalent mass: closed form and bisection agree, whatever was measured") {
  std::vector<double> force(1024, 0.0);
  for (std::size_t k = 1; k < 10; ++k) {
    force[k] = 50.0 * std::sin(std::numbers::pi * static_cast<double>(k) / 10.0);
  }
  const double period_s = 0.001;
  const auto motion = shapegcode::wilson_theta(reference, force, period_s);
  for (const auto quantity :
       {shapegcode::Quantity::displacement, shapegcode::Quantity::velocity, shapegcode::Quantity::acceleration}) {
    const Eigen::VectorXd& values = quantity == shapegcode::Quantity::acceleration ? motion.acceleration_m_per_s2
                                    : quantity == shapegcode::Quantity::velocity   ? motion.velocity_m_per_s
                                                                                   : motion.displacement_m;
    const std::vector<double> response(values.begin(), values.end());
    const MassProblem problem{{force, response}, period_s, std::sqrt(800.0), std::sqrt(0.005), quantity};
    const EquivalentMass closed = shapegcode::equivalent_mass_closed_form(problem);
    CHECK(closed.mass_kg == doctest::Approx(5.0).epsilon(1e-12));
    const EquivalentMass search = shapegcode::equivalent_mass_bisection(problem, {1e-3, 1e3, 1e-9, 100});
    CHECK(search.converged);
    CHECK(search.mass_kg == doctest::Approx(closed.mass_kg).epsilon(2e-9));
    const EquivalentMass outside = shapegcode::equivalent_mass_bisection(problem, {10.0, 1e3, 0.01, 50});
    CHECK_FALSE(outside.converged);
    CHECK(outside.halvings == 50);
    CHECK(outside.mass_kg == doctest::Approx(10.0));
  }
}

TEST_CASE("equivalent mass: refusals") {
  const std::vector<double> force{0.0, 1.0, 0.0};
  const std::vector<double> none(3, 0.0);
  CHECK_THROWS_AS((void)shapegcode::wilson_theta(reference, {}, 0.005), Error);
  CHECK_THROWS_AS((void)shapegcode::wilson_theta(reference, force, 0.005, 0.9), Error);
  CHECK_THROWS_AS((void)shapegcode::wilson_theta({5.0, -1.0, 4000.0}, force, 0.005), Error);
  CHECK_THROWS_AS((void)shapegcode::wilson_theta({5.0, 1.0, 0.0}, force, 0.005), Error);
  CHECK_THROWS_AS((void)shapegcode::wilson_theta(reference, force, 0.005, 1.4, std::nan("")), Error);
  CHECK_THROWS_AS((void)shapegcode::equivalent_mass_closed_form({{force, none}, 0.005, 28.0, 0.07}), Error);
  CHECK_THROWS_AS((void)shapegcode::equivalent_mass_closed_form({{none, force}, 0.005, 28.0, 0.07}), Error);
  CHECK_THROWS_AS((void)shapegcode::equivalent_mass_closed_form({{force, force}, 0.005, 0.0, 0.07}), Error);
  CHECK_THROWS_AS((void)shapegcode::equivalent_mass_closed_form({{force, force}, 0.005, 28.0, 1.1}), Error);
  CHECK_THROWS_AS((void)shapegcode::equivalent_mass_bisection({{force, force}, 0.005, 28.0, 0.07}, {2.0, 1.0, 0.1, 9}),
                  Error);
}
