#include <doctest/doctest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <memory>
#include <numbers>
#include <random>
#include <span>
#include <vector>

#include "row_of_lines.hpp"
#include "shapegcode/error.hpp"
#include "shapegcode/motion.hpp"
#include "shapegcode/simulation.hpp"

using shapegcode::BlockEnd;
using shapegcode::count_slowed_blocks;
using shapegcode::Error;
using shapegcode::fastest_block_ends;
using shapegcode::Fir;
using shapegcode::LookAheadLimits;
using shapegcode::make_arc;
using shapegcode::make_line;
using shapegcode::Mode;
using shapegcode::MotionLimits;
using shapegcode::Path;
using shapegcode::plan_speed;
using shapegcode::Samples;
using shapegcode::Segment;
using shapegcode::simulate_blocks;
using shapegcode::simulate_path;
using shapegcode::simulate_planned;
using shapegcode::simulate_samples;
using shapegcode::SimulationFigures;
using shapegcode::SimulationOptions;
using shapegcode::SpeedProfile;
using shapegcode::Vector3;
using shapegcode::tests::row_of_lines;

namespace {

constexpr double pi = std::numbers::pi;

using PathPointer = std::shared_ptr<const Path>;

PathPointer path_of(std::vector<Segment> segments) { return std::make_shared<const Path>(std::move(segments)); }

PathPointer paper_path(double feed) {
  return path_of({make_line({0, 0, 0}, {20, 0, 0}, feed),
                  make_arc({20, 0, 0}, {40, 20, 0}, {20, 20, 0}, pi / 2, 2, feed),
                  make_line({40, 20, 0}, {40, 40, 0}, feed)});
}

std::shared_ptr<const SpeedProfile> plan(const PathPointer& path, double arc_ratio) {
  MotionLimits limits;
  limits.time_constant_s = 0.05;
  limits.arc_feed_ratio = arc_ratio;
  return std::make_shared<const SpeedProfile>(plan_speed(*path, limits));
}

SimulationOptions vertical_machine(double period_s) {
  SimulationOptions options;
  options.period_s = period_s;
  options.modes = {std::vector<Mode>{{46.0, 0.02, 1.0}}, std::vector<Mode>{{131.0, 0.02, 1.0}}, {}};
  return options;
}

/// The paper's path in continuous time by its own formulas: nothing of the library.
struct PaperMotion {
  double feed, slow;
  double steady, arc_s, line_s, duration;

  PaperMotion(double feed_mm_per_s, double ratio) : feed(feed_mm_per_s), slow(ratio * feed_mm_per_s) {
    steady = (20.0 - 0.025 * feed - 0.025 * (feed + slow)) / feed;
    line_s = 0.1 + steady;
    arc_s = 10.0 * pi / slow;
    duration = 2.0 * line_s + arc_s;
  }

  [[nodiscard]] Vector3 acceleration(double t) const {
    const double up = feed / 0.05;
    const double between = (feed - slow) / 0.05;
    if (t < 0.0 || t >= duration) return Vector3::Zero();
    if (t < 0.05) return {up, 0, 0};
    if (t < 0.05 + steady) return Vector3::Zero();
    if (t < line_s) return {-between, 0, 0};
    if (t < line_s + arc_s) {
      const double turn = slow * (t - line_s) / 20.0;
      const double inwards = slow * slow / 20.0;
      return {-inwards * std::sin(turn), inwards * std::cos(turn), 0};
    }
    if (t < line_s + arc_s + 0.05) return {0, between, 0};
    if (t < line_s + arc_s + 0.05 + steady) return Vector3::Zero();
    return {0, -up, 0};
  }
};

struct Vibration {
  double before = 0.0, after = 0.0;  // largest |deflection|
};

/// d'' + 2*zeta*omega*d' + omega^2*d = -x'' by Runge-Kutta with 10 us.
Vibration integrated(const PaperMotion& motion, Eigen::Index axis, double frequency_hz, double zeta) {
  const double omega = 2.0 * pi * frequency_hz;
  constexpr double h = 1e-5;
  double d = 0.0;
  double v = 0.0;
  Vibration result;
  const auto rate = [&](double t, double dd, double vv) {
    return -motion.acceleration(t)[axis] - 2.0 * zeta * omega * vv - omega * omega * dd;
  };
  for (double t = 0.0; t < motion.duration + 0.1; t += h) {
    const double k1 = rate(t + 1e-9, d, v);
    const double k2 = rate(t + 0.5 * h, d + 0.5 * h * v, v + 0.5 * h * k1);
    const double k3 = rate(t + 0.5 * h, d + 0.5 * h * v + 0.25 * h * h * k1, v + 0.5 * h * k2);
    const double k4 = rate(t + h - 1e-9, d + h * v + 0.5 * h * h * k2, v + h * k3);
    d += h * v + h * h / 6.0 * (k1 + k2 + k3);
    v += h / 6.0 * (k1 + 2.0 * k2 + 2.0 * k3 + k4);
    double& worst = t + h < motion.duration ? result.before : result.after;
    worst = std::max(worst, std::abs(d));
  }
  return result;
}

}  // namespace

