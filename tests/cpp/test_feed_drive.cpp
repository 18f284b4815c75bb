#include <doctest/doctest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <string>
#include <utility>
#include <vector>

#include <Eigen/Core>
#include <unsupported/Eigen/MatrixFunctions>

#include "feed_drives.hpp"
#include "shapegcode/error.hpp"
#include "shapegcode/plant/feed_drive.hpp"
#include "shapegcode/plant/modal.hpp"

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;
using shapegcode::Error;
using shapegcode::ErrorKind;
using shapegcode::FeedDrive;
using shapegcode::FeedDriveLinearModel;
using shapegcode::FeedDriveParameters;
using shapegcode::FeedDriveRealTime;
using shapegcode::FrictionModel;
using shapegcode::PositionFeedback;

namespace {

constexpr double period_s = 1e-3;

/// Responses of a linear model to set-points joined by straight lines (Van Loan's block matrix exponential).
std::vector<double> exact(const FeedDriveLinearModel& model, const std::vector<double>& setpoints) {
  const Index n = model.a.rows();
  const Index m = model.b.cols();
  MatrixXd block = MatrixXd::Zero(n + 2 * m, n + 2 * m);
  block.topLeftCorner(n, n) = model.a * period_s;
  block.block(0, n, n, m) = model.b * period_s;
  block.block(n, n + m, m, m).setIdentity();
  const MatrixXd transition = block.exp();
  VectorXd x = VectorXd::Zero(n);
  VectorXd before = VectorXd::Zero(m);
  std::vector<double> responses;
  for (const double setpoint : setpoints) {
    VectorXd input(m);
    input[0] = setpoint;
    if (m == 2) input[1] = (setpoint - before[0]) / period_s;
    x = (transition.topLeftCorner(n, n) * x + transition.block(0, n, n, m) * before +
         transition.block(0, n + m, n, m) * (input - before))
            .eval();
    before = input;
    responses.push_back((model.c * x + model.d * input)[0]);
  }
  return responses;
}

template <class Plant>
std::vector<double> play(Plant& plant, const std::vector<double>& setpoints) {
  std::vector<double> responses;
  for (const double setpoint : setpoints) responses.push_back(plant.step(setpoint));
  return responses;
}

double largest_difference(const std::vector<double>& a, const std::vector<double>& b) {
  REQUIRE(a.size() == b.size());
  double largest = 0.0;
  for (std::size_t i = 0; i < a.size(); ++i) largest = std::max(largest, std::abs(a[i] - b[i]));
  return largest;
}

/// Every kind of linear drive.
std::vector<FeedDriveParameters> linear_drives() {
  std::vector<FeedDriveParameters> drives;
  for (const double velocity_ratio : {0.0, 0.9}) {
    for (const double acceleration_ratio : {0.0, 0.7}) {
      for (const PositionFeedback feedback : {PositionFeedback::motor, PositionFeedback::table}) {
        FeedDriveParameters drive = feed_drives::linear();
        drive.velocity_feed_forward_ratio = velocity_ratio;
        drive.acceleration_feed_forward_ratio = acceleration_ratio;
        drive.position_feedback = feedback;
        drives.push_back(drive);
        drive.velocity_integral_time_s = 0.0;
        drive.modes.push_back({131.0, 0.01, -0.3});
        drives.push_back(drive);
        drive.modes.clear();
        drives.push_back(drive);
      }
    }
  }
  return drives;
}

}  // namespace

TEST_CASE("feed drive: without friction, backlash and limit it is the exact linear solution") {
  const std::vector<double> setpoints = feed_drives::circle_mm(400);
  for (const FeedDriveParameters& parameters : linear_drives()) {
    FeedDrive drive(parameters, period_s, 1e-11, 1e-12);
    const std::vector<double> responses = play(drive, setpoints);
    CHECK(largest_difference(responses, exact(linear_model(parameters), setpoints)) < 1e-8 * 20.0);
  }
}

TEST_CASE("feed drive: a stiff drive with a fast loop is the base-excited mode alone") {
  FeedDriveParameters parameters = feed_drives::linear();
  parameters.stiffness_n_per_m = 1e12;
  parameters.damping_n_s_per_m = 1e8;
  parameters.velocity_gain_n_s_per_m = 1e9;
  parameters.velocity_integral_time_s = 0.0;
  parameters.position_gain_per_s = 1e5;
  FeedDrive drive(parameters, period_s, 1e-9, 1e-10);
  shapegcode::ModalPlant plant({parameters.modes, {}, {}}, period_s);
  for (const double setpoint : feed_drives::circle_mm(300)) {
    CHECK(drive.step(setpoint) == doctest::Approx(plant.step({setpoint, 0.0, 0.0})[0]).epsilon(0.003));
  }
}

