#include <doctest/doctest.h>

#include <array>
#include <cmath>
#include <random>
#include <span>

#include "shapegcode/error.hpp"
#include "shapegcode/fanuc_model.hpp"
#include "shapegcode/motion.hpp"
#include "stepped_into.hpp"

using namespace shapegcode;

namespace {

FanucModel paper_machine() {
  FanucModel model;
  model.rapid_rate_mm_per_s = Vector3::Constant(10000.0 / 60.0);
  model.rapid_time_constant_s = Vector3::Constant(0.15);
  model.in_position_s = {0.025, 0.025, 0.12};
  return model;
}

}  // namespace

TEST_CASE("rapid: paper 004, eq. 6, 11 and 13 on numbers worked out by hand") {
  FanucModel model = paper_machine();
  // 100 mm at 166.67 mm/s: 600 ms, and the time constant.
  CHECK(rapid_time_s({100.0, 0.0, 0.0}, model) == doctest::Approx(0.750));
  CHECK(rapid_time_s({100.1, 0.0, 0.0}, model) == doctest::Approx(0.751));  // 600.6 ms -> 601 ms
  // 10 mm: a = 1111.1 mm/s2, sqrt(10 / 1111.1) = 94.87 ms -> 2 x 95 ms.
  CHECK(rapid_time_s({0.0, 0.0, -10.0}, model) == doctest::Approx(0.190));
  // The border between both: 25 mm takes 150 ms at the rate.
  CHECK(rapid_time_s({25.0, 0.0, 0.0}, model) == doctest::Approx(0.300));
  CHECK(rapid_time_s({0.0, 0.0, 0.0}, model) == 0.0);
  model.rapid_bell_time_s = 0.03;
  CHECK(rapid_time_s({100.0, 0.0, 0.0}, model) == doctest::Approx(0.780));
  CHECK(rapid_time_s({0.0, 0.0, -10.0}, model) == doctest::Approx(0.220));
}

TEST_CASE("rapid: per axis rates and time constants, straight and each axis for itself") {
  FanucModel model = paper_machine();
  model.rapid_rate_mm_per_s = {400.0, 300.0, 100.0};
  model.rapid_time_constant_s = {0.1, 0.2, 0.05};
  // X 1 s, Y 0.5 s, Z 0.9 s at their rates. Straight: X sets the rate; the acceleration is Y's or Z's, scaled: X may
  // have 4000, Y 1500 * 400/150, Z 2000 * 400/90 mm/s2: X and Y alike, so the ramp lasts 400 / 4000.
  CHECK(rapid_time_s({400.0, -150.0, 90.0}, model) == doctest::Approx(1.1));
  model.rapid_path = RapidPath::non_linear;
  CHECK(rapid_time_s({400.0, -150.0, 90.0}, model) == doctest::Approx(1.1));  // X
  CHECK(rapid_time_s({40.0, -150.0, 90.0}, model) == doctest::Approx(0.95));  // Z 0.9 + 0.05
  CHECK(rapid_time_s({40.0, -240.0, 70.0}, model) == doctest::Approx(1.0));   // Y 0.8 + 0.2
  const RapidShape shape = rapid_shape({40.0, -240.0, 0.0}, model);
  CHECK(shape.travel[2] == 0);
  CHECK(shape.rate_mm_per_s == doctest::Approx(300.0));
}

TEST_CASE("rapid: the override scales the rate and keeps the acceleration") {
  FanucModel model = paper_machine();
  model.rapid_override = 0.5;
  CHECK(rapid_time_s({100.0, 0.0, 0.0}, model) == doctest::Approx(1.2 + 0.075));
  CHECK(rapid_time_s({5.0, 0.0, 0.0}, model) == doctest::Approx(2.0 * 0.068));  // sqrt(5 / 1111.1) = 67.08 ms
}

