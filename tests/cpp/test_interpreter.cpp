#include <doctest/doctest.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <numbers>
#include <string>
#include <vector>

#include "shapegcode/error.hpp"
#include "shapegcode/gcode/interpreter.hpp"

using shapegcode::Error;
using shapegcode::ErrorKind;
using shapegcode::ModalState;
using shapegcode::Program;
using shapegcode::read_program;
using shapegcode::ReaderOptions;
using shapegcode::Region;
using shapegcode::Segment;
using shapegcode::SegmentKind;
using shapegcode::Vector3;

namespace {

// Lines 1 to 3 of every text below: the position is known and zero, the first line of a body is line 4.
const std::string known_zero = "%\nG21 G90 G17 G94\nG00 X0. Y0. Z0.\n";

std::string framed(const std::string& body) { return known_zero + body + "M30\n%\n"; }

Program read(const std::string& body, const ReaderOptions& options = {}) { return read_program(framed(body), options); }

bool near(const Vector3& a, const Vector3& b, double tolerance = 1e-9) { return (a - b).norm() < tolerance; }

bool warns(const Program& program, const std::string& part, std::uint32_t line = 0) {
  return std::any_of(program.warnings.begin(), program.warnings.end(), [&](const auto& finding) {
    return finding.message.find(part) != std::string::npos && (line == 0 || finding.line == line);
  });
}

struct Refusal {
  bool thrown = false;
  std::string message;
  std::uint32_t line = 0;
  std::uint32_t column = 0;
};

Refusal refusal(const std::string& text, const ReaderOptions& options = {}) {
  try {
    (void)read_program(text, options);
  } catch (const Error& error) {
    CHECK(error.kind() == ErrorKind::program);
    return {true, error.what(), error.line(), error.column()};
  }
  return {};
}

void check_refused(const std::string& text, std::uint32_t line, std::uint32_t column,
                   const std::vector<std::string>& parts) {
  CAPTURE(text);
  const Refusal found = refusal(text);
  CHECK(found.thrown);
  CHECK(found.line == line);
  CHECK(found.column == column);
  CAPTURE(found.message);
  for (const std::string& part : parts) {
    CAPTURE(part);
    CHECK(found.message.find(part) != std::string::npos);
  }
}

std::string text_of(const Program& program, const Region& region) {
  return program.text.substr(region.text_begin, region.text_end - region.text_begin);
}

const Segment& only_segment(const Program& program) {
  REQUIRE(program.regions.size() == 1);
  REQUIRE(program.regions[0]->path->size() == 1);
  return (*program.regions[0]->path)[0];
}

/// Two cuts with `line` between them; how many regions come out.
std::size_t regions_around(const std::string& line, const std::string& second = "G90 G01 X20. F600.") {
  return read("G01 X10. F600.\n" + line + "\n" + second + "\n").regions.size();
}

}  // namespace

// --- Numbers and units
// ------------------------------------------------------------------------------------------------

TEST_CASE("interpreter: decimal point rule both ways, metric and inch") {
  ReaderOptions calculator;
  calculator.calculator_decimal_point = true;
  ReaderOptions increments;
  increments.calculator_decimal_point = false;
  struct Case {
    const char* words;
    double calculator_mm, increments_mm;
  };
  for (const Case& c : {Case{"G01 X10 F60.", 10.0, 0.010}, Case{"G01 X10. F60.", 10.0, 10.0},
                        Case{"G01 X-5 F60.", -5.0, -0.005}, Case{"G20 G01\nG01 X10 F60.", 254.0, 0.0254},
                        Case{"G20\nG01 X1. F60.", 25.4, 25.4}, Case{"G20\nG01 X.5 F60.", 12.7, 12.7}}) {
    CAPTURE(std::string(c.words));
    const Segment a = only_segment(read(std::string(c.words) + "\n", calculator));
    CHECK(a.end_mm.x() == doctest::Approx(c.calculator_mm).epsilon(1e-14));
    const Segment b = only_segment(read(std::string(c.words) + "\n", increments));
    CHECK(b.end_mm.x() == doctest::Approx(c.increments_mm).epsilon(1e-14));
  }
  // The increment is a setting: IS-C.
  increments.least_increment_mm = 0.0001;
  CHECK(only_segment(read("G01 X10 F60.\n", increments)).end_mm.x() == doctest::Approx(0.001).epsilon(1e-14));
}

