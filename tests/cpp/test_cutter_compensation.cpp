#include "program/rewrite/cutter_compensation.hpp"

#include <doctest/doctest.h>

#include <cmath>
#include <numbers>
#include <string>
#include <vector>

#include "compensation_program.hpp"
#include "shapegcode/error.hpp"

using shapegcode::compensate;
using shapegcode::CompensatedMove;
using shapegcode::CompensationBlock;
using shapegcode::CompensationOptions;
using shapegcode::Error;
using shapegcode::ErrorKind;
using shapegcode::make_arc;
using shapegcode::Segment;
using shapegcode::SegmentKind;
using shapegcode::Vector3;
using shapegcode::tests::ends;
using shapegcode::tests::pi;
using shapegcode::tests::Program;

namespace {

/// The alarm number and line of the refusal; 0 if there is none.
std::pair<int, std::uint32_t> refused(const Program& program, const std::string& words,
                                      const CompensationOptions& options = {}) {
  try {
    (void)program.run(options);
  } catch (const Error& error) {
    CHECK_MESSAGE(std::string(error.what()).find(words) != std::string::npos, error.what());
    CHECK(error.kind() == ErrorKind::program);
    return {error.alarm(), error.line()};
  }
  return {0, 0};
}

}  // namespace

TEST_CASE("cutter compensation: a square inside and outside has its sides moved by the radius") {
  Program inside;  // counter-clockwise, tool on the left: pocket of 20 mm from its lower left corner's middle side
  inside.line(10, 0);
  inside.line(20, 0);
  inside.line(20, 20);
  inside.line(0, 20);
  inside.line(0, 0);
  inside.line(10, 0);
  inside.mode = 40;
  inside.line(10, 10);
  CHECK(ends(inside.run()) ==
        "0(10.000 2.000) 1(18.000 2.000) 2(18.000 18.000) 3(2.000 18.000) 4(2.000 2.000) "
        "5(10.000 2.000) 6(10.000 10.000)");
  for (CompensationBlock& block : inside.blocks) {
    if (block.mode == 41) block.mode = 42;
  }
  CHECK(ends(inside.run()) ==
        "0(10.000 -2.000) 1(22.000 -2.000) 2(22.000 22.000) 3(-2.000 22.000) 4(-2.000 -2.000) "
        "5(10.000 -2.000) 6(10.000 10.000)");
  // A negative value swaps the sides.
  for (CompensationBlock& block : inside.blocks) block.radius_mm = -2.0;
  CHECK(ends(inside.run()) ==
        "0(10.000 2.000) 1(18.000 2.000) 2(18.000 18.000) 3(2.000 18.000) 4(2.000 2.000) "
        "5(10.000 2.000) 6(10.000 10.000)");
  for (std::size_t i = 0; i < 7; ++i) {
    CHECK(inside.run()[i].segment.feed_mm_per_s == inside.blocks[i].segment.feed_mm_per_s);
    CHECK(inside.run()[i].segment.line == i + 1);
  }
}

TEST_CASE("cutter compensation: a full circle inside and outside keeps its centre and turns once") {
  for (const double sweep : {360.0, -360.0}) {
    for (const int mode : {41, 42}) {
      Program program;
      program.mode = mode;
      program.line(10, 0);
      program.arc(10, 0, 0, 0, sweep);
      program.mode = 40;
      program.line(0, 0);
      const auto moves = program.run();
      REQUIRE(moves.size() == 3);
      const Segment& circle = moves[1].segment;
      const double expected = (sweep > 0) == (mode == 41) ? 8.0 : 12.0;
      CHECK(circle.kind == SegmentKind::arc);
      CHECK(circle.start_radius_mm == doctest::Approx(expected).epsilon(1e-14));
      CHECK(circle.end_radius_mm == doctest::Approx(expected).epsilon(1e-14));
      CHECK(circle.sweep_rad == doctest::Approx(sweep * pi / 180).epsilon(1e-14));
      CHECK((circle.start_mm - Vector3(expected, 0, 0)).norm() < 1e-12);
      CHECK((circle.centre_mm - Vector3(0, 0, 0)).norm() == 0.0);
      CHECK(moves[2].segment.end_mm == Vector3(0, 0, 0));
    }
  }
}