TEST_CASE(
    "rapid: closed form and set-points agree on 20000 rapids, and with the planner of look-ahead to two periods") {
  std::mt19937 generator(7);
  std::uniform_real_distribution<double> unit(0.0, 1.0);
  for (int i = 0; i < 20000; ++i) {
    FanucModel model;
    model.period_s = i % 3 == 0 ? 0.004 : 0.001;
    const double rate = 50.0 + 500.0 * unit(generator);
    model.rapid_rate_mm_per_s = {rate, rate * (0.3 + unit(generator)), rate * (0.3 + unit(generator))};
    for (int axis = 0; axis < axis_count; ++axis) {
      model.rapid_time_constant_s[axis] = model.period_s * (1 + i % 50) * (1.0 + (axis == 2 ? unit(generator) : 0.0));
    }
    model.rapid_bell_time_s = i % 2 == 0 ? 0.0 : model.period_s * (i % 20);
    model.rapid_path = i % 5 < 3 ? RapidPath::linear : RapidPath::non_linear;
    const double reach = std::pow(10.0, -3.0 + 5.0 * unit(generator));
    Vector3 travel(reach * (unit(generator) - 0.5), i % 4 == 0 ? 0.0 : reach * (unit(generator) - 0.5), 0.0);
    if (i % 7 == 0) travel.z() = -reach;
    CAPTURE(i);
    RapidInterpolator interpolator({1.0, 2.0, 3.0}, Vector3(1.0, 2.0, 3.0) + travel, model);
    CHECK(interpolator.period_count() * model.period_s == doctest::Approx(rapid_time_s(travel, model)));
    if (i % 50 != 0 || model.rapid_path != RapidPath::linear || model.rapid_bell_time_s > 0.0) continue;
    MotionLimits limits;
    limits.law = AccelerationLaw::jerk_limited;
    limits.max_feed_mm_per_s = model.rapid_rate_mm_per_s;
    limits.max_acceleration_mm_per_s2 = model.rapid_rate_mm_per_s.cwiseQuotient(model.rapid_time_constant_s);
    const Path path({make_line(Vector3::Zero(), travel, 1e6)});
    const double planned = plan_speed(path, limits).duration_s();
    CHECK(std::abs(rapid_time_s(travel, model) - planned) <= 2.0 * model.period_s);
  }
}

TEST_CASE("rapid: refuses what cannot be counted or given") {
  FanucModel model = paper_machine();
  model.rapid_rate_mm_per_s = Vector3::Constant(1e-9);
  CHECK_THROWS_AS((void)rapid_time_s({100.0, 0.0, 0.0}, model), Error);
  CHECK_THROWS_AS(RapidInterpolator(Vector3::Zero(), {100.0, 0.0, 0.0}, model), Error);
  model = paper_machine();
  model.rapid_time_constant_s.y() = -0.1;
  CHECK_THROWS_AS(RapidInterpolator(Vector3::Zero(), {100.0, 0.0, 0.0}, model), Error);
}

TEST_CASE("rapid: set-points end in the end, and go on giving it") {
  const FanucModel model = paper_machine();
  RapidInterpolator interpolator({0.0, 0.0, 0.0}, {0.1, -3.0, 7.0}, model);
  Vector3 position;
  int count = 0;
  while (interpolator.step(position)) ++count;
  CHECK(count == interpolator.period_count() + 1);
  CHECK(position == Vector3(0.1, -3.0, 7.0));
  CHECK_FALSE(interpolator.step(position));
  const Samples none = rapid_samples({4.0, 4.0, 4.0}, {4.0, 4.0, 4.0}, model);
  CHECK(none.positions_mm.rows() == 1);
}

TEST_CASE("rapid: into memory of the caller's, the same set-points") {
  RapidInterpolator interpolator({0.0, 1.0, 2.0}, {10.0, -5.0, 2.0}, paper_machine());
  RapidInterpolator other = interpolator;
  shapegcode::tests::check_same_into_memory(interpolator, other);
}
