#include <doctest/doctest.h>

#include <algorithm>
#include <cmath>
#include <memory>
#include <numbers>
#include <string>
#include <vector>

#include "shapegcode/error.hpp"
#include "shapegcode/motion.hpp"
#include "shapegcode/program.hpp"
#include "shapegcode/simulation_stream.hpp"
#include "shapegcode/timing.hpp"

using namespace shapegcode;

namespace {

std::shared_ptr<const Path> some_path() {
  return std::make_shared<const Path>(std::vector<Segment>{
      make_line({0, 0, 0}, {20, 0, 0}, 100.0),
      make_arc({20, 0, 0}, {40, 20, 0}, {20, 20, 0}, std::numbers::pi / 2, 2, 100.0),
      make_line({40, 20, 0}, {40, 40, 3}, 50.0),
  });
}

SimulationOptions vertical_machine() {
  SimulationOptions options;
  options.modes = {std::vector<Mode>{{46.0, 0.02, 0.8}}, std::vector<Mode>{{131.0, 0.02, 1.0}, {31.0, 0.05, 0.3}}, {}};
  return options;
}

std::vector<FeedDriveParameters> three_drives() {
  FeedDriveParameters drive;
  drive.motor_mass_kg = 120.0;
  drive.table_mass_kg = 200.0;
  drive.stiffness_n_per_m = 1e8;
  drive.damping_n_s_per_m = 5e3;
  drive.position_gain_per_s = 50.0;
  drive.velocity_gain_n_s_per_m = 1e5;
  drive.velocity_integral_time_s = 0.02;
  drive.velocity_feed_forward_ratio = 0.5;
  drive.table_friction = {FrictionModel::lugre, 400.0, 120.0, 180.0, 2e-3, 0.0, 5e7, 2e4};
  drive.modes = {{46.0, 0.02, 1.0}};
  std::vector<FeedDriveParameters> drives(3, drive);
  drives[1].position_gain_per_s = 80.0;
  drives[2].table_friction = {};
  return drives;
}

struct Simulated {
  std::vector<Vector3> command, response, velocity;
  std::vector<std::uint32_t> line;
  std::vector<BlockKind> kind;
};

/// The whole stream, in pieces of so many samples.
Simulated drained(SimulationStream stream, std::size_t piece) {
  Simulated simulated;
  for (;;) {
    const SimulationChunk chunk = stream.read(piece);
    CHECK(chunk.first_sample == simulated.line.size());
    CHECK(chunk.command_mm.rows() == static_cast<Eigen::Index>(chunk.size()));
    for (std::size_t i = 0; i < chunk.size(); ++i) {
      simulated.command.emplace_back(chunk.command_mm.row(static_cast<Eigen::Index>(i)));
      simulated.response.emplace_back(chunk.response_mm.row(static_cast<Eigen::Index>(i)));
      simulated.velocity.emplace_back(chunk.velocity_mm_per_s.row(static_cast<Eigen::Index>(i)));
    }
    simulated.line.insert(simulated.line.end(), chunk.line.begin(), chunk.line.end());
    simulated.kind.insert(simulated.kind.end(), chunk.kind.begin(), chunk.kind.end());
    if (chunk.size() == 0) {
      CHECK(stream.read(piece).size() == 0);
      return simulated;
    }
  }
}

/// Bit for bit the beginning of what simulation recorded.
void check_same(const Simulated& simulated, const SimulationFigures& figures) {
  const auto rows = static_cast<Eigen::Index>(simulated.line.size());
  REQUIRE(rows <= figures.recorded_command.positions_mm.rows());
  std::size_t different = 0;
  for (Eigen::Index i = 0; i < rows; ++i) {
    const auto k = static_cast<std::size_t>(i);
    const Vector3 command = figures.recorded_command.positions_mm.row(i);
    const Vector3 response = figures.recorded_response.positions_mm.row(i);
    different += command != simulated.command[k] || response != simulated.response[k] ? 1U : 0U;
  }
  CHECK(different == 0);
}

std::shared_ptr<const Program> program(const std::string& body) {
  ReaderOptions options;
  options.unknown_after_tool_change = {false, false, false};
  return std::make_shared<const Program>(read_program("%\nO1\n" + body + "\nM30\n%\n", options));
}

FanucModel waiting_controller(MotionKind motion) {
  FanucModel model;
  model.motion = motion;
  model.in_position_s = {0.025, 0.025, 0.12};
  model.limits.corner_speed_difference_mm_per_s = Vector3::Constant(8.0);
  model.limits.max_acceleration_mm_per_s2 = Vector3::Constant(1000.0);
  model.tool_change_s = 1.5;
  model.m_function_s = 0.25;
  return model;
}

// Dwells and functions take whole periods, so that no time is left over.
const std::string whole_program =
    "G90 G94 G17\nG00 X0. Y0. Z5.\nM06 T1\nG01 Z-1. F600.\nX30. F6000.\nG03 X30. Y20. R10.\nG01 X5. Y3.\nG04 "
    "P250\nM08\n"
    "G00 Z20.\nX100. Y50.\nG09 G01 X90.\nY45.";

}  // namespace