TEST_CASE("interpreter: R and I J K follow the decimal point rule too") {
  ReaderOptions increments;
  increments.calculator_decimal_point = false;
  // A quarter circle of 10 mm, all words in um.
  for (const char* words : {"G03 X10000 Y10000 R10000 F60.\n", "G03 X10000 Y10000 J10000 F60.\n"}) {
    const Segment arc = only_segment(read(words, increments));
    CHECK(near(arc.centre_mm, {0.0, 10.0, 0.0}));
    CHECK(arc.sweep_rad == doctest::Approx(std::numbers::pi / 2));
  }
}

TEST_CASE("interpreter: feed in mm/min and inch/min") {
  CHECK(only_segment(read("G01 X10. F600\n")).feed_mm_per_s == doctest::Approx(10.0).epsilon(1e-14));
  CHECK(only_segment(read("G01 X10. F0.6\n")).feed_mm_per_s == doctest::Approx(0.01).epsilon(1e-14));
  CHECK(only_segment(read("G20\nG01 X1. F60.\n")).feed_mm_per_s == doctest::Approx(25.4).epsilon(1e-14));
  CHECK(only_segment(read("G20\nG01 X1. F60\n")).feed_mm_per_s == doctest::Approx(25.4).epsilon(1e-14));
  // F stands for the moves that follow, and for the move of its own block.
  const Program program = read("G01 X10. F600.\nX20.\nX30. F1200.\nF300.\nX40.\n");
  REQUIRE(program.regions.size() == 1);
  const auto& path = *program.regions[0]->path;
  REQUIRE(path.size() == 4);
  CHECK(path[0].feed_mm_per_s == doctest::Approx(10.0));
  CHECK(path[1].feed_mm_per_s == doctest::Approx(10.0));
  CHECK(path[2].feed_mm_per_s == doctest::Approx(20.0));
  CHECK(path[3].feed_mm_per_s == doctest::Approx(5.0));
}

TEST_CASE("interpreter: inverse time feed G93 belongs to its block's length") {
  // F2: 30 mm in half a minute. On an arc F counts the radius: 10 mm in 10 s.
  const Program program = read("G93 G01 X30. F2.\nG03 X40. Y10. R10. F6.\n");
  REQUIRE(program.regions.size() == 1);
  const auto& path = *program.regions[0]->path;
  REQUIRE(path.size() == 2);
  CHECK(path[0].feed_mm_per_s == doctest::Approx(1.0));
  CHECK(path[1].feed_mm_per_s == doctest::Approx(1.0));
  check_refused(framed("G93 G01 X30. F2.\nX40.\n"), 5, 1, {"G93 needs F"});
  // The F of one mode is no F of the other.
  check_refused(framed("G01 X10. F600.\nG93\nG94 X20.\n"), 6, 1, {"no feed F"});
}

TEST_CASE("interpreter: warns once of numbers without a point and of a distance mode never given") {
  const Program program = read_program("%\nG00 X1 Y1. Z1.\nG01 X2 F100\nX3\nM30\n%\n");
  int points = 0;
  int distances = 0;
  for (const auto& finding : program.warnings) {
    if (finding.message.find("without a decimal point") != std::string::npos) {
      ++points;
      CHECK(finding.line == 2);
    }
    if (finding.message.find("neither G90 nor G91") != std::string::npos) {
      ++distances;
      CHECK(finding.line == 2);
    }
  }
  CHECK(points == 1);
  CHECK(distances == 1);
  CHECK_FALSE(warns(read("G01 X1. Y0 F100\n"), "without a decimal point"));
  CHECK_FALSE(warns(read("G01 X1. F100\n"), "neither G90"));
}

// --- Regions
// ----------------------------------------------------------------------------------------------------------

