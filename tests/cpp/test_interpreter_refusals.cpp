#include <doctest/doctest.h>

#include <algorithm>
#include <cstdint>
#include <string>

#include "interpreter_program.hpp"
#include "shapegcode/program.hpp"

using shapegcode::read_program;
using shapegcode::ReaderOptions;
using shapegcode::tests::check_refused;
using shapegcode::tests::framed;
using shapegcode::tests::read;
using shapegcode::tests::refusal;
using shapegcode::tests::Refusal;
using shapegcode::tests::warns;

// --- Refusals --------------------------------------------------------------------------------------------------------

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
  check_refused("G90\nG00 X1.\n", 2, 1, {"neither '%' lines nor an end M30"});
  CHECK(warns(read_program("G90\nG00 X1.\nM30\n"), "no '%' lines"));
  CHECK(warns(read_program("%\nG90\nG00 X1.\n%\n"), "does not end with M30, M02 or M99"));
  CHECK(read_program("LEADER TEXT @@\n%\nG21 G90 G00 X0.\nM30\n%\n").warnings.empty());
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

TEST_CASE("interpreter: a program of more drilling moves than memory holds is refused before it is expanded") {
  // Ten cuts a hole, three moves each.
  ReaderOptions options;
  options.limits.moves = 64;
  const std::string cycle = "G83 Z-10. R0. Q1. F100. ";
  CHECK(read(cycle + "\nX5.\nG80\n", options).alarms.empty());
  CHECK(read(cycle + "K2\nG80\n", options).alarms.empty());
  const Refusal repeated = refusal(framed(cycle + "K3\nG80\n"), options);
  CHECK(repeated.message ==
        "drilling cycle G83 feeds down 10 times in 3 hole(s), 10.000 mm deep: with its 90 moves the program "
        "comes to 90, more than 64 moves (controller.max_program_moves)");
  CHECK(repeated.line == 4);
  CHECK(repeated.column == 15);
  // What cycles came to before counts.
  const Refusal third = refusal(framed(cycle + "\nX5.\nX10.\nG80\n"), options);
  CHECK(third.thrown);
  CHECK(third.line == 6);
  // Without pecks there is one cut a hole.
  CHECK(read("G81 Z-10. R0. F100. K10\nG80\n", options).alarms.empty());
  // Also where each repetition becomes a block of its own.
  CHECK(refusal(framed("G51.1 X0.\n" + cycle + "X1. K3\nG80\nG50.1\n"), options).thrown);
  // The one that filled the memory.
  const Refusal real = refusal(framed("G83 X1. Z-50. R2. Q0.001 F100. K9999\nG80\n"));
  CHECK(real.message.find("52000 times in 9999 hole(s)") != std::string::npos);
  CHECK(real.message.find("more than 800000 moves beyond one for each line") != std::string::npos);
  CHECK(real.line == 4);
}