TEST_CASE("simulation stream: a path gives what simulation records, bit for bit, in pieces of any size") {
  const auto path = some_path();
  MotionLimits limits;
  limits.time_constant_s = 0.05;
  limits.jerk_time_s = 0.02;
  const auto profile = std::make_shared<const SpeedProfile>(plan_speed(*path, limits));
  SimulationOptions options = vertical_machine();
  for (const bool filtered : {false, true}) {
    if (filtered) options.axis_filters = {Fir::moving_average(24), Fir::moving_average(5)};
    options.record_samples = 100'000;
    const SimulationFigures figures = simulate_path(path, profile, options);
    const std::size_t decay = 250;  // that simulation records behind the end
    for (const std::size_t piece : {std::size_t{1}, std::size_t{7}, std::size_t{4096}}) {
      const Simulated simulated = drained(SimulationStream(path, profile, options), piece);
      CHECK(simulated.line.size() + decay == static_cast<std::size_t>(figures.recorded_command.positions_mm.rows()));
      check_same(simulated, figures);
      const Simulated rested = drained(SimulationStream(path, profile, options, 0.25), piece);
      CHECK(rested.line.size() == simulated.line.size() + decay);
      check_same(rested, figures);
    }
  }
}

TEST_CASE("simulation stream: blocks give what simulation records, bit for bit, with the line of each") {
  const shapegcode::Segments all = some_path()->segments();
  std::vector<Segment> segments(all.begin(), all.end());
  for (std::size_t i = 0; i < segments.size(); ++i) segments[i].line = static_cast<std::uint32_t>(10 * (i + 1));
  const auto blocks = std::make_shared<const Path>(segments);
  SimulationOptions options = vertical_machine();
  options.axis_filters = {Fir::moving_average(50)};
  options.record_samples = 100'000;
  const SimulationFigures figures = simulate_blocks(segments, *blocks, BlockEnd::ceil, 0.7, options);
  const Simulated simulated = drained(SimulationStream(blocks, BlockEnd::ceil, 0.7, options), 100);
  check_same(simulated, figures);
  CHECK(simulated.line.front() == 10);
  CHECK(simulated.line.back() == 30);
  CHECK(std::is_sorted(simulated.line.begin(), simulated.line.end()));
  // 20 mm at 70 mm/s: the second block begins 286 periods behind the first.
  CHECK(std::count(simulated.line.begin(), simulated.line.end(), 10U) == doctest::Approx(286).epsilon(0.01));
}

