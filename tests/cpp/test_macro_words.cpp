#include <doctest/doctest.h>

#include <array>
#include <cmath>
#include <cstddef>
#include <map>
#include <string>
#include <string_view>

#include "program/macro/macro_statement.hpp"
#include "program/macro/macro_variables.hpp"
#include "program/text/lexer.hpp"
#include "shapegcode/error.hpp"

using shapegcode::Error;
using shapegcode::ErrorKind;
using shapegcode::MacroArguments;
using shapegcode::MacroValue;
using shapegcode::MacroVariables;
using shapegcode::parse_arguments;
using shapegcode::substitute;
using shapegcode::WordFormat;

namespace {

MacroVariables sample() {
  MacroVariables variables;
  for (const auto& [number, value] : std::map<int, double>{
           {1, 12.5}, {2, -3.0}, {3, 0.0}, {4, 1.23456}, {5, 2.5}, {6, 54.1}, {7, 123456.789}, {8, 1e9}, {10, 4.0}}) {
    variables.write(number, value, 1, 1);
  }
  return variables;  // #20 and up: vacant
}

std::string words(std::string_view line, const WordFormat& format = {}) {
  MacroVariables variables = sample();
  return substitute(line, 8, variables, format);
}

template <class F>
int alarm_of(F&& action) {
  try {
    action();
  } catch (const Error& error) {
    CAPTURE(error.what());
    CHECK(error.kind() == ErrorKind::program);
    CHECK(error.line() == 8);
    CHECK(error.column() > 0);
    return error.alarm();
  }
  return -1;
}

const std::array<double, 26> unit_scale = [] {
  std::array<double, 26> scale{};
  scale.fill(1.0);
  return scale;
}();

MacroArguments arguments(std::string_view line, const std::array<double, 26>& scale = unit_scale) {
  MacroVariables variables = sample();
  return parse_arguments(line, 8, variables, scale);
}

int argument_alarm(std::string_view line) {
  CAPTURE(std::string(line));
  return alarm_of([&] { (void)arguments(line); });
}

void check_locals(std::string_view line, const std::map<int, double>& expected,
                  const std::array<double, 26>& scale = unit_scale) {
  CAPTURE(std::string(line));
  const MacroArguments found = arguments(line, scale);
  for (int k = 0; k < 34; ++k) {
    CAPTURE(k);
    const auto wanted = expected.find(k);
    CHECK(found.locals[static_cast<std::size_t>(k)] ==
          (wanted == expected.end() ? MacroValue{} : MacroValue{wanted->second}));
  }
}

}  // namespace

TEST_CASE("lengths carry a decimal point and the least increment") {
  CHECK(words("G1 X#1 Y#2 Z#3") == "G1 X12.5 Y-3. Z0.");
  CHECK(words("X-#1Y-#2Z+#1") == "X-12.5Y3.Z12.5");
  CHECK(words("X[#1+#2]F[#5*100]") == "X9.5F250.");
  CHECK(words("I#4J[-#4]K[#4/10]") == "I1.235J-1.235K.123");
  CHECK(words("X[0.0005]Y[-0.0005]Z[0.0004]") == "X.001Y-.001Z0.");  // halves away from zero
  CHECK(words("U#1V#1W#1R#1Q#1") == "U12.5V12.5W12.5R12.5Q12.5");
  CHECK(words("X#4Y#4A#4", {.length_decimals = 4}) == "X1.2346Y1.2346A1.235");
  CHECK(words("A#4B#4C#4,R#4 ,C#4", {.length_decimals = 4}) == "A1.235B1.235C1.235,R1.2346 ,C1.2346");
  CHECK(words("x#1y#2") == "x12.5y-3.");
}

TEST_CASE("whole numbers, G, F and dwell") {
  CHECK(words("M[3.4999999]S[1000.5]T#5D#5H#2L#3P[9.6]") == "M3S1001T3D3H-3L0P10");
  CHECK(words("G#6 G[1] G#10") == "G54.1 G1 G4");
  CHECK(words("F[5]") == "F5.0");  // never a one-digit feed code
  CHECK(words("F[244.31239]") == "F244.3124");
  CHECK(words("F[12345.678912]") == "F12345.679");
  CHECK(words("G04 X[1.23456]", {.length_decimals = 4}) == "G04 X1.235");
  CHECK(words("G4 U[1.23456]", {.length_decimals = 4}) == "G4 U1.235");
  CHECK(words("G#10 X[1.23456]", {.length_decimals = 4}) == "G4 X1.235");
  CHECK(words("G04.1 X[1.23456]", {.length_decimals = 4}) == "G04.1 X1.2346");
  CHECK(words("G41 X[1.23456] (G04)", {.length_decimals = 4}) == "G41 X1.2346 (G04)");
  CHECK(words("G04 P[1.5*1000]") == "G04 P1500");
}

