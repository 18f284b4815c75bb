// Texts as controls and post-processors write them: heads, folders, line ends, tape marks.
#include <doctest/doctest.h>

#include <string>

#include "interpreter_program.hpp"

using namespace shapegcode;
using namespace shapegcode::tests;

namespace {

const std::string body = "G21G90G17G94\nG0X0Y0Z5.\nG1X20.F300.\nN0030Y10.\nG0Z50.\nM30\n";

std::string with_line_ends(const std::string& text, const std::string& end) {
  std::string result;
  for (const char c : text) {
    result += c == '\n' ? end : std::string(1, c);
  }
  return result;
}

}  // namespace

TEST_CASE("tape: every form of a program's head leads to the same motion") {
  for (const std::string head : {"O0001(PART)\n", ":0001(PART)\n", "<PART-A>\n", "O<PART-A>\n", "O0000(PART)\n",
                                 "&F=/USER/LIBRARY/\nO0001\n", ""}) {
    CAPTURE(head);
    const Program program = read_program("%\n" + head + body + "%\n");
    REQUIRE(program.regions.size() == 1);
    CHECK(program.regions[0]->path->size() == 2);
    CHECK(program.final_state.position_mm == Vector3(20, 10, 50));
  }
  CHECK(warns(read_program("%\nO0000\n" + body + "%\n"), "alarm 0074", 2));
  check_refused("%\n<PART\n" + body + "%\n", 2, 1, {"<...>"});
  check_refused("%\nG0X1.<PART>\n" + body + "%\n", 2, 6, {"no program character"});
}

TEST_CASE("tape: the same O number may stand in two folders, and a call finds the one of its own") {
  const auto moves_to = [](const std::string& x) { return "O20\nG1X" + x + "F100.\nM99\n"; };
  const std::string text = "%\n&F=/A/\nO10\nG21G90\nG0X0Y0Z0\nM98P20\nM30\n" + moves_to("1.") +
                           "&F=/B/\nO10\nG21G90\n" + "G0X0Y0Z0\nM98P20\nM30\n" + moves_to("2.") + "%\n";
  CHECK(read_program(text).final_state.position_mm.x() == 1.0);
  check_refused("%\nO1\nM30\nO1\nM30\n%\n", 4, 1, {"stands twice"});
}

TEST_CASE("tape: line ends LF, CR LF and LF CR CR") {
  const Program plain = read_program("%\nO1\n" + body + "%\n");
  for (const std::string end : {"\r\n", "\n\r\r"}) {
    const Program program = read_program(with_line_ends("%\nO1\n" + body + "%\n", end));
    CHECK(program.line_end == end);
    REQUIRE(program.regions.size() == 1);
    const Region& region = *program.regions[0];
    CHECK(region.exit.position_mm == plain.regions[0]->exit.position_mm);
    CHECK(program.text.substr(region.text_begin, 2) == "G1");
    CHECK(program.text.substr(region.text_end, 2) == "G0");
  }
}

TEST_CASE("tape: without the first tape mark there is a warning, without the last one the program is cut off") {
  const Program program = read_program("O0001\n" + body + "%\n");
  CHECK(program.regions.size() == 1);
  CHECK(warns(program, "no line '%' at the start", 1));
  CHECK(refusal("%\nO0001\n" + body).thrown);
}

TEST_CASE("tape: text behind the closing mark is not read, and a warning says so") {
  for (const std::string& text : {"%\nO1\n" + body + "%\nG1X99.\nM30\n", "%\nO1\n" + body + "%\n%\n\n(LEFT)\n%\n"}) {
    const Program program = read_program(text);
    CHECK(program.final_state.position_mm.x() == 20.0);
    CHECK(warns(program, "text behind the '%'", text.find("LEFT") == std::string::npos ? 10 : 12));
  }
  for (const std::string end : {"%\n", "%", "% (END)\n\n", "%\n%\n"}) {
    CHECK_FALSE(warns(read_program("%\nO1\n" + body + end), "text behind"));
  }
}

TEST_CASE("tape: a line that ends with CR alone is refused where it stands") {
  check_refused(with_line_ends("%\nO1\n" + body + "%\n", "\r"), 1, 2, {"CR alone", "LF or CR LF"});
  check_refused("%\nG21G90\nG1X1.\rY2.F100.\nM30\n%\n", 3, 6, {"CR alone"});
  for (const std::string end : {"\r\n", "\n\r\r", "\r\r\n", "\n\r", " \r \n"}) {
    CHECK_FALSE(refusal(with_line_ends("%\nO1\n" + body + "%\n", end)).thrown);
  }
}