TEST_CASE("simulation stream: a program takes its cycle time, without a jump, and the plant follows its set-points") {
  const auto text = program(whole_program);
  for (const MotionKind motion : {MotionKind::look_ahead, MotionKind::after_interpolation}) {
    CAPTURE(static_cast<int>(motion));
    const FanucModel model = waiting_controller(motion);
    SimulationOptions options = vertical_machine();
    const Simulated simulated = drained(SimulationStream(text, model, options), 1000);
    const double closed_s = time_program(*text, model).parts.total_s();
    CHECK(static_cast<double>(simulated.line.size() - 1) * model.period_s == doctest::Approx(closed_s).epsilon(1e-9));
    CHECK(closed_s == doctest::Approx(interpolate_program(*text, model).total_s).epsilon(1e-9));
    CHECK(simulated.velocity.front() == Vector3::Zero());
    double largest_step = 0.0;
    for (std::size_t i = 1; i < simulated.line.size(); ++i) {
      const Vector3 step = simulated.command[i] - simulated.command[i - 1];
      largest_step = std::max(largest_step, step.norm());
      CHECK((simulated.velocity[i] * model.period_s - step).norm() < 1e-12);
    }
    CHECK(largest_step < 0.4 * 1.5);  // rapids: 400 mm/s in each of two axes
    CHECK((simulated.command.front() - Vector3(0, 0, 5)).norm() < 1e-12);
    CHECK((simulated.command.back() - Vector3(90, 45, 20)).norm() < 1e-9);
    CHECK(std::is_sorted(simulated.line.begin(), simulated.line.end()));
    CHECK(std::count(simulated.kind.begin(), simulated.kind.end(), BlockKind::dwell) == 250);
    CHECK(std::count(simulated.kind.begin(), simulated.kind.end(), BlockKind::tool_change) == 1500);
    // The same set-points through the plant of simulation, in one piece.
    Samples samples;
    samples.period_s = model.period_s;
    samples.positions_mm.resize(static_cast<Eigen::Index>(simulated.command.size()), axis_count);
    for (std::size_t i = 0; i < simulated.command.size(); ++i) {
      samples.positions_mm.row(static_cast<Eigen::Index>(i)) = simulated.command[i];
    }
    options.record_samples = simulated.command.size();
    check_same(simulated, simulate_samples(samples, Path(), options));
  }
}

TEST_CASE("simulation stream: M06 for the tool in the spindle is a tool change, as in the table of blocks") {
  const auto text = program("G00 X0. Y0. Z5.\nM06 T1\nM06 M08\nG01 X5. F600.");
  FanucModel model = waiting_controller(MotionKind::look_ahead);
  model.last_tool_in_spindle = true;
  const Simulated simulated = drained(SimulationStream(text, model, vertical_machine()), 1000);
  CHECK(std::count(simulated.kind.begin(), simulated.kind.end(), BlockKind::tool_change) == 250);
}

TEST_CASE("simulation stream: waits that are no whole periods add up") {
  const auto text = program("G90 G94\nG00 X0. Y0. Z0.\nG04 X.0015\nG04 X.0025\nG04 X.0007\nG04 X.0007\nG04 X.0006");
  const FanucModel model;
  const Simulated simulated = drained(SimulationStream(text, model, vertical_machine()), 10);
  CHECK(simulated.line.size() == 1 + 6);
  const auto of_line = [&](std::uint32_t line) {
    return std::count(simulated.line.begin(), simulated.line.end(), line);
  };
  CHECK(of_line(4) == 1);  // the start: from where the rapid comes is not known
  CHECK(of_line(5) == 1);
  CHECK(of_line(6) == 3);
  CHECK(of_line(7) + of_line(8) + of_line(9) == 2);
}

