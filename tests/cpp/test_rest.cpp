// Behind a stop what vibrates or lags dies out. Among the smallest numbers a step takes many times as long, and
// rounding can hold a state there for ever: no state may come there.
#include <doctest/doctest.h>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <utility>
#include <vector>

#include "feed_drives.hpp"
#include "shapegcode/filter.hpp"
#include "shapegcode/plant/feed_drive.hpp"
#include "shapegcode/plant/linear_plant.hpp"
#include "shapegcode/plant/modal.hpp"
#include "shapegcode/plant/servo_lag.hpp"

using namespace shapegcode;

namespace {

constexpr double period_s = 1e-3;
constexpr long moving = 500;
constexpr long steps = 60'000;

/// There and back to zero, then rest.
double command(long i) { return i < moving ? std::sin(0.01 * static_cast<double>(i)) : 0.0; }

struct Rest {
  long subnormal = 0;
  bool moved = false;
  double last = 0.0;
  void see(double value) {
    subnormal += std::fpclassify(value) == FP_SUBNORMAL ? 1 : 0;
    moved = moved || value != 0.0;
    last = value;
  }
};

/// Runs `step(i, rest)`, which shows the states to `rest`.
template <class Step>
void check_rest(Step&& step) {
  Rest rest;
  for (long i = 0; i < steps; ++i) step(i, rest);
  CHECK(rest.moved);
  CHECK(rest.subnormal == 0);
  CHECK(rest.last == 0.0);
}

}  // namespace

TEST_CASE("rest: modes end at nothing") {
  AxisModes modes;
  modes[0] = {{46.0, 0.1, 1.0}};
  ModalPlant plant(modes, period_s);
  check_rest([&](long i, Rest& rest) {
    plant.step(Vector3(command(i), 0.0, 0.0));
    rest.see(plant.deflection()[0]);
  });
  AxisModeTables tables;
  tables[0] = {{0, {-1.0, 1.0}, {40.0, 50.0}, {}}};
  ModalPlant varying(modes, period_s, tables);
  check_rest([&](long i, Rest& rest) {
    varying.step(Vector3(command(i), 0.0, 0.0));
    rest.see(varying.deflection()[0]);
  });
}

TEST_CASE("rest: modes of a record end as those of the plant, whatever its pieces") {
  const std::vector<Mode> modes{{46.0, 0.1, 1.0}, {131.0, 0.3, 0.5}, {20.0, 0.7, 0.1}};
  Eigen::MatrixXd record(steps, 1);
  for (long i = 0; i < steps; ++i) record(i, 0) = command(i);
  const Eigen::MatrixXd whole = plant_response(record, {modes}, period_s);
  ModalResponse response({modes}, period_s);
  Eigen::MatrixXd pieces(steps, 1);
  for (long first = 0, rows = 1; first < steps; first += rows, rows = std::min(rows * 3 + 1, 1000L)) {
    rows = std::min(rows, steps - first);
    response.apply(record.middleRows(first, rows), pieces.middleRows(first, rows));
  }
  CHECK((whole.array() == pieces.array()).all());
  AxisModes by_axis;
  by_axis[0] = modes;
  ModalPlant plant(by_axis, period_s);
  plant.reset(Vector3(command(0), 0.0, 0.0));
  long other = 0;
  for (long i = 1; i < steps; ++i) other += plant.step(Vector3(command(i), 0.0, 0.0))[0] != whole(i, 0) ? 1 : 0;
  CHECK(other == 0);
  CHECK(whole(steps - 1, 0) == 0.0);
}

TEST_CASE("rest: a servo loop's lag ends at nothing") {
  ServoLag loop(Vector3::Constant(30.0), Vector3::Constant(0.5), period_s);
  check_rest([&](long i, Rest& rest) {
    loop.step(Vector3(command(i), 0.0, 0.0));
    rest.see(loop.error_mm()[0]);
  });
}

TEST_CASE("rest: the states of a linear plant end at nothing") {
  StateSpace lag;
  lag.a = Eigen::MatrixXd::Constant(1, 1, -20.0);
  lag.b = Eigen::MatrixXd::Constant(1, 1, 20.0);
  lag.c = Eigen::MatrixXd::Identity(1, 1);
  lag.d = Eigen::MatrixXd::Zero(1, 1);
  LinearPlant plant(std::move(lag), period_s);
  double output = 0.0;
  check_rest([&](long i, Rest& rest) {
    const double input = command(i);
    plant.step({&input, 1}, {&output, 1});
    rest.see(plant.state()[0]);
  });
}

TEST_CASE("rest: a feed drive in real time ends at nothing") {
  FeedDriveParameters parameters = feed_drives::with_friction();
  parameters.table_friction = {};
  parameters.motor_friction = {};
  parameters.modes = {{46.0, 0.1, 1.0}};
  FeedDriveRealTime drive(parameters, period_s);
  check_rest([&](long i, Rest& rest) {
    drive.step(command(i));
    rest.see(drive.response_mm());
    rest.see(drive.motor_mm());
    rest.see(drive.table_mm());
  });
}

TEST_CASE("rest: filters end at the input, in both forms") {
  for (const double time_constant : {0.3, 3.0, 50.0}) {
    CAPTURE(time_constant);
    const Fir fir = Fir::exponential(time_constant);
    FirStream stream(fir, 1);
    std::vector<double> in;
    std::vector<double> streamed;
    check_rest([&](long i, Rest& rest) {
      double value = command(i);
      in.push_back(value);
      stream.step({&value, 1}, {&value, 1});
      streamed.push_back(value);
      rest.see(value);
    });
    std::vector<double> out(in.size() + static_cast<std::size_t>(fir.duration_samples()));
    fir.apply(in, out);
    out.resize(in.size());
    CHECK(out == streamed);
  }
  VaryingFirStream varying(VaryingFir({Fir({0, 4}, {0.5, 0.5}), Fir({0, 2, 5}, {0.3, 0.4, 0.3})}), 1);
  check_rest([&](long i, Rest& rest) {
    double value = command(i);
    varying.step({&value, 1}, {&value, 1}, 0.5 + 0.5 * value);
    rest.see(value);
  });
}