TEST_CASE("simulation: vibration of the paper's path against an integration of its closed-form acceleration") {
  for (const double feed : {100.0, 200.0}) {
    for (const double ratio : {0.6, 0.99}) {
      const PaperMotion motion(feed, ratio);
      const auto path = paper_path(feed);
      const SimulationFigures figures = simulate_path(path, plan(path, ratio), vertical_machine(1e-4));
      CAPTURE(feed);
      CAPTURE(ratio);
      CHECK(figures.duration_s == doctest::Approx(motion.duration).epsilon(2e-4));
      for (const Eigen::Index axis : {0, 1}) {
        const Vibration expected = integrated(motion, axis, axis == 0 ? 46.0 : 131.0, 0.02);
        CAPTURE(axis);
        CHECK(figures.residual_mm[axis] == doctest::Approx(expected.after).epsilon(0.03));
        CHECK(figures.peak_mm[axis] == doctest::Approx(expected.before).epsilon(0.01));
      }
      CHECK(figures.residual_mm.z() == 0.0);
      CHECK(figures.end_mm == Vector3(40, 40, 0));
    }
  }
}

TEST_CASE("simulation: the paper's path at 200 mm/s, 1 % reduction, unshaped") {
  const auto path = paper_path(200.0);
  for (const double period : {1e-3, 1e-4}) {
    const SimulationFigures figures = simulate_path(path, plan(path, 0.99), vertical_machine(period));
    CAPTURE(period);
    CHECK(figures.residual_mm.x() > 0.0165);
    CHECK(figures.residual_mm.x() < 0.0168);
    CHECK(figures.residual_mm.y() > 0.0074);
    CHECK(figures.residual_mm.y() < 0.0086);
    CHECK(figures.peak_acceleration_mm_per_s2.x() == doctest::Approx(4000.0).epsilon(0.01));
    CHECK(figures.peak_acceleration_mm_per_s2.y() == doctest::Approx(4000.0).epsilon(0.01));
    // The response leaves the path by 42 um.
    CHECK(figures.response.max_abs_mm == doctest::Approx(0.042).epsilon(0.05));
  }
}

TEST_CASE("simulation: the minimal shaper as axis filter: no vibration left, and the orbit errors of the model") {
  // Times 6.514 and 11.326 ms lie on a grid of 2 us.
  SimulationOptions options = vertical_machine(2e-6);
  options.axis_filters = {Fir({0, 3257, 5663}, {0.49156, 0.06297, 0.44547})};
  struct Row {
    double feed, ratio, orbit_percent;
  };
  for (const Row& row : {Row{100, 0.6, 0.0270}, Row{200, 0.99, 0.2908}}) {
    const auto path = paper_path(row.feed);
    const SimulationFigures figures = simulate_path(path, plan(path, row.ratio), options);
    CAPTURE(row.feed);
    REQUIRE(figures.orbit_error_percent.size() == 1);
    CHECK(std::abs(figures.orbit_error_percent[0] - row.orbit_percent) < 3e-4);
    CHECK(figures.residual_mm.x() < 1e-5);
    CHECK(figures.residual_mm.y() < 1e-5);
    CHECK(figures.duration_s == doctest::Approx(PaperMotion(row.feed, row.ratio).duration + 0.011326).epsilon(1e-4));
    if (row.feed == 200.0) {
      CHECK(figures.command.max_abs_mm == doctest::Approx(0.0295).epsilon(0.02));
      CHECK(figures.response.max_abs_mm == doctest::Approx(0.0266).epsilon(0.02));
    }
  }
}