TEST_CASE("interpreter: what ends a region") {
  for (const char* stop : {"M08",
                           "M00",
                           "M01",
                           "S1000",
                           "T2",
                           "D1",
                           "H1",
                           "G04 P100",
                           "G04 X1.",
                           "G00 X12.",
                           "G00 Z5.",
                           "G53 X0.",
                           "G28 Z0.",
                           "G91 G28 Z0.",
                           "G30 Z0.",
                           "G61",
                           "G43 H1",
                           "G55",
                           "G52 X0.",
                           "G92 X10.",
                           "G20",
                           "G41 D1",
                           "G10 L2 P1 X0.",
                           "/G01 X11.",
                           "/",
                           "/M08",
                           "/(SKIP)",
                           "G81 X11. Z-1. R1.",
                           "G99",
                           "G05.1 Q1",
                           "G08 P1",
                           "G09",
                           "G16",
                           "G68 X0. Y0. R0.",
                           "G51.1 X0.",
                           "A90.",
                           "B1.",
                           "G63",
                           "G33 X11. F1.",
                           "G80",
                           "G97 S800",
                           "G54.1 P3",
                           "G69",
                           "G50",
                           "G15"}) {
    CAPTURE(std::string(stop));
    const Program program = read("G01 X10. F600.\n" + std::string(stop) +
                                 "\nG40 G69 G15 G50.1 G64 G49 G80 G54 G21\n"
                                 "G90 G00 X10. Y0. Z0.\nG01 X20. F600.\n");
    CHECK(program.regions.size() == 2);
    CHECK(program.regions[0]->first_line == 4);
    CHECK(program.regions[0]->last_line == 4);
  }
}

TEST_CASE("interpreter: what leaves a region open") {
  for (const char* neutral : {"",
                              "   ",
                              ";",
                              "(COMMENT)",
                              "N100",
                              "N100 (COMMENT)",
                              "G17",
                              "G18",
                              "G19",
                              "G90",
                              "G91",
                              "G94",
                              "F1200.",
                              "G00",
                              "G01",
                              "G02",
                              "G40",
                              "G49",
                              "G54",
                              "G64",
                              "G21",
                              "G98",
                              "N5 G90 G94 F100."}) {
    CAPTURE(std::string(neutral));
    CHECK(regions_around(neutral) == 1);
  }
}

TEST_CASE("interpreter: a cut that shares its block with another function is kept, the run around it is split") {
  for (const char* block : {"G01 X15. M08", "G01 X15. S2000", "G01 X15. T3", "G01 X15. H2", "G01 X15. D2",
                            "G01 X15. M08 M09", "/G01 X15.", "G01 X15. A5.", "G43 G01 X15. H1"}) {
    CAPTURE(std::string(block));
    const Program program = read("G01 X10. F600.\n" + std::string(block) + "\nG01 X20.\n");
    REQUIRE(program.regions.size() >= 1);
    CHECK(program.regions[0]->last_line == 4);
    CHECK(warns(program, "kept untouched", 5));
    for (const auto& region : program.regions) {
      CHECK((region->last_line < 5 || region->first_line > 5));
    }
  }
}

TEST_CASE("interpreter: a region's lines, bytes, blocks, length and states") {
  const std::string head = "N1 G01 X10. F600. (FIRST)\r\n";
  const std::string tail = "\r\nG17\r\nN2 Y10.\r\n";
  const std::string text =
      "%\r\nO0042(PART)\r\nG90 G21 G17\r\nG00 X0. Y0. Z0.\r\n" + head + tail + "(AFTER)\r\nM05\r\nM30\r\n%\r\n";
  const Program program = read_program(text);
  CHECK(program.text == text);
  CHECK(program.line_end == "\r\n");
  CHECK(program.line_count == 12);
  CHECK(program.program_number == 42);
  CHECK(program.header_offset == text.find("G90"));
  REQUIRE(program.regions.size() == 1);
  const Region& region = *program.regions[0];
  CHECK(region.first_line == 5);
  CHECK(region.last_line == 8);
  CHECK(text_of(program, region) == head + tail);
  CHECK(region.blocks == 2);
  CHECK(region.path->length_mm() == doctest::Approx(20.0));
  CHECK((*region.path)[0].line == 5);
  CHECK((*region.path)[1].line == 8);
  CHECK(near(region.entry.position_mm, {0.0, 0.0, 0.0}));
  CHECK(region.entry.motion == 0);
  CHECK(region.entry.feed == 0.0);
  CHECK(near(region.exit.position_mm, {10.0, 10.0, 0.0}));
  CHECK(region.exit.motion == 1);
  CHECK(region.exit.feed == 600.0);
  CHECK_FALSE(region.incremental);
  CHECK_FALSE(region.exact_stop_at_end);
}

