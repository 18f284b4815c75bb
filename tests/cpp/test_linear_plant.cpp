#include <doctest/doctest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <utility>
#include <vector>

#include "plant/feed_drive/ode.hpp"
#include "shapegcode/error.hpp"
#include "shapegcode/plant/linear_plant.hpp"
#include "shapegcode/plant/modal.hpp"

using Eigen::MatrixXd;
using Eigen::VectorXd;
using shapegcode::Error;
using shapegcode::LinearPlant;
using shapegcode::StateSpace;

namespace {

constexpr double period_s = 1e-3;

/// Base-excited mode, states u and u' - 2*zeta*omega*x.
StateSpace modal(double frequency_hz, double damping) {
  const double omega = 2.0 * std::numbers::pi * frequency_hz;
  StateSpace plant{MatrixXd(2, 2), MatrixXd(2, 1), MatrixXd(1, 2), MatrixXd::Zero(1, 1)};
  plant.a << 0.0, 1.0, -omega * omega, -2.0 * damping * omega;
  plant.b << 2.0 * damping * omega, omega * omega * (1.0 - 4.0 * damping * damping);
  plant.c << 1.0, 0.0;
  return plant;
}

/// Two masses on a stiff spring with a damper to a commanded point, and the force behind a pole at 1e5 1/s.
StateSpace stiff() {
  StateSpace plant{MatrixXd::Zero(5, 5), MatrixXd::Zero(5, 1), MatrixXd::Zero(2, 5), MatrixXd::Zero(2, 1)};
  const double spring = 3e6;
  plant.a << 0, 1, 0, 0, 0,                       //
      -spring, -50.0, spring, 50.0, 1.0,          //
      0, 0, 0, 1, 0,                              //
      1.5 * spring, 75.0, -1.5 * spring, -75, 0,  //
      -1e5 * 4e3, -1e5 * 1e2, 0, 0, -1e5;
  plant.b(4, 0) = 1e5 * 4e3;
  plant.c(0, 0) = plant.c(1, 2) = 1.0;
  return plant;
}

double command(int sample) {
  const double angle = 0.05 * sample;
  return sample < 10 ? 0.0 : std::sin(angle) + 0.3 * std::sin(7.3 * angle) - std::sin(0.5) - 0.3 * std::sin(3.65);
}

/// One step of a plant with one input.
VectorXd stepped(LinearPlant& plant, double input) {
  VectorXd output(plant.outputs());
  plant.step({&input, 1}, {output.data(), static_cast<std::size_t>(output.size())});
  return output;
}

/// Largest difference of the outputs over the largest output, against CVODE restarted at every sample.
double apart_from_cvode(const StateSpace& system, int samples) {
  double from = 0.0;
  double slope = 0.0;
  double since = 0.0;
  const auto size = system.a.rows();
  const VectorXd tolerance = VectorXd::Constant(size, 1e-12);
  shapegcode::OdeSolver solver(
      [&](double t, const Eigen::Ref<const VectorXd>& x, Eigen::Ref<VectorXd> rate) {
        rate = system.a * x + system.b * (from + slope * (t - since));
      },
      [&](double, const Eigen::Ref<const VectorXd>&, Eigen::Ref<MatrixXd> jacobian) { jacobian = system.a; },
      VectorXd::Zero(size), 0.0, 1e-12, tolerance);
  LinearPlant plant(system, period_s);
  double worst = 0.0;
  double largest = 0.0;
  for (int i = 1; i <= samples; ++i) {
    since = solver.time();
    from = command(i - 1);
    slope = (command(i) - from) / (i * period_s - since);
    solver.restart(solver.state());
    const VectorXd expected = system.c * solver.advance(i * period_s) + system.d * command(i);
    const VectorXd got = stepped(plant, command(i));
    worst = std::max(worst, (got - expected).cwiseAbs().maxCoeff());
    largest = std::max(largest, expected.cwiseAbs().maxCoeff());
  }
  return worst / largest;
}

}  // namespace