TEST_CASE("cutter compensation: outside corners as drawn, obtuse by intersection, acute by the radius") {
  Program program;
  program.mode = 42;
  program.line(0, -10);
  SUBCASE("square corner of two lines") {
    program.line(20, -10);
    program.line(20, 10);
    CHECK(ends(program.run()).find("1(22.000 -12.000) 2(22.000 10.000)") != std::string::npos);
  }
  SUBCASE("obtuse corner of two lines: 45 degrees") {
    program.line(20, -10);
    program.line(30, 0);
    // tan(22.5 degrees) times the radius beyond the corner
    const auto moves = program.run();
    CHECK(moves[1].segment.end_mm.x() == doctest::Approx(20 + 2 * std::tan(pi / 8)));
    CHECK(moves[1].segment.end_mm.y() == doctest::Approx(-12));
    CHECK(moves.size() == 3);
  }
  SUBCASE("acute corner of two lines: 135 degrees") {
    program.line(20, -10);
    program.line(10, 0);
    const double h = std::sqrt(2.0);  // normal of the second line times the radius: (h, h); its direction (-h, h) / 2
    const auto moves = program.run();
    REQUIRE(moves.size() == 4);
    CHECK((moves[1].segment.end_mm - Vector3(22, -12, 0)).norm() < 1e-12);
    CHECK((moves[2].segment.end_mm - Vector3(20 + h + h, -10 + h - h, 0)).norm() < 1e-12);
    CHECK(moves[2].source == 2);  // the way round the corner belongs to the next block and runs at its feed
    CHECK(moves[2].segment.feed_mm_per_s == program.blocks[2].segment.feed_mm_per_s);
    CHECK((moves[3].segment.end_mm - Vector3(10 + h, h, 0)).norm() < 1e-12);
  }
  SUBCASE("back along the same line: the tool goes round its end") {
    program.line(20, -10);
    program.line(5, -10);
    CHECK(ends(program.run()).find("1(22.000 -12.000) 2(22.000 -8.000) 2(5.000 -8.000)") != std::string::npos);
  }
  SUBCASE("line to arc, arc to line") {
    program.line(20, -10);
    program.arc(40, -10, 30, -10, -180);  // leaves upwards: 90 degrees outside; ends downwards
    program.line(60, -10);                // turns left by 90 degrees: outside again
    CHECK(ends(program.run())
              .find("1(22.000 -12.000) 2(22.000 -10.000) 2(38.000 -10.000) 3(38.000 -12.000) "
                    "3(60.000 -12.000)") != std::string::npos);
  }
  SUBCASE("arc to arc, acute") {
    program.line(20, -10);
    program.arc(40, -10, 30, -10, -180);
    program.arc(50, 0, 40, 0, 90);  // leaves along +X
    CHECK(ends(program.run()).find("2(38.000 -10.000) 3(38.000 -12.000) 3(40.000 -12.000) 3(52.000 0.000)") !=
          std::string::npos);
  }
}

TEST_CASE("cutter compensation: inside corners with arcs are the intersection of the offset curves") {
  Program program;  // left of the path
  program.line(0, 10);
  program.line(0, 0);
  program.line(20, 0);
  SUBCASE("line to arc") {
    program.arc(40, 0, 30, 0, -180);  // circle of radius 12 about (30, 0) against the line at y = 2
    const auto moves = program.run();
    const Vector3 corner(30 - std::sqrt(144.0 - 4.0), 2, 0);
    CHECK((moves[2].segment.end_mm - corner).norm() < 1e-12);
    CHECK(moves[3].segment.sweep_rad == doctest::Approx(-(pi - std::asin(2.0 / 12.0))));
    CHECK(moves[3].segment.start_radius_mm == doctest::Approx(12.0));
    SUBCASE("and arc to line") {
      program.line(60, 0);
      const auto more = program.run();
      CHECK(more[3].segment.end_mm.x() == doctest::Approx(30 + std::sqrt(140.0)));
      CHECK(more[3].segment.end_mm.y() == doctest::Approx(2.0));
      CHECK(more[3].segment.sweep_rad == doctest::Approx(-(pi - 2.0 * std::asin(2.0 / 12.0))));
    }
    SUBCASE("and arc to arc") {
      program.arc(60, 0, 50, 0, -180);  // circles of radius 12 about (30, 0) and (50, 0)
      const auto more = program.run();
      CHECK((more[3].segment.end_mm - Vector3(40, std::sqrt(44.0), 0)).norm() < 1e-12);
    }
  }
}

