// What a program may ask at most: counted while it is read, by hand here.
#include <doctest/doctest.h>

#include <cstddef>
#include <limits>
#include <string>

#include "shapegcode/error.hpp"
#include "shapegcode/program.hpp"

using namespace shapegcode;

namespace {

const std::string head = "%\nO0001\nG21 G90 G17\nG00 X0 Y0 Z0\n";  // lines 1 to 4, one zero move or more
const std::string tail = "M30\n%\n";

ReaderOptions known() {
  ReaderOptions options;
  options.unknown_after_tool_change = {false, false, false};
  options.power_on.known = {true, true, true};
  return options;
}

Program read(const std::string& body, const ReaderOptions& options) {
  return read_program(head + body + tail, options);
}

struct Refused {
  std::string message;
  std::uint32_t line = 0;
};

Refused refused(const std::string& text, const ReaderOptions& options) {
  try {
    static_cast<void>(read_program(text, options));
  } catch (const Error& error) {
    CHECK(error.kind() == ErrorKind::program);
    return {error.what(), error.line()};
  }
  return {};
}

bool holds(const std::string& text, const std::string& part) { return text.find(part) != std::string::npos; }

}  // namespace

TEST_CASE("work limits: least time is length over feed, dwells and functions added, no axis faster than it is") {
  ReaderOptions options = known();
  const auto seconds = [&](const std::string& body) { return read(body, options).least_time_s; };
  CHECK(seconds("G01 X60. F60.\n") == doctest::Approx(60.0));
  CHECK(seconds("G01 X60. F60.\nG04 X2.5\nG04 P500\n") == doctest::Approx(63.0));
  CHECK(seconds("G93 G01 X7. F.5\n") == doctest::Approx(120.0));
  CHECK(seconds("S300\nG95 G01 X60. F.1\n") == doctest::Approx(120.0));
  CHECK(seconds("G01 X10. F600.\nG03 I-10.\n") == doctest::Approx(1.0 + 2.0 * 3.14159265358979 * 1.0));
  // Without the speeds of the axes a rapid takes no time.
  CHECK(seconds("G00 X500.\n") == 0.0);
  options.limits.rapid_mm_per_s = {100.0, 50.0, 25.0};
  CHECK(seconds("G00 X500. Y100.\n") == doctest::Approx(5.0));
  CHECK(seconds("G00 X500. Y300.\n") == doctest::Approx(6.0));
  options.limits.feed_mm_per_s = {10.0, 10.0, 10.0};
  CHECK(seconds("G01 X100. F60000.\n") == doctest::Approx(10.0));
  options.limits.tool_change_s = 8.0;
  options.limits.m_function_s = 0.5;
  CHECK(seconds("T3 M06\nM03 S100\nM08\n") == doctest::Approx(8.0 + 0.5 + 0.5 + 0.5));  // M30 too
  // A drilling cycle: down at 1 mm/s, back up and over it as a rapid.
  options.limits.rapid_mm_per_s = {100.0, 100.0, 100.0};
  CHECK(seconds("G81 X100. Z-10. R0. F60.\n") == doctest::Approx(1.0 + 10.0 + 0.1 + 0.5));
}

TEST_CASE("work limits: programmed seconds are refused at the line that passes them") {
  ReaderOptions options = known();
  options.limits.seconds = 100.0;
  CHECK(refused(head + "G01 X60. F60.\nX20.\n" + tail, options).message.empty());
  const Refused line = refused(head + "G01 X60. F60.\nX20.\nX0\n" + tail, options);
  CHECK(line.line == 7);
  CHECK(
      line.message ==
      "the program runs for more than 100 s up to here (controller.max_program_s); this move takes 20 s at 60 mm/min");
  const Refused slip = refused(head + "G01 X5000. F.001\n" + tail, options);
  CHECK(slip.line == 5);
  CHECK(holds(slip.message, "this move takes 3e+08 s at 0.001 mm/min"));
  const Refused day = refused(head + "G04 X86400.\n" + tail, options);
  CHECK(day.line == 5);
  CHECK(holds(day.message, "this dwell takes 86400 s"));
  // Sums count: of dwells in a subprogram, of a peck cycle's cuts.
  const Refused sum = refused(head + "M98 P0002 L9999\nM30\nO0002\nG04 X9.\nM99\n%\n", options);
  CHECK(sum.line == 8);
  CHECK(holds(sum.message, "this dwell takes 9 s; called by O1 line 5"));
  const Refused pecks = refused(head + "G83 Z-50. R0. Q.5 F6.\n" + tail, options);
  CHECK(pecks.line == 5);
  CHECK(holds(pecks.message, "controller.max_program_s"));
  // A full turn of a radius as large as a word can say.
  CHECK(refused(head + "G01 Y0 F500.\nG03 X.01 R-99999.\n" + tail, options).line == 6);
}

