#include <doctest/doctest.h>

#include <cmath>
#include <numbers>
#include <string>

#include "interpreter_program.hpp"
#include "shapegcode/program.hpp"

using shapegcode::Program;
using shapegcode::read_program;
using shapegcode::ReaderOptions;
using shapegcode::Segment;
using shapegcode::SegmentKind;
using shapegcode::Vector3;
using shapegcode::tests::check_refused;
using shapegcode::tests::framed;
using shapegcode::tests::near;
using shapegcode::tests::only_segment;
using shapegcode::tests::read;
using shapegcode::tests::warns;

// --- Position --------------------------------------------------------------------------------------------------------

TEST_CASE("interpreter: an absolute move from an unknown position is kept and makes it known") {
  const Program program = read_program("%\nG90 G21 G17\nG01 X1. Y1. F60.\nX2.\nZ5.\nX3. Z6.\nM30\n%\n");
  REQUIRE(program.regions.size() == 2);
  CHECK(warns(program, "position before it is not known", 3));
  CHECK(program.regions[0]->first_line == 4);  // X and Y known; Z stays
  CHECK(program.regions[0]->last_line == 4);
  CHECK(warns(program, "position before it is not known", 5));
  CHECK(program.regions[1]->first_line == 6);
  CHECK_FALSE(program.regions[1]->incremental);
}

TEST_CASE("interpreter: which axes each code forgets") {
  struct Case {
    const char* block;
    bool x, y, z;
  };
  for (const Case& c :
       {Case{"G91 G28 Z0.", true, true, false}, Case{"G28 X0. Y0.", false, false, true},
        Case{"G30 Z0.", true, true, false}, Case{"G53 G00 X0.", false, true, true}, Case{"M06 T1", false, false, false},
        Case{"G43 H7", true, true, false}, Case{"G55", false, false, false}, Case{"G92 X7.", true, true, true},
        Case{"G52 X7.", true, true, true}, Case{"G10 L2 P1 X5.", false, true, true},
        Case{"G31 Z-1. F60.", true, true, false}, Case{"G68 X0. Y0. R30.", true, true, true},
        Case{"M08", true, true, true}, Case{"G04 X2.", true, true, true}, Case{"G54", true, true, true},
        Case{"/G00 X5.", false, true, true}, Case{"/M06 T1", false, false, false}}) {
    CAPTURE(std::string(c.block));
    const Program program = read(std::string(c.block) + "\n");
    CHECK(program.final_state.known[0] == c.x);
    CHECK(program.final_state.known[1] == c.y);
    CHECK(program.final_state.known[2] == c.z);
  }
  ReaderOptions options;
  options.unknown_after_tool_change = {false, false, true};
  const Program program = read("M06 T1\n", options);
  CHECK(program.final_state.known[0]);
  CHECK(program.final_state.known[1]);
  CHECK_FALSE(program.final_state.known[2]);
}

TEST_CASE("interpreter: a move beside a code that takes no axis words is a move") {
  for (const char* code :
       {"G69", "G50", "G15", "G13.1", "G40 G49 G50 G69 G80", "G97 S800", "G08 P1", "G23", "G80 G98"}) {
    CAPTURE(std::string(code));
    const Program program = read(std::string(code) + " G00 X50.\nG01 X60. F60.\n");
    CHECK(program.final_state.position_mm.x() == 60.0);
    REQUIRE(program.regions.size() == 1);
    CHECK(near((*program.regions[0]->path)[0].start_mm, {50.0, 0.0, 0.0}));
  }
  // Axis words of the code itself move nothing.
  for (const char* code : {"G50.1 X50.", "G22 X50. Y1. Z1. I0. J0. K0."}) {
    CAPTURE(std::string(code));
    CHECK(read(std::string(code) + "\n").final_state.position_mm.x() == 0.0);
  }
  // A cut beside such a code is kept, and moves.
  const Program cut = read("G97 S800 G01 X50. F60.\nX60.\n");
  REQUIRE(cut.regions.size() == 1);
  CHECK(near((*cut.regions[0]->path)[0].start_mm, {50.0, 0.0, 0.0}));
}

