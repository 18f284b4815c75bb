#include <doctest/doctest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <random>
#include <vector>

#include <Eigen/Core>

#include "feed_drives.hpp"
#include "plant/feed_drive/feed_drive_equations.hpp"
#include "shapegcode/plant/feed_drive.hpp"

using Eigen::MatrixXd;
using Eigen::VectorXd;
using shapegcode::FeedDriveEquations;
using shapegcode::FeedDriveInput;
using shapegcode::FeedDriveParameters;
using shapegcode::friction_force;
using shapegcode::FrictionForce;
using shapegcode::FrictionModel;
using shapegcode::FrictionParameters;
using shapegcode::PositionFeedback;

namespace {

constexpr double period_s = 1e-3;

using Random = std::mt19937_64;

double uniform(Random& random, double low, double high) {
  return std::uniform_real_distribution<double>(low, high)(random);
}

bool coin(Random& random) { return std::bernoulli_distribution(0.5)(random); }

FrictionParameters random_friction(Random& random) {
  const std::array<FrictionParameters, 3> kinds{FrictionParameters{FrictionModel::viscous, 900.0},
                                                feed_drives::stribeck(), feed_drives::lugre()};
  return kinds[std::uniform_int_distribution<std::size_t>(0, 2)(random)];
}

FeedDriveParameters random_drive(Random& random) {
  FeedDriveParameters drive = feed_drives::linear();
  drive.table_friction = random_friction(random);
  drive.motor_friction = random_friction(random);
  if (coin(random)) drive.backlash_m = 8e-6;
  if (coin(random)) drive.force_limit_n = 2000.0;
  if (coin(random)) drive.velocity_integral_time_s = 0.0;
  if (coin(random)) drive.position_feedback = PositionFeedback::table;
  if (coin(random)) drive.modes.push_back({131.0, 0.01, 0.4});
  drive.velocity_feed_forward_ratio = uniform(random, 0.0, 1.0);
  drive.acceleration_feed_forward_ratio = uniform(random, 0.0, 1.0);
  return drive;
}

// Not within `distance` of a kink of the right side: a difference over it is no derivative.
constexpr double away = 1e-3;

/// A speed in stick (micrometres per second) or slip, either way.
double random_speed(Random& random) {
  const double size = coin(random) ? uniform(random, 1e-5, 1e-3) : uniform(random, 1e-3, 0.3);
  return coin(random) ? size : -size;
}

/// A deflection inside the gap, past it, and just either side of where the contact begins and is whole.
double random_deflection(Random& random, double backlash) {
  if (backlash == 0.0) return uniform(random, -1e-5, 1e-5);
  const double contact = 0.1 * backlash;
  const double begins = 0.5 * (backlash - contact);
  const std::array<double, 5> places{-1.0 + away, -away, away, 1.0 - away, 1.0 + away};
  const double past = coin(random) ? places[std::uniform_int_distribution<std::size_t>(0, 4)(random)] * contact
                                   : uniform(random, -0.9, 0.0) * begins;
  return (coin(random) ? 1.0 : -1.0) * (begins + past);
}

}  // namespace

