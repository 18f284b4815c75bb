#include <doctest/doctest.h>

#include <cmath>
#include <vector>

#include "compensation_program.hpp"
#include "program/rewrite/cutter_compensation.hpp"

// What changes from block to block in cutter compensation: value, side, direction, motion.

using shapegcode::CompensatedMove;
using shapegcode::CompensationOptions;
using shapegcode::Segment;
using shapegcode::Vector3;
using shapegcode::tests::ends;
using shapegcode::tests::pi;
using shapegcode::tests::Program;

TEST_CASE("cutter compensation: a new value holds from the end of its block, a line runs askew, an arc spirals") {
  Program program;
  program.line(10, 0);
  program.line(20, 0);
  program.radius = 3.0;
  SUBCASE("line") {
    program.line(30, 0);
    program.line(40, 0);
    CHECK(ends(program.run()) == "0(10.000 2.000) 1(20.000 2.000) 2(30.000 3.000) 3(40.000 3.000)");
  }
  SUBCASE("arc") {
    program.arc(30, 10, 20, 10, 90);
    const Segment arc = program.run()[2].segment;
    CHECK(arc.start_radius_mm == doctest::Approx(8.0));
    CHECK(arc.end_radius_mm == doctest::Approx(7.0));
    CHECK(arc.sweep_rad == doctest::Approx(pi / 2));
    CHECK((arc.end_mm - Vector3(27, 10, 0)).norm() < 1e-12);
  }
  SUBCASE("the corner at the block's end has the new value on both sides") {
    program.line(30, 0);
    program.line(30, 20);
    CHECK(ends(program.run()) == "0(10.000 2.000) 1(20.000 2.000) 2(27.000 3.000) 3(27.000 20.000)");
  }
  SUBCASE("value zero cancels, the next one starts anew") {
    program.radius = 0.0;
    program.line(30, 0);
    program.line(40, 0);
    program.radius = 1.0;
    program.line(50, 0);
    program.line(60, 0);
    CHECK(ends(program.run()) ==
          "0(10.000 2.000) 1(20.000 2.000) 2(30.000 0.000) 3(40.000 0.000) 4(50.000 1.000) 5(60.000 1.000)");
  }
}

TEST_CASE("cutter compensation: change of side") {
  Program program;
  program.line(10, 0);
  program.line(20, 0);
  program.mode = 42;
  SUBCASE("straight on there is no intersection: across the path") {
    program.line(40, 0);
    CHECK(ends(program.run()) == "0(10.000 2.000) 1(20.000 2.000) 2(20.000 -2.000) 2(40.000 -2.000)");
  }
  SUBCASE("lines at a right angle meet at the radius from both") {
    program.line(20, 20);
    CHECK(ends(program.run()) == "0(10.000 2.000) 1(22.000 2.000) 2(22.000 20.000)");
    program.blocks.pop_back();
    program.at = {20, 0, 0};
    program.line(20, -20);
    CHECK(ends(program.run()) == "0(10.000 2.000) 1(18.000 2.000) 2(18.000 -20.000)");
  }
  SUBCASE("line and arc: circle of radius 8 about (20, -10) has no point at y = 2, that of 12 touches it") {
    program.arc(30, -10, 20, -10, -90);
    CHECK(ends(program.run()) == "0(10.000 2.000) 1(20.000 2.000) 2(20.000 -2.000) 2(28.000 -10.000)");
    program.blocks.pop_back();
    program.at = {20, 0, 0};
    program.arc(20, -20, 20, -10, 180);  // back to the left: right of it is outside, radius 12
    const auto moves = program.run();
    REQUIRE(moves.size() == 3);
    CHECK((moves[1].segment.end_mm - Vector3(20, 2, 0)).norm() < 1e-6);
  }
  SUBCASE("a negative value has the other side") {
    program.mode = 41;
    program.radius = -2.0;
    program.line(40, 0);  // its end only: the corner before it has the value of the block before
    CHECK(ends(program.run()) == "0(10.000 2.000) 1(20.000 2.000) 2(40.000 -2.000)");
  }
}