TEST_CASE("interpreter: additional work coordinates G54.1 and back") {
  const Program there = read("G54.1 P1 G00 X1. Y2. Z3.\nG01 X4. F60.\n");
  REQUIRE(there.regions.size() == 1);
  CHECK(near((*there.regions[0]->path)[0].start_mm, {1.0, 2.0, 3.0}));
  // G54 is a change again, although it was the last of G54 ... G59.
  const Program back = read("G54.1 P1 G00 X1. Y2. Z3.\nG54\n");
  CHECK_FALSE(back.final_state.known[0]);
  CHECK_FALSE(back.final_state.known[2]);
  CHECK_FALSE(read("G54.1 P1 G00 X1. Y2. Z3.\nG54.1 P2\n").final_state.known[0]);
}

TEST_CASE("interpreter: G92 sets a position, G52 shifts it, known work offsets move it") {
  CHECK(near(read("G01 X10. F60.\nG92 X1. Y2.\n").final_state.position_mm, {1.0, 2.0, 0.0}));
  CHECK(read_program("%\nG90 G92 X1. Y2.\nM30\n%\n").final_state.known[1]);
  // The tool stands at 10; with the local zero at 3 that is 7; with the zero at 5 it is 5; back at 10.
  CHECK(near(read("G01 X10. F60.\nG52 X3.\n").final_state.position_mm, {7.0, 0.0, 0.0}));
  CHECK(near(read("G01 X10. F60.\nG52 X3.\nG52 X5.\n").final_state.position_mm, {5.0, 0.0, 0.0}));
  CHECK(near(read("G01 X10. F60.\nG52 X3.\nG52 X0.\n").final_state.position_mm, {10.0, 0.0, 0.0}));
  ReaderOptions options;
  options.work_offsets_mm = {{-400.0, -200.0, -300.0}, {-350.0, -220.0, -300.0}};
  // Machine position -390, -200, -300; seen from G55: -40, 20, 0.
  const Program program = read("G01 X10. F60.\nG55\nG01 X0.\n", options);
  CHECK(near(program.final_state.position_mm, {0.0, 20.0, 0.0}));
  REQUIRE(program.regions.size() == 2);
  CHECK(near((*program.regions[1]->path)[0].start_mm, {-40.0, 20.0, 0.0}));
  CHECK_FALSE(read("G01 X10. F60.\nG59\n", options).final_state.known[0]);
}

TEST_CASE("interpreter: G91 from an unknown origin gives an incremental region, from a known one none") {
  const Program unknown = read_program("%\nG21 G17 G91\nG01 X10. F60.\nY5.\nX-3.\nM30\n%\n");
  REQUIRE(unknown.regions.size() == 1);
  CHECK(unknown.regions[0]->incremental);
  const auto& path = *unknown.regions[0]->path;
  REQUIRE(path.size() == 3);
  CHECK(near(path[2].end_mm - path[0].start_mm, {7.0, 5.0, 0.0}));
  CHECK_FALSE(unknown.final_state.known[0]);
  const Program known = read("G91\nG01 X10. F60.\nY5.\nX-3.\n");
  REQUIRE(known.regions.size() == 1);
  CHECK_FALSE(known.regions[0]->incremental);
  CHECK(near(known.final_state.position_mm, {7.0, 5.0, 0.0}));
  // Z after G28 Z0 is not known: the region that moves it is incremental, one that moves X and Y only is not.
  const Program after_home = read("G91 G28 Z0.\nG91 G01 X1. F60.\nM08\nZ-1.\n");
  REQUIRE(after_home.regions.size() == 2);
  CHECK_FALSE(after_home.regions[0]->incremental);
  CHECK(after_home.regions[1]->incremental);
}