TEST_CASE("simulation: a circle behind a moving average shrinks by its closed form") {
  // Mean of L points of a circle, one angle apart: radius * sin(L*a/2)/(L*sin(a/2)).
  for (const double sense : {1.0, -1.0}) {
    std::vector<Segment> turns;
    for (int i = 0; i < 3; ++i)
      turns.push_back(make_arc({10, 0, 0}, {10, 0, 0}, {0, 0, 0}, sense * 2.0 * pi, 2, 100.0));
    const auto path = path_of(turns);
    SimulationOptions options;
    options.axis_filters = {Fir::moving_average(40)};
    const SimulationFigures figures = simulate_path(path, plan(path, 1.0), options);
    const double angle = 100.0 * 1e-3 / 10.0;
    const double shrunk = 10.0 * (1.0 - std::sin(20.0 * angle) / (40.0 * std::sin(0.5 * angle)));
    // Radius * variance * (v/R)^2 / 2.
    CHECK(shrunk == doctest::Approx(10.0 * (0.04 * 0.04 / 12.0) * 100.0 / 2.0).epsilon(0.01));
    // Inside is left of a counter-clockwise circle.
    const double inside = sense > 0.0 ? figures.command.most_positive_mm : -figures.command.most_negative_mm;
    CHECK(inside == doctest::Approx(shrunk).epsilon(1e-3));
    CHECK(figures.response.most_positive_mm == figures.command.most_positive_mm);  // no modes
    CHECK(figures.orbit_error_percent.size() == 3);
    // A whole turn at speed: twice the relative radial error.
    CHECK(figures.orbit_error_percent[1] == doctest::Approx(200.0 * shrunk / 10.0).epsilon(0.01));
  }
}

TEST_CASE("simulation: a command on its path deviates by nothing, one beside it by its distance and side") {
  const auto path = paper_path(100.0);
  const Samples on = shapegcode::interpolate(path, plan(path, 0.6), 1e-3);
  const SimulationFigures exact = simulate_samples(on, *path, SimulationOptions{});
  CHECK(exact.command.max_abs_mm < 1e-9);
  CHECK(exact.command.count == static_cast<std::size_t>(on.positions_mm.rows()));
  CHECK(exact.orbit_error_percent.at(0) < 1e-6);
  CHECK(exact.residual_mm == Vector3::Zero());
  // A straight run 5 um left of a line along X, 3 um above.
  const auto line = path_of({make_line({0, 0, 0}, {50, 0, 0}, 100.0)});
  Samples beside{1e-3, Eigen::MatrixXd(501, 3)};
  for (Eigen::Index i = 0; i <= 500; ++i)
    beside.positions_mm.row(i) = Vector3(0.1 * static_cast<double>(i), 0.005, 0.0);
  const SimulationFigures left = simulate_samples(beside, *line, SimulationOptions{});
  CHECK(left.command.most_positive_mm == doctest::Approx(0.005));
  CHECK(left.command.most_negative_mm == 0.0);
  CHECK(left.command.rms_mm() == doctest::Approx(0.005));
  beside.positions_mm.col(1).setConstant(-0.004);
  CHECK(simulate_samples(beside, *line, SimulationOptions{}).command.most_negative_mm == doctest::Approx(-0.004));
}

