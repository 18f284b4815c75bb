// Words of LinuxCNC as its documentation has them: https://linuxcnc.org/docs/html/gcode/overview.html, g-code.html and
// o-code.html. The moves are held against its own interpreter in tests/python/test_input_linuxcnc.py.
#include <doctest/doctest.h>

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <random>
#include <string>
#include <string_view>
#include <vector>

#include "program/linuxcnc/plain_lines.hpp"
#include "shapegcode/error.hpp"
#include "shapegcode/linuxcnc_program.hpp"

using shapegcode::Error;
using shapegcode::ErrorKind;
using shapegcode::LinuxcncOptions;
using shapegcode::LinuxcncProgram;
using shapegcode::read_linuxcnc;
using shapegcode::SourceText;

namespace {

constexpr std::string_view head = "G21 G90\nG0 X0 Y0 Z5\nF600\n";

LinuxcncOptions options_of_a_mill() {
  LinuxcncOptions options;
  options.file = "part.ngc";
  for (int system = 1; system <= 9; ++system) options.work_offsets_mm[system] = {0.0, 0.0, 0.0};
  return options;
}

/// What lines behind the head become, up to the end.
std::string expanded(const std::string& body, const LinuxcncOptions& options = options_of_a_mill()) {
  const std::string text = read_linuxcnc(std::string(head) + body + "\nM2\n", options).expanded.text;
  const std::size_t begin = text.find("Z5.\n") + 4;
  std::string found = text.substr(begin, text.rfind("M02\n") - begin);
  // Blank lines keep the numbers of lines.
  found.erase(0, found.find_first_not_of('\n'));
  found.erase(std::ranges::unique(found, [](char a, char b) { return a == '\n' && b == '\n'; }).begin(), found.end());
  return found;
}

Error refused(const std::string& body, const LinuxcncOptions& options = options_of_a_mill()) {
  CAPTURE(body);
  try {
    (void)read_linuxcnc(std::string(head) + body + "\nM2\n", options);
  } catch (const Error& error) {
    CHECK(error.kind() == ErrorKind::program);
    CHECK(error.column() == 1);
    return error;
  }
  FAIL("not refused");
  return {ErrorKind::argument, ""};
}

std::string message(const std::string& body) { return refused(body).what(); }

/// X of a move to the value.
std::string value_of(const std::string& expression) { return expanded("G1 X[" + expression + "]"); }

}  // namespace

TEST_CASE("operators bind as the documentation says, those of one rank from left to right") {
  CHECK(value_of("2 / 3 * 1.5 - 5.5 / 11.0") == "G01X0.5F600.\n");
  CHECK(value_of("2 ** 3 ** 2") == "G01X64.F600.\n");
  CHECK(value_of("1 + 2 * 3 GT 6 AND 1 OR 0") == "G01X1.F600.\n");
  CHECK(value_of("-7 MOD 3") == "G01X2.F600.\n");
  CHECK(value_of("1 EQ 1.00009") == "G01X1.F600.\n");
  CHECK(value_of("- [2] ** 2") == "G01X4.F600.\n");
}

TEST_CASE("functions take degrees and brackets") {
  CHECK(value_of("SIN[30] + COS[60] + TAN[45]") == "G01X2.F600.\n");
  CHECK(value_of("ATAN[1] / [-1]") == "G01X135.F600.\n");
  CHECK(value_of("FIX[-2.8] + FUP[-2.8]") == "G01X-5.F600.\n");
  CHECK(value_of("ROUND[2.5] + SQRT[16] + ABS[-1] + LN[EXP[2]]") == "G01X10.F600.\n");
  CHECK(value_of("ACOS[0.5] + ASIN[0.5]") == "G01X90.F600.\n");
  CHECK(value_of("EXISTS[#<here>]") == "G01X0.F600.\n");
}