TEST_CASE("words with a vacant operand go, everything else stays to the letter") {
  CHECK(words("G1 X#20 Y#1") == "G1  Y12.5");
  CHECK(words("G1X#20Y-#21Z[#22]F#1") == "G1F12.5");
  CHECK(words("G1 X1. ,R#20") == "G1 X1. ");
  CHECK(words("G1 X[#20+0]") == "G1 X0.");
  CHECK(words("/2 N10  G01 X1.50 Y 2 (X#1) F#1 ; ") == "/2 N10  G01 X1.50 Y 2 (X#1) F12.5 ; ");
  CHECK(words("G1 X - #1 (A) Y # 2") == "G1 X-12.5 (A) Y-3.");
  CHECK(words("N10 X1. Y-.5") == "N10 X1. Y-.5");
  CHECK(words("") == "");
}

TEST_CASE("ROUND behind an address rounds to its least increment") {
  // B-64304EN: #1=1.2345, #2=2.3456 at 0.001: "X-#1", "X-#2", "X[#1+#2]" fall short by 0.001, ROUND[#1]+ROUND[#2] does
  // not.
  MacroVariables variables;
  variables.write(1, 1.2345, 1, 1);
  variables.write(2, 2.3456, 1, 1);
  CHECK(substitute("X-#1", 8, variables, {}) == "X-1.235");
  CHECK(substitute("X-#2", 8, variables, {}) == "X-2.346");
  CHECK(substitute("X[#1+#2]", 8, variables, {}) == "X3.58");
  CHECK(substitute("X[ROUND[#1]+ROUND[#2]]", 8, variables, {}) == "X3.581");
  CHECK(substitute("M[ROUND[#1]+ROUND[#2]]", 8, variables, {}) == "M3");
}

TEST_CASE("what substitute writes reads back as the value") {
  MacroVariables variables;
  for (int k = -2000000; k <= 2000000; k += 12347) {
    const double value = k * 0.00137;
    variables.write(1, value, 1, 1);
    for (const char* text : {"X#1", "F#1", "S#1"}) {
      const std::string line = substitute(text, 8, variables, {});
      CAPTURE(line);
      shapegcode::Block block;
      shapegcode::scan_block(line, 1, 250, block);
      REQUIRE(block.word_count == 1);
      const double half = text[0] == 'X' ? 0.0005 : text[0] == 'F' ? 0.00005 : 0.5;
      CHECK(std::abs(block.words[0].value - value) <= half + 1e-9);
      CHECK(block.words[0].has_point == (text[0] != 'S'));
    }
  }
}

TEST_CASE("alarms of NC blocks") {
  const auto alarm = [](std::string_view line) {
    CAPTURE(std::string(line));
    return alarm_of([&] { (void)words(line); });
  };
  for (const char* line : {"X#1+10", "X[1", "X1#2", "X1[2]", "N#1", "O#1 X1", "/#1 X1", "XSIN[30]", "X##1", "X#", "[1]",
                           "X[1]]", "X#1 5", "X#1.5"}) {
    CHECK(alarm(line) == 114);
  }
  CHECK(alarm("X#1=5") == 127);
  CHECK(alarm("G1 =5") == 127);
  CHECK(alarm("G1 X,R#20Y1") == 5);
  CHECK(alarm("X#7") == 3);  // 123456.789
  CHECK(alarm("X#8") == 3);
  CHECK(alarm("S#8") == 3);
  CHECK(alarm("F#8") == 3);
  CHECK(alarm("X#99") == 115);
  CHECK(alarm("X[1/0]") == 112);
  CHECK(alarm("X#1 (OPEN") == 0);
}

