#include <doctest/doctest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <complex>
#include <limits>
#include <numbers>
#include <utility>
#include <vector>

#include "shapegcode/error.hpp"
#include "shapegcode/plant/modal.hpp"

using shapegcode::AxisModes;
using shapegcode::AxisModeTables;
using shapegcode::Error;
using shapegcode::ModalPlant;
using shapegcode::Mode;
using shapegcode::ModeTable;
using shapegcode::Vector3;

namespace {

constexpr double two_pi = 2.0 * std::numbers::pi;

using State = std::array<double, 2>;  // position and velocity

struct Oscillator {
  double omega, zeta, omega_d;
  explicit Oscillator(const Mode& mode)
      : omega(two_pi * mode.frequency_hz), zeta(mode.damping_ratio), omega_d(omega * std::sqrt(1.0 - zeta * zeta)) {}
  /// Deflection at t after a jump of the command's velocity by one: minus the impulse response.
  [[nodiscard]] double after_velocity_jump(double t) const {
    return t <= 0.0 ? 0.0 : -std::exp(-zeta * omega * t) * std::sin(omega_d * t) / omega_d;
  }
  /// Rate of position and velocity behind a command x that moves at xv: u'' = 2 zeta omega (xv - u') + omega^2 (x - u).
  [[nodiscard]] State rate(const State& u, double x, double xv) const {
    return {u[1], 2.0 * zeta * omega * (xv - u[1]) + omega * omega * (x - u[0])};
  }
};

/// One step of the classical fourth-order method from t to t + h; `rate`: of time and state.
template <typename Rate>
void runge_kutta_step(State& y, double t, double h, const Rate& rate) {
  const auto ahead = [&y](const State& r, double dt) { return State{y[0] + dt * r[0], y[1] + dt * r[1]}; };
  const State k1 = rate(t, y);
  const State k2 = rate(t + h / 2, ahead(k1, h / 2));
  const State k3 = rate(t + h / 2, ahead(k2, h / 2));
  const State k4 = rate(t + h, ahead(k3, h));
  for (std::size_t j = 0; j < 2; ++j) y[j] += h / 6 * (k1[j] + 2 * k2[j] + 2 * k3[j] + k4[j]);
}

/// A command with every kind of change, in mm.
double command_at(double t) {
  if (t < 0.05) return 0.0;
  if (t < 0.25) return 500.0 * (t - 0.05) * (t - 0.05);
  return 20.0 + 3.0 * std::sin(40.0 * (t - 0.25));
}

AxisModes on_x(std::vector<Mode> modes) { return {std::move(modes), {}, {}}; }
AxisModes on_z(Mode mode) { return {std::vector<Mode>{}, std::vector<Mode>{}, std::vector<Mode>{mode}}; }

}  // namespace

TEST_CASE("modal: pole and refusals") {
  const Mode mode{46.0, 0.02, 1.0};
  const std::complex<double> s = shapegcode::pole(mode);
  CHECK(s.real() == doctest::Approx(-0.02 * two_pi * 46.0));
  CHECK(std::abs(s) == doctest::Approx(two_pi * 46.0));
  const double nan = std::numeric_limits<double>::quiet_NaN();
  CHECK_THROWS_AS((void)shapegcode::pole({0.0, 0.02, 1.0}), Error);
  CHECK_THROWS_AS((void)shapegcode::pole({nan, 0.02, 1.0}), Error);
  CHECK_THROWS_AS((void)shapegcode::pole({46.0, 1.0, 1.0}), Error);
  CHECK_THROWS_AS((void)shapegcode::pole({46.0, -0.01, 1.0}), Error);
  CHECK_THROWS_AS((void)shapegcode::pole({46.0, nan, 1.0}), Error);
  CHECK_THROWS_AS(ModalPlant(on_x({{46.0, 0.02, 1.0}}), 0.0), Error);
  CHECK_THROWS_AS(ModalPlant(on_x({{46.0, 0.02, 1.0}}), nan), Error);
  CHECK_THROWS_AS(ModalPlant(on_x({{46.0, 0.02, nan}}), 1e-3), Error);
  CHECK_THROWS_AS((void)ModalPlant(on_x({{46.0, 0.02, 1.0}}), 1e-3).residual_peak(0), Error);
}

