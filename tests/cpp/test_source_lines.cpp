// Lines of a plain program that was made of a text in another control's words lead back to that text.
#include <doctest/doctest.h>

#include <string>
#include <vector>

#include "shapegcode/error.hpp"
#include "shapegcode/program.hpp"

namespace shapegcode {
namespace {

const std::string plain = "%\nG21G90G00X0.Y0.\nG01X1.F100.\nX2.\nM30\n%\n";

TEST_CASE("a plain program leads back to lines and files") {
  Program program = read_program(plain);
  REQUIRE_FALSE(program.expanded);
  const std::vector<LineOrigin> lines = {{1, 0}, {4, 0}, {2, 1}, {2, 1}, {9, 0}, {9, 0}};
  lead_back(program, "source", lines, {"sub.ngc"}, {{4, "a note", 0, 0, ""}});
  CHECK(program.expanded);
  CHECK(program.unexpanded == "source");
  CHECK(program.text == plain);
  REQUIRE(program.origins.size() == program.line_count);
  CHECK(program.origins[1] == LineOrigin{4, 0});
  CHECK(program.origins[2].line == 2);
  CHECK(program.files[program.origins[2].file] == "sub.ngc");
  CHECK(program.warnings.front().message == "a note");
}

TEST_CASE("so does one that was expanded itself, with its findings") {
  ReaderOptions options;
  options.collect_alarms = true;
  Program program = read_program("%\nG21G90G00X0.Y0.\n#1=5.\nG01X#1F100.\nG77\nM30\n%\n", options);
  REQUIRE(program.expanded);
  REQUIRE(program.alarms.size() == 1);
  CHECK(program.alarms[0].line == 5);
  lead_back(program, "source", {{1, 0}, {11, 0}, {12, 0}, {13, 0}, {14, 0}, {15, 0}, {16, 0}}, {}, {});
  CHECK(program.alarms[0].line == 14);
  std::vector<std::uint32_t> found;
  for (const LineOrigin& origin : program.origins) {
    found.push_back(origin.line);
  }
  CHECK(found == std::vector<std::uint32_t>{1, 11, 13, 14, 15, 16});
}

TEST_CASE("missing lines and files are refused") {
  Program program = read_program(plain);
  CHECK_THROWS_AS(lead_back(program, "", {{1, 0}}, {}, {}), Error);
  const std::vector<LineOrigin> lines(6, LineOrigin{1, 1});
  CHECK_THROWS_AS(lead_back(program, "", lines, {}, {}), Error);
}

}  // namespace
}  // namespace shapegcode