TEST_CASE("parameters get their values together, when the line is read") {
  CHECK(expanded("#3 = 15\n#3 = 6 G1 X#3\nX#3") == "G01X15.F600.\nG01X6.F600.\n");
  CHECK(expanded("#1 = 2\n#2 = 7\n#3 = ##1\nG1 X#3 Y[#<_z> + #5220]") == "G01X7.Y6.F600.\n");
  CHECK(expanded("#<Depth of cut> = 4\nG1 Z-#<depthofcut>") == "G01Z-4.F600.\n");
}

TEST_CASE("O words loop, choose and call") {
  CHECK(expanded("#1 = 0\no1 while [#1 LT 2]\nG1 X#1\n#1 = [#1 + 1]\no1 endwhile") == "G01X0.F600.\nG01X1.F600.\n");
  CHECK(expanded("o1 do\n#1 = [#1 + 1]\no2 if [#1 EQ 2]\no1 continue\no2 endif\nG1 X#1\no1 while [#1 LT 3]") ==
        "G01X1.F600.\nG01X3.F600.\n");
  CHECK(expanded("o1 if [0]\nG1 X[1]\no1 elseif [1]\nG1 X[2]\no1 else\nG1 X[3]\no1 endif") == "G01X2.F600.\n");
  CHECK(expanded("o1 repeat [3]\no1 break\no1 endrepeat\no2 repeat [2]\nG91 G1 X[1]\no2 endrepeat") ==
        "G91G01X1.F600.\nG91G01X1.F600.\n");
  CHECK(expanded("o<s> sub\n#<own> = #1\nG1 X#<own>\no<s> endsub [#1 + #2]\no<s> call [4] [5]\nG1 Y#<_value>") ==
        "G01X4.F600.\nG01Y9.F600.\n");
  CHECK(expanded("M98 P100 L2\nM30\nO100\nG1 X[1]\nM99") == "G01X1.F600.\nG01X1.F600.\nM30\n%\n");
}

TEST_CASE("subroutines come from other files, and every line knows its file") {
  LinuxcncOptions options = options_of_a_mill();
  std::vector<std::string> asked;
  options.find_subroutine = [&asked](const std::string& name) -> std::optional<SourceText> {
    asked.push_back(name);
    if (name != "hole") return std::nullopt;
    return SourceText{"lib/hole.ngc", "; a hole\r\no<hole> sub\r\nG1 Z[#1]\r\no<hole> endsub"};
  };
  const LinuxcncProgram program =
      read_linuxcnc(std::string(head) + "o<hole> call [-1]\no<hole> call [-2]\nM2\n", options);
  CHECK(asked == std::vector<std::string>{"hole"});
  CHECK(program.expanded.files == std::vector<std::string>{"lib/hole.ngc"});
  CHECK(program.expanded.text.find("G01Z-1.F600.\nG01Z-2.F600.\nM02\n") != std::string::npos);
  const auto of_file = std::ranges::find(program.expanded.line_files, 1U) - program.expanded.line_files.begin();
  CHECK(program.expanded.lines[static_cast<std::size_t>(of_file)] == 3);
  CHECK(std::string(refused("o<none> call", options).what()).starts_with("subroutine O<none> is neither in the file"));
  options.find_subroutine = [](const std::string&) {
    return std::optional(SourceText{"hole.ngc", "o<hole> sub\nG38.2 Z-1\no<hole> endsub"});
  };
  const Error error = refused("o<hole> call", options);
  CHECK(error.file() == "hole.ngc");
  CHECK(error.line() == 2);
  CHECK(std::string(error.what()) ==
        "G38.2 is a probing move: where it ends, only the machine knows: it is not read; "
        "called from part.ngc line 4");
}