TEST_CASE("modal: an axis without modes follows exactly, rest stays rest") {
  ModalPlant plant(on_x({{46.0, 0.02, 1.0}}), 1e-3);
  plant.reset({1.0, 2.0, 3.0});
  for (int i = 0; i < 10; ++i) CHECK(plant.step({1.0, 2.0, 3.0}) == Vector3(1.0, 2.0, 3.0));
  CHECK(plant.peak().isZero(0.0));
  const Vector3 response = plant.step({1.5, 2.5, 3.5});
  CHECK(response[1] == 2.5);
  CHECK(response[2] == 3.5);
  CHECK(response[0] == 1.5 + plant.deflection()[0]);
  CHECK(response[0] < 1.5);
}

TEST_CASE("modal: ramp and one-period step against the closed form") {
  for (const double zeta : {0.0, 0.02, 0.3, 0.95}) {
    for (const double period : {1e-4, 1e-3, 8e-3, 30e-3}) {
      const Mode mode{46.0, zeta, 0.7};
      const Oscillator oscillator(mode);
      ModalPlant ramp(on_x({mode}), period);
      ModalPlant step(on_x({mode}), period);
      ramp.reset(Vector3::Zero());
      step.reset(Vector3::Zero());
      const double v = 100.0;
      const double height = 2.0;
      double worst = 0.0;
      for (int i = 1; i <= 200; ++i) {
        const double t = i * period;
        const double ramp_error = ramp.step({v * t, 0, 0})[0] - (v * t + 0.7 * v * oscillator.after_velocity_jump(t));
        const double expected_step =
            height +
            0.7 * height / period * (oscillator.after_velocity_jump(t) - oscillator.after_velocity_jump(t - period));
        worst = std::max({worst, std::abs(ramp_error), std::abs(step.step({height, 0, 0})[0] - expected_step)});
      }
      CAPTURE(zeta);
      CAPTURE(period);
      CHECK(worst < 1e-10);
    }
  }
}

TEST_CASE("modal: several modes against an independent Runge-Kutta integration of u") {
  const std::vector<Mode> modes{{46.0, 0.02, 0.8}, {131.0, 0.05, 0.3}, {12.0, 0.2, -0.1}};
  const double period = 2e-3;
  constexpr int fine = 400;
  const double h = period / fine;
  ModalPlant plant(on_x(modes), period);
  plant.reset(Vector3::Zero());
  // u'' = 2 zeta omega (x' - u') + omega^2 (x - u), one u per mode; response x + sum participation (u - x).
  std::array<State, 3> state{};
  double worst = 0.0;
  double fine_peak = 0.0;
  for (int i = 1; i <= 300; ++i) {
    const double x0 = command_at((i - 1) * period);
    const double x1 = command_at(i * period);
    const double xv = (x1 - x0) / period;
    double deflection = 0.0;
    for (int k = 0; k < fine; ++k) {
      deflection = 0.0;
      for (std::size_t m = 0; m < 3; ++m) {
        const Oscillator o(modes[m]);
        const double t = k * h;
        runge_kutta_step(state[m], t, h, [&](double at, const State& y) { return o.rate(y, x0 + xv * at, xv); });
        deflection += modes[m].participation * (state[m][0] - (x0 + xv * (t + h)));
      }
      fine_peak = std::max(fine_peak, std::abs(deflection));
    }
    worst = std::max(worst, std::abs(plant.step({x1, 0, 0})[0] - (x1 + deflection)));
  }
  CHECK(worst < 1e-9);
  CHECK(plant.peak()[0] == doctest::Approx(fine_peak).epsilon(2e-4));
}

TEST_CASE("modal: free decay has the stated rate, without damping the amplitude stays") {
  for (const double zeta : {0.0, 0.02}) {
    const Mode mode{100.0, zeta, 1.0};
    const Oscillator o(mode);
    const double period = two_pi / o.omega_d / 20.0;
    ModalPlant plant(on_x({mode}), period);
    plant.reset(Vector3::Zero());
    plant.step({1.0, 0, 0});
    for (int i = 0; i < 4; ++i) plant.step({1.0, 0, 0});
    double before = plant.deflection()[0];
    for (int swing = 0; swing < 1000 && std::abs(before) > 1e-8; ++swing) {
      for (int i = 0; i < 20; ++i) plant.step({1.0, 0, 0});
      const double now = plant.deflection()[0];
      CHECK(now / before == doctest::Approx(std::exp(-zeta * o.omega * 20.0 * period)).epsilon(1e-9));
      before = now;
    }
  }
}