TEST_CASE("simulation: vibration of a straight move against its closed form, several modes on an axis") {
  // Acceleration +-a in 50 ms steps from rest to rest: each step of the acceleration rings as a/omega^2.
  const auto path = path_of({make_line({0, 0, 0}, {30, 0, 0}, 100.0)});
  const std::vector<Mode> modes{{31.0, 0.03, 0.8}, {77.0, 0.01, 0.25}};
  SimulationOptions options;
  options.period_s = 1e-4;
  options.modes = {modes, {}, {}};
  const SimulationFigures figures = simulate_path(path, plan(path, 1.0), options);
  const double a = 2000.0;
  const std::array<std::array<double, 2>, 4> steps{{{0.0, a}, {0.05, -a}, {0.3, -a}, {0.35, a}}};
  const auto deflection = [&](double t) {
    double sum = 0.0;
    for (const Mode& mode : modes) {
      const double omega = 2.0 * pi * mode.frequency_hz;
      const double zeta = mode.damping_ratio;
      const double root = std::sqrt(1.0 - zeta * zeta);
      for (const auto& [at, size] : steps) {
        const double u = t - at;
        if (u <= 0.0) continue;
        const double ringing =
            std::exp(-zeta * omega * u) * (std::cos(omega * root * u) + zeta / root * std::sin(omega * root * u));
        sum -= mode.participation * size / (omega * omega) * (1.0 - ringing);
      }
    }
    return sum;
  };
  double before = 0.0;
  double after = 0.0;
  for (double t = 0.0; t < 0.35; t += 1e-5) before = std::max(before, std::abs(deflection(t)));
  for (double t = 0.35; t < 0.55; t += 1e-5) after = std::max(after, std::abs(deflection(t)));
  CHECK(figures.peak_mm.x() == doctest::Approx(before).epsilon(2e-3));
  CHECK(figures.residual_mm.x() == doctest::Approx(after).epsilon(0.02));
  CHECK(figures.residual_mm.y() == 0.0);
}

TEST_CASE("simulation: overlapped blocks take the sum of their ticks and the filter's length") {
  // 2.5 and 4 and 1.2 ms: 3 + 4 + 2 ticks under ceil, 7.7 ms under carry; a moving average of 50 samples adds 49.
  const auto blocks = row_of_lines({0.25, 0.2, 0.06}, {100.0, 50.0, 50.0});
  const Path path(blocks);
  SimulationOptions options;
  CHECK(simulate_blocks(blocks, path, BlockEnd::ceil, 1.0, options).duration_s == doctest::Approx(0.009));
  CHECK(simulate_blocks(blocks, path, BlockEnd::carry, 1.0, options).duration_s == doctest::Approx(0.008));
  options.axis_filters = {Fir::moving_average(50), Fir({0, 3}, {0.5, 0.5})};
  const SimulationFigures figures = simulate_blocks(blocks, path, BlockEnd::ceil, 1.0, options);
  CHECK(figures.duration_s == doctest::Approx(0.009 + 0.049 + 0.003));
  CHECK((figures.end_mm - Vector3(0.51, 0, 0)).norm() < 1e-12);
  CHECK(simulate_blocks(blocks, path, BlockEnd::carry, 0.5, SimulationOptions{}).duration_s == doctest::Approx(0.016));
}

TEST_CASE("simulation: the moment of rest is that of the last set-point, whatever rests came before") {
  // Moves, rests for 100 ms, moves, rests: the figures speak of the second rest.
  Samples samples{1e-3, Eigen::MatrixXd::Zero(400, 3)};
  for (Eigen::Index i = 0; i < 400; ++i) {
    const double first = std::clamp(static_cast<double>(i), 0.0, 50.0);
    const double second = std::clamp(static_cast<double>(i) - 150.0, 0.0, 50.0);
    samples.positions_mm(i, 0) = 0.1 * (first + 0.5 * second);
  }
  const auto line = path_of({make_line({0, 0, 0}, {7.5, 0, 0}, 100.0)});
  const SimulationFigures figures = simulate_samples(samples, *line, vertical_machine(1e-3));
  CHECK(figures.duration_s == doctest::Approx(0.2));
  // Alone, the second move leaves less than the first; what is left of the first has decayed by 0.15 s.
  Samples second{1e-3, samples.positions_mm.bottomRows(251)};
  const double alone = simulate_samples(second, *line, vertical_machine(1e-3)).residual_mm.x();
  CHECK(figures.residual_mm.x() == doctest::Approx(alone).epsilon(0.5));
  Samples first{1e-3, samples.positions_mm.topRows(140)};
  CHECK(simulate_samples(first, *line, vertical_machine(1e-3)).residual_mm.x() ==
        doctest::Approx(2.0 * alone).epsilon(1e-6));
}

