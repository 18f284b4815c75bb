#include <doctest/doctest.h>

#include <algorithm>
#include <cmath>
#include <initializer_list>
#include <limits>
#include <numbers>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

#include "plant/feed_drive/ode.hpp"
#include "shapegcode/error.hpp"
#include "shapegcode/plant/modal.hpp"

using Eigen::MatrixXd;
using Eigen::Ref;
using Eigen::VectorXd;
using shapegcode::Error;
using shapegcode::ErrorKind;
using shapegcode::OdeSolver;

namespace {

using State = Ref<const VectorXd>;

VectorXd values(std::initializer_list<double> list) {
  VectorXd vector(static_cast<Eigen::Index>(list.size()));
  Eigen::Index i = 0;
  for (const double value : list) vector[i++] = value;
  return vector;
}

OdeSolver robertson() {
  return {[](double, const State& y, Ref<VectorXd> rate) {
            rate[0] = -0.04 * y[0] + 1e4 * y[1] * y[2];
            rate[2] = 3e7 * y[1] * y[1];
            rate[1] = -rate[0] - rate[2];
          },
          [](double, const State& y, Ref<MatrixXd> j) {
            j(0, 0) = -0.04;
            j(0, 1) = 1e4 * y[2];
            j(0, 2) = 1e4 * y[1];
            j(2, 1) = 6e7 * y[1];
            j(1, 0) = 0.04;
            j(1, 1) = -j(0, 1) - j(2, 1);
            j(1, 2) = -j(0, 2);
          },
          values({1.0, 0.0, 0.0}),
          0.0,
          1e-9,
          values({1e-14, 1e-18, 1e-14})};
}

/// y' = -1000 (y - cos t) - sin t, y(0) = 1: y = cos t, stiff.
OdeSolver relaxation() {
  return {[](double t, const State& y, Ref<VectorXd> rate) { rate[0] = -1000.0 * (y[0] - std::cos(t)) - std::sin(t); },
          [](double, const State&, Ref<MatrixXd> j) { j(0, 0) = -1000.0; },
          values({1.0}),
          0.0,
          1e-10,
          1e-12};
}

}  // namespace

TEST_CASE("ode: Robertson's kinetics against the reference solution of the stiff test set") {
  OdeSolver solver = robertson();
  const VectorXd early = solver.advance(0.4);
  CHECK(solver.time() == 0.4);
  CHECK(early[0] == doctest::Approx(9.8517e-1).epsilon(1e-4));
  CHECK(early[1] == doctest::Approx(3.3864e-5).epsilon(1e-4));
  CHECK(early[2] == doctest::Approx(1.4794e-2).epsilon(1e-4));
  const VectorXd& late = solver.advance(1e11);
  CHECK(late[0] == doctest::Approx(0.2083340149701255e-7).epsilon(1e-5));
  CHECK(late[1] == doctest::Approx(0.8333360770334713e-13).epsilon(1e-5));
  CHECK(late[2] == doctest::Approx(0.9999999791665050).epsilon(1e-9));
  CHECK(&late == &solver.state());
  CHECK(solver.steps() > 100);
}

TEST_CASE("ode: van der Pol, mu = 1e-6, against the reference solution of the stiff test set") {
  constexpr double mu = 1e-6;
  OdeSolver solver(
      [](double, const State& y, Ref<VectorXd> rate) {
        rate[0] = y[1];
        rate[1] = ((1.0 - y[0] * y[0]) * y[1] - y[0]) / mu;
      },
      [](double, const State& y, Ref<MatrixXd> j) {
        j(0, 1) = 1.0;
        j(1, 0) = (-2.0 * y[0] * y[1] - 1.0) / mu;
        j(1, 1) = (1.0 - y[0] * y[0]) / mu;
      },
      values({2.0, 0.0}), 0.0, 1e-10, 1e-12);
  const VectorXd& y = solver.advance(2.0);
  CHECK(y[0] == doctest::Approx(0.1706167732170483e1).epsilon(1e-6));
  CHECK(y[1] == doctest::Approx(-0.8928097010247975).epsilon(1e-6));
}