TEST_CASE("linear plant: as CVODE solves it, also undamped and stiff") {
  CHECK(apart_from_cvode(modal(46.0, 0.02), 150) < 1e-8);
  CHECK(apart_from_cvode(modal(131.0, 0.0), 150) < 1e-8);
  CHECK(apart_from_cvode(modal(900.0, 0.7), 50) < 1e-8);
  CHECK(apart_from_cvode(stiff(), 100) < 1e-8);
}

TEST_CASE("linear plant: a base-excited mode is ModalPlant's") {
  for (const double damping : {0.0, 0.02, 0.9}) {
    LinearPlant plant(modal(46.0, damping), period_s);
    shapegcode::ModalPlant mode({std::vector<shapegcode::Mode>{{46.0, damping, 1.0}}, {}, {}}, period_s);
    double worst = 0.0;
    for (int i = 0; i < 2000; ++i) {
      worst = std::max(worst, std::abs(stepped(plant, command(i))[0] - mode.step({command(i), 0.0, 0.0})[0]));
    }
    CHECK(worst < 1e-11);
  }
}

TEST_CASE("linear plant: integrators keep a polynomial exactly") {
  // u = t, so the chain holds t^2/2, t^3/6: after 1e5 samples only summing up is left as an error.
  StateSpace chain{MatrixXd::Zero(2, 2), MatrixXd::Zero(2, 1), MatrixXd::Identity(2, 2), MatrixXd::Zero(2, 1)};
  chain.a(1, 0) = 1.0;
  chain.b(0, 0) = 1.0;
  LinearPlant plant(chain, period_s);
  for (int i = 1; i <= 100'000; ++i) stepped(plant, i * period_s);
  CHECK(plant.output()[0] == doctest::Approx(5e3).epsilon(1e-12));
  CHECK(plant.output()[1] == doctest::Approx(1e6 / 6.0).epsilon(1e-12));
}

TEST_CASE("matrix exponential: an integrator beside a rate of 1e6 stays an integrator") {
  MatrixXd a(3, 3);
  a << -1e6, 1e6, 0.0, 0.0, -1.0, 1.0, 0.0, 0.0, 0.0;
  const MatrixXd e = shapegcode::matrix_exponential(a);
  CHECK(e(2, 2) == 1.0);
  CHECK(e(1, 1) == doctest::Approx(std::exp(-1.0)).epsilon(1e-9));
  CHECK(e(1, 2) == doctest::Approx(1.0 - std::exp(-1.0)).epsilon(1e-9));
  CHECK(e(0, 1) == doctest::Approx(std::exp(-1.0) * 1e6 / (1e6 - 1.0)).epsilon(1e-9));
  CHECK(std::abs(e(0, 0)) < 1e-12);
  CHECK(shapegcode::matrix_exponential(MatrixXd(0, 0)).size() == 0);
}

TEST_CASE("linear plant: refusals") {
  const double nan = std::numeric_limits<double>::quiet_NaN();
  const StateSpace good = modal(46.0, 0.02);
  const auto with = [&](MatrixXd StateSpace::*member, MatrixXd value) {
    StateSpace plant = good;
    plant.*member = std::move(value);
    return plant;
  };
  CHECK_THROWS_AS(LinearPlant(good, 0.0), Error);
  CHECK_THROWS_AS(LinearPlant(good, nan), Error);
  CHECK_THROWS_AS(LinearPlant(with(&StateSpace::a, MatrixXd::Zero(2, 3)), period_s), Error);
  CHECK_THROWS_AS(LinearPlant(with(&StateSpace::b, MatrixXd::Zero(1, 1)), period_s), Error);
  CHECK_THROWS_AS(LinearPlant(with(&StateSpace::b, MatrixXd::Zero(2, 0)), period_s), Error);
  CHECK_THROWS_AS(LinearPlant(with(&StateSpace::c, MatrixXd::Zero(0, 2)), period_s), Error);
  CHECK_THROWS_AS(LinearPlant(with(&StateSpace::d, MatrixXd::Constant(1, 1, nan)), period_s), Error);
  CHECK_THROWS_AS(LinearPlant(with(&StateSpace::a, MatrixXd::Identity(2, 2) * 1e9), period_s), Error);
  CHECK_THROWS_AS((void)shapegcode::matrix_exponential(MatrixXd::Zero(1, 2)), Error);
}