TEST_CASE("simulation: set-points without a path give no contour figures") {
  Samples samples{1e-3, Eigen::MatrixXd::Zero(100, 3)};
  for (Eigen::Index i = 0; i < 100; ++i) samples.positions_mm(i, 0) = 0.1 * static_cast<double>(i);
  const SimulationFigures figures = simulate_samples(samples, Path(), vertical_machine(1e-3));
  CHECK(figures.duration_s == doctest::Approx(0.099));
  CHECK(figures.residual_mm.x() > 0.0);
  CHECK(figures.command.count == 0);
  CHECK(figures.orbit_error_percent.empty());
}

TEST_CASE("simulation: records no more samples than asked for, and the decay behind the stop") {
  const auto path = path_of({make_line({0, 0, 0}, {10, 0, 0}, 100.0)});
  SimulationOptions options = vertical_machine(1e-3);
  const auto profile = plan(path, 1.0);  // 0.15 s: 151 set-points
  CHECK(simulate_path(path, profile, options).recorded_command.positions_mm.rows() == 0);
  options.record_samples = 100;
  CHECK(simulate_path(path, profile, options).recorded_command.positions_mm.rows() == 100);
  options.record_samples = 100000;
  const SimulationFigures figures = simulate_path(path, profile, options);
  REQUIRE(figures.recorded_command.positions_mm.rows() == 151 + 250);
  REQUIRE(figures.recorded_response.positions_mm.rows() == 151 + 250);
  CHECK(figures.recorded_command.period_s == 1e-3);
  CHECK(figures.recorded_command.positions_mm(150, 0) == 10.0);
  CHECK(figures.recorded_command.positions_mm(400, 0) == 10.0);
  const Eigen::VectorXd swing =
      (figures.recorded_response.positions_mm.col(0) - figures.recorded_command.positions_mm.col(0)).cwiseAbs();
  CHECK(swing.tail(250).maxCoeff() <= figures.residual_mm.x() * (1.0 + 1e-9));
  CHECK(swing.tail(250).maxCoeff() > 0.9 * figures.residual_mm.x());
  CHECK(swing.head(151).maxCoeff() <= figures.peak_mm.x() * (1.0 + 1e-9));
}

TEST_CASE("simulation: the last seconds of a run leave the same residual once older vibration has decayed") {
  std::vector<double> lengths(2000, 0.3);
  std::vector<double> feeds(2000, 60.0);
  const auto blocks = row_of_lines(lengths, feeds);
  const Path path(blocks);
  SimulationOptions options = vertical_machine(1e-3);
  options.axis_filters = {Fir::moving_average(20)};
  const Vector3 whole = simulate_blocks(blocks, path, BlockEnd::ceil, 1.0, options).residual_mm;
  options.last_seconds = 3.0;
  options.measure_contour = false;
  const SimulationFigures part = simulate_blocks(blocks, path, BlockEnd::ceil, 1.0, options);
  CHECK(part.residual_mm.x() == doctest::Approx(whole.x()).epsilon(1e-6));
  CHECK(part.duration_s == doctest::Approx(3.019).epsilon(3e-3));  // a block more or less
  // Half the speed: twice the time, so half the blocks fill it.
  CHECK(simulate_blocks(blocks, path, BlockEnd::ceil, 0.5, options).duration_s == doctest::Approx(3.019).epsilon(5e-3));
}