TEST_CASE("cutter compensation: blocks without motion in the plane") {
  Program program;
  program.mode = 42;
  program.line(10, 0);
  program.line(20, 0);
  const auto after = [&](int count, int blocks_read) {
    Program whole = program;
    for (int i = 0; i < count; ++i) whole.height(5.0 * (i + 1));
    whole.line(10, 10);  // acute, outside: vectors (22, -2) and (22.83, 0)
    CompensationOptions options;
    options.blocks_read = blocks_read;
    const auto moves = whole.run(options);
    for (const CompensatedMove& move : moves) {
      const double height = whole.blocks[move.source].segment.end_mm.z();
      CHECK(move.segment.end_mm.z() == height);
    }
    return ends(moves);
  };
  CHECK(after(0, 3) == "0(10.000 -2.000) 1(22.000 -2.000) 2(22.828 0.000) 2(11.414 11.414)");
  // One is read past: it runs on the first vector of the corner.
  CHECK(after(1, 3) == "0(10.000 -2.000) 1(22.000 -2.000) 2(22.000 -2.000) 3(22.828 0.000) 3(11.414 11.414)");
  // Two are not, unless the control reads further: the vector stands across the block before them.
  CHECK(after(2, 3) == "0(10.000 -2.000) 1(20.000 -2.000) 2(20.000 -2.000) 3(20.000 -2.000) 4(11.414 11.414)");
  CHECK(after(2, 4) ==
        "0(10.000 -2.000) 1(22.000 -2.000) 2(22.000 -2.000) 3(22.000 -2.000) 4(22.828 0.000) 4(11.414 11.414)");
  SUBCASE("before an arc the tool first goes to the arc's own vector") {
    program.height(1);
    program.height(2);
    program.arc(40, 0, 30, 0, -180);
    CHECK(ends(program.run()) ==
          "0(10.000 -2.000) 1(20.000 -2.000) 2(20.000 -2.000) 3(20.000 -2.000) 4(22.000 0.000) 4(38.000 0.000)");
  }
  SUBCASE("before the first motion in the plane nothing is compensated") {
    Program start;
    start.height(5);
    start.line(10, 0);
    start.line(20, 0);
    CHECK(ends(start.run()) == "0(0.000 0.000) 1(10.000 2.000) 2(20.000 2.000)");
  }
  SUBCASE("G40 alone: the vector stands across the block before, the next motion takes it off") {
    CompensationOptions type_b;
    type_b.start_up = 'B';
    program.mode = 40;
    program.height(5);
    program.line(0, 20);
    program.arc(20, 20, 10, 20, 180);
    CHECK(ends(program.run(type_b)) ==
          "0(10.000 -2.000) 1(20.000 -2.000) 2(20.000 -2.000) 3(0.000 20.000) 4(20.000 20.000)");
  }
}

TEST_CASE("cutter compensation: corner vectors nearer than the ignorable length are one") {
  Program program;
  program.mode = 42;
  program.line(10, 0);
  program.line(20, 0);
  CompensationOptions options;
  SUBCASE("acute corner: (22, -2) and (22.828, 0)") {
    program.line(10, 10);
    options.ignorable_corner_mm = 1.99;
    CHECK(ends(program.run(options)) == "0(10.000 -2.000) 1(22.000 -2.000) 2(22.828 0.000) 2(11.414 11.414)");
    options.ignorable_corner_mm = 2.01;
    CHECK(ends(program.run(options)) == "0(10.000 -2.000) 1(22.000 -2.000) 2(11.414 11.414)");
  }
  SUBCASE("an arc keeps its own vector: (22, -2) goes, (22, 0) stays") {
    program.arc(40, 0, 30, 0, -180);
    options.ignorable_corner_mm = 2.5;
    CHECK(ends(program.run(options)) == "0(10.000 -2.000) 1(22.000 0.000) 2(38.000 0.000)");
  }
}

TEST_CASE("cutter compensation: back along the same line in any direction the tool goes round the line's end") {
  for (int degrees = 0; degrees < 360; degrees += 7) {
    const Vector3 along(std::cos(degrees * pi / 180), std::sin(degrees * pi / 180), 0.0);
    const Vector3 left(-along.y(), along.x(), 0.0);
    for (const double side : {1.0, -1.0}) {
      for (const double aside : {0.0, 5e-6, -5e-6}) {  // mm, as numbers read in inches may leave
        Program program;
        program.mode = side > 0.0 ? 41 : 42;
        program.line(5.0 * along.x(), 5.0 * along.y());
        program.line(20.0 * along.x(), 20.0 * along.y());
        program.line(8.0 * along.x() + aside * left.x(), 8.0 * along.y() + aside * left.y());
        const auto moves = program.run();
        REQUIRE(moves.size() == 4);
        CHECK((moves[1].segment.end_mm - (22.0 * along + 2.0 * side * left)).norm() < 1e-5);
        CHECK((moves[2].segment.end_mm - (22.0 * along - 2.0 * side * left)).norm() < 1e-5);
        CHECK((moves[3].segment.end_mm - (8.0 * along - 2.0 * side * left)).norm() < 1e-5);
      }
    }
  }
}

TEST_CASE("cutter compensation: a nearly tangent arc hardly larger than the cutter keeps its radius") {
  // The centre's circle of 1 um bends away from the common tangent at once: one vector for both would leave it.
  for (const double turn : {1e-5, 1e-4, 5e-4, 9e-4}) {
    Program program;
    program.line(10, 0);
    program.line(20, 0);
    const double radius = 2.001;
    const Vector3 centre(20 - radius * std::sin(turn), radius * std::cos(turn), 0);
    const double end = turn + pi / 2;
    program.arc(centre.x() + radius * std::sin(end), centre.y() - radius * std::cos(end), centre.x(), centre.y(), 90);
    const auto moves = program.run();
    REQUIRE(moves.size() == 3);
    CHECK(std::abs(moves[1].segment.end_mm.y() - 2.0) < 1e-9);
    CHECK(std::abs((moves[1].segment.end_mm - centre).norm() - 0.001) < 2e-7);
  }
}
