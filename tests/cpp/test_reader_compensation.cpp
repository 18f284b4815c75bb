#include <doctest/doctest.h>

#include <string>

#include "interpreter_program.hpp"
#include "shapegcode/program.hpp"

using shapegcode::Program;
using shapegcode::ReaderOptions;
using shapegcode::tests::read;
using shapegcode::tests::warns;

namespace {

/// The radius of D1 is known, that of D9 is not.
ReaderOptions one_known_radius() {
  ReaderOptions options;
  options.tool_offsets[1].radius_mm = 2.0;
  return options;
}

bool has(const Program& program, const std::string& part) { return program.text.find(part) != std::string::npos; }

const std::string kept_span = "G41 D9 G01 X10. Y10. F600.\nX20.\nG40 Y20.\n";
const std::string expanded_span = "G90 G00 X0. Y0. Z0.\nG41 D1 G01 X10. F600.\nX20.\nG40 G01 X30. Y20.\n";

}  // namespace

TEST_CASE("reader: a compensation that is expanded leaves no word behind, whatever was kept before it") {
  const Program alone = read(expanded_span, one_known_radius());
  CHECK_FALSE(has(alone, "G41"));
  CHECK_FALSE(has(alone, "D1"));
  CHECK_FALSE(has(alone, "G40"));
  const Program program = read(kept_span + expanded_span, one_known_radius());
  CHECK(warns(program, "the radius of offset D9 is not known", 4));
  CHECK(has(program, "G41 G01 X10. Y10. D9 F600."));
  CHECK(has(program, "G40 Y20."));
  CHECK_FALSE(has(program, "D1"));
  // Behind the kept span, which ends with its G40, stands what the other one comes to alone.
  const std::string begin = "G90 G00 X0. Y0. Z0.\n";
  CHECK(program.text.substr(program.text.find(begin)) == alone.text.substr(alone.text.find(begin)));
  CHECK(program.expanded_radii_mm == alone.expanded_radii_mm);
}

TEST_CASE("reader: while the control compensates itself, a radius that is known is left to it too") {
  const std::string body = "G41 D9 G01 X10. Y10. F600.\nX20.\nG42 D1 Y20.\nX30.\nG40 Y40.\n";
  const Program program = read(body, one_known_radius());
  CHECK(has(program, "G42 G01 Y20. D1"));
  CHECK(has(program, "G40 Y40."));
  CHECK(program.expanded_radii_mm.empty());
  CHECK(program.compensated_moves == 0);
}

TEST_CASE("reader: the offset number may stand in a block before G41") {
  const Program before = read("G43 H1 Z5. D1\nG41 G01 X10. F600.\nX20.\nG40 G01 X30. Y20.\n", one_known_radius());
  const Program beside = read("G43 H1 Z5.\nG41 D1 G01 X10. F600.\nX20.\nG40 G01 X30. Y20.\n", one_known_radius());
  CHECK(before.text.substr(before.text.find("G01")) == beside.text.substr(beside.text.find("G01")));
}

TEST_CASE("reader: #4007 is the compensation that is on, expanded or kept") {
  const Program expanded = read("G41 D1 G01 X10. F600.\n#1=#4007\nG40 G01 X#1\n", one_known_radius());
  CHECK(expanded.final_state.position_mm.x() == doctest::Approx(41.0));
  const Program kept = read("G41 D9 G01 X10. F600.\n#1=#4007\nG40 G01 X#1\n", one_known_radius());
  CHECK(kept.final_state.position_mm.x() == doctest::Approx(41.0));
  const Program off = read(kept_span + "#1=#4007\nG90 G01 X#1\n", one_known_radius());
  CHECK(off.final_state.position_mm.x() == doctest::Approx(40.0));
}