TEST_CASE("interpreter: trailing neutral lines belong to no region") {
  const Program program = read("G01 X10. F600.\nN7 (LATE)\nF300.\n\nM05\n");
  REQUIRE(program.regions.size() == 1);
  CHECK(text_of(program, *program.regions[0]) == "G01 X10. F600.\n");
  CHECK(program.regions[0]->notes.empty());
  CHECK(program.regions[0]->exit.feed == 600.0);
  CHECK(program.final_state.feed == 300.0);
}

TEST_CASE("interpreter: a cut without length makes no segment, and alone no region") {
  CHECK(read("G01 X0. F600.\n").regions.empty());
  const Program program = read("G01 X10. F600.\nX10.\nX20.\n");
  REQUIRE(program.regions.size() == 1);
  CHECK(program.regions[0]->path->size() == 2);
  CHECK(program.regions[0]->blocks == 3);
}

TEST_CASE("interpreter: N words and comments of a region with the segment before which they stood") {
  const Program program = read("N10 G01 X10. F600. (A)\nN20\n(B)\nN30 X20.\nX30.\nN40 (C)\nX40. (D)\nM05\n");
  REQUIRE(program.regions.size() == 1);
  const Region& region = *program.regions[0];
  struct Expected {
    std::uint32_t segment;
    std::int32_t n_number;
    std::string comment;
  };
  const std::vector<Expected> expected = {{0, -1, "(A)"}, {0, 10, ""},    {1, 20, ""}, {1, -1, "(B)"},
                                          {1, 30, ""},    {3, -1, "(C)"}, {3, 40, ""}, {3, -1, "(D)"}};
  REQUIRE(region.notes.size() == expected.size());
  for (std::size_t i = 0; i < expected.size(); ++i) {
    CAPTURE(i);
    CHECK(region.notes[i].segment == expected[i].segment);
    CHECK(region.notes[i].n_number == expected[i].n_number);
    CHECK(program.text.substr(region.notes[i].comment_offset, region.notes[i].comment_length) == expected[i].comment);
  }
}

TEST_CASE("interpreter: a note never carries a word of its block") {
  // The comments are written out again as they stand: X10. between them would be a move.
  const Program program = read("G01 (A) X10. (B) F600.\n");
  REQUIRE(program.regions.size() == 1);
  std::string comments;
  for (const auto& note : program.regions[0]->notes) {
    comments += program.text.substr(note.comment_offset, note.comment_length);
  }
  CHECK(comments == "(A)(B)");
}

TEST_CASE("interpreter: exact stop by G09 and by G61") {
  const Program once = read("G01 X10. F600.\nG09 X20.\nX30.\n");
  REQUIRE(once.regions.size() == 2);
  CHECK(once.regions[0]->path->size() == 2);
  CHECK(once.regions[0]->exact_stop_at_end);
  CHECK((*once.regions[0]->path)[1].stop_at_end);
  CHECK_FALSE((*once.regions[0]->path)[0].stop_at_end);
  CHECK_FALSE(once.regions[1]->exact_stop_at_end);
  const Program modal = read("G61\nG01 X10. F600.\nX20.\nG64\nX30.\nX40.\n");
  REQUIRE(modal.regions.size() == 3);
  CHECK(modal.regions[0]->exact_stop_at_end);
  CHECK(modal.regions[1]->exact_stop_at_end);
  CHECK_FALSE(modal.regions[2]->exact_stop_at_end);
  CHECK(modal.regions[2]->path->size() == 2);
}