TEST_CASE("simulation stream: where the coordinates jump, the command jumps and the plant goes on") {
  ReaderOptions reader;
  reader.work_offsets_mm = {{0, 0, 0}, {100, 0, 0}, {0, 0, 0}, {0, 0, 0}, {0, 0, 0}, {0, 0, 0}};
  const auto text = std::make_shared<const Program>(
      read_program("%\nO1\nG90 G94 G54\nG00 X0. Y0. Z0.\nG01 X30. F6000.\nG92 X0.\nG01 X-20.\nM30\n%\n", reader));
  FanucModel model;
  SimulationOptions options = vertical_machine();
  const Simulated jumping = drained(SimulationStream(text, model, options), 100);
  const auto straight = program("G90 G94 G54\nG00 X0. Y0. Z0.\nG01 X30. F6000.\nM08\nG01 X10.");
  const Simulated continuous = drained(SimulationStream(straight, model, options), 100);
  REQUIRE(jumping.command.size() == continuous.command.size());
  double largest = 0.0;
  double jump = 0.0;
  double speeds_apart = 0.0;
  for (std::size_t i = 0; i < jumping.command.size(); ++i) {
    const Vector3 deflection = jumping.response[i] - jumping.command[i];
    largest = std::max(largest, (deflection - (continuous.response[i] - continuous.command[i])).norm());
    speeds_apart = std::max(speeds_apart, (jumping.velocity[i] - continuous.velocity[i]).norm());
    jump = i > 0 ? std::max(jump, (jumping.command[i] - jumping.command[i - 1]).norm()) : 0.0;
  }
  CHECK(largest < 1e-12);
  CHECK(jump > 29.0);
  CHECK(speeds_apart < 1e-9);
}

TEST_CASE("simulation stream: modes that vary with position see the machine's coordinates") {
  // The second region lies 100 mm further in the machine, where the table of X says 40 Hz.
  const auto text = program("G90 G94\nG00 X0. Y0. Z0.\nG01 X30. F6000.\nG00 X0.\nG01 X20.");
  REQUIRE(text->regions.size() == 2);
  const FanucModel model;
  SimulationOptions varying = vertical_machine();
  varying.mode_tables[0] = {ModeTable{0, {60.0, 80.0}, {46.0, 40.0}, {}}};
  SimulationOptions stiff = vertical_machine();
  stiff.modes[0] = {{46.0, 0.02, 0.8}};
  const Simulated near = drained(SimulationStream(text, model, varying, {Vector3::Zero(), Vector3(0, 0, 0)}), 1000);
  const Simulated same = drained(SimulationStream(text, model, stiff), 1000);
  const Simulated far = drained(SimulationStream(text, model, varying, {Vector3::Zero(), Vector3(100, 0, 0)}), 1000);
  REQUIRE(near.line.size() == far.line.size());
  double before = 0.0;
  double second = 0.0;
  double nominal = 0.0;
  for (std::size_t i = 0; i < near.line.size(); ++i) {
    nominal = std::max(nominal, (near.response[i] - same.response[i]).norm());
    CHECK((near.command[i] - far.command[i]).norm() == 0.0);
    double& worst = near.line[i] < 7 ? before : second;
    worst = std::max(worst, (near.response[i] - far.response[i]).norm());
  }
  CHECK(nominal < 1e-12);
  CHECK(before < 1e-12);
  CHECK(second > 1e-3);
}