TEST_CASE("feed drive: the lag at constant speed is that of the position gain and of the feed-forward") {
  for (const double ratio : {0.0, 0.6, 1.0}) {
    FeedDriveParameters parameters = feed_drives::with_friction();
    parameters.velocity_feed_forward_ratio = ratio;
    FeedDrive drive(parameters, period_s);
    for (int i = 1; i <= 2000; ++i) drive.step(0.05 * i);
    const double lag = (1.0 - ratio) * 50.0 / parameters.position_gain_per_s;
    CHECK(drive.setpoint_mm() - drive.motor_mm() == doctest::Approx(lag).epsilon(1e-6).scale(10.0));
    // The motor carries both frictions, and the spring that of the table.
    CHECK(drive.friction_force_n() == doctest::Approx(300.0 + 1500.0 * 0.05).epsilon(1e-4));
    CHECK(drive.spring_force_n() == doctest::Approx(drive.friction_force_n()).epsilon(1e-4));
    CHECK(drive.motor_force_n() == doctest::Approx(375.0 + 500.0 * 0.05).epsilon(1e-4));
    CHECK(drive.motor_mm() - drive.table_mm() == doctest::Approx(375.0 / 1.2e8 * 1e3).epsilon(1e-4));
    CHECK(drive.table_velocity_mm_per_s() == doctest::Approx(50.0).epsilon(1e-6));
    CHECK(drive.motor_velocity_mm_per_s() == doctest::Approx(50.0).epsilon(1e-6));
  }
}

TEST_CASE("feed drive: backlash is lost at a reversal of a semi-closed loop and found by a scale") {
  for (const PositionFeedback feedback : {PositionFeedback::motor, PositionFeedback::table}) {
    FeedDriveParameters parameters = feed_drives::with_friction();
    parameters.modes.clear();
    parameters.backlash_m = 10e-6;
    parameters.position_feedback = feedback;
    FeedDrive drive(parameters, period_s);
    const auto settle = [&](double from, double to) {
      for (int i = 1; i <= 500; ++i) drive.step(from + (to - from) * i / 500.0);
      for (int i = 0; i < 2000; ++i) drive.step(to);
      return drive.table_mm();
    };
    settle(0.0, 1.0);
    const double up = settle(1.0, 2.0);
    const double force_up = drive.spring_force_n();
    settle(2.0, 4.0);
    const double down = settle(4.0, 2.0);
    const double force_down = drive.spring_force_n();
    CHECK(force_up > 250.0);
    CHECK(force_down < -250.0);
    // The motor stands at the set-point; between it and the table are the gap and the section that holds the friction.
    const double lost_mm = 0.010 + (force_up - force_down) / parameters.stiffness_n_per_m * 1e3;
    CHECK(down - up == doctest::Approx(feedback == PositionFeedback::motor ? lost_mm : 0.0).epsilon(1e-3).scale(0.01));
  }
}

TEST_CASE("feed drive: the force stays within its limit and winds nothing up") {
  FeedDriveParameters parameters = feed_drives::with_friction();
  parameters.force_limit_n = 1500.0;
  parameters.velocity_feed_forward_ratio = 0.9;
  parameters.acceleration_feed_forward_ratio = 0.8;
  const auto overshoot_mm = [&] {
    FeedDrive drive(parameters, period_s);
    double force = 0.0;
    double highest = 0.0;
    for (int i = 1; i <= 3000; ++i) {
      drive.step(std::min(0.2 * i, 40.0));  // 200 mm/s at once: the force is enough for 1.6 m/s^2
      force = std::max(force, std::abs(drive.motor_force_n()));
      highest = std::max(highest, drive.motor_mm());
    }
    CHECK(force == 1500.0);
    CHECK(std::abs(drive.motor_mm() - 40.0) < 0.1);  // static friction over both gains, without the integral
    return highest - 40.0;
  };
  // It cannot brake as hard as the set-points do and runs past the end, but no further than without an integral.
  const double with_integral_mm = overshoot_mm();
  parameters.velocity_integral_time_s = 0.0;
  const double without_mm = overshoot_mm();
  INFO(with_integral_mm, " mm with, ", without_mm, " mm without");
  CHECK(with_integral_mm < without_mm + 0.5);
  CHECK(without_mm > 1.0);
}