TEST_CASE("interpreter: everything behind M30 is left alone") {
  const Program program = read_program("%\nG90 G00 X0. Y0. Z0.\nG01 X1. F60.\nM30\nG01 X2.\nG65 P1\n%\nnot read\n");
  REQUIRE(program.regions.size() == 1);
  CHECK(program.regions[0]->last_line == 3);
  const Program m02 = read_program("%\nG90 G00 X0. Y0. Z0.\nG01 X1. F60.\nM02\nG01 X2.\n%\n");
  CHECK(m02.regions.size() == 1);
}

// --- Position
// ---------------------------------------------------------------------------------------------------------

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

// --- Arcs
// -------------------------------------------------------------------------------------------------------------

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

// --- Refusals
// ---------------------------------------------------------------------------------------------------------

TEST_CASE("interpreter: an arc off its radius is refused with both ends, centre, radii and tolerance") {
  check_refused(framed("G00 X10.\nG03 X0. Y10.37 I-10. F60.\n"), 5, 16,
                {"0.3700", "start (X10.0000 Y0.0000)", "end (X0.0000 Y10.3700)", "centre (X0.0000 Y0.0000)",
                 "start radius 10.0000", "end radius 10.3700", "tolerance 0.0100", "0020"});
  check_refused(framed("G18 G00 Z10.\nG03 X10.5 Z0. K-10. F60.\n"), 5, 15, {"start (Z10.0000 X0.0000)", "0.5000"});
  check_refused(framed("G03 X30. R10. F60.\n"), 4, 10, {"R10.0000", "30.0000", "15.0000", "0020"});
  check_refused(framed("G03 X30. R0 F60.\n"), 4, 10, {"R0.0000"});
  check_refused(framed("G03 X0. R10. F60.\n"), 4, 9, {"full circle needs I J K"});
  check_refused(framed("G03 I0. F60.\n"), 4, 5, {"start radius 0.0000"});
}

TEST_CASE("interpreter: an arc without R or I J K is refused") {
  check_refused(framed("N5 G02 X10. F60.\n"), 4, 4, {"G17", "0022"});
  check_refused(framed("G02 X10. K5. F60.\n"), 4, 1, {"G17", "0022"});  // K is not in G17
  check_refused(framed("G18 G02 X10. J5. F60.\n"), 4, 1, {"G18", "0022"});
  check_refused(framed("G01 X1. F60.\nG02\nX10.\n"), 6, 1, {"0022"});
}

TEST_CASE("interpreter: a cut without a feed, with F0 and with a negative F is refused") {
  check_refused(framed("G01 X10.\n"), 4, 1, {"no feed F", "0011"});
  check_refused(framed("G01 X10. F0\n"), 4, 10, {"F0", "0011"});
  check_refused(framed("G01 X10. F100.\nX20. F0.\n"), 5, 6, {"F0"});
  check_refused(framed("G01 X10. F-100.\n"), 4, 10, {"negative"});
  check_refused(framed("G81 X10. Z-5. R1.\n"), 4, 1, {"G81", "0011"});
}

TEST_CASE("interpreter: half a tape is refused, none is not") {
  check_refused("%\nG90\nM30\n", 4, 1, {"no line '%' at the end"});
  check_refused("G90\nM30\n%\n", 1, 1, {"none at its start"});
  check_refused("G90\nG00 X1.\n", 2, 1, {"neither '%' lines nor an end M30"});
  CHECK(warns(read_program("G90\nG00 X1.\nM30\n"), "no '%' lines"));
  CHECK(warns(read_program("%\nG90\nG00 X1.\n%\n"), "does not end with M30"));
  CHECK(read_program("LEADER TEXT @@\n%\nG90 G00 X0.\nM30\n%\n").warnings.empty());
  // A '%' in a comment is no tape mark.
  check_refused("%\nG90 (50% DONE)\nM30\n", 4, 1, {"no line '%'"});
}

TEST_CASE("interpreter: what is no program is refused") {
  check_refused("", 1, 1, {"empty"});
  check_refused(" \n\t\r\n", 1, 1, {"empty"});
  check_refused(std::string("%\nG90\nX\0\n%\n", 11), 3, 2, {"byte 0x00"});
}

