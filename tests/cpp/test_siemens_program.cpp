#include "shapegcode/siemens_program.hpp"

#include <doctest/doctest.h>
#include <fmt/format.h>

#include <algorithm>
#include <random>
#include <string>
#include <string_view>
#include <vector>

#include "shapegcode/error.hpp"

using shapegcode::Error;
using shapegcode::read_siemens;
using shapegcode::SiemensOptions;
using shapegcode::SiemensProgram;
using shapegcode::SourceText;

namespace {

const std::string start = "G17 G90 G94 G71\nG0 X0 Y0 Z0\nG1 F1000\n";

SiemensOptions options() {
  SiemensOptions made;
  made.file = "part.mpf";
  made.name = "PART";
  made.max_program_steps = 2000;
  made.left_out = {{"SOFT", "SOFT is left out"}};
  made.refused = [](const std::string& word) { return word == "H" ? "H functions go to the PLC" : ""; };
  made.called = [](const std::string& name) -> std::optional<SourceText> {
    if (name == "RECT") {
      return SourceText{"RECT.SPF",
                        "PROC RECT(REAL W, REAL H, VAR REAL AREA) SAVE DISPLOF\nG91\nX=W\nY=H\nAREA=W*H\nRET\n"};
    }
    if (name == "WRONG") return SourceText{"WRONG.SPF", "X1\nX=1/0\nM17\n"};
    return std::nullopt;
  };
  return made;
}

/// Lines behind the opening of the expanded program and the first move, joined by `/`.
std::string lines_of(const std::string& body) {
  const std::string text = read_siemens(start + body + "\nM30\n", options()).expanded.text;
  constexpr std::string_view first = "G00X0.Y0.Z0.\n";
  constexpr std::string_view last = "M30\n%\n";
  const std::size_t begin = text.find(first) + first.size();
  REQUIRE(text.ends_with(last));
  std::string found = text.substr(begin, text.size() - last.size() - begin);
  std::erase(found, '\r');
  std::ranges::replace(found, '\n', '/');
  const auto is_gap = [](char a, char b) { return a == '/' && b == '/'; };
  found.erase(std::unique(found.begin(), found.end(), is_gap), found.end());
  const std::size_t begins = found.find_first_not_of('/');
  return begins == std::string::npos ? "" : found.substr(begins, found.find_last_not_of('/') + 1 - begins);
}

std::string error_of(const std::string& body) {
  try {
    static_cast<void>(read_siemens(start + body + "\nM30\n", options()));
  } catch (const Error& error) {
    return fmt::format("{}:{}:{}: {}", error.file(), error.line(), error.column(), error.what());
  }
  return {};
}

}  // namespace

// Expected words are worked out by hand from the pages named (easymanua.ls, manual and page).
TEST_CASE("moves, arcs and frames become FANUC's words") {
  CHECK(lines_of("X=AC(10) Y=IC(2)") == "G01X10.Y2.F1000.");                                           // 662598 p. 53
  CHECK(lines_of("G0 X30 Y40\nG2 X50 Y40 I10 J-7") == "G00X30.Y40./G02X50.Y40.I10.J-7.F1000.");        // 592300 p. 154
  CHECK(lines_of("G0 X30 Y40\nCIP X50 Y40 I1=40 J1=45") == "G00X30.Y40./G02X50.Y40.I10.J-7.5F1000.");  // p. 157
  CHECK(lines_of("G1 X20\nCT X30 Y10") == "G01X20.F1000./G03X30.Y10.I0.J10.");                         // p. 157
  CHECK(lines_of("G3 I0 J10 AR=90") == "G03X10.Y10.I0.J10.F1000.");                                    // 662598 p. 78
  CHECK(lines_of("G700 X1 F10") == "G01X25.4F254.");                                                   // 592300 p. 139
  CHECK(lines_of("TRANS X10 Y5\nX1 Y1\nATRANS X1\nX1") == "G01X11.Y6.F1000./G01X12.");                 // 662598 p. 56
  CHECK(lines_of("MIRROR X0\nX-10\nG2 X-20 Y10 I0 J10") == "G01X10.F1000./G03X20.Y10.I0.J10.");        // 1265481 p. 309
  CHECK(lines_of("G111 X20 Y10\nRP=50 AP=0") == "G01X70.Y10.F1000.");                                  // 1265481 p. 174
  CHECK(lines_of("X10 RND=2\nY10") == "G01X10.F1000.,R2./G01Y10.");                                    // 679150 p. 193
  CHECK(lines_of("S600 M3\nG4 S5") == "S600/M03/G04X0.5");
}

TEST_CASE("tools, edges and settable frames keep their names") {
  const SiemensProgram program = read_siemens(start + "T=\"MILL\" D2\nM6\nG505\nSOFT\nM30\n", options());
  REQUIRE(program.names.size() == 3);
  CHECK(program.names[0] == std::pair<std::string, std::string>("T901", "T=\"MILL\""));
  CHECK(program.names[1] == std::pair<std::string, std::string>("H801", "D2"));
  CHECK(program.names[2] == std::pair<std::string, std::string>("G54.1P5", "G505"));
  CHECK(program.expanded.notes.back().text == "SOFT is left out");
  CHECK(program.expanded.notes.back().line == 7);
}