TEST_CASE("interpreter: an arc moves both axes of its plane, named or not") {
  // Y is not known and carries no word, yet the half circle and the full circle move it.
  const Program half = read_program("%\nG91 G21 G17\nG92 X0.\nG03 X10. R5. F60.\nM30\n%\n");
  REQUIRE(half.regions.size() == 1);
  CHECK(half.regions[0]->incremental);
  const Program full = read_program("%\nG91 G21 G17\nG92 X0.\nG03 I5. F60.\nM30\n%\n");
  REQUIRE(full.regions.size() == 1);
  CHECK(full.regions[0]->incremental);
  // In G90 the block would have to be written with absolute Y words that nobody knows.
  const Program absolute = read_program("%\nG90 G21 G17\nG92 X0.\nG03 X10. R5. F60.\nM30\n%\n");
  CHECK(absolute.regions.empty());
  CHECK(warns(absolute, "position before it is not known", 4));
  // The axis across the plane is not moved by a flat arc.
  const Program flat = read_program("%\nG90 G21 G17\nG92 X0. Y0.\nG03 X10. R5. F60.\nM30\n%\n");
  REQUIRE(flat.regions.size() == 1);
  CHECK_FALSE(flat.regions[0]->incremental);
}

// --- Arcs ------------------------------------------------------------------------------------------------------------

namespace {

/// Half-way point of a block's arc, from its own centre and radius by rotation of the start: not point_at.
Vector3 halfway(const Segment& s) {
  const int a = (s.normal + 1) % 3;
  const int b = (s.normal + 2) % 3;
  const double turn = 0.5 * s.sweep_rad;
  const double da = s.start_mm[a] - s.centre_mm[a];
  const double db = s.start_mm[b] - s.centre_mm[b];
  Vector3 p = 0.5 * (s.start_mm + s.end_mm);
  p[a] = s.centre_mm[a] + da * std::cos(turn) - db * std::sin(turn);
  p[b] = s.centre_mm[b] + da * std::sin(turn) + db * std::cos(turn);
  return p;
}

}  // namespace

TEST_CASE("interpreter: arcs in three planes turn the right way") {
  // Quarter circles of radius 10 about the origin: half-way points by hand. Clockwise is seen from the plus end of the
  // axis across the plane; in G18 the first axis is Z, so G03 leads from +Z to +X.
  const double h = 10.0 * std::sqrt(0.5);
  struct Case {
    const char* text;
    Vector3 halfway;
    double sweep;
  };
  const double quarter = std::numbers::pi / 2;
  for (const Case& c : {
           Case{"G00 X10.\nG17 G03 X0. Y10. I-10. F60.", {h, h, 0.0}, quarter},
           Case{"G00 X10.\nG17 G03 X0. Y10. R10. F60.", {h, h, 0.0}, quarter},
           Case{"G00 Y10.\nG17 G02 X10. Y0. J-10. F60.", {h, h, 0.0}, -quarter},
           Case{"G00 X10.\nG17 G02 X0. Y10. R10. F60.", {10.0 - h, 10.0 - h, 0.0}, -quarter},
           Case{"G00 X10.\nG17 G02 X0. Y10. I-10. F60.", {-h, -h, 0.0}, -3 * quarter},
           Case{"G00 X10.\nG17 G03 X0. Y10. R-10. F60.", {10.0 + h, 10.0 + h, 0.0}, 3 * quarter},
           Case{"G00 Z10.\nG18 G03 X10. Z0. K-10. F60.", {h, 0.0, h}, quarter},
           Case{"G00 Z10.\nG18 G03 X10. Z0. R10. F60.", {h, 0.0, h}, quarter},
           Case{"G00 X10.\nG18 G02 X0. Z10. I-10. F60.", {h, 0.0, h}, -quarter},
           Case{"G00 X10.\nG18 G03 X0. Z10. I-10. F60.", {-h, 0.0, -h}, 3 * quarter},
           Case{"G00 X10.\nG18 G03 X0. Z10. R10. F60.", {10.0 - h, 0.0, 10.0 - h}, quarter},
           Case{"G00 Y10.\nG19 G03 Y0. Z10. J-10. F60.", {0.0, h, h}, quarter},
           Case{"G00 Y10.\nG19 G03 Y0. Z10. R10. F60.", {0.0, h, h}, quarter},
           Case{"G00 Z10.\nG19 G02 Y10. Z0. K-10. F60.", {0.0, h, h}, -quarter},
       }) {
    CAPTURE(std::string(c.text));
    const Segment arc = only_segment(read(std::string(c.text) + "\n"));
    CHECK(arc.kind == SegmentKind::arc);
    CHECK(arc.sweep_rad == doctest::Approx(c.sweep));
    CHECK(near(halfway(arc), c.halfway));
    CHECK(arc.length_mm == doctest::Approx(10.0 * std::abs(c.sweep)));
  }
}