TEST_CASE("interpreter: unknown and unsupported codes are refused with their column") {
  check_refused(framed("G90 G77 X1.\n"), 4, 5, {"unknown G code G77"});
  check_refused(framed("G90 G54.7 X1.\n"), 4, 5, {"G54.7"});
  check_refused(framed("G1.23 X1.\n"), 4, 1, {"unknown G code G1.23", "0010"});
  check_refused(framed("G-1 X1.\n"), 4, 1, {"minus sign in G code G-1", "0006"});
  check_refused(framed("N5 G65 P8000\n"), 4, 1, {"O8000", "0078"});
  check_refused(framed("G66 P9000\n"), 4, 1, {"G66", "0078"});
  check_refused(framed("G07.1 C50.\n"), 4, 1, {"G7.1"});
  check_refused(framed("M98 P1000\n"), 4, 5, {"O1000", "0078"});
  check_refused(framed("M98\n"), 4, 1, {"M98", "0076"});
  check_refused(framed("M198 P1\n"), 4, 6, {"O0001", "0078"});
  check_refused(framed("GOTO 7\n"), 4, 6, {"N7", "0078"});
  check_refused(framed("O2000\nO2000\n"), 5, 1, {"O2000", "twice", "0073"});
  check_refused(framed("G01 X1. Y2. X3. F60.\n"), 4, 13, {"address X is given twice"});
  check_refused(framed("G01 X123456.789 F60.\n"), 4, 5, {"too many digits", "limit 8"});
  check_refused(framed("G01 X1. (OPEN\n"), 4, 9, {"does not close"});
  check_refused(framed("M1 M2 M3 M4 M5 M6 M7\n"), 4, 19, {"6 M codes"});
  check_refused(framed("G04\n"), 4, 1, {"G04 needs P"});
  check_refused(framed("G04 P1.5\n"), 4, 5, {"0007"});
  check_refused(framed("N-5 G01 X1. F60.\n"), 4, 1, {"minus sign in address N", "0006"});
  check_refused(framed("G01 X1. E2. F60.\n"), 4, 9, {"address E", "0009"});
  check_refused(framed("M98 M99 P2\n"), 4, 5, {"M99 in one block with M98"});
}

TEST_CASE("interpreter: a decimal point is refused where whole numbers belong") {
  for (const char* word : {"M3.", "S1000.5", "T1.", "N1.", "O1.", "H1.", "D1.", "L2."}) {
    check_refused(framed(std::string(word) + "\n"), 4, 1,
                  {"decimal point in address " + std::string(1, word[0]), "0007"});
  }
  check_refused(framed("M98 P1. L2\n"), 4, 5, {"program number P", "0007"});
  check_refused(framed("M98 P1 L2.\n"), 4, 8, {"repetitions L", "0007"});
}

TEST_CASE("interpreter: axis values beyond eight digits are refused in every kind of move") {
  for (const char* code : {"G00", "G01 F60.", "G81 Z-1. R1. F60."}) {
    CAPTURE(std::string(code));
    const Refusal found = refusal(framed(std::string(code) + " X100000.\n"));
    CHECK(found.message == "X100000.0000 lies outside +-99999.9990 (alarm 0003)");
  }
  CHECK_FALSE(refusal(framed("G00 X-99999.999\n")).thrown);
}

TEST_CASE("interpreter: the repetitions of a cycle may carry a point but no fraction") {
  const auto holes = [](const std::string& k) {
    return read("G00 Z10.\nG91 G98 G81 X10. Z-7. R-8. " + k + " F60.\nG80\n").final_state.position_mm.x();
  };
  CHECK(holes("K3") == 30.0);
  CHECK(holes("K3.") == 30.0);  // as a computed K is written
  check_refused(framed("G81 Z-1. R1. K1.5 F60.\n"), 4, 14, {"K1.5", "0007"});
}

TEST_CASE("interpreter: an error of a block that waited is that block's own") {
  // The corner and the compensated span are worked out later than they are read.
  check_refused(framed("G01 X5. F60.\nX10. ,R20.\nY10.\n"), 5, 6, {",R20.0000", "0055"});
  check_refused(framed("G10 L12 P1 R5.\nG01 G42 D1 X10. F60.\nX30.\nG02 X34. Y-4. R4.\nG01 Y-20.\nG40 X0.\n"), 7, 1,
                {"4.0000", "5.0000", "0041"});
}

