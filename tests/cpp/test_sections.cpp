#include <doctest/doctest.h>

#include <cmath>
#include <numbers>
#include <random>
#include <vector>

#include "shapegcode/error.hpp"
#include "shapegcode/measure/sections.hpp"

using shapegcode::LineRange;
using shapegcode::make_arc;
using shapegcode::make_line;
using shapegcode::Path;
using shapegcode::PathSection;
using shapegcode::SectionKind;
using shapegcode::Segment;
using shapegcode::Vector3;

namespace {

constexpr double pi = std::numbers::pi;

/// Line, quarter arc, line: source lines 7, 8, 9.
Path line_arc_line() {
  return Path({make_line({0, 0, 0}, {20, 0, 0}, 100.0, 7),
               make_arc({20, 0, 0}, {40, 20, 0}, {20, 20, 0}, 0.5 * pi, 2, 100.0, 8),
               make_line({40, 20, 0}, {40, 40, 0}, 100.0, 9)});
}

}  // namespace

TEST_CASE("sections: line, arc, line") {
  const std::vector<PathSection> sections = path_sections(line_arc_line());
  REQUIRE(sections.size() == 3);
  CHECK(sections[0].kind == SectionKind::line);
  CHECK(sections[1].kind == SectionKind::arc);
  CHECK(sections[2].kind == SectionKind::line);
  CHECK(sections[1].begin_mm == doctest::Approx(20.0));
  CHECK(sections[1].length_mm() == doctest::Approx(10.0 * pi));
  CHECK(sections[1].first_line == 8);
  CHECK_FALSE(sections[0].stops_at_end);
  CHECK(sections[2].stops_at_end);
}

TEST_CASE("sections: runs of one direction and of one circle are one; a reversal, a stop and another circle are not") {
  std::vector<Segment> segments = {make_line({0, 0, 0}, {5, 0, 0}, 100.0),
                                   make_line({5, 0, 0}, {5, 0, 0}, 100.0),
                                   make_line({5, 0, 0}, {9, 0, 0}, 100.0),
                                   make_line({9, 0, 0}, {2, 0, 0}, 100.0),
                                   make_arc({2, 0, 0}, {0, 2, 0}, {0, 0, 0}, 0.5 * pi, 2, 100.0),
                                   make_arc({0, 2, 0}, {-2, 0, 0}, {0, 0, 0}, 0.5 * pi, 2, 100.0),
                                   make_arc({-2, 0, 0}, {0, 2, 0}, {0, 0, 0}, -0.5 * pi, 2, 100.0),
                                   make_arc({0, 2, 0}, {4, 2, 0}, {2, 2, 0}, pi, 2, 100.0)};
  CHECK(path_sections(Path(segments)).size() == 5);
  segments[0].stop_at_end = true;
  const std::vector<PathSection> sections = path_sections(Path(segments));
  REQUIRE(sections.size() == 6);
  CHECK(sections[0].stops_at_end);
  CHECK(sections[3].first == 4);
  CHECK(sections[3].last == 5);
}

TEST_CASE("sections: a curve in short pieces is one section; the pieces tile the path") {
  std::mt19937 random(5);
  std::uniform_real_distribution<double> turn(0.001, 0.3);
  std::uniform_real_distribution<double> length(0.02, 1.5);
  for (int trial = 0; trial < 50; ++trial) {
    std::vector<Segment> segments;
    Vector3 p = Vector3::Zero();
    double heading = 0.0;
    for (int i = 0; i < 200; ++i) {
      heading += i % 2 == 0 ? turn(random) : -turn(random);
      const Vector3 next = p + length(random) * Vector3(std::cos(heading), std::sin(heading), 0.0);
      segments.push_back(make_line(p, next, 100.0));
      p = next;
    }
    const Path path(segments);
    const std::vector<PathSection> sections = path_sections(path, 0.5);
    double reached = 0.0;
    bool short_before = false;
    for (const PathSection& section : sections) {
      CHECK(section.begin_mm == reached);
      reached = section.end_mm;
      const bool is_short = section.kind == SectionKind::curve || section.length_mm() < 0.5;
      CHECK_FALSE((is_short && short_before));
      short_before = is_short;
    }
    CHECK(reached == path.length_mm());
    CHECK(path_sections(path, 0.0).size() == 200);
  }
  CHECK_THROWS_AS(static_cast<void>(path_sections(line_arc_line(), std::nan(""))), shapegcode::Error);
}

TEST_CASE("sections: by source lines") {
  const Path path = line_arc_line();
  const std::vector<LineRange> two = {{8, 8}, {9, 30}};
  const std::vector<PathSection> sections = line_sections(path, two);
  REQUIRE(sections.size() == 2);
  CHECK(sections[0].kind == SectionKind::arc);
  CHECK(sections[1].begin_mm == doctest::Approx(20.0 + 10.0 * pi));
  const std::vector<LineRange> both = {{7, 8}};
  CHECK(line_sections(path, both).at(0).kind == SectionKind::curve);
  const std::vector<LineRange> none = {{20, 30}};
  CHECK(line_sections(path, none).empty());
  const std::vector<LineRange> backwards = {{9, 8}};
  CHECK_THROWS_AS(static_cast<void>(line_sections(path, backwards)), shapegcode::Error);
  const std::vector<LineRange> overlapping = {{7, 8}, {8, 9}};
  CHECK_THROWS_AS(static_cast<void>(line_sections(path, overlapping)), shapegcode::Error);
}