TEST_CASE("interpreter: full circles and helices") {
  const Segment circle = only_segment(read("G02 I10. F60.\n"));
  CHECK(circle.sweep_rad == doctest::Approx(-2.0 * std::numbers::pi));
  CHECK(near(circle.centre_mm, {10.0, 0.0, 0.0}));
  CHECK(near(halfway(circle), {20.0, 0.0, 0.0}));
  const Segment turn = only_segment(read("G03 X0. Y0. Z-3. I0. J-5. F60.\n"));
  CHECK(turn.sweep_rad == doctest::Approx(2.0 * std::numbers::pi));
  CHECK(near(halfway(turn), {0.0, -10.0, -1.5}));
  CHECK(turn.length_mm == doctest::Approx(std::hypot(10.0 * std::numbers::pi, 3.0)));
  const Segment half = only_segment(read("G03 X20. Z4. R10. F60.\n"));
  CHECK(near(halfway(half), {10.0, -10.0, 2.0}));
  CHECK(half.length_mm == doctest::Approx(std::hypot(10.0 * std::numbers::pi, 4.0)));
  const Segment zx = only_segment(read("G18 G03 Z20. Y4. R10. F60.\n"));  // from Z0 to Z20 through X-10
  CHECK(near(halfway(zx), {-10.0, 2.0, 10.0}));
}

TEST_CASE("interpreter: arcs from a G91 start, and I J K as positions") {
  const Program chain = read("G91 G03 X10. Y10. J10. F60.\nX-10. Y10. I-10.\n");
  REQUIRE(chain.regions.size() == 1);
  const auto& path = *chain.regions[0]->path;
  REQUIRE(path.size() == 2);
  CHECK(near(path[1].centre_mm, {0.0, 10.0, 0.0}));
  CHECK(near(path[1].end_mm, {0.0, 20.0, 0.0}));
  ReaderOptions options;
  options.absolute_arc_centres = true;
  const Segment arc = only_segment(read("G00 X10.\nG03 X0. Y10. I0. J0. F60.\n", options));
  CHECK(near(arc.centre_mm, {0.0, 0.0, 0.0}));
  CHECK(near(only_segment(read("G00 X10. Y5.\nG02 X10. Y5. I20. F60.\n", options)).centre_mm, {20.0, 5.0, 0.0}));
}

TEST_CASE("interpreter: start and end radius may differ within the tolerance") {
  const Segment arc = only_segment(read("G00 X10.\nG03 X0. Y10.009 I-10. F60.\n"));
  CHECK(arc.start_radius_mm == doctest::Approx(10.0));
  CHECK(arc.end_radius_mm == doctest::Approx(10.009));
  CHECK(near(arc.end_mm, {0.0, 10.009, 0.0}));
  // A radius short of half its chord by less than the tolerance is a half circle.
  const Segment half = only_segment(read("G03 X20. R9.997 F60.\n"));
  CHECK(std::abs(half.sweep_rad) == doctest::Approx(std::numbers::pi).epsilon(1e-6));
}

// --- Block skip ------------------------------------------------------------------------------------------------------