TEST_CASE("interpreter: a text that breaks off is refused at its last line") {
  for (const char* text : {"G#5G#5", "G21\nG90\nG00X0", "G21\nG90\nG00X0\n", "G21\nM98P2\nO2\nM99\n"}) {
    CAPTURE(std::string(text));
    const Refusal found = refusal(text);
    const std::string lines = text;
    CHECK(found.thrown);
    CHECK(found.line >= 1);
    CHECK(found.line <= static_cast<std::uint32_t>(1 + std::count(lines.begin(), lines.end() - 1, '\n')));
    CHECK(found.column >= 1);
  }
}

TEST_CASE("interpreter: a line over the limit is refused with its length") {
  ReaderOptions options;
  options.max_line_length = 60;
  const Refusal found = refusal(framed("G01 X1. F60. (" + std::string(60, 'A') + ")\n"), options);
  CHECK(found.thrown);
  CHECK(found.line == 4);
  CHECK(found.message == "line of 75 characters (limit 60)");
}

// --- Block skip
// -------------------------------------------------------------------------------------------------------

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

// --- Kept untouched
// ---------------------------------------------------------------------------------------------------

TEST_CASE("interpreter: modes that are not supported keep their moves, with one warning for a run of them") {
  struct Case {
    const char* on;
    const char* off;
    const char* why;
  };
  for (const Case& c : {Case{"G41 D1", "G40", "cutter compensation"}, Case{"G95", "G94 F600.", "G95"},
                        Case{"G62", "G64", "G62"}, Case{"G63", "G64", "G63"}}) {
    CAPTURE(std::string(c.on));
    const Program program = read("G01 X10. F600.\n" + std::string(c.on) + "\nG01 X20. F1.\nX21.\nX22.\n" + c.off +
                                 "\nG90 G00 X0. Y0. Z0.\nG01 X30. F600.\n");
    REQUIRE(program.regions.size() == 2);
    CHECK(program.regions[0]->last_line == 4);
    CHECK(program.regions[1]->first_line == 11);
    CHECK(warns(program, c.why, 6));
    int kept = 0;
    for (const auto& finding : program.warnings) {
      if (finding.message.find("kept untouched") != std::string::npos) ++kept;
    }
    CHECK(kept == 1);
  }
}

TEST_CASE("interpreter: the position behind cutter compensation is not the programmed one") {
  const Program program = read("G41 D1\nG01 X10. F600.\nG40\nX20.\nX30. Y5.\nX40.\n");
  REQUIRE(program.regions.size() >= 1);
  CHECK(program.regions[0]->first_line >= 8);  // X20. and, for Y, X30. Y5. make the axes known
  CHECK_FALSE(program.final_state.uncertain_groups != 0U);
}

// --- The clock
// --------------------------------------------------------------------------------------------------------

TEST_CASE("interpreter: rapids and dwells between the regions") {
  const Program program = read("G00 X30. Y40.\nG04 P1500\nG04 X2.5\nG01 X31. F60.\nG00 Z10.\n");
  REQUIRE(program.other_moves.size() == 4);
  CHECK(program.other_moves[0].segment.kind == SegmentKind::rapid);
  CHECK(program.other_moves[0].segment.length_mm == doctest::Approx(50.0));
  CHECK(program.other_moves[0].segment.line == 4);
  CHECK(program.other_moves[1].dwell_s == doctest::Approx(1.5));
  CHECK(program.other_moves[2].dwell_s == doctest::Approx(2.5));
  CHECK(program.other_moves[3].segment.length_mm == doctest::Approx(10.0));
  ReaderOptions increments;
  increments.calculator_decimal_point = false;
  CHECK(read("G04 X2500\n", increments).other_moves[0].dwell_s == doctest::Approx(2.5));
  check_refused(framed("G04 P-5\n"), 4, 5, {"G04 P-5 is negative", "0006"});
}