TEST_CASE("simulation: blocks that a look-ahead would slow down, counted by hand") {
  LookAheadLimits limits;
  limits.corner_speed_difference_mm_per_s = Vector3(10.0, 10.0, 10.0);
  limits.max_feed_mm_per_s = Vector3(100.0, 100.0, 50.0);
  // From rest to 9, 18, 40 (a step of 22), 45.
  CHECK(count_slowed_blocks(row_of_lines({1, 1, 1, 1}, {9, 18, 40, 45}), limits) == 1);
  // A right angle at 9 mm/s is two steps of 9; at 15 it is over the limit.
  const std::vector<Segment> slow{make_line({0, 0, 0}, {1, 0, 0}, 9), make_line({1, 0, 0}, {1, 1, 0}, 9)};
  CHECK(count_slowed_blocks(slow, limits) == 0);
  const std::vector<Segment> fast{make_line({0, 0, 0}, {1, 0, 0}, 9), make_line({1, 0, 0}, {2, 0, 0}, 15),
                                  make_line({2, 0, 0}, {2, 1, 0}, 15)};
  CHECK(count_slowed_blocks(fast, limits) == 1);
  // Blocks of no length do not hide a step.
  const std::vector<Segment> hidden{make_line({0, 0, 0}, {1, 0, 0}, 9), make_line({1, 0, 0}, {1, 0, 0}, 9),
                                    make_line({1, 0, 0}, {0, 0, 0}, 9)};
  CHECK(count_slowed_blocks(hidden, limits) == 1);
  limits.corner_speed_difference_mm_per_s = Vector3::Constant(1e9);
  CHECK(count_slowed_blocks(row_of_lines({1, 1}, {100, 101}), limits) == 1);
  const std::vector<Segment> plunge{make_line({0, 0, 0}, {0, 0, -1}, 51)};
  CHECK(count_slowed_blocks(plunge, limits) == 1);
}

TEST_CASE("simulation: a buffer that runs empty stops the axis dead, and the table swings as the closed form says") {
  // 60 mm/s for 6 s, older vibration is gone; a stop from v rings as an impulse: peak (v/omega)*exp(-zeta*phi/root).
  const auto blocks = row_of_lines(std::vector<double>(1200, 0.3), std::vector<double>(1200, 60.0));
  const Path path(blocks);
  SimulationOptions options = vertical_machine(1e-3);
  const SimulationFigures alone = simulate_blocks(blocks, path, BlockEnd::ceil, 1.0, options);
  options.starved_blocks = {700, 800};
  options.starved_s = 0.030;
  const double omega = 2.0 * pi * 46.0;
  const double zeta = 0.02;
  const double root = std::sqrt(1.0 - zeta * zeta);
  const double swing = 60.0 / omega * std::exp(-zeta / root * std::atan2(root, zeta));
  for (const double memory : {0.0, 1.5}) {
    options.starved_memory_s = memory;
    for (const BlockEnd end : {BlockEnd::ceil, BlockEnd::carry}) {
      const SimulationFigures figures = simulate_blocks(blocks, path, end, 1.0, options);
      REQUIRE(figures.starved.size() == 2);
      CHECK(figures.starved[0].block == 700);
      CHECK(figures.starved[1].block == 800);
      for (const auto& starved : figures.starved) {
        CHECK(starved.residual_mm.x() == doctest::Approx(swing).epsilon(2e-3));
        CHECK(starved.residual_mm.y() == 0.0);
        CHECK(starved.command.max_abs_mm < 1e-9);  // along the path
      }
      // The run itself knows nothing of it.
      CHECK(figures.duration_s == doctest::Approx(alone.duration_s));
      CHECK((figures.residual_mm - alone.residual_mm).norm() < 1e-12);
      CHECK((figures.peak_mm - alone.peak_mm).norm() < 1e-12);
    }
  }
}