TEST_CASE("feed drive: a copy goes on alike, and a moved origin changes nothing else") {
  const std::vector<double> setpoints = feed_drives::circle_mm(300);
  FeedDriveParameters parameters = feed_drives::with_friction();
  parameters.velocity_feed_forward_ratio = 0.5;
  FeedDrive drive(parameters, period_s);
  play(drive, {setpoints.begin(), setpoints.begin() + 150});
  FeedDrive copy = drive;
  FeedDrive assigned(feed_drives::linear(), 0.5);
  assigned = copy;
  FeedDrive shifted = drive;
  shifted.shift(700.0);
  CHECK(shifted.response_mm() == doctest::Approx(drive.response_mm() + 700.0));
  CHECK(copy.setpoint_mm() == drive.setpoint_mm());
  for (std::size_t i = 150; i < setpoints.size(); ++i) {
    const double response = drive.step(setpoints[i]);
    const double of_copy = copy.step(setpoints[i]);
    CHECK(std::abs(of_copy - response) < 1e-4);
    CHECK(assigned.step(setpoints[i]) == of_copy);
    CHECK(std::abs(shifted.step(setpoints[i] + 700.0) - 700.0 - response) < 1e-4);
  }
  CHECK(drive.time_s() == doctest::Approx(0.3));
  FeedDrive moved = std::move(drive);
  moved.reset(-12.5);
  CHECK(moved.time_s() == 0.0);
  for (int i = 0; i < 10; ++i) CHECK(moved.step(-12.5) == -12.5);
  CHECK(moved.motor_force_n() == 0.0);
}

TEST_CASE("feed drive: at a set-point where only the slope changes the integrator runs on") {
  FeedDrive drive(feed_drives::with_friction(), period_s);
  const std::vector<double> setpoints = feed_drives::circle_mm(1000);
  play(drive, setpoints);
  // A restart takes about ten steps to come back to the order it had.
  CHECK(static_cast<double>(drive.steps()) < 5.0 * static_cast<double>(setpoints.size()));
}

TEST_CASE("feed drive: refuses what it cannot be") {
  const double nan = std::numeric_limits<double>::quiet_NaN();
  const auto refuses = [](auto&& change, const std::string& what) {
    FeedDriveParameters parameters = feed_drives::with_friction();
    change(parameters);
    try {
      FeedDrive(parameters, period_s);
      FAIL("accepted: " << what);
    } catch (const Error& error) {
      CHECK(error.kind() == ErrorKind::argument);
      CHECK_MESSAGE(std::string(error.what()).find(what) != std::string::npos, error.what());
    }
  };
  refuses([](FeedDriveParameters& p) { p.motor_mass_kg = 0.0; }, "mass of the motor is 0 kg");
  refuses([](FeedDriveParameters& p) { p.table_mass_kg = -1.0; }, "mass of the table");
  refuses([&](FeedDriveParameters& p) { p.stiffness_n_per_m = nan; }, "stiffness between");
  refuses([](FeedDriveParameters& p) { p.damping_n_s_per_m = -1.0; }, "damping between");
  refuses([](FeedDriveParameters& p) { p.backlash_m = -1e-6; }, "backlash");
  refuses([](FeedDriveParameters& p) { p.position_gain_per_s = 0.0; }, "position gain");
  refuses([](FeedDriveParameters& p) { p.velocity_gain_n_s_per_m = 0.0; }, "velocity gain");
  refuses([](FeedDriveParameters& p) { p.velocity_integral_time_s = -1.0; }, "integral time");
  refuses([](FeedDriveParameters& p) { p.velocity_feed_forward_ratio = 1.1; }, "within 0 ... 1");
  refuses([](FeedDriveParameters& p) { p.acceleration_feed_forward_ratio = -0.1; }, "within 0 ... 1");
  refuses([](FeedDriveParameters& p) { p.force_limit_n = -5.0; }, "force limit");
  refuses([](FeedDriveParameters& p) { p.modes[0].damping_ratio = 1.0; }, "damping");
  refuses([&](FeedDriveParameters& p) { p.modes[0].participation = nan; }, "participation");
  refuses([](FeedDriveParameters& p) { p.table_friction.static_n = 200.0; }, "static friction of the table is 200");
  refuses([](FeedDriveParameters& p) { p.table_friction.coulomb_n = 0.0; }, "Coulomb friction");
  refuses([](FeedDriveParameters& p) { p.table_friction.bristle_stiffness_n_per_m = 0.0; }, "bristles");
  refuses([](FeedDriveParameters& p) { p.motor_friction.viscous_n_s_per_m = -1.0; }, "viscous friction of the motor");
  refuses([](FeedDriveParameters& p) { p.table_friction.model = FrictionModel::stribeck; }, "smoothing speed");
  const FeedDriveParameters good = feed_drives::with_friction();
  CHECK_THROWS_AS(FeedDrive(good, 0.0), Error);
  CHECK_THROWS_AS(FeedDrive(good, period_s, 0.0), Error);
  CHECK_THROWS_AS(FeedDrive(good, period_s, 1e-6, -1.0), Error);
  CHECK_THROWS_AS(FeedDriveRealTime(good, 0.0), Error);
  CHECK_THROWS_AS(FeedDriveRealTime(good, period_s, 0), Error);
  FeedDrive drive(good, period_s);
  drive.step(0.01);
  CHECK_THROWS_AS(drive.step(nan), Error);
  CHECK_THROWS_AS(drive.reset(nan), Error);
  CHECK(drive.time_s() == period_s);
  CHECK_THROWS_AS(linear_model(good), Error);
  FeedDriveParameters gap = feed_drives::linear();
  gap.backlash_m = 1e-6;
  CHECK_THROWS_AS(linear_model(gap), Error);
}

