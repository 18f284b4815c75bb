#include <doctest/doctest.h>

#include <cstdint>
#include <numbers>
#include <string>
#include <vector>

#include "interpreter_program.hpp"
#include "shapegcode/program.hpp"

using shapegcode::Program;
using shapegcode::read_program;
using shapegcode::ReaderOptions;
using shapegcode::Region;
using shapegcode::Segment;
using shapegcode::SegmentKind;
using shapegcode::Vector3;
using shapegcode::tests::check_refused;
using shapegcode::tests::framed;
using shapegcode::tests::near;
using shapegcode::tests::only_segment;
using shapegcode::tests::read;
using shapegcode::tests::regions_around;
using shapegcode::tests::text_of;
using shapegcode::tests::warns;

// --- Numbers and units -----------------------------------------------------------------------------------------------

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

// --- Regions ---------------------------------------------------------------------------------------------------------

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

// --- Kept untouched --------------------------------------------------------------------------------------------------

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

// --- The clock -------------------------------------------------------------------------------------------------------

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