TEST_CASE("tape: a byte-order mark is left out with a note") {
  const std::string mark = "\xEF\xBB\xBF";
  for (const std::string& text :
       {"%\nO1\n" + body + "%\n", "O1\n" + body, "\n%\nO1\nM98P2\n" + body + "O2\nM99\n%\n"}) {
    const Program plain = read_program(text);
    const Program marked = read_program(mark + text);
    CHECK(warns(marked, "byte-order mark", 1));
    CHECK(marked.warnings.size() == plain.warnings.size() + 1);
    CHECK(marked.text == plain.text);
    CHECK(marked.program_number == 1);
    const auto entries = list_programs(mark + text);
    REQUIRE(entries.size() == list_programs(text).size());
    CHECK(entries[0].number == 1);
    CHECK(entries.back().text_end == list_programs(text).back().text_end + mark.size());
  }
}

TEST_CASE("tape: N words keep their leading zeros") {
  const Program program = read_program("%\nO1\n" + body + "%\n");
  REQUIRE(program.regions[0]->notes.size() == 1);
  CHECK(program.regions[0]->notes[0].n_number == 30);
  CHECK(program.regions[0]->notes[0].n_digits == 4);
}

TEST_CASE("tape: macro words by their first two letters") {
  const Program program = read("#1=0\nWH[#1LT3]DO1\nG01X[#1*10.]F100.\n#1=#1+1\nEN1\nIF[#1EQ3]GO10\nX99.\nN10Y7.\n");
  CHECK(program.final_state.position_mm == Vector3(20, 7, 0));
}

TEST_CASE("tape: what other controls leave out") {
  CHECK(warns(read("G04\nG01X1.F100.\n"), "a stop, no dwell", 4));
  CHECK(read("G41G01X10.F100.\nX20.\nG40X30.\n").final_state.position_mm == Vector3(30, 0, 0));
  CHECK(warns(read("G41G01X10.F100.\nG40X30.\n"),
              "offset D0 has a radius of 0, as there is no D: G41 shifts the path by nothing", 4));
  ReaderOptions options;
  options.arc_without_centre_is_line = true;
  const Program lines = read("G01X1.F100.\nG02X5.Y5.\n", options);
  CHECK(lines.regions[0]->path->segments()[1].kind == SegmentKind::line);
  check_refused(framed("G01X1.F100.\nG02X5.Y5.\n"), 5, 1, {"arc without R"});
  CHECK(warns(read_program("%\nG90\nG0X0Y0\nM30\n%\n"), "neither G20 nor G21", 3));
  // The example is a word of that line.
  CHECK(warns(read_program("%\nG90\nG0X0Y12.5\nM30\n%\n"),
              "Y12.5 is read as 12.5 mm, and would be 317.5 mm in inch (power_on.units)", 3));
}

TEST_CASE("tape: a macro that asks what only the control knows is a call that nobody looks into") {
  const std::string text =
      "%\nO1\nG21G90\nG00X0Y0Z0\nG65P9810Z-5.\nG00X10.Y0Z0\nG01X20.F100.\nM30\nO9810\nIF[#500GT1]GOTO5\nG01Z#26F50."
      "\nN5M99\n"
      "%\n";
  const Program program = read_program(text);
  CHECK(warns(program, "only the control knows", 5));
  CHECK(program.text.find("G65P9810Z-5.") != std::string::npos);
  CHECK(program.final_state.position_mm == Vector3(20, 0, 0));
  CHECK(program.regions.size() == 1);
}

TEST_CASE("tape: the programs of a memory punch, each with number or name, folder, line and bytes") {
  const std::string text =
      "LEADER\n%\n&F=/A B/\nO0001(X)\nM30\n:0002\nM99\n&F=/B/\r\nO1\nM30\n<PART>\nM30\nO<OTHER>\nM30\n%\n";
  const std::vector<ProgramEntry> found = list_programs(text);
  REQUIRE(found.size() == 5);
  const std::int64_t numbers[5] = {1, 2, 1, -1, -1};
  const char* const names[5] = {"", "", "", "<PART>", "<OTHER>"};
  const char* const folders[5] = {"/A B/", "/A B/", "/B/", "/B/", "/B/"};
  const std::uint32_t lines[5] = {3, 6, 8, 11, 13};
  for (std::size_t k = 0; k < 5; ++k) {
    CHECK(found[k].number == numbers[k]);
    CHECK(found[k].name == names[k]);
    CHECK(found[k].folder == folders[k]);
    CHECK(found[k].first_line == lines[k]);
    CHECK(found[k].text_end == (k < 4 ? found[k + 1].text_begin : text.rfind('%')));
  }
  // Read by its place a program stands alone, and says which others it called.
  ReaderOptions options;
  options.program_index = 2;
  CHECK(read_program(text, options).text == "%\n&F=/B/\nO1\nM30\n%\n");
  options.program_index = 5;
  CHECK_THROWS_AS((void)read_program(text, options), Error);
  options.program_index = 0;
  const std::string calls = "%\nO1\nM98 P3\nM30\nO2\nM99\nO3\nM98 P2\nM99\n%\n";
  CHECK(read_program(calls, options).called == std::vector<std::size_t>{1, 2});
}