TEST_CASE("words with another meaning than on FANUC") {
  CHECK(expanded("G4 P0.25") == "G04X0.25\n");
  CHECK(expanded("G64 P0.01\nG61\nG61.1") == "G64\nG64\nG61\n");
  CHECK(expanded("G90.1\nG2 X10 I5 J0") == "G02X10.I5.J0.F600.\n");
  CHECK(expanded("G1 X[1] Y[0]\nG90.1 G3 X-1 I0 J0") == "G01X1.Y0.F600.\nG03X-1.I-1.J0.F600.\n");
  CHECK(expanded("G2 X0 I5 P2 Z[3]") == "G02Z4.I5.J0.F600.\nX0.Z3.I5.J0.\n");
  CHECK(expanded("G59.1 G1 X[1]") == "G54.1 P1\nG01X1.F600.\n");
  CHECK(expanded("G1 @10 ^90") == "G01X0.Y10.F600.\n");
  CHECK(expanded("G10 L20 P1 X2\nG92 Y[3]") == "F600.\nG90G10L2P1X-2.\nG92Y3.\n");
  CHECK(expanded("M61 Q5 M62 P1 M3 S[99.5]") == "S100M03\n");
}

TEST_CASE("drilling cycles are FANUC's where they move alike") {
  CHECK(expanded("G81 X1 Z-1 R1\nX2 L2") ==
        "G81G99X1.Y0.Z-1.R1.F600.\nG81G99X2.Y0.Z-1.R1.F600.\n" + std::string("G81G99X2.Y0.Z-1.R1.\n"));
  CHECK(expanded("G98 G82 X1 Z-1 R1 P0.5") == "G98\nG82G98X1.Y0.Z-1.R1.P500F600.\n");
  CHECK(expanded("M4 G84 X1 Z-1 R1 P0.5") ==
        "M04\nG00X1.Y0.F600.\nG00Z1.\nG01Z-1.F600.\nM05\nM03\nG04X0.5\nG01Z1.F600.\nM05\nM04\n");
  CHECK(expanded("G83 X1 Z-1 R1 Q0.2").starts_with("G00X1.Y0.F600.\nG00Z1.\nG01Z0.8F600.\nG00Z1.\nG00Z1.054\n"));
}

TEST_CASE("lines in which nothing differs stay as they are") {
  CHECK(expanded("N10 g1 x1.5Y-2 F100\n Z.5\nG02 X3 Y0 I.5") == "F600.\nN10 g1 x1.5Y-2 F100\n Z.5\nG02 X3 Y0 I.5\n");
  CHECK(expanded("G1 X1\nY#5420\nZ[2]") == "F600.\nG1 X1\nG01Y1.F600.\nG01Z2.F600.\n");
  LinuxcncOptions options = options_of_a_mill();
  options.adds_points = true;
  CHECK(expanded("N5 G1 X1 Y2. F30\nX-3Y.5", options) == "F600.\nN5 G1 X1. Y2. F30.\nX-3.Y.5\n");
}

TEST_CASE("what plain lines are") {
  const std::vector<std::uint8_t> once(100, 1);
  const auto scan = [&](std::string_view text) { return shapegcode::linuxcnc::scan_plain_lines(text, 0, true, once); };
  const auto count = [&](std::string_view text) { return scan(text).count; };
  CHECK(count("X1\nY2\n\nZ3\n") == 2);
  CHECK(count("n1G03X1I2K3F4\n") == 1);
  CHECK(count("X12345678.\n") == 1);
  for (const std::string_view other :
       {"X123456789.\n", "X.\n",      "X1.2.3\n", "X\n",    "N G1 X1\n",  "N0 X1\n", "N100 X1\n",
        "G10 X1\n",      "G1.1 X1\n", "G4 X1\n",  "G1\n",   "G1 X1 I2\n", "G2 X1\n", "X1 A2\n",
        "X1 F1 F2\n",    "X#1\n",     "X1 (a)\n", "X- 1\n", "F1 X1\n",    "X1",      "X1\r\n"}) {
    CAPTURE(std::string(other));
    CHECK(count(other) == 0);
  }
  const auto lines = scan("N99 G1 X1 X2\nG3 Y-.5 J7 F9\nN100 X4\n");
  CHECK(lines.n_words == std::vector<std::uint32_t>{99});
  CHECK(lines.last_motion == 3);
  CHECK(lines.last[0] == 2.0);
  CHECK(lines.sum[0] == 3.0);
  CHECK(lines.last[1] == -0.5);
  CHECK(lines.last_feed == 9.0);
  CHECK(lines.last_centre == std::array<std::size_t, 3>{0, 2, 0});
}