TEST_CASE("simulation: a wait against the same set-points written down by hand") {
  // A slanting run behind a moving average: X and Y swing at their own frequencies, so the table leaves the line.
  const Vector3 direction(0.8, 0.6, 0.0);
  std::vector<Segment> blocks;
  for (int i = 0; i < 200; ++i) blocks.push_back(make_line(0.3 * i * direction, 0.3 * (i + 1) * direction, 60.0));
  const Path path(blocks);
  for (const int taps : {1, 8, 25}) {
    SimulationOptions options = vertical_machine(1e-3);
    if (taps > 1) options.axis_filters = {Fir::moving_average(taps)};
    options.starved_blocks = {119};
    options.starved_s = 0.020;
    const SimulationFigures figures = simulate_blocks(blocks, path, BlockEnd::ceil, 1.0, options);
    REQUIRE(figures.starved.size() == 1);

    // 5 periods each: 120 blocks, 20 ms of rest, 80 blocks.
    constexpr Eigen::Index stop = 600;
    Samples samples{1e-3, Eigen::MatrixXd(1021, 3)};
    for (Eigen::Index i = 0; i <= 1020; ++i)
      samples.positions_mm.row(i) = 0.06 * static_cast<double>(i <= stop ? i : std::max(stop, i - 20)) * direction;
    options.starved_blocks.clear();
    options.record_samples = 10000;
    const SimulationFigures by_hand = simulate_samples(samples, path, options);
    CAPTURE(taps);
    const auto& starved = figures.starved[0];
    CHECK(starved.response.max_abs_mm == doctest::Approx(by_hand.response.max_abs_mm).epsilon(1e-9));
    CHECK(starved.response.most_negative_mm == doctest::Approx(by_hand.response.most_negative_mm).epsilon(1e-9));
    CHECK(starved.response.count == by_hand.response.count);
    const Eigen::MatrixXd swing =
        (by_hand.recorded_response.positions_mm - by_hand.recorded_command.positions_mm).cwiseAbs();
    for (const Eigen::Index axis : {0, 1}) {
      double expected = by_hand.residual_mm[axis];
      // At rest from the stop plus the filter's length to the restart, if that long.
      for (Eigen::Index i = stop + taps - 1; i <= stop + 20; ++i) expected = std::max(expected, swing(i, axis));
      CAPTURE(axis);
      CHECK(starved.residual_mm[axis] >= expected * (1.0 - 1e-9));
      CHECK(starved.residual_mm[axis] <= expected * 1.08 + 1e-6);  // between the set-points it may be a little more
    }
  }
}

TEST_CASE("simulation: a corner behind what was looked at is no corner missed") {
  // Half a second behind the wait is looked at; the corner lies 0.4 mm further on.
  const std::vector<Segment> legs{make_line({0, 0, 0}, {30, 0, 0}, 60), make_line({30, 0, 0}, {30.9, 0, 0}, 1),
                                  make_line({30.9, 0, 0}, {30.9, 20, 0}, 60)};
  SimulationOptions options = vertical_machine(1e-3);
  options.starved_blocks = {0};
  options.starved_s = 0.01;
  options.starved_memory_s = 0.5;
  const SimulationFigures figures = simulate_blocks(legs, Path(legs), BlockEnd::ceil, 1.0, options);
  REQUIRE(figures.starved.size() == 1);
  CHECK(figures.starved[0].command.max_abs_mm < 1e-9);
}

TEST_CASE("simulation: starved blocks that cannot be are refused") {
  const auto blocks = row_of_lines({1.0, 1.0}, {10.0, 10.0});
  const Path path(blocks);
  SimulationOptions options;
  options.starved_s = 0.01;
  options.starved_blocks = {2};
  CHECK_THROWS_AS(simulate_blocks(blocks, path, BlockEnd::ceil, 1.0, options), Error);
  options.starved_blocks = {1, 0};
  CHECK_THROWS_AS(simulate_blocks(blocks, path, BlockEnd::ceil, 1.0, options), Error);
  options.starved_blocks = {0};
  options.starved_s = -1.0;
  CHECK_THROWS_AS(simulate_blocks(blocks, path, BlockEnd::ceil, 1.0, options), Error);
  options.starved_s = 0.01;
  options.last_seconds = 1.0;
  CHECK_THROWS_AS(simulate_blocks(blocks, path, BlockEnd::ceil, 1.0, options), Error);
}

TEST_CASE("simulation: the places at which a stop excites most, by hand") {
  // Speeds at the ends: X 10, X 30, (18, 24), the last one ends in a stop.
  const std::vector<Segment> blocks{make_line({0, 0, 0}, {1, 0, 0}, 10), make_line({1, 0, 0}, {2, 0, 0}, 30),
                                    make_line({2, 0, 0}, {2, 0, 0}, 99), make_line({2, 0, 0}, {5, 4, 0}, 30),
                                    make_line({5, 4, 0}, {9, 4, 9}, 50), make_line({9, 4, 9}, {9, 4, 9}, 10)};
  CHECK(fastest_block_ends(blocks) == std::vector<std::size_t>{1, 3});
  CHECK(fastest_block_ends(std::span(blocks).first(1)).empty());
  CHECK(fastest_block_ends({}).empty());
  // A quarter turn from X to Y: at its end only Y moves.
  const std::vector<Segment> turn{make_arc({10, 0, 0}, {0, 10, 0}, {0, 0, 0}, pi / 2, 2, 20.0),
                                  make_line({0, 10, 0}, {-5, 10, 0}, 5.0), make_line({-5, 10, 0}, {-6, 10, 0}, 5.0)};
  CHECK(fastest_block_ends(turn).size() <= 2);
  CHECK(fastest_block_ends(turn).front() == 0);
}

