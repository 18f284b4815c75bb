#include <doctest/doctest.h>

#include <fstream>
#include <sstream>
#include <string>

#include "shapegcode/error.hpp"
#include "shapegcode/program.hpp"
#include "shapegcode/timing.hpp"

using namespace shapegcode;

namespace {

Program sample(const std::string& name) {
  const std::ifstream file(std::string(SHAPEGCODE_TESTS_DIR "/golden/programs/") + name, std::ios::binary);
  std::stringstream text;
  text << file.rdbuf();
  return read_program(text.str(), {});
}

Program program(const std::string& body) {
  ReaderOptions options;
  options.unknown_after_tool_change = {false, false, false};
  return read_program("%\nO1\n" + body + "\nM30\n%\n", options);
}

FanucModel variant(int k) {
  FanucModel model;
  model.motion = k % 2 == 0 ? MotionKind::after_interpolation : MotionKind::look_ahead;
  model.in_position = k % 3 == 0 ? InPosition::servo_lag : InPosition::measured;
  model.in_position_s = {0.025, 0.025, 0.12};
  model.filter_shape = k == 2 ? FilterShape::exponential : FilterShape::linear;
  model.block_end = k == 4 ? BlockEnd::carry : BlockEnd::ceil;
  model.bell_time_s = 0.02;
  model.rapid_bell_time_s = 0.03;
  model.look_ahead_filter_time_constant_s = k == 5 ? 0.024 : 0.0;
  model.limits.jerk_time_s = k == 3 ? 0.0 : 0.03;
  model.limits.corner_speed_difference_mm_per_s = Vector3::Constant(8.0);
  model.limits.max_acceleration_mm_per_s2 = Vector3::Constant(1000.0);
  model.feed_override = k == 1 ? 0.9 : 1.0;
  return model;
}

}  // namespace

TEST_CASE("cycle time: closed form and full interpolation of programs agree") {
  for (const char* name : {"PARALLEL.NC", "G83.NC", "PROGRAM2.NC", "G17_18_19.NC", "TEST_G91.NC"}) {
    const Program read = sample(name);
    for (int k = 0; k < 6; ++k) {
      CAPTURE(name);
      CAPTURE(k);
      const FanucModel model = variant(k);
      const CycleTime closed = time_program(read, model, true);
      CHECK(closed.parts.total_s() == doctest::Approx(interpolate_program(read, model).total_s).epsilon(0.005));
      double sum = 0.0;
      for (const BlockTime& block : closed.blocks) sum += block.duration_s;
      CHECK(sum == doctest::Approx(closed.parts.total_s()));
      double tools = 0.0;
      for (const ToolTime& tool : closed.tools) tools += tool.parts.total_s();
      CHECK(tools == doctest::Approx(closed.parts.total_s()));
    }
  }
}

TEST_CASE("cycle time: an exact stop waits for the servo loop, in arcs and lines, under both kinds of motion") {
  const Program read =
      program("G90 G94 G61\nG00 X0. Y0. Z0.\nG01 X30. F6000.\nG03 X30. Y20. R10.\nG01 X29.5\nX5. Y3. Z-7.");
  for (const MotionKind motion : {MotionKind::after_interpolation, MotionKind::look_ahead}) {
    FanucModel model;
    model.motion = motion;
    model.in_position = InPosition::servo_lag;
    model.in_position_width_mm = Vector3::Constant(0.005);
    const CycleTime closed = time_program(read, model);
    const InterpolatedTime full = interpolate_program(read, model);
    REQUIRE(closed.regions.size() == 4);
    for (std::size_t i = 0; i < 4; ++i) {
      CAPTURE(i);
      CHECK(closed.regions[i].in_position_s > 0.05);
      CHECK(closed.regions[i].duration_s == doctest::Approx(full.region_s[i]).epsilon(0.01));
    }
    model.feed_forward_ratio = Vector3::Ones();
    CHECK(time_program(read, model).parts.in_position_s == 0.0);
  }
}

TEST_CASE("cycle time: without steps, without blocks") {
  const CycleTime closed = time_program(Program(), FanucModel(), true);
  CHECK(closed.parts.total_s() == 0.0);
  CHECK(closed.tools.empty());
  CHECK(closed.blocks.empty());
  CHECK(interpolate_program(Program(), FanucModel()).total_s == 0.0);
}

TEST_CASE("circle: refuses what is no circle") {
  CHECK_THROWS_AS((void)simulate_circle(0.0, 10.0, FanucModel()), Error);
  CHECK_THROWS_AS((void)simulate_circle(10.0, -1.0, FanucModel()), Error);
  CHECK_THROWS_AS((void)simulate_circle(1e6, 1e-6, FanucModel()), Error);
}

TEST_CASE("cycle time: M codes, the spindle that starts and stops while the axes move, ways that are not known") {
  ReaderOptions options;
  const Program read = read_program(
      "%\nO1\nG21 G90 G94\nT1 M6\nG0 X0. Y0. S6000 M3\nG4 P500\nZ5. M8\nG1 Z0. F600.\nM5\nG91 G28 Z0. M9\nM30\n%\n",
      options);
  FanucModel model;
  model.tool_change_s = 6.0;
  model.m_function_s = 0.1;
  model.m_code_s = {{8, 0.4}};
  model.spindle_start_s = {{4000.0, 1.0}, {12000.0, 5.0}};  // 2 s at 6000
  model.spindle_stop_s = {{12000.0, 6.0}};                  // 3 s from 6000
  model.unknown_move_s = {0.7, 0.8, 0.9};
  const CycleTime time = time_program(read, model, true);
  CHECK(time.parts.tool_change_s == doctest::Approx(6.0));
  // M03 takes .1 s and the way in X and Y .8, then .5 of dwell: of the start .6 s are left before M08's .4. Z from a
  // place not known: .9. M05 .1, way of G28 .9, M09 .1: of the stop 3 - .1 - .9 - .1 are left before M30's .1.
  CHECK(time.parts.function_s == doctest::Approx(0.1 + 0.8 + (2.0 - 0.1 - 0.8 - 0.5) + 0.4 + 0.9 + 0.1 + 0.1 + 0.9 +
                                                 (3.0 - 0.1 - 0.1 - 0.9) + 0.1));
  const InterpolatedTime simulated = interpolate_program(read, model);
  CHECK(simulated.function_s == doctest::Approx(time.parts.function_s));
  CHECK(simulated.tool_change_s == doctest::Approx(6.0));
  // A cut right behind M03 waits for the whole start.
  const Program cut = program("G21 G90 G94 G0 X0. Y0. Z0.\nS12000 M3\nG1 X10. F600.");
  model.unknown_move_s.setZero();
  CHECK(time_program(cut, model).parts.function_s == doctest::Approx(5.0 + 0.1));  // M03 passes within it; M30
  CHECK(interpolate_program(cut, model).function_s == doctest::Approx(5.1));
  model.spindle_start_s = {{4000.0, 1.0}, {3000.0, 5.0}};
  CHECK_THROWS_AS((void)time_program(cut, model), Error);
}