TEST_CASE("what is refused is named with its line") {
  CHECK(refused("G1 X[1]\nG41 D1").line() == 5);
  CHECK(message("G1 X1e3") == "E3 and no word in the block that uses it: LinuxCNC refuses it");
  CHECK(message("G1 X[1/0]") == "division by zero");
  CHECK(message("G1 X[SQRT[-1]]") == "SQRT of -1: it must not be negative");
  CHECK(message("G1 X#<none>") == "parameter #<none> has no value here");
  CHECK(message("G1 X#5061").starts_with("parameter #5061 is known to the machine only"));
  CHECK(message("G1 &5") == "'&5' is not a word");
  CHECK(message("G1 X(a)2") == "a comment is inside a word: `X1(a)2` is not X12");
  CHECK(message("O1 while [0]\nG1") == "O1 WHILE: no ENDWHILE after it");
  CHECK(message("o1 sub\no1 call\no1 endsub\no1 call").starts_with("subroutines are nested more than 10 deep"));
  CHECK(message("M3 M5") == "M3 and M5 in one block");
  CHECK(message("G1 X\xc4") == "a value is expected at '\xc3\xa4'");  // Latin-1 in, UTF-8 out
  LinuxcncOptions options = options_of_a_mill();
  options.max_steps = 1000;
  CHECK(std::string(refused("o1 while [1]\no1 endwhile", options).what()).ends_with("does not seem to end"));
  options.max_expansion_bytes = 1000;
  CHECK(std::string(refused("G2 X0 I1 P1000000000", options).what()).ends_with("(controller.max_expansion_bytes)"));
}

TEST_CASE("depth has a limit") {
  const std::string nested = std::string(300, '[') + "1" + std::string(300, ']');
  CHECK(expanded("G1 X" + nested) == "G01X1.F600.\n");
  for (const char sign : {'[', '-', '+', '#'}) {
    CHECK(message("G1 X" + std::string(100'000, sign)).starts_with("the values of this line are nested too deep"));
  }
  std::string sum = "1";
  for (int k = 0; k < 20'000; ++k) sum += "+0";
  CHECK(value_of(sum) == "G01X1.F600.\n");
}

TEST_CASE("no text does harm") {
  constexpr std::array<std::string_view, 48> pieces = {
      "G1", "G2",  "G3",  "G81",  "G83", "G92",      "G92.3",    "G10",     "L2",       "L20",    "P1",     "Q.1",
      "R1", "X1",  "Y-1", "Z.5",  "I1",  "J",        "K",        "F100",    "\n",       "\n",     "\r\n",   "[",
      "]",  "#1",  "=",   "#<a>", "o1 ", "while",    "endwhile", "repeat ", "[3]",      "sub",    "endsub", "call",
      "if", "M98", "M99", "M70",  "M73", "(comment", ")",        ";",       "99999999", "\xff\0", "^",      "@"};
  std::mt19937 random(79602505);
  LinuxcncOptions options = options_of_a_mill();
  options.max_steps = 200;
  options.max_expansion_bytes = 20'000;
  std::size_t read = 0;
  for (int trial = 0; trial < 20'000; ++trial) {
    std::string text = random() % 2 == 0 ? std::string(head) : std::string();
    const std::size_t length = random() % 40;
    for (std::size_t k = 0; k < length; ++k) {
      text += random() % 12 == 0 ? std::string(1, static_cast<char>(random()))
                                 : std::string(pieces[random() % pieces.size()]);
      if (random() % 4 == 0) text += ' ';
    }
    try {
      const auto program = read_linuxcnc(text + "\nM2\n", options).expanded;
      REQUIRE(static_cast<std::size_t>(std::ranges::count(program.text, '\n')) == program.lines.size());
      REQUIRE(std::ranges::is_sorted(program.notes, {}, &shapegcode::SourceNote::line));
      ++read;
    } catch (const Error& error) {
      REQUIRE(error.kind() == ErrorKind::program);
      REQUIRE(error.line() > 0);
    }
  }
  CHECK(read > 100);
}