TEST_CASE("work limits: moves are counted while loops, calls and cycles are expanded") {
  ReaderOptions options = known();
  options.limits.moves = 50;
  std::string lines = "G01 F500.\n";
  for (int k = 1; k <= 50; ++k) {
    lines += "X" + std::to_string(k) + ".\n";
  }
  // The M30 is one more.
  CHECK(read_program(head + lines + "%\n", options).move_count == 50);
  CHECK(refused(head + lines + tail, options).line == 4 + 51 + 1);
  const std::string nested = "F500.\nM98 P0002 L9999\nM30\nO0002\nM98 P0003 L9999\nM99\nO0003\nG01 X1.\nX0\nM99\n%\n";
  const Refused calls = refused(head + nested, options);
  CHECK(calls.message ==
        "up to here more than 50 moves (controller.max_program_moves); called by O2 line 9; called by "
        "O1 line 6");
  CHECK(calls.line == 12);
  const Refused loop = refused(head + "F500.\n#1=0\nWHILE[#1EQ0]DO1\nG01 X1.\nX0\nEND1\n" + tail, options);
  CHECK(holds(loop.message, "controller.max_program_moves"));
  CHECK(loop.line == 8);
  CHECK(
      holds(refused(head + "G91 G03 I-20. Z-.01 F500.\nM98 P0002 L5000\nM30\nO0002\nG03 I-20. Z-.01\nM99\n%\n", options)
                .message,
            "more than 50 moves"));
  // Blocks with machine functions are kept too.
  CHECK(holds(refused(head + "M98 P0002 L9999\nM30\nO0002\nM08\nM99\n%\n", options).message, "max_program_moves"));
}

TEST_CASE("work limits: a plain text of any length is read, what few lines expand to is limited") {
  ReaderOptions options = known();
  options.limits.expansion_moves = 10;
  options.limits.expansion_bytes = 100;
  options.limits.steps = 10;
  std::string lines = "F500.\n";
  for (int k = 1; k <= 500; ++k) {
    lines += "G01 X" + std::to_string(k) + ".\n";
  }
  CHECK(read_program(head + lines + tail, options).move_count == 501);
  options.limits.steps = 10'000;
  const std::string loop = head + "F500.\n#1=0\nWHILE[#1EQ0]DO1\nG01 X1.\nX0\nEND1\n" + tail;
  options.limits.expansion_bytes = 10'000;
  const Refused moves = refused(loop, options);  // twelve lines, the last of them empty
  CHECK(moves.message == "up to here more than 10 moves beyond one for each line (controller.max_expansion_moves)");
  CHECK((moves.line == 8 || moves.line == 9));
  options.limits.expansion_moves = 10'000;
  options.limits.expansion_bytes = 100;
  const Refused bytes = refused(loop, options);
  CHECK(bytes.message ==
        "up to here the expanded program is more than 100 bytes longer than the text (controller.max_expansion_bytes)");
  // A cut of a drilling cycle is a move beyond its line, and counted before the first one.
  options.limits.expansion_moves = 40;
  CHECK(holds(refused(head + "G83 Z-50. R0. Q.5 F600.\n" + tail, options).message,
              "more than 40 moves beyond one for each line (controller.max_expansion_moves)"));
}

TEST_CASE("work limits: every line that is executed beyond once is a step") {
  ReaderOptions options = known();
  options.limits.steps = 20;
  std::string lines;
  for (int k = 0; k < 30; ++k) {
    lines += "(LINE)\n";
  }
  CHECK(refused(head + lines + tail, options).message.empty());
  CHECK(holds(refused(head + "N10 GOTO 10\n" + tail, options).message,
              "more than 20 blocks executed beyond one for each line (controller.max_program_steps): the program does "
              "not seem to end"));
  // A program without a line of its own is called, too.
  const std::string empty = head + "M98 P0002 L99999\nM30\nO0002\n%\n";
  CHECK(holds(refused(empty, options).message, "more than 20 blocks"));
  // Reading again with a macro shut counts on: each of these asks for what only the control knows.
  std::string macros;
  std::string bodies;
  for (int k = 1; k <= 12; ++k) {
    macros += "G65 P" + std::to_string(9000 + k) + "\n";
    bodies += "O" + std::to_string(9000 + k) + "\nIF[#5061GT0]GOTO1\nN1\nM99\n";
  }
  options.limits.steps = 1000;
  CHECK(refused(head + macros + "M30\n" + bodies + "%\n", options).message.empty());
  options.limits.steps = 60;
  CHECK(holds(refused(head + macros + "M30\n" + bodies + "%\n", options).message, "more than 60 blocks"));
}