TEST_CASE("feed drive: a failure carries CVODE's flag and the time, and the drive can be used again") {
  FeedDrive drive(feed_drives::with_friction(), period_s);
  drive.step(0.01);
  const double response = drive.response_mm();
  try {
    drive.step(1e300);
    FAIL("no error");
  } catch (const Error& error) {
    CHECK(error.kind() == ErrorKind::numeric);
    CHECK_MESSAGE(std::string(error.what()).find("CV_") != std::string::npos, error.what());
    CHECK(std::string(error.what()).find("t = 0.001") != std::string::npos);
  }
  CHECK(drive.response_mm() == response);
  CHECK(drive.setpoint_mm() == doctest::Approx(0.01));
  FeedDrive other(feed_drives::with_friction(), period_s);
  other.step(0.01);
  CHECK(std::abs(drive.step(0.03) - other.step(0.03)) < 1e-6);
}

TEST_CASE("feed drive in real time: third order against the exact linear solution") {
  const std::vector<double> setpoints = feed_drives::circle_mm(300);
  for (const FeedDriveParameters& parameters : linear_drives()) {
    const std::vector<double> exact_mm = exact(linear_model(parameters), setpoints);
    const auto error_mm = [&](int substeps) {
      FeedDriveRealTime drive(parameters, period_s, substeps);
      return largest_difference(play(drive, setpoints), exact_mm);
    };
    CHECK(error_mm(4) < 3e-5);
    CHECK(error_mm(32) < error_mm(16) / 6.0);
  }
}

TEST_CASE("feed drive in real time: beside CVODE with friction, backlash and limit") {
  const std::vector<double> setpoints = feed_drives::circle_mm(1200);
  FeedDriveParameters parameters = feed_drives::with_friction();
  const auto error_mm = [&] {
    FeedDrive drive(parameters, period_s, 1e-9, 1e-10);
    FeedDriveRealTime real_time(parameters, period_s);
    const double error = largest_difference(play(drive, setpoints), play(real_time, setpoints));
    CHECK(real_time.table_mm() == doctest::Approx(drive.table_mm()).epsilon(1e-5));
    CHECK(real_time.motor_mm() == doctest::Approx(drive.motor_mm()).epsilon(1e-5));
    CHECK(real_time.friction_force_n() == doctest::Approx(drive.friction_force_n()).epsilon(1e-3));
    CHECK(real_time.motor_force_n() == doctest::Approx(drive.motor_force_n()).epsilon(1e-3));
    return error;
  };
  CHECK(error_mm() < 2e-5);
  parameters.velocity_feed_forward_ratio = 0.9;
  parameters.acceleration_feed_forward_ratio = 0.8;
  CHECK(error_mm() < 2e-5);
  parameters.backlash_m = 5e-6;
  CHECK(error_mm() < 1e-4);
  parameters.force_limit_n = 700.0;
  CHECK(error_mm() < 1e-3);
  parameters.force_limit_n = 0.0;
  parameters.table_friction = feed_drives::stribeck();
  CHECK(error_mm() < 1e-3);
}

TEST_CASE("feed drive in real time: set-points that no machine follows stay near CVODE") {
  FeedDriveParameters parameters = feed_drives::with_friction();
  parameters.motor_friction = feed_drives::lugre();
  parameters.backlash_m = 1e-6;
  parameters.velocity_feed_forward_ratio = 0.9;
  parameters.position_gain_per_s = 50.0;
  std::vector<double> jumps;  // 5 m/s for a millisecond: fixed steps alone end in numbers that are not finite
  for (int i = 0; i < 600; ++i) jumps.push_back(i / 100 % 2 == 1 ? 5.0 : 0.0);
  FeedDrive drive(parameters, period_s, 1e-8, 1e-8);
  FeedDriveRealTime real_time(parameters, period_s);
  CHECK(largest_difference(play(drive, jumps), play(real_time, jumps)) < 0.05);
}

TEST_CASE("feed drive in real time: a copy goes on alike, and reset forgets what was not finite") {
  FeedDriveRealTime drive(feed_drives::with_friction(), period_s);
  for (const double setpoint : feed_drives::circle_mm(50)) drive.step(setpoint);
  FeedDriveRealTime copy = drive;
  CHECK(copy.step(1.3) == drive.step(1.3));
  CHECK(std::isnan(drive.step(std::numeric_limits<double>::quiet_NaN())));
  drive.reset(3.0);
  CHECK(drive.step(3.0) == 3.0);
}