TEST_CASE("cutter compensation: start-up and cancel, types A and B") {
  CompensationOptions type_b;
  type_b.start_up = 'B';
  const auto corner = [](double next_x, double next_y) {
    Program program;
    program.mode = 42;
    program.line(20, 0);
    program.line(next_x, next_y);
    return program;
  };
  SUBCASE("inside a corner both end across the next block") {
    CHECK(ends(corner(20, -20).run()) == "0(18.000 0.000) 1(18.000 -20.000)");
    CHECK(ends(corner(20, -20).run(type_b)) == "0(18.000 0.000) 1(18.000 -20.000)");
  }
  SUBCASE("obtuse") {
    CHECK(ends(corner(20, 20).run()) == "0(22.000 0.000) 1(22.000 20.000)");
    CHECK(ends(corner(20, 20).run(type_b)) == "0(20.000 -2.000) 1(22.000 -2.000) 1(22.000 20.000)");
  }
  SUBCASE("acute") {
    CHECK(ends(corner(0, 20).run()) == "0(21.414 1.414) 1(1.414 21.414)");
    CHECK(ends(corner(0, 20).run(type_b)) == "0(20.000 -2.000) 1(22.000 -2.000) 1(22.828 0.000) 1(1.414 21.414)");
  }
  SUBCASE("start-up before an arc") {
    Program program;
    program.mode = 42;
    program.line(20, 0);
    program.arc(40, 0, 30, 0, -180);
    CHECK(ends(program.run()) == "0(22.000 0.000) 1(38.000 0.000)");
    CHECK(ends(program.run(type_b)) == "0(20.000 -2.000) 1(22.000 -2.000) 1(22.000 0.000) 1(38.000 0.000)");
    SUBCASE("cancel after it") {
      program.mode = 40;
      program.line(60, 0);
      CHECK(ends(program.run()) == "0(22.000 0.000) 1(38.000 0.000) 2(60.000 0.000)");
      CHECK(ends(program.run(type_b)) ==
            "0(20.000 -2.000) 1(22.000 -2.000) 1(22.000 0.000) 1(38.000 0.000) "
            "2(38.000 -2.000) 2(40.000 -2.000) 2(60.000 0.000)");
    }
  }
  SUBCASE("cancel after a line") {
    Program program = corner(20, 20);
    program.mode = 40;
    SUBCASE("obtuse") {
      program.line(0, 20);
      CHECK(ends(program.run()) == "0(22.000 0.000) 1(22.000 20.000) 2(0.000 20.000)");
      CHECK(ends(program.run(type_b)) ==
            "0(20.000 -2.000) 1(22.000 -2.000) 1(22.000 22.000) 2(20.000 22.000) 2(0.000 20.000)");
    }
    SUBCASE("inside") {
      program.line(40, 20);
      CHECK(ends(program.run(type_b)) == "0(20.000 -2.000) 1(22.000 -2.000) 1(22.000 20.000) 2(40.000 20.000)");
    }
  }
}

