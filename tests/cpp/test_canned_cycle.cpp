#include <doctest/doctest.h>

#include <vector>

#include "program/interpret/canned_cycle.hpp"

using shapegcode::CannedCycle;
using shapegcode::expand_cycle;
using shapegcode::OtherMove;
using shapegcode::SegmentKind;
using shapegcode::Vector3;

namespace {

struct Step {
  double level;
  bool rapid;
  double dwell = 0.0;
};

/// From Z10, R 2, bottom -7, 5 mm/s.
void check_steps(CannedCycle cycle, const std::vector<Step>& expected) {
  cycle.r_mm = 2.0;
  cycle.bottom_mm = -7.0;
  cycle.initial_mm = 10.0;
  std::vector<OtherMove> moves;
  const Vector3 end = expand_cycle(cycle, {3.0, 4.0, 10.0}, 2, 5.0, 17, moves);
  CAPTURE(cycle.code);
  REQUIRE(moves.size() == expected.size());
  double level = 10.0;
  for (std::size_t i = 0; i < expected.size(); ++i) {
    CAPTURE(i);
    CHECK(moves[i].dwell_s == expected[i].dwell);
    CHECK(moves[i].segment.start_mm == Vector3(3.0, 4.0, level));
    CHECK(moves[i].segment.end_mm == Vector3(3.0, 4.0, expected[i].level));
    if (expected[i].dwell == 0.0) {
      CHECK((moves[i].segment.kind == SegmentKind::rapid) == expected[i].rapid);
      CHECK(moves[i].segment.feed_mm_per_s == (expected[i].rapid ? 0.0 : 5.0));
    }
    CHECK(moves[i].segment.line == 17);
    level = expected[i].level;
  }
  CHECK(end == Vector3(3.0, 4.0, cycle.return_to_r ? 2.0 : 10.0));
}

CannedCycle cycle_of(int code, double peck = 0.0, double dwell = 0.0, bool return_to_r = false) {
  CannedCycle cycle;
  cycle.code = code;
  cycle.peck_mm = peck;
  cycle.dwell_s = dwell;
  cycle.return_to_r = return_to_r;
  return cycle;
}

}  // namespace

TEST_CASE("canned cycle: drilling, with dwell, with the return to R") {
  check_steps(cycle_of(81), {{2, true}, {-7, false}, {10, true}});
  check_steps(cycle_of(81, 0, 0, true), {{2, true}, {-7, false}, {2, true}});
  check_steps(cycle_of(82, 0, 0.5), {{2, true}, {-7, false}, {-7, false, 0.5}, {10, true}});
  check_steps(cycle_of(81, 0, 0.5), {{2, true}, {-7, false}, {10, true}});  // P has no meaning here
}

TEST_CASE("canned cycle: boring and tapping feed out") {
  for (const int code : {74, 84, 85, 89}) check_steps(cycle_of(code), {{2, true}, {-7, false}, {2, false}, {10, true}});
}

TEST_CASE("canned cycle: pecks of 4 mm in a hole of 9 mm") {
  // G83 goes out to R and back to 0.5 mm over the last depth; G73 backs up by 0.5 mm only.
  check_steps(
      cycle_of(83, 4.0),
      {{2, true}, {-2, false}, {2, true}, {-1.5, true}, {-6, false}, {2, true}, {-5.5, true}, {-7, false}, {10, true}});
  check_steps(cycle_of(73, 4.0),
              {{2, true}, {-2, false}, {-1.5, true}, {-6, false}, {-5.5, true}, {-7, false}, {10, true}});
  check_steps(cycle_of(83, 20.0), {{2, true}, {-7, false}, {10, true}});  // one peck
}

TEST_CASE("canned cycle: along another axis, and upwards") {
  CannedCycle cycle = cycle_of(81);
  cycle.r_mm = 1.0;
  cycle.bottom_mm = 4.0;
  cycle.initial_mm = 0.0;
  std::vector<OtherMove> moves;
  CHECK(expand_cycle(cycle, {0.0, 0.0, 0.0}, 1, 5.0, 1, moves) == Vector3(0.0, 0.0, 0.0));
  REQUIRE(moves.size() == 3);
  CHECK(moves[1].segment.end_mm == Vector3(0.0, 4.0, 0.0));
}

TEST_CASE("canned cycle: thousands of pecks reach the bottom") {
  CannedCycle cycle = cycle_of(73, 0.001);
  cycle.r_mm = 2.0;
  cycle.bottom_mm = -18.0;
  cycle.initial_mm = 10.0;
  std::vector<OtherMove> moves;
  (void)expand_cycle(cycle, {0.0, 0.0, 10.0}, 2, 5.0, 1, moves);
  CHECK(shapegcode::cuts_per_hole(cycle) == 20000.0);
  REQUIRE(moves.size() > 20000);
  CHECK(moves[moves.size() - 2].segment.end_mm.z() == -18.0);
}