TEST_CASE("expressions, loops and jumps are executed") {
  // Priorities: 1265481 p. 444; conversions: 662833 p. 54.
  CHECK(lines_of("X=2+3*4-7 DIV 2 Y=1 B_OR 6 B_AND 4") == "G01X11.Y5.F1000.");
  CHECK(lines_of("DEF INT N=2.5\nX=N Y=N/2 Z=NOT 0") == "G01X3.Y1.5Z1.F1000.");
  CHECK(lines_of("DEF INT N\nFOR N=1 TO 3\nX=N\nENDFOR") == "G01X1.F1000./G01X2./G01X3.");
  CHECK(lines_of("R1=0\nBACK: R1=R1+1\nIF R1<3 GOTOB BACK\nX=R1") == "G01X3.F1000.");
  CHECK(lines_of("AGAIN: G91 X1\nG90\nREPEAT AGAIN P=2") == "G01X1.F1000./G01X2./G01X3.");
  CHECK(lines_of("DEF REAL A\nRECT(4,,A)\nRECT(2,3,A)\nX=A") == "G01X4.F1000./G01Y0./G01X6./G01Y3./G01X6.");
}

TEST_CASE("a jump leaves structures, and enters none") {
  CHECK(lines_of("R1=0\nWHILE R1<2\nR1=R1+1\nLOOP\nGOTOF NEXT\nENDLOOP\nNEXT: X=R1\nENDWHILE") ==
        "G01X1.F1000./G01X2.");
  CHECK(error_of("GOTOF INSIDE\nLOOP\nINSIDE: X1\nENDLOOP").find("no such label") != std::string::npos);
}

TEST_CASE("what is refused is named with file, line and column") {
  CHECK(error_of("X=1/0").starts_with("part.mpf:4:4: division by 0"));
  CHECK(error_of("X1 X2").starts_with("part.mpf:4:4: X twice in one block"));
  CHECK(error_of("X5 ; \xC3\x85\n\"\xC3\x85\" X=R7").starts_with("part.mpf:5:1: "));
  CHECK(error_of("G4 ; \xC3\x85").starts_with("part.mpf:4:1: G4 without F or S"));
  CHECK(error_of("T=\"\xC3\x85\" X=R7").starts_with("part.mpf:4:9: R7 is read before"));
  CHECK(error_of("H5") == "part.mpf:4:1: H: H functions go to the PLC");
  CHECK(error_of("AGAIN: X1\nGOTOB AGAIN").find("max_program_steps = 2000") != std::string::npos);
  CHECK(error_of("WRONG") == "WRONG.SPF:2:4: division by 0: the divisor must be another number; called from line 4");
  CHECK(error_of("R1=" + std::string(3000, '(') + "1" + std::string(3000, ')')).find("nested too deep") !=
        std::string::npos);
  CHECK(error_of("R1=1" + std::string(20000, '-') + "1").find("nested too deep") != std::string::npos);
  CHECK(error_of("X" + std::string(5000, '9')).find("too large") != std::string::npos);
}

TEST_CASE("no text makes the reader fail otherwise than by an Error") {
  const std::vector<std::string> parts = {"G0 ",      "G1 ",         "G2 ",
                                          "G3 ",      "CIP ",        "CT ",
                                          "X",        "Y=",          "Z=IC(",
                                          "I1=",      "CR=",         "AR=",
                                          "TURN=",    "AP=",         "RP=",
                                          "F",        "RND=",        "CHF=",
                                          "\n",       "\n",          "\n",
                                          "5 ",       "-3.5 ",       "1EX300 ",
                                          "R1",       "=",           "+",
                                          "*",        "/",           "(",
                                          ")",        "[",           "]",
                                          ",",        "\"",          ";",
                                          "IF ",      "ELSE",        "ENDIF",
                                          "FOR ",     " TO ",        "ENDFOR",
                                          "WHILE ",   "ENDWHILE",    "LOOP",
                                          "ENDLOOP",  "REPEAT ",     "UNTIL ",
                                          "GOTOF ",   "GOTOB ",      "L1: ",
                                          "L1 ",      "DEF REAL A",  "DEF INT B",
                                          "RECT(",    "WRONG ",      "CALL(",
                                          "TRANS ",   "AROT ",       "SCALE ",
                                          "MIRROR ",  "RPL=",        "T=",
                                          "D",        "M6 ",         "M",
                                          "S",        "G54 ",        "G505 ",
                                          "G93 ",     "G95 ",        "FLIN ",
                                          "SUPA ",    "G110 ",       "G4 ",
                                          "G74 ",     "G18 ",        "G91 ",
                                          "G70 ",     "SQRT(",       "ATAN2(",
                                          " MOD ",    " B_AND ",     "NOT ",
                                          "'HFF'",    "%_N_A_SPF\n", "PROC A(REAL B)",
                                          "\xC3\xA9", "\xFF",        "\xC3"};
  std::mt19937_64 random(7);  // NOLINT(bugprone-random-generator-seed): the same programs at each run
  std::size_t refused = 0;
  for (int trial = 0; trial < 4000; ++trial) {
    std::string text = trial % 2 == 0 ? start : "";
    for (std::size_t count = random() % 60; count > 0; --count) {
      text += parts[random() % parts.size()];
      if (random() % 50 == 0) text += static_cast<char>(random() % 256);
    }
    try {
      const SiemensProgram program = read_siemens(text, options());
      CHECK(std::ranges::count(program.expanded.text, '\n') ==
            static_cast<std::ptrdiff_t>(program.expanded.lines.size()));
    } catch (const Error& error) {
      CHECK(error.line() > 0);
      CHECK(error.column() > 0);
      ++refused;
    }
  }
  CHECK(refused > 1000);
}