TEST_CASE("simulation: a planned path measured against the one it was made from") {
  // The path that is run lies 4 um to the left of the programmed one.
  const auto run =
      path_of({make_line({0, 0.004, 0}, {20, 0.004, 0}, 50.0), make_line({20, 0.004, 0}, {40, 0.004, 0}, 80.0)});
  const auto programmed = path_of({make_line({0, 0, 0}, {40, 0, 0}, 50.0)});
  const SimulationFigures figures = simulate_path(run, plan(run, 1.0), *programmed, vertical_machine(1e-3));
  CHECK(figures.command.most_positive_mm == doctest::Approx(0.004));
  CHECK(figures.command.most_negative_mm == 0.0);
  const SimulationFigures own = simulate_path(run, plan(run, 1.0), vertical_machine(1e-3));
  CHECK(own.command.max_abs_mm == 0.0);
  CHECK(figures.duration_s == own.duration_s);
  CHECK(figures.residual_mm == own.residual_mm);
}

TEST_CASE("simulation: a plan that is not kept is simulated as one that is, bit for bit") {
  std::mt19937_64 generator(3);
  std::uniform_real_distribution<double> length(0.01, 3.0);
  std::uniform_real_distribution<double> turn(-1.0, 1.0);
  std::uniform_real_distribution<double> feed(1.0, 120.0);
  std::vector<Segment> segments;
  Vector3 at = Vector3::Zero();
  double heading = 0.0;
  for (int i = 0; i < 3000; ++i) {
    heading += i % 50 == 0 ? turn(generator) : 0.05 * turn(generator);
    const Vector3 to = at + length(generator) * Vector3(std::cos(heading), std::sin(heading), 0.1);
    segments.push_back(make_line(at, to, i % 3 == 0 ? feed(generator) : 60.0));
    at = to;
  }
  const PathPointer path = path_of(segments);
  for (const auto law : {shapegcode::AccelerationLaw::constant_time, shapegcode::AccelerationLaw::jerk_limited}) {
    MotionLimits limits;
    limits.law = law;
    limits.max_acceleration_mm_per_s2 = Vector3::Constant(2000.0);
    limits.corner_speed_difference_mm_per_s = Vector3::Constant(8.0);
    SimulationOptions options = vertical_machine(1e-3);
    options.record_samples = 10'000'000;
    const auto profile = std::make_shared<const SpeedProfile>(plan_speed(*path, limits));
    const SimulationFigures kept = simulate_path(path, profile, *path, options);
    const SimulationFigures passed = simulate_planned(path, limits, *path, options);
    CHECK(passed.duration_s == kept.duration_s);
    CHECK(passed.recorded_command.positions_mm == kept.recorded_command.positions_mm);
    CHECK(passed.response.sum_of_squares_mm2 == kept.response.sum_of_squares_mm2);
  }
}

TEST_CASE("simulation: the response alone is measured as it is beside the command") {
  const auto path = paper_path(100.0);
  SimulationOptions options = vertical_machine(1e-3);
  const SimulationFigures both = simulate_blocks(path->segments(), *path, BlockEnd::ceil, 1.0, options);
  options.measure_command = false;
  const SimulationFigures alone = simulate_blocks(path->segments(), *path, BlockEnd::ceil, 1.0, options);
  CHECK(both.orbit_error_percent.size() == 1);
  CHECK(alone.orbit_error_percent.empty());
  CHECK(alone.command.max_abs_mm == 0.0);
  CHECK(alone.response.max_abs_mm == both.response.max_abs_mm);
  CHECK(alone.response.sum_of_squares_mm2 == both.response.sum_of_squares_mm2);
  CHECK(alone.residual_mm == both.residual_mm);
}
