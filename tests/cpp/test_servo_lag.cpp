#include <doctest/doctest.h>

#include <cmath>

#include "shapegcode/error.hpp"
#include "shapegcode/plant/servo_lag.hpp"

using shapegcode::Error;
using shapegcode::ServoLag;
using shapegcode::Vector3;

TEST_CASE("servo lag: refuses what no loop can have") {
  const Vector3 gain = Vector3::Constant(30.0);
  CHECK_THROWS_AS(ServoLag(gain, Vector3::Zero(), 0.0), Error);
  CHECK_THROWS_AS(ServoLag(Vector3(30.0, 0.0, 30.0), Vector3::Zero(), 1e-3), Error);
  CHECK_THROWS_AS(ServoLag(gain, Vector3(0.0, 0.0, 1.5), 1e-3), Error);
}

TEST_CASE("servo lag: behind a steady speed the error is v (1 - a) / K and rises and decays with exp(-K t)") {
  const double speed = 80.0;
  const double period = 2e-3;
  ServoLag loop({30.0, 40.0, 50.0}, {0.0, 0.5, 1.0}, period);
  loop.reset({5.0, 5.0, 5.0});
  for (int i = 1; i <= 200; ++i) {
    const double t = i * period;
    const Vector3 setpoint = Vector3::Constant(5.0 + speed * t);
    const Vector3 position = loop.step(setpoint);
    CHECK(loop.error_mm().x() == doctest::Approx(speed / 30.0 * (1.0 - std::exp(-30.0 * t))));
    CHECK(loop.error_mm().y() == doctest::Approx(0.5 * speed / 40.0 * (1.0 - std::exp(-40.0 * t))));
    CHECK(loop.error_mm().z() == 0.0);
    CHECK((setpoint - position - loop.error_mm()).norm() < 1e-12);
  }
  const double at_stop = loop.error_mm().x();
  const Vector3 stop = Vector3::Constant(5.0 + speed * 0.4);
  loop.shift({1.0, 2.0, 3.0});  // a change of coordinates moves nothing
  for (int i = 1; i <= 100; ++i) {
    loop.step(stop + Vector3(1.0, 2.0, 3.0));
    CHECK(loop.error_mm().x() == doctest::Approx(at_stop * std::exp(-30.0 * i * period)));
  }
}