TEST_CASE("feed drive: the Jacobian is that of the right side, in stick, slip and at the ends of the gap") {
  Random random(20260601);
  int limited = 0;
  for (int draw = 0; draw < 500; ++draw) {
    const FeedDriveParameters parameters = random_drive(random);
    const FeedDriveEquations equations(parameters, period_s);
    const FeedDriveEquations::Layout& at = equations.layout();
    const FeedDriveInput input{uniform(random, -0.5, 0.5), uniform(random, -0.3, 0.3), uniform(random, -0.3, 0.3)};
    const double time_s = uniform(random, 0.0, period_s);
    VectorXd y(at.size);
    y[at.position] = input.setpoint_m + uniform(random, -0.005, 0.005);
    y[at.speed] = 0.0;
    y[at.speed] = random_speed(random) - equations.motor_velocity(input, time_s, y.data());
    y[at.deflection] = random_deflection(random, parameters.backlash_m);
    y[at.table_velocity] = random_speed(random);
    if (at.integral >= 0) y[at.integral] = uniform(random, -1e-3, 1e-3);
    for (const int bristle : {at.table_bristle, at.motor_bristle}) {
      if (bristle >= 0) y[bristle] = uniform(random, -1.2e-5, 1.2e-5);
    }
    for (int i = at.modes; i < at.size; i += 2) {
      y[i] = uniform(random, -1e-4, 1e-4);
      y[i + 1] = uniform(random, -0.01, 0.01);
    }
    limited += equations.is_limited(input, time_s, y.data()) ? 1 : 0;

    MatrixXd jacobian = MatrixXd::Zero(at.size, at.size);
    equations.jacobian(input, time_s, y.data(), jacobian.data());
    VectorXd rate(at.size);
    equations.rate(input, time_s, y.data(), rate.data());
    for (int column = 0; column < at.size; ++column) {
      const bool is_velocity = column == at.speed || column == at.table_velocity;
      const double step = is_velocity ? 2e-8 : (column == at.position ? 2e-10 : 1e-10);
      VectorXd above = y;
      VectorXd below = y;
      above[column] += step;
      below[column] -= step;
      VectorXd rate_above(at.size);
      VectorXd rate_below(at.size);
      equations.rate(input, time_s, above.data(), rate_above.data());
      equations.rate(input, time_s, below.data(), rate_below.data());
      const VectorXd differences = (rate_above - rate_below) / (above[column] - below[column]);
      // Rounding: the right side is a difference of terms far larger than it.
      const double level = jacobian.col(column).cwiseAbs().maxCoeff();
      for (int row = 0; row < at.size; ++row) {
        INFO("draw ", draw, ", row ", row, ", column ", column);
        CHECK(std::abs(differences[row] - jacobian(row, column)) <= 2e-5 * level + 1e-15 * 1e4 / step);
      }
    }
  }
  CHECK(limited > 25);
}

TEST_CASE("feed drive: where only the set-points' slope changes the right side does not jump") {
  FeedDriveParameters parameters = feed_drives::with_friction();
  parameters.velocity_feed_forward_ratio = 0.9;
  parameters.acceleration_feed_forward_ratio = 0.8;
  const FeedDriveEquations equations(parameters, period_s);
  Random random(7);
  for (int draw = 0; draw < 100; ++draw) {
    const FeedDriveInput input{uniform(random, -0.5, 0.5), uniform(random, -0.3, 0.3), uniform(random, -0.3, 0.3)};
    const FeedDriveInput next{input.setpoint_m + input.velocity_m_per_s * period_s, uniform(random, -0.3, 0.3),
                              input.velocity_m_per_s};
    const VectorXd y = 0.01 * VectorXd::Random(equations.layout().size);
    VectorXd before(y.size());
    VectorXd after(y.size());
    equations.rate(input, period_s, y.data(), before.data());
    equations.rate(next, 0.0, y.data(), after.data());
    CHECK((after - before).cwiseAbs().maxCoeff() < 1e-9 * before.cwiseAbs().maxCoeff());
  }
}

TEST_CASE("friction: steady sliding lies on the curve in every model") {
  const FrictionParameters lugre = feed_drives::lugre();
  const FrictionParameters stribeck = feed_drives::stribeck();
  for (const double v : {-0.2, -0.004, -1e-3, 1e-3, 0.005, 0.05, 0.4}) {
    const double level = 300.0 + 150.0 * std::exp(-std::pow(v / 0.005, 2));
    const double curve = std::copysign(level, v) + 1500.0 * v;
    const double bristle = std::copysign(level / 3e7, v);
    const FrictionForce of_lugre = friction_force(lugre, v, bristle);
    CHECK(of_lugre.bristle_rate_m_per_s == doctest::Approx(0.0).scale(std::abs(v)));
    CHECK(of_lugre.force_n == doctest::Approx(curve));
    CHECK(friction_force(stribeck, v, 0.0).force_n == doctest::Approx(curve));
    CHECK(friction_force({FrictionModel::viscous, 1500.0}, v, 0.0).force_n == doctest::Approx(1500.0 * v));
  }
}

TEST_CASE("friction: bristles at rest are a spring") {
  const FrictionForce force = friction_force(feed_drives::lugre(), 0.0, 4e-6);
  CHECK(force.force_n == doctest::Approx(120.0));
  CHECK(force.by_bristle == doctest::Approx(3e7));
  CHECK(force.by_velocity > 0.0);
}