TEST_CASE("ode: the base-excited mode as ModalPlant propagates it") {
  const shapegcode::Mode mode{46.0, 0.02, 1.0};
  const double omega = 2.0 * std::numbers::pi * mode.frequency_hz;
  const double period = 1e-3;
  double from = 0.0;
  double velocity = 0.0;
  double since = 0.0;
  OdeSolver solver(
      [&](double t, const State& y, Ref<VectorXd> rate) {
        const double x = from + velocity * (t - since);
        rate[0] = y[1];
        rate[1] = 2.0 * mode.damping_ratio * omega * (velocity - y[1]) + omega * omega * (x - y[0]);
      },
      [&](double, const State&, Ref<MatrixXd> j) {
        j(0, 1) = 1.0;
        j(1, 0) = -omega * omega;
        j(1, 1) = -2.0 * mode.damping_ratio * omega;
      },
      values({0.0, 0.0}), 0.0, 1e-12, values({1e-13, 1e-10}));
  shapegcode::ModalPlant plant({std::vector{mode}, {}, {}}, period);
  plant.reset(shapegcode::Vector3::Zero());
  double worst = 0.0;
  double x = 0.0;
  for (int i = 1; i <= 200; ++i) {
    since = solver.time();
    from = x;
    x = i < 100 ? 0.1 * i : 10.0;
    velocity = (x - from) / (i * period - since);
    solver.restart(solver.state());
    const double u = solver.advance(i * period)[0];
    worst = std::max(worst, std::abs(u - plant.step({x, 0, 0})[0]));
  }
  CHECK(worst < 1e-8);
}

TEST_CASE("ode: with stop_exactly the right side is not asked beyond the stop") {
  double latest = 0.0;
  OdeSolver solver(
      [&](double t, const State& y, Ref<VectorXd> rate) {
        latest = std::max(latest, t);
        rate[0] = -y[0];
      },
      [](double, const State&, Ref<MatrixXd> j) { j(0, 0) = -1.0; }, values({1.0}), 0.0, 1e-8, 1e-10);
  for (int i = 1; i <= 20; ++i) {
    const double t = 0.05 * i;
    CHECK(solver.advance(t)[0] == doctest::Approx(std::exp(-t)).epsilon(1e-6));
    CHECK(latest <= t * (1.0 + 1e-12));
  }
  // Interpolated results leave the solver ahead; an exact stop behind that is interpolated as well.
  solver.advance(1.001, false);
  CHECK(latest > 1.001);
  CHECK(solver.advance(1.002)[0] == doctest::Approx(std::exp(-1.002)).epsilon(1e-6));
  CHECK(solver.advance(1.002)[0] == doctest::Approx(std::exp(-1.002)).epsilon(1e-6));
  CHECK(solver.advance(3.0)[0] == doctest::Approx(std::exp(-3.0)).epsilon(1e-6));
  CHECK(latest <= 3.0 * (1.0 + 1e-12));
}