TEST_CASE("cutter compensation: what the control refuses, with its alarm, line and values") {
  using Refusal = std::pair<int, std::uint32_t>;
  Program program;
  program.line(10, 0);
  SUBCASE("0033: the offset curves do not meet") {
    program.line(20, 0);
    program.arc(14, 0, 17, 0, 180);
    CHECK(refused(program, "cutter radius 2.0000 mm") == Refusal{33, 2});
    CHECK(refused(program, "line 3 do not meet inside their corner of 90.000 degrees") == Refusal{33, 2});
  }
  SUBCASE("0034: start-up and cancel in an arc") {
    Program start;
    start.arc(20, 0, 10, 0, 180);
    CHECK(refused(start, "started only in a straight block") == Refusal{34, 1});
    program.line(20, 0);
    program.mode = 40;
    program.arc(30, 10, 20, 10, 90);
    CHECK(refused(program, "cancelled only in a straight block: this arc has radius 10.0000 mm") == Refusal{34, 3});
    program.blocks[2].mode = 41;
    program.blocks[2].radius_mm = 0.0;  // D0 is a cancel too
    CHECK(refused(program, "cancelled") == Refusal{34, 3});
  }
  SUBCASE("0037: an arc in another plane") {
    program.line(20, 0);
    program.add(make_arc(program.at, {30, 0, -10}, {20, 0, -10}, pi / 2, 1, 10.0));
    CHECK(refused(program, "arc about Y") == Refusal{37, 3});
  }
  SUBCASE("0038 and 0041: an inside arc no larger than the cutter") {
    program.line(20, 0);
    program.arc(20, 4, 20, 2, 180);
    CHECK(refused(program, "arc radius 2.0000 mm equals the cutter radius 2.0000 mm") == Refusal{38, 3});
    for (CompensationBlock& block : program.blocks) block.radius_mm = 5.0;
    CHECK(refused(program, "arc radius 2.0000 mm is smaller than the cutter radius 5.0000 mm") == Refusal{41, 3});
    for (CompensationBlock& block : program.blocks) block.radius_mm = 1.999;
    CHECK_NOTHROW((void)program.run());
  }
  SUBCASE("0041: a groove narrower than the cutter; without the check the line runs back") {
    program.line(20, 0);
    program.line(20, 3);
    program.line(0, 3);
    CHECK(refused(program,
                  "block of 3.0000 mm is too short for its corners with cutter radius 2.0000 mm: the tool "
                  "centre would run 1.0000 mm against") == Refusal{41, 3});
    CompensationOptions unchecked;
    unchecked.check_interference = false;
    CHECK(ends(program.run(unchecked)) == "0(10.000 2.000) 1(18.000 2.000) 2(18.000 1.000) 3(0.000 1.000)");
  }
  SUBCASE("0041: an arc that its corners use up") {
    program.line(20, 0);
    program.arc(22, 0, 21, -std::sqrt(3.0), -60);  // radius 2, a bump in a floor
    program.line(40, 0);
    CHECK_NOTHROW((void)program.run());  // the centre's circle of 4 mm meets the line at 2 mm: 0.27 rad each side
    Program groove;                      // 3 mm wide, its floor an arc
    groove.line(0, 20);
    groove.line(0, 0);
    groove.arc(3, 0, 1.5, -std::sqrt(22.75), -2.0 * std::asin(0.3) * 180 / pi);
    groove.line(3, 20);
    CHECK(refused(groove,
                  "sweep 34.915 degrees is too short for its corners with cutter radius 2.0000 mm: they take "
                  "43.107 degrees") == Refusal{41, 3});
  }
}

TEST_CASE("cutter compensation: arguments out of range are refused as such") {
  Program program;
  program.line(10, 0);
  program.line(20, 0);
  const auto refuses = [](const Program& wrong, int normal, const CompensationOptions& options) {
    try {
      (void)compensate(wrong.blocks, normal, options);
    } catch (const Error& error) {
      return error.kind() == ErrorKind::argument;
    }
    return false;
  };
  CHECK_FALSE(refuses(program, 2, {}));
  CHECK(refuses(program, 3, {}));
  CHECK(refuses(program, -1, {}));
  CHECK(refuses(program, 2, {.start_up = 'C'}));
  CHECK(refuses(program, 2, {.ignorable_corner_mm = -1.0}));
  CHECK(refuses(program, 2, {.blocks_read = 2}));
  Program wrong = program;
  wrong.blocks[1].mode = 43;
  CHECK(refuses(wrong, 2, {}));
  wrong = program;
  wrong.blocks[1].segment.start_mm.x() += 1e-3;
  CHECK(refuses(wrong, 2, {}));
  wrong = program;
  wrong.blocks[1].radius_mm = std::nan("");
  CHECK(refuses(wrong, 2, {}));
  CHECK(compensate({}, 2, {}).empty());
}