TEST_CASE("modal: peak sees a swing between set-points") {
  const Mode mode{131.0, 0.0, 1.0};
  const Oscillator o(mode);
  for (const double period : {1e-3, 5e-3}) {
    ModalPlant plant(on_x({mode}), period);
    plant.reset(Vector3::Zero());
    for (int i = 1; i <= 100; ++i) plant.step({0.1 * i, 0, 0});
    CHECK(plant.peak()[0] == doctest::Approx(0.1 / period / o.omega).epsilon(1e-4));
    plant.reset_peak();
    CHECK(plant.peak()[0] == std::abs(plant.deflection()[0]));
    plant.reset({5, 0, 0});
    CHECK(plant.peak().isZero(0.0));
  }
}

TEST_CASE("modal: residual peak of a stopped ramp, the stop included") {
  for (const double zeta : {0.0, 0.02, 0.2}) {
    const Mode mode{46.0, zeta, 1.0};
    const Oscillator o(mode);
    const double period = 1e-3;
    ModalPlant plant(on_x({mode}), period);
    plant.reset(Vector3::Zero());
    const int n = 137;
    const double v = 100.0;
    for (int i = 1; i <= n; ++i) plant.step({v * i * period, 0, 0});
    const double stop = n * period;
    double expected = 0.0;
    for (double t = stop; t < stop + 6.0 / 46.0; t += 1e-6) {
      expected = std::max(expected, std::abs(v * (o.after_velocity_jump(t) - o.after_velocity_jump(t - stop))));
    }
    CHECK(plant.residual_peak()[0] == doctest::Approx(expected).epsilon(1e-5));
    CHECK(plant.residual_peak()[1] == 0.0);
  }
  // Two modes beat: the search must reach the time when they add up.
  const std::vector<Mode> pair{{100.0, 0.0, 1.0}, {110.0, 0.0, 1.0}};
  ModalPlant plant(on_x(pair), 1e-3);
  plant.reset(Vector3::Zero());
  for (int i = 1; i <= 50; ++i) plant.step({0.1 * i, 0, 0});
  double expected = 0.0;
  for (double t = 0.05; t < 0.05 + 0.2; t += 1e-6) {
    double d = 0.0;
    for (const Mode& mode : pair) {
      const Oscillator o(mode);
      d += 100.0 * (o.after_velocity_jump(t) - o.after_velocity_jump(t - 0.05));
    }
    expected = std::max(expected, std::abs(d));
  }
  CHECK(plant.residual_peak(20)[0] == doctest::Approx(expected).epsilon(1e-5));
}

TEST_CASE("modal: a two-impulse zero-vibration shaper leaves nothing after a ramp") {
  const double zeta = 0.05;
  const double period = 1e-3;
  // Half the damped period is 10 samples exactly.
  const double frequency = 1.0 / (2.0 * 10.0 * period * std::sqrt(1.0 - zeta * zeta));
  const Mode mode{frequency, zeta, 1.0};
  const double k = std::exp(-zeta * std::numbers::pi / std::sqrt(1.0 - zeta * zeta));
  ModalPlant shaped(on_x({mode}), period);
  ModalPlant plain(on_x({mode}), period);
  shaped.reset(Vector3::Zero());
  plain.reset(Vector3::Zero());
  const auto ramp = [&](int i) { return 0.1 * std::clamp(i, 0, 100); };
  for (int i = 1; i <= 110; ++i) {
    shaped.step({(ramp(i) + k * ramp(i - 10)) / (1.0 + k), 0, 0});
    if (i <= 100) plain.step({ramp(i), 0, 0});
  }
  CHECK(plain.residual_peak()[0] > 1e-3);
  CHECK(shaped.residual_peak()[0] < 1e-12);
}

TEST_CASE("modal: a mode far above the set-point rate is propagated exactly too") {
  const Mode mode{1230.0, 0.01, 1.0};
  const Oscillator o(mode);
  ModalPlant plant(on_x({mode}), 5e-3);
  plant.reset(Vector3::Zero());
  for (int i = 1; i <= 20; ++i) {
    plant.step({0.5 * i, 0, 0});
    CHECK(plant.deflection()[0] == doctest::Approx(100.0 * o.after_velocity_jump(i * 5e-3)).epsilon(1e-9));
  }
  CHECK(plant.peak()[0] > 0.97 * 100.0 / o.omega);
}