TEST_CASE("work limits: bytes of the text, of called files, and beyond them of what they are expanded to") {
  ReaderOptions options = known();
  const std::string text = head + "G01 X1. F500.\n" + tail;
  options.limits.bytes = text.size();
  CHECK(refused(text, options).message.empty());
  options.limits.bytes = text.size() - 1;
  const Refused whole = refused(text, options);
  CHECK(whole.line == 7);  // the '%' at the end
  CHECK(holds(whole.message, "bytes of program text (controller.max_program_bytes)"));
  options.load_program = [](std::int64_t) {
    return SourceText{"O2.nc", "%\nO0002\n" + std::string(500, '\n') + "M99\n%\n"};
  };
  const std::string caller = head + "M98 P0002\n" + tail;
  options.limits.bytes = caller.size() + 700;
  CHECK(refused(caller, options).message.empty());
  options.limits.bytes = caller.size() + 100;
  CHECK(holds(refused(caller, options).message, "controller.max_program_bytes"));
  options.load_program = {};
  options.limits.expansion_bytes = 2000;
  const Refused loop = refused(head + "F500.\nM98 P0002 L9999\nM30\nO0002\nG01 X1.\nX0\nM99\n%\n", options);
  CHECK(holds(loop.message, "more than 2000 bytes longer than the text (controller.max_expansion_bytes)"));
  CHECK(loop.line >= 8);
}

TEST_CASE("work limits: reading stops at the limit where alarms are collected, with what was read so far") {
  ReaderOptions options = known();
  options.collect_alarms = true;
  options.limits.moves = 1000;
  const Program program = read("F500.\n#1=0\nWHILE[#1EQ0]DO1\nG01 X1.\nX0\nEND1\n", options);
  REQUIRE(program.alarms.size() == 1);
  CHECK(holds(program.alarms[0].message, "more than 1000 moves"));
  REQUIRE(program.regions.size() == 1);
  CHECK(program.regions[0]->path->size() == 1000);
  CHECK(program.move_count == 1001);  // the one that was too much
}

TEST_CASE("work limits: one place warns once however often it runs, and of one kind a hundred are listed") {
  ReaderOptions options = known();
  const Program called = read_program(head + "M98 P0002 L500\nM98 P0002 L500\nM30\nO0002\nG01 X1. F500.\n%\n", options);
  std::size_t without_end = 0;
  for (const Finding& warning : called.warnings) {
    without_end += holds(warning.message, "ends without M99") ? 1U : 0U;
  }
  CHECK(without_end == 1);
  std::string rotary = "G01 F500.\n";
  for (int k = 0; k < 250; ++k) {
    rotary += "A" + std::to_string(k + 1) + ".\n";
  }
  const Program turned = read(rotary, options);
  std::size_t listed = 0;
  std::string last;
  for (const Finding& warning : turned.warnings) {
    if (holds(warning.message, "rotary")) {
      ++listed;
      last = warning.message;
    }
  }
  CHECK(listed == 101);
  CHECK(last.substr(0, 8) == "150 more");
}

TEST_CASE("program store: loops find their END, programs their folder, however many there are") {
  ReaderOptions options = known();
  // Loops in loops, and the same number twice: each goes behind its own END.
  const Program loops = read(
      "#1=0\nWHILE[#1LT3]DO1\n#2=0\nWHILE[#2LT2]DO2\nG01 X[#1*10+#2+1] F500.\n#2=#2+1\nEND2\n#1=#1+1\nEND1\n"
      "WHILE[#1LT3]DO1\nX99.\nEND1\nX50.\n",
      options);
  REQUIRE(loops.regions.size() == 1);
  const auto& segments = loops.regions[0]->path->segments();
  REQUIRE(segments.size() == 7);
  const double ends[7] = {1.0, 2.0, 11.0, 12.0, 21.0, 22.0, 50.0};
  for (std::size_t k = 0; k < 7; ++k) {
    CHECK(segments[k].end_mm[0] == doctest::Approx(ends[k]));
  }
  // Ten thousand programs in ten thousand folders; each calls the O2 of its own.
  std::string text = "%\n";
  for (int k = 0; k < 10'000; ++k) {
    text += "&F=/F" + std::to_string(k) + "/\nO1\n" + (k == 0 ? "G21G90G00X0Y0Z0\nM98 P2\nM30\n" : "M30\n") +
            "O2\nG01 X" + std::to_string(k + 1) + ". F500.\nM99\n";
  }
  const Program folders = read_program(text + "%\n", options);
  CHECK(folders.regions.at(0)->path->segments().back().end_mm[0] == 1.0);
  CHECK(folders.program_numbers.size() == 20'000);
}