TEST_CASE("argument specification I") {
  // The table of the manuals, all at once.
  check_locals(
      "G65 P9010 A1.B2.C3.D7.E8.F9.H11.I4.J5.K6.M13.Q17.R18.S19.T20.U21.V22.W23.X24.Y25.Z26.",
      {{1, 1},   {2, 2},   {3, 3},   {4, 4},   {5, 5},   {6, 6},   {7, 7},   {8, 8},   {9, 9},   {11, 11}, {13, 13},
       {17, 17}, {18, 18}, {19, 19}, {20, 20}, {21, 21}, {22, 22}, {23, 23}, {24, 24}, {25, 25}, {26, 26}});
  check_locals("G65 P1 Z1. A-2. X+3.", {{26, 1}, {1, -2}, {24, 3}});
  check_locals("G65 P1 A1. A2.", {{1, 2}});
  check_locals("G65 P1 A#1 B-#2 C[#1*2] D#20", {{1, 12.5}, {2, 3}, {3, 25}});
  check_locals("g65 p1 a1.5", {{1, 1.5}});
}

TEST_CASE("argument specification II and mixtures") {
  std::string line = "G65 P1 A1. B2. C3.";
  std::map<int, double> expected = {{1, 1}, {2, 2}, {3, 3}};
  for (int k = 4; k <= 33; ++k) {
    line += " ";
    line += static_cast<char>('I' + (k - 4) % 3);
    line += std::to_string(k) + ".";
    expected[k] = k;
  }
  check_locals(line, expected);
  // B-63684EN, "Mixture of argument specifications I and II": D5.0 comes later than the second I.
  check_locals("G65 A1.0 B2.0 I-3.0 I4.0 D5.0 P1000", {{1, 1}, {2, 2}, {4, -3}, {7, 5}});
  check_locals("G65 P1 D5. I1. I4.", {{4, 1}, {7, 4}});
  check_locals("G65 P1 K1. I2. K3. J4.", {{6, 1}, {7, 2}, {9, 3}, {11, 4}});
  check_locals("G65 P1 J5. I4.", {{5, 5}, {7, 4}});  // not in alphabetical order: a second set
  CHECK(argument_alarm("G65 P1 I1.I1.I1.I1.I1.I1.I1.I1.I1.I1.I1.") == 129);
}

TEST_CASE("numbers without decimal point are scaled by letter, computed ones are not") {
  std::array<double, 26> scale = unit_scale;
  scale[0] = 0.001;
  scale['X' - 'A'] = 0.0001;
  scale['I' - 'A'] = 0.01;
  check_locals("G65 P1 A1000 X-10 I5 I5 B3", {{1, 1000 * 0.001}, {24, -10 * 0.0001}, {4, 0.05}, {7, 0.05}, {2, 3}},
               scale);
  check_locals("G65 P1 A1000. X#1 I[5]", {{1, 1000}, {24, 12.5}, {4, 5}}, scale);
}

TEST_CASE("P, L, what stands in front, and calls by other codes") {
  const MacroArguments call = arguments("/2 N10 (CALL) G65 P9010 L3 A1. (END)");
  CHECK(call.program == 9010);
  CHECK(call.repeats == 3);
  CHECK(call.locals[1] == MacroValue{1.0});
  CHECK(arguments("G65 P#10").program == 4);
  CHECK(arguments("G65 P[9000+10] L#5").repeats == 3);
  CHECK(arguments("G66.1 A1.").program == -1);
  CHECK(arguments("G65").repeats == 1);
  check_locals("N5 G100 X1. Y2.", {{24, 1}, {25, 2}});
  check_locals("M06 T5.", {{20, 5}});
  check_locals("G13 M6. X1.", {{13, 6}, {24, 1}});
}

TEST_CASE("alarms of macro calls") {
  for (const char* line : {"G65 P1 G1 A1.", "G65 P1 N5", "G65 P1 O5", "A1. G65 P1", "X1. G66 P1", "G90 G65 P1"}) {
    CHECK(argument_alarm(line) == 129);
  }
  for (const char* line : {"G65 P0", "G65 P-1", "G65 P#20", "G65 P[100000000]"}) {
    CHECK(argument_alarm(line) == 76);
  }
  for (const char* line : {"G65 P1 A", "G65 P1 A-", "G65 P1 AB1", "G65 P1 A1+2", "G65 P1 A#1+2", "G65 P1 ,R5.",
                           "G65 P1 #1", "G65 P1 [1]", "G65 P1 A1 /2", "G65 P1 %"}) {
    CHECK(argument_alarm(line) == 114);
  }
  CHECK(argument_alarm("G65 P1 #1=5") == 114);
  CHECK(argument_alarm("G65 P1 A=5") == 114);
  CHECK(argument_alarm("G65 P1 A#1=5") == 127);
  CHECK(argument_alarm("G65 P1 A123456789") == 3);
  CHECK(argument_alarm("G65 P1 L0") == 0);
  CHECK(argument_alarm("G65 P1 (OPEN") == 0);
}