TEST_CASE("interpreter: a drilling cycle runs down and back, modal from hole to hole") {
  // From Z10: rapid over the hole, rapid to R2, feed to Z-5, one rapid to the return level.
  const Program program = read("G00 Z10.\nG98 G81 X10. Y0. Z-5. R2. F60.\nX20.\nG80\nG00 X0.\n");
  CHECK(program.regions.empty());
  const auto& moves = program.other_moves;
  struct Expected {
    Vector3 end;
    double feed;
  };
  const std::vector<Expected> expected = {{{0, 0, 10}, 0},  {{10, 0, 10}, 0}, {{10, 0, 2}, 0}, {{10, 0, -5}, 1},
                                          {{10, 0, 10}, 0}, {{20, 0, 10}, 0}, {{20, 0, 2}, 0}, {{20, 0, -5}, 1},
                                          {{20, 0, 10}, 0}, {{0, 0, 10}, 0}};
  REQUIRE(moves.size() == expected.size());
  for (std::size_t i = 0; i < expected.size(); ++i) {
    CAPTURE(i);
    CHECK(near(moves[i].segment.end_mm, expected[i].end));
    CHECK(moves[i].segment.feed_mm_per_s == doctest::Approx(expected[i].feed));
  }
  // The initial level is that before the cycle, also for a hole that begins at R.
  const Program mixed = read("G00 Z10.\nG99 G81 X10. Z-5. R2. F60.\nG98 X20.\nG80\n");
  CHECK(near(mixed.final_state.position_mm, {20.0, 0.0, 10.0}));
  // G99 returns to R and the next hole starts there; G91 counts R from the level and Z from R; K repeats.
  const Program r_level = read("G00 Z10.\nG99 G81 X10. Z-5. R2. F60.\nG80\n");
  CHECK(near(r_level.final_state.position_mm, {10.0, 0.0, 2.0}));
  const Program repeated = read("G00 Z10.\nG91 G98 G81 X10. Z-7. R-8. K3 F60.\nG80\n");
  CHECK(near(repeated.final_state.position_mm, {30.0, 0.0, 10.0}));
  double deepest = 0.0;
  for (const auto& move : repeated.other_moves) deepest = std::min(deepest, move.segment.end_mm.z());
  CHECK(deepest == doctest::Approx(-5.0));
  CHECK(near(read("G00 Z10.\nG81 X10. Z-5. R2. K0 F60.\nG80\n").final_state.position_mm, {0.0, 0.0, 10.0}));
}

TEST_CASE("interpreter: the initial level of a cycle is that of its own axis") {
  // G18 drills along Y: from Y30 to R5, down to -2 and back to Y30.
  const Program program = read("G18\nG00 Y30. Z7.\nG98 G81 X10. Y-2. R5. F60.\nG80\n");
  CHECK(near(program.final_state.position_mm, {10.0, 30.0, 7.0}));
}

TEST_CASE("interpreter: a motion code ends a cycle") {
  const Program program = read("G81 X10. Z-5. R2. F60.\nG01 X20. F600.\n");
  REQUIRE(program.regions.size() == 0);  // the block that cancels a cycle is kept
  CHECK(program.final_state.cycle == 80);
  CHECK(read("G81 X10. Z-5. R2. F60.\nG01 X20. F600.\nX30.\n").regions.size() == 1);
}

TEST_CASE("interpreter: probes give the state behind a line") {
  ReaderOptions options;
  options.probe_lines = {0, 2, 4, 5, 99};
  const Program program = read("G91 G01 X10. F600.\nG90 X3.\n", options);
  REQUIRE(program.probed.size() == 5);
  CHECK_FALSE(program.probed[0].known[0]);
  CHECK(program.probed[1].distance == 90);
  CHECK(program.probed[2].distance == 91);
  CHECK(program.probed[2].position_mm.x() == 10.0);
  CHECK(program.probed[3].distance == 90);
  CHECK(program.probed[3].position_mm.x() == 3.0);
  CHECK(program.probed[4].position_mm.x() == 3.0);
}

TEST_CASE("interpreter: of several codes of a group in one block the last counts") {
  const Program program = read("G91 G90 G00 G01 X10. F600.\n");
  REQUIRE(program.regions.size() == 1);
  CHECK(program.final_state.distance == 90);
  CHECK(program.final_state.motion == 1);
}