TEST_CASE("ode: a thousand restarts do not spoil the solution nor add up in cost") {
  OdeSolver solver = relaxation();
  long first_half = 0;
  for (int i = 1; i <= 1000; ++i) {
    CHECK(std::abs(solver.advance(i * 1e-3)[0] - std::cos(i * 1e-3)) < 1e-7);
    solver.restart(solver.state());
    if (i == 500) first_half = solver.rhs_evaluations();
  }
  CHECK(solver.rhs_evaluations() - first_half < 1.2 * static_cast<double>(first_half));
  CHECK(solver.rhs_evaluations() < 50'000);
}

TEST_CASE("ode: an exception of the right side or of the Jacobian reaches the caller unchanged") {
  bool rhs_fails = false;
  bool jacobian_fails = false;
  OdeSolver solver(
      [&](double, const State& y, Ref<VectorXd> rate) {
        if (rhs_fails) throw std::out_of_range("from the right side");
        rate[0] = -1e5 * y[0];
      },
      [&](double, const State&, Ref<MatrixXd> j) {
        if (jacobian_fails) throw std::domain_error("from the Jacobian");
        j(0, 0) = -1e5;
      },
      values({1.0}), 0.0, 1e-6, 1e-9);
  solver.advance(0.001);
  rhs_fails = true;
  CHECK_THROWS_WITH_AS(solver.advance(0.002), "from the right side", std::out_of_range);
  CHECK_THROWS_AS(solver.advance(0.002), Error);
  CHECK(solver.time() == 0.001);
  rhs_fails = false;
  jacobian_fails = true;
  solver.restart(values({1.0}));
  CHECK_THROWS_WITH_AS(solver.advance(0.002), "from the Jacobian", std::domain_error);
  jacobian_fails = false;
  solver.restart(values({1.0}), 0.0);
  CHECK(std::abs(solver.advance(0.1)[0]) < 1e-6);
}

TEST_CASE("ode: a system of its own, whose tolerance is taken of other magnitudes and whose steps are limited") {
  // A slow oscillation far from zero: |y| would make the relative tolerance a hundred times the amplitude.
  struct Far final : shapegcode::OdeSystem {
    void rate(double, const double* y, double* rate) override {
      rate[0] = y[1];
      rate[1] = 1e6 - y[0];
    }
    void jacobian(double, const double*, double* matrix) override {
      matrix[1] = -1.0;  // row 1, column 0
      matrix[2] = 1.0;
    }
    void magnitudes(double, const double* y, Ref<VectorXd> magnitude) override {
      magnitude << std::abs(y[0] - 1e6), std::abs(y[1]);
    }
  } far;
  OdeSolver solver(far, values({1e6 + 1.0, 0.0}), 0.0, 1e-7, VectorXd::Constant(2, 1e-7));
  CHECK(solver.advance(20.0)[0] - 1e6 == doctest::Approx(std::cos(20.0)).epsilon(1e-4));
  const long steps = solver.steps();
  solver.restart(values({1e6 + 1.0, 0.0}), 0.0);
  solver.limit_step(0.02);
  CHECK(solver.advance(20.0)[0] - 1e6 == doctest::Approx(std::cos(20.0)).epsilon(1e-4));
  CHECK(solver.steps() - steps >= 1000);
  CHECK_THROWS_AS(solver.limit_step(0.0), Error);
  CHECK_THROWS_AS(OdeSolver(far, values({1.0, 2.0}), 0.0, 1e-6, values({1.0})), Error);
}

TEST_CASE("ode: a failure names CVODE's flag and the time") {
  // y' = y^2 from 1 has no solution beyond t = 1.
  OdeSolver solver([](double, const State& y, Ref<VectorXd> rate) { rate[0] = y[0] * y[0]; },
                   [](double, const State& y, Ref<MatrixXd> j) { j(0, 0) = 2.0 * y[0]; }, values({1.0}), 0.0, 1e-8,
                   1e-8);
  try {
    solver.advance(2.0);
    FAIL("no error");
  } catch (const Error& error) {
    const std::string message = error.what();
    INFO(message);
    CHECK(error.kind() == ErrorKind::numeric);
    CHECK(message.find("CV_") != std::string::npos);
    const auto at = message.find("t = ");
    REQUIRE(at != std::string::npos);
    CHECK(std::stod(message.substr(at + 4)) == doctest::Approx(1.0).epsilon(1e-3));
  }
  const double nan = std::numeric_limits<double>::quiet_NaN();
  OdeSolver not_a_number([&](double, const State&, Ref<VectorXd> rate) { rate[0] = nan; },
                         [](double, const State&, Ref<MatrixXd>) {}, values({1.0}), 0.0, 1e-8, 1e-8);
  CHECK_THROWS_AS(not_a_number.advance(1.0), Error);
}

TEST_CASE("ode: refuses bad arguments") {
  const OdeSolver::Rhs rhs = [](double, const State&, Ref<VectorXd> rate) { rate.setZero(); };
  const OdeSolver::Jacobian jacobian = [](double, const State&, Ref<MatrixXd>) {};
  const double nan = std::numeric_limits<double>::quiet_NaN();
  CHECK_THROWS_AS(OdeSolver(nullptr, jacobian, values({1.0}), 0.0, 1e-6, 1e-6), Error);
  CHECK_THROWS_AS(OdeSolver(rhs, nullptr, values({1.0}), 0.0, 1e-6, 1e-6), Error);
  CHECK_THROWS_AS(OdeSolver(rhs, jacobian, VectorXd(), 0.0, 1e-6, 1e-6), Error);
  CHECK_THROWS_AS(OdeSolver(rhs, jacobian, values({nan}), 0.0, 1e-6, 1e-6), Error);
  CHECK_THROWS_AS(OdeSolver(rhs, jacobian, values({1.0}), 0.0, 0.0, 1e-6), Error);
  CHECK_THROWS_AS(OdeSolver(rhs, jacobian, values({1.0}), 0.0, 1e-6, -1.0), Error);
  CHECK_THROWS_AS(OdeSolver(rhs, jacobian, values({1.0}), 0.0, 1e-6, values({1.0, 1.0})), Error);
  OdeSolver solver(rhs, jacobian, values({1.0}), 5.0, 1e-6, 1e-6);
  CHECK_THROWS_AS(solver.advance(4.0), Error);
  CHECK_THROWS_AS(solver.advance(nan), Error);
  CHECK_THROWS_AS(solver.restart(values({1.0, 2.0})), Error);
  CHECK(solver.advance(6.0)[0] == 1.0);
  OdeSolver moved = std::move(solver);
  CHECK(moved.advance(7.0)[0] == 1.0);
}