TEST_CASE("interpreter: after a '/' that changes the modal state nothing is shaped until the group is given again") {
  struct Case {
    const char* skipped;
    const char* again;
  };
  for (const Case& c : {Case{"/G91", "G90"}, Case{"/G18", "G17"}, Case{"/G00", "G01"}, Case{"/G20", "G21"},
                        Case{"/G61", "G64"}, Case{"/G95", "G94 F600."}}) {
    CAPTURE(std::string(c.skipped));
    const Program program = read("G01 X10. F600.\n" + std::string(c.skipped) + "\nX20. F700.\n" + c.again +
                                 "\nG90 G00 X0. Y0. Z0.\nG01 X30. F600.\n");
    CHECK(warns(program, "block skip '/' changes the modal state", 5));
    REQUIRE(program.regions.size() == 2);
    CHECK(program.regions[0]->last_line == 4);
    CHECK(program.regions[1]->first_line == 9);
    CHECK(program.final_state.uncertain_groups == 0U);
  }
  // F is a group of its own, settled by the next F.
  const Program feed = read("G01 X10. F600.\n/F1200.\nX20.\nX30. F600.\n");
  REQUIRE(feed.regions.size() == 2);
  CHECK(feed.regions[0]->last_line == 4);
  CHECK(feed.regions[1]->first_line == 7);
  // The same state again changes nothing.
  CHECK(read("G01 X10. F600.\n/G90\nX20.\n").regions.size() == 2);
  CHECK(read("G01 X10. F600.\n/G90\nX20.\n").final_state.uncertain_groups == 0U);
}

TEST_CASE("interpreter: a second '/' block does not settle what a first one left open") {
  // With the switch on neither runs and G90 stands; with it off G91 does.
  const Program distance = read("G01 X10. F600.\n/G91\n/G91\nX20.\n");
  CHECK(distance.final_state.uncertain_groups != 0U);
  CHECK(distance.regions.size() == 1);
  const Program feed = read("G01 X10. F600.\n/F1200.\n/F1200.\nX20.\n");
  CHECK(feed.final_state.uncertain_groups != 0U);
  CHECK(feed.regions.size() == 1);
}

TEST_CASE("interpreter: a move in an uncertain state leaves the axis unknown") {
  // X is 10 + 10 with the switch off, 10 with it on.
  const Program distance = read("G01 X10. F600.\n/G91\nG01 X10.\nG90\nY5.\nX30.\nY10.\n");
  REQUIRE(distance.regions.size() == 3);
  CHECK(distance.regions[0]->last_line == 4);
  CHECK(distance.regions[1]->first_line == 8);  // Y alone
  CHECK(distance.regions[1]->last_line == 8);
  CHECK(distance.regions[2]->first_line == 10);  // line 9 leaves from an X that nobody knows
  // 25.4 mm or 1 mm.
  const Program units = read("G01 X10. F600.\n/G20\nG01 X1.\nG21\nG01 X30. F600.\nY10.\n");
  REQUIRE(units.regions.size() == 2);
  CHECK(units.regions[1]->first_line == 9);
}

TEST_CASE("interpreter: a '/' in front of M30 or of a mode's cancellation settles nothing") {
  const Program end = read("G01 X10. F600.\n/M30\nX20.\n");
  CHECK(end.regions.size() == 2);
  check_refused(framed("G68 X0. Y0. R30.\n/G69\n"), 5, 1, {"'/'", "input.block_skip"});
}

TEST_CASE("interpreter: a '/' move leaves its axes unknown until they are given") {
  const Program program = read("G01 X10. F600.\n/G01 X15. \nY5.\nX20.\nX30.\n");
  REQUIRE(program.regions.size() == 3);
  CHECK(program.regions[1]->first_line == 6);  // Y alone
  CHECK(program.regions[1]->last_line == 6);
  CHECK(program.regions[2]->first_line == 8);  // X20. was kept and made X known
}

TEST_CASE("interpreter: a mirror of one axis of the plane turns G68 the other way") {
  // Worked out by hand: mirror about X8.353, then +108.657 degrees about the mirrored centre (25.33, -6.157).
  const Program program = read("G51.1X8.353\nG68X-8.624Y-6.157R-108.657\nG00X14.088Y-6.791\nG69\nG50.1X0\n");
  CHECK(near(program.final_state.position_mm, {33.196, -27.473, 0}, 6e-4));
  // Mirrored in both axes it turns as programmed.
  const Program both = read("G51.1X0Y0\nG68X0Y0R90.\nG00X1.Y0\nG69\nG50.1X0Y0\n");
  CHECK(near(both.final_state.position_mm, {0, -1, 0}, 1e-9));
}
