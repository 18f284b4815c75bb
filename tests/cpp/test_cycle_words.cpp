// Words that a drilling cycle remembers or defaults: one case per word.
#include <doctest/doctest.h>

#include <string>

#include "interpreter_program.hpp"

using namespace shapegcode;
using namespace shapegcode::tests;

namespace {

/// The state behind the body, which begins at X0 Y0 Z14.
ModalState behind(const std::string& body, const ReaderOptions& options = {}) {
  return read("G00 Z14.\n" + body, options).final_state;
}

/// Levels of the feed moves down, in their order.
std::vector<double> drilled(const std::string& body) {
  std::vector<double> levels;
  for (const OtherMove& move : read("G00 Z14.\n" + body).other_moves) {
    if (move.segment.kind != SegmentKind::rapid && move.segment.end_mm.z() < move.segment.start_mm.z()) {
      levels.push_back(move.segment.end_mm.z());
    }
  }
  return levels;
}

}  // namespace

TEST_CASE("cycle words: R left out is the level at which the cycle began") {
  for (const std::string back : {"G98", "G99"}) {
    CAPTURE(back);
    const ModalState state = behind(back + "\nG84 Z3.8 F800.\nG80\n");
    CHECK(state.position_mm == Vector3(0, 0, 14));
    CHECK(state.known[2]);
  }
  CHECK(warns(read("G00 Z14.\nG99 G84 Z3.8 F800.\nG80\n"), "without R", 5));
  // In G91 Z counts from there.
  CHECK(drilled("G91 G98 G81 Z-4. F100.\nG80\n") == std::vector<double>{10.0});
}

TEST_CASE("cycle words: R of the hole before holds until G80 or a code of group 01") {
  CHECK(behind("G99 G81 Z1. R5. F100.\nX10.\nG80\n").position_mm == Vector3(10, 0, 5));
  CHECK(behind("G99 G81 Z1. R5. F100.\nG80\nG00 Z14.\nG81 X20. Z1.\nG80\n").position_mm == Vector3(20, 0, 14));
  CHECK(behind("G99 G81 Z1. R5. F100.\nG00 Z14.\nG81 X20. Z1.\nG80\n").position_mm == Vector3(20, 0, 14));
  // From one cycle to the next the data stay.
  CHECK(behind("G99 G81 Z1. R5. F100.\nG82 X20. P100\nG80\n").position_mm == Vector3(20, 0, 5));
}

TEST_CASE("cycle words: without Z nothing is drilled") {
  CHECK(drilled("G99 G81 R5. F100.\nX10.\nG80\n").empty());
  CHECK(behind("G99 G81 R5. F100.\nX10.\nG80\n").position_mm == Vector3(10, 0, 5));
  CHECK(warns(read("G00 Z14.\nG99 G81 R5. F100.\nG80\n"), "without Z: nothing is drilled", 5));
}

TEST_CASE("cycle words: Q and P are stored in a block that drills, and in no other") {
  CHECK(drilled("G99 G83 Z1. R5. Q2. F100.\nX10.\nG80\n") == std::vector<double>{3, 1, 3, 1});
  CHECK(drilled("G99 G83 Z1. R5. Q2. F100.\nQ4.\nX10.\nG80\n") == std::vector<double>{3, 1, 3, 1});
  CHECK(drilled("G99 G83 Z1. R5. Q2. F100.\nX10. Q4.\nG80\n") == std::vector<double>{3, 1, 1});
}

TEST_CASE("cycle words: K and L hold in their block alone; K0 stores; K without a place drills nothing") {
  CHECK(drilled("G91 G99 G81 X5. Z-4. R-9. K3 F100.\nX1.\nG80\n").size() == 4);
  CHECK(behind("G91 G99 G81 X5. Z-4. R-9. L3 F100.\nG80\n").position_mm == Vector3(15, 0, 5));
  CHECK(drilled("G99 G81 X5. Z1. R5. K0 F100.\nX10.\nG80\n").size() == 1);
  CHECK(drilled("G99 G81 X5. Z1. R5. F100.\nK3\nG80\n").size() == 1);
  CHECK(drilled("G99 G81 X5. Z1. R5. F100.\nR6.\nG80\n").size() == 2);  // R alone drills where the tool stands
}

TEST_CASE("cycle words: G98 goes back to the level before the first cycle, also in G91") {
  CHECK(behind("G91 G98 G81 X5. Z-4. R-9. K2 F100.\nG80\n").position_mm == Vector3(10, 0, 14));
  CHECK(behind("G99 G81 X5. Z1. R5. F100.\nG98 X10.\nG80\n").position_mm == Vector3(10, 0, 14));
}