TEST_CASE("modal: a mode that other axes excite is that of one axis under their sum") {
  const Mode mode{46.0, 0.02, 0.7};
  Mode crossing = mode;
  crossing.excited_by = {0.5, -2.0, 0.0};
  const Mode of_y{80.0, 0.03, 1.0};
  const Mode of_z{30.0, 0.01, 0.2};
  ModalPlant across(AxisModes{std::vector<Mode>{}, std::vector<Mode>{of_y}, std::vector<Mode>{crossing, of_z}}, 1e-3);
  ModalPlant alone(AxisModes{std::vector<Mode>{mode}, std::vector<Mode>{of_y}, std::vector<Mode>{of_z}}, 1e-3);
  across.reset({1.0, 2.0, 3.0});
  alone.reset({0.5 * 1.0 - 2.0 * 2.0, 2.0, 3.0});
  for (int k = 1; k <= 400; ++k) {
    const double t = 1e-3 * k;
    const Vector3 command(1.0 + command_at(t), 2.0 + std::sin(30.0 * t), 3.0 - 0.1 * command_at(0.5 * t));
    across.step(command);
    alone.step({0.5 * command[0] - 2.0 * command[1], command[1], command[2]});
    REQUIRE(across.deflection()[0] == 0.0);
    REQUIRE(across.deflection()[1] == alone.deflection()[1]);
    REQUIRE(across.deflection()[2] == doctest::Approx(alone.deflection()[0] + alone.deflection()[2]).epsilon(1e-9));
  }
  CHECK(across.peak()[2] > 0.01);
  // Behind the stop too: a plant whose Z has nothing but the crossing mode.
  ModalPlant z(on_z(crossing), 1e-3);
  ModalPlant x(on_x({mode}), 1e-3);
  for (int k = 1; k <= 137; ++k) {
    z.step({0.1 * k, -0.05 * k, 7.0 * k});
    x.step({0.15 * k, 0.0, 0.0});
  }
  CHECK(z.residual_peak()[2] == doctest::Approx(x.residual_peak()[0]).epsilon(1e-9));
  CHECK(z.peak()[2] == doctest::Approx(x.peak()[0]).epsilon(1e-9));
  crossing.excited_by[1] = std::numeric_limits<double>::infinity();
  CHECK_THROWS_AS(ModalPlant(on_z(crossing), 1e-3), Error);
}

TEST_CASE("modal: tables of modes") {
  const Mode mode{46.0, 0.02, 0.7};
  const ModeTable table{2, {0.0, 200.0, 400.0}, {52.0, 46.0, 41.0}, {0.02, 0.03, 0.01}};
  const auto at = [&](double position) { return shapegcode::mode_at(mode, table, position); };
  CHECK(at(-5.0).frequency_hz == 52.0);
  CHECK(at(0.0).frequency_hz == 52.0);
  CHECK(at(50.0).frequency_hz == doctest::Approx(50.5));
  CHECK(at(50.0).damping_ratio == doctest::Approx(0.0225));
  CHECK(at(200.0).frequency_hz == 46.0);
  CHECK(at(300.0).frequency_hz == doctest::Approx(43.5));
  CHECK(at(400.0).frequency_hz == 41.0);
  CHECK(at(1e9).damping_ratio == 0.01);
  CHECK(at(300.0).participation == 0.7);
  CHECK(shapegcode::mode_at(mode, {}, 300.0).frequency_hz == 46.0);
  CHECK(shapegcode::mode_at(mode, {0, {5.0}, {40.0}, {}}, 300.0).frequency_hz == 40.0);

  const double nan = std::numeric_limits<double>::quiet_NaN();
  for (const ModeTable& bad : std::vector<ModeTable>{{3, {0.0}, {50.0}, {}},
                                                     {0, {0.0, 0.0}, {50.0, 51.0}, {}},
                                                     {0, {0.0, nan}, {50.0, 51.0}, {}},
                                                     {0, {0.0, 1.0}, {50.0}, {}},
                                                     {0, {0.0, 1.0}, {50.0, 51.0}, {0.1}},
                                                     {0, {0.0, 1.0}, {50.0, 0.0}, {}},
                                                     {0, {0.0, 1.0}, {50.0, 51.0}, {0.1, 1.0}}}) {
    CHECK_THROWS_AS(ModalPlant(on_x({mode}), 1e-3, {{{bad}, {}, {}}}), Error);
  }
  CHECK_THROWS_AS(ModalPlant(on_x({mode}), 1e-3, {{{table, table}, {}, {}}}), Error);
}