TEST_CASE("simulation stream: feed drives get the set-points of their axes; their motion and forces are given") {
  const auto text = program("G90 G94\nG00 X0. Y0. Z0.\nG01 X3. Y1. Z.5 F3000.\nG04 P20\nG00 X0.");
  const FanucModel model;
  SimulationOptions options = vertical_machine();
  options.modes = {};
  options.drives = three_drives();
  SimulationStream stream(text, model, options);
  const SimulationChunk chunk = stream.read(100'000);
  REQUIRE(chunk.size() > 100);
  REQUIRE(chunk.friction_force_n.rows() == chunk.command_mm.rows());
  double lag = 0.0;
  for (Eigen::Index axis = 0; axis < axis_count; ++axis) {
    FeedDrive drive(options.drives[static_cast<std::size_t>(axis)], model.period_s);
    drive.reset(chunk.command_mm(0, axis));
    std::size_t different = 0;
    for (Eigen::Index i = 0; i < chunk.command_mm.rows(); ++i) {
      const double response = drive.step(chunk.command_mm(i, axis));
      const bool same = response == chunk.response_mm(i, axis) && drive.motor_mm() == chunk.motor_mm(i, axis) &&
                        drive.motor_force_n() == chunk.motor_force_n(i, axis) &&
                        drive.friction_force_n() == chunk.friction_force_n(i, axis);
      different += same ? 0U : 1U;
      lag = std::max(lag, std::abs(response - chunk.command_mm(i, axis)));
    }
    CHECK(different == 0);
  }
  CHECK(lag > 0.1);
}

TEST_CASE("simulation: residual and settling time of both plants are those of a long rest") {
  const auto path = some_path();
  MotionLimits limits;
  limits.time_constant_s = 0.03;
  const auto profile = std::make_shared<const SpeedProfile>(plan_speed(*path, limits));
  SimulationOptions options = vertical_machine();
  options.settling_band_mm = 0.002;
  options.settling_limit_s = 1.5;
  for (const bool driven : {false, true}) {
    CAPTURE(driven);
    if (driven) options.drives = three_drives();
    const SimulationFigures figures = simulate_path(path, profile, options);
    const Simulated rest = drained(SimulationStream(path, profile, options, 2.0), 1000);
    const auto stop = static_cast<std::size_t>(std::lround(figures.duration_s / options.period_s));
    for (Eigen::Index axis = 0; axis < axis_count; ++axis) {
      double settling = 0.0;
      double residual = 0.0;
      for (std::size_t i = stop; i < rest.line.size(); ++i) {
        const double deflection = std::abs(rest.response[i][axis] - rest.command[i][axis]);
        residual = std::max(residual, deflection);
        if (deflection > options.settling_band_mm) {
          settling = static_cast<double>(i + 1 - stop) * options.period_s;
        }
      }
      // A copied drive goes on with the same accuracy, not the same digits; modes peak between set-points too.
      CHECK(figures.settling_s[axis] == doctest::Approx(settling).epsilon(driven ? 0.002 : 0.03));
      CHECK(figures.residual_mm[axis] == doctest::Approx(residual).epsilon(driven ? 1e-4 : 0.03));
    }
    CHECK(figures.settling_s.maxCoeff() > 0.05);
    options.settling_limit_s = 0.02;
    CHECK(std::isinf(simulate_path(path, profile, options).settling_s.maxCoeff()));
    options.settling_limit_s = 1.5;
  }
}

TEST_CASE("csv rows: numbers read back as they were") {
  Eigen::MatrixXd table(2, 4);
  table << 0.1, -0.0, 12.0, 1.0 / 3.0, 1e-300, 123456789.125, -2.5e-7, 0.001;
  const std::vector<std::uint8_t> word = {1, 0};
  CHECK(csv_rows(word, {"cutting", "rapid"}, table) ==
        "rapid,0.1,0,12,0.3333333333333333\ncutting,1e-300,123456789.125,-2.5e-07,0.001\n");
  CHECK(csv_rows({}, {}, Eigen::MatrixXd(0, 4)).empty());
  CHECK_THROWS_AS((void)csv_rows(word, {"cutting"}, table), Error);
  CHECK_THROWS_AS((void)csv_rows(word, {"cutting", "rapid"}, Eigen::MatrixXd::Zero(3, 1)), Error);
}

TEST_CASE("simulation stream: what cannot be is refused") {
  const auto text = program(whole_program);
  const FanucModel model;
  SimulationOptions options = vertical_machine();
  CHECK_THROWS_AS(SimulationStream(text, model, options, {Vector3::Zero()}), Error);
  CHECK_THROWS_AS(SimulationStream(text, model, options, {}, -1.0), Error);
  options.drives.resize(2, three_drives()[0]);
  CHECK_THROWS_AS(SimulationStream(text, model, options), Error);
  options.drives.clear();
  options.period_s = 0.002;
  CHECK_THROWS_AS(SimulationStream(text, model, options), Error);
}
