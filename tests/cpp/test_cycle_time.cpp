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

ControllerModel variant(int k) {
  ControllerModel model;
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
      const ControllerModel model = variant(k);
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
    ControllerModel model;
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
  const CycleTime closed = time_program(Program(), ControllerModel(), true);
  CHECK(closed.parts.total_s() == 0.0);
  CHECK(closed.tools.empty());
  CHECK(closed.blocks.empty());
  CHECK(interpolate_program(Program(), ControllerModel()).total_s == 0.0);
}

TEST_CASE("circle: refuses what is no circle") {
  CHECK_THROWS_AS((void)simulate_circle(0.0, 10.0, ControllerModel()), Error);
  CHECK_THROWS_AS((void)simulate_circle(10.0, -1.0, ControllerModel()), Error);
  CHECK_THROWS_AS((void)simulate_circle(1e6, 1e-6, ControllerModel()), Error);
}