TEST_CASE("modal: a table that says the same everywhere changes nothing but rounding") {
  const std::vector<Mode> modes{{46.0, 0.02, 0.8}, {131.0, 0.05, 0.3}};
  const ModeTable constant{1, {0.0, 10.0, 20.0}, {46.0, 46.0, 46.0}, {}};
  ModalPlant plain(on_x(modes), 2e-3);
  ModalPlant tabled(on_x(modes), 2e-3, {{{constant}, {}, {}}});
  plain.reset(Vector3::Zero());
  tabled.reset(Vector3::Zero());
  double worst = 0.0;
  for (int i = 1; i <= 300; ++i) {
    const Vector3 command(command_at(i * 2e-3), 0.1 * i, 0.0);
    worst = std::max(worst, (plain.step(command) - tabled.step(command)).cwiseAbs().maxCoeff());
  }
  CHECK(worst < 1e-12);
  CHECK(tabled.peak()[0] == doctest::Approx(plain.peak()[0]).epsilon(1e-12));
  CHECK(tabled.residual_peak()[0] == doctest::Approx(plain.residual_peak()[0]).epsilon(1e-12));
}

TEST_CASE("modal: a mode that varies with position against a Runge-Kutta integration of the varying equation") {
  // X swings at 52 ... 41 Hz over Z, Z moves at up to 500 mm/s and back; the second mode stays.
  const std::vector<Mode> modes{{46.0, 0.02, 0.8}, {131.0, 0.05, 0.3}};
  const ModeTable table{2, {0.0, 100.0, 200.0}, {52.0, 46.0, 41.0}, {0.02, 0.03, 0.01}};
  const auto z_at = [](double t) { return 100.0 - 120.0 * std::cos(4.0 * t); };
  for (const double period : {1e-3, 2e-3}) {
    constexpr int fine = 200;
    const double h = period / fine;
    ModalPlant plant(on_x(modes), period, AxisModeTables{{{table}, {}, {}}});
    plant.reset({0.0, 0.0, z_at(0.0)});
    std::array<State, 2> state{};
    double worst = 0.0;
    double fine_peak = 0.0;
    const int steps = static_cast<int>(0.8 / period);
    for (int i = 1; i <= steps; ++i) {
      const double x0 = command_at((i - 1) * period);
      const double x1 = command_at(i * period);
      const double xv = (x1 - x0) / period;
      const double z0 = z_at((i - 1) * period);
      const double z1 = z_at(i * period);
      double deflection = 0.0;
      for (int k = 0; k < fine; ++k) {
        deflection = 0.0;
        for (std::size_t m = 0; m < 2; ++m) {
          const double t = k * h;
          runge_kutta_step(state[m], t, h, [&](double at, const State& y) {
            Mode here = modes[m];
            if (m == 0) {
              const double z = z0 + (z1 - z0) * at / period;
              const double share = std::clamp(z / 100.0, 0.0, 2.0);
              here.frequency_hz = share < 1.0 ? 52.0 - 6.0 * share : 46.0 - 5.0 * (share - 1.0);
              here.damping_ratio = share < 1.0 ? 0.02 + 0.01 * share : 0.03 - 0.02 * (share - 1.0);
            }
            return Oscillator(here).rate(y, x0 + xv * at, xv);
          });
          deflection += modes[m].participation * (state[m][0] - (x0 + xv * (t + h)));
        }
        fine_peak = std::max(fine_peak, std::abs(deflection));
      }
      worst = std::max(worst, std::abs(plant.step({x1, 0.0, z1})[0] - (x1 + deflection)));
    }
    CAPTURE(period);
    CAPTURE(fine_peak);
    // The frozen frequency errs by the square of the period; the peak deflection is some 0.3 mm.
    CHECK(worst < 5e-5 * fine_peak * (period / 1e-3) * (period / 1e-3));
    CHECK(plant.peak()[0] == doctest::Approx(fine_peak).epsilon(2e-4));
  }
}

TEST_CASE("modal: the residual after a stop is that of the mode where the axis stands") {
  const Mode mode{46.0, 0.02, 1.0};
  const ModeTable table{2, {0.0, 400.0}, {52.0, 41.0}, {}};
  for (const double z : {-10.0, 0.0, 123.0, 400.0, 500.0}) {
    ModalPlant varying(on_x({mode}), 1e-3, AxisModeTables{{{table}, {}, {}}});
    const double frequency = 52.0 - 11.0 * std::clamp(z / 400.0, 0.0, 1.0);
    ModalPlant fixed(on_x({{frequency, 0.02, 1.0}}), 1e-3);
    varying.reset({0.0, 0.0, z});
    fixed.reset({0.0, 0.0, z});
    for (int i = 1; i <= 137; ++i) {
      varying.step({0.1 * i, 0.0, z});
      fixed.step({0.1 * i, 0.0, z});
    }
    CHECK(varying.residual_peak()[0] == doctest::Approx(fixed.residual_peak()[0]).epsilon(1e-5));
  }
}
