#include <doctest/doctest.h>

#include <cstdint>
#include <string>
#include <string_view>

#include "program/macro/macro_statement.hpp"
#include "program/macro/macro_variables.hpp"
#include "shapegcode/error.hpp"

using shapegcode::Error;
using shapegcode::ErrorKind;
using shapegcode::execute_assignment;
using shapegcode::go_to_target;
using shapegcode::MacroStatement;
using shapegcode::MacroStatementKind;
using shapegcode::MacroValue;
using shapegcode::MacroVariables;
using shapegcode::parse_statement;

namespace {

template <class F>
Error refusal(F&& action) {
  try {
    action();
  } catch (const Error& error) {
    CHECK(error.kind() == ErrorKind::program);
    CHECK(error.line() == 8);
    CHECK(error.column() > 0);
    return error;
  }
  FAIL("not refused");
  return {ErrorKind::argument, ""};
}

int parse_alarm(std::string_view line) {
  CAPTURE(std::string(line));
  return refusal([&] { (void)parse_statement(line, 8); }).alarm();
}

int assignment_alarm(std::string_view line) {
  CAPTURE(std::string(line));
  MacroVariables variables;
  return refusal([&] { execute_assignment(line, 0, 8, variables); }).alarm();
}

int go_to_alarm(std::string_view line) {
  CAPTURE(std::string(line));
  MacroVariables variables;
  return refusal([&] { (void)go_to_target(line, 4, 8, variables); }).alarm();
}

void check_kind(std::string_view line, MacroStatementKind kind, std::string_view body = {}) {
  CAPTURE(std::string(line));
  const MacroStatement statement = parse_statement(line, 8);
  CHECK(statement.kind == kind);
  CHECK(line.substr(statement.body).starts_with(body));
  if (kind == MacroStatementKind::if_go_to || kind == MacroStatementKind::if_then ||
      kind == MacroStatementKind::while_do) {
    CHECK(line[statement.condition] == '[');
  }
}

}  // namespace

TEST_CASE("kinds of statements") {
  check_kind("", MacroStatementKind::nc_block);
  check_kind("(ONLY A COMMENT)", MacroStatementKind::nc_block);
  check_kind("N10", MacroStatementKind::nc_block);
  check_kind("G1 X#1 Y[#2+1] (A=B)", MacroStatementKind::nc_block);
  check_kind("X[SIN[#1]]", MacroStatementKind::nc_block);
  check_kind("G65 P9010 A#1", MacroStatementKind::nc_block);
  check_kind("#1=2", MacroStatementKind::assignment, "#1=2");
  check_kind("N10 #[#1+1] = 2 (X)", MacroStatementKind::assignment, "#[#1");
  check_kind("(A) #1=2", MacroStatementKind::assignment, "#1=2");
  check_kind("GOTO 10", MacroStatementKind::go_to, "10");
  check_kind("GOTO#1", MacroStatementKind::go_to, "#1");
  check_kind("IF[#1EQ2](WHY)GOTO10", MacroStatementKind::if_go_to, "10");
  check_kind("go [#1*10]", MacroStatementKind::go_to, "[#1");
  check_kind("IF[#1EQ2]GOTO10", MacroStatementKind::if_go_to, "10");
  check_kind("IF [[#1 EQ 2] AND [#2 LT 1]] GO #1", MacroStatementKind::if_go_to, "#1");
  check_kind("IF [#1 EQ 2] THEN GOTO 7", MacroStatementKind::if_go_to, "7");
  check_kind("IF[#1EQ#0]THEN#3000=1(A MISSING)", MacroStatementKind::if_then, "#3000");
  check_kind("if [#1 eq 2] th #2 = #1+1", MacroStatementKind::if_then, "#2 =");
  check_kind("DPRNT[X#1[53]]", MacroStatementKind::output);
  check_kind("POPEN", MacroStatementKind::output);
  check_kind("PCLOS", MacroStatementKind::output);
  check_kind("BPRNT[ A #1 [3] ]", MacroStatementKind::output);
  const MacroStatement loop = parse_statement("N5 WHILE [#1 LE 10] DO 2 (LOOP)", 8);
  CHECK(loop.kind == MacroStatementKind::while_do);
  CHECK(loop.loop == 2);
  CHECK(loop.condition == 9);
  CHECK(loop.n_number == 5);
  CHECK(parse_statement("WH[1EQ1]DO3", 8).loop == 3);
  CHECK(parse_statement("DO1", 8).kind == MacroStatementKind::do_loop);
  const MacroStatement end = parse_statement("/3 N20 END1;", 8);
  CHECK(end.kind == MacroStatementKind::end_loop);
  CHECK(end.loop == 1);
  CHECK(end.optional_skip);
  CHECK(end.skip_switch == 3);
  CHECK(end.n_number == 20);
  const MacroStatement behind_n = parse_statement("N00000000007/#1=1", 8);
  CHECK(behind_n.optional_skip);
  CHECK(behind_n.skip_switch == 1);
  CHECK(behind_n.n_number == 7);
  CHECK(parse_statement("EN2", 8).kind == MacroStatementKind::end_loop);
  CHECK(parse_statement("N99999999", 8).n_number == 99999999);
}

TEST_CASE("alarms of statements") {
  for (const char* line : {"#1",
                           "#1 5",
                           "IF",
                           "IF #1 EQ 2 GOTO 3",
                           "IF[#1EQ2",
                           "IF[#1EQ2]",
                           "IF[#1EQ2]#1=3",
                           "IF[#1EQ2]THEN",
                           "IF[#1EQ2]THEN G1X1",
                           "IF[#1EQ2]THEN #1",
                           "THEN #1=2",
                           "WHILE[#1EQ2]",
                           "WHILE DO1",
                           "WHILE[#1EQ2] END1",
                           "GOTO",
                           "IF[1EQ1]GOTO",
                           "XSIN[30]",
                           "FOO 1",
                           "SETVN1",
                           "GOTON10",
                           "DO1 [",
                           "END1 5"}) {
    CAPTURE(line);
    CHECK(parse_alarm(line) == 114);
  }
  for (const char* line : {"DO", "DO4", "DO0", "END", "END4", "DO#1", "WHILE[1EQ1]DO", "WHILE[1EQ1]DO4", "DO-1",
                           "END99999999999999999999"}) {
    CHECK(parse_alarm(line) == 126);
  }
  for (const char* line : {"G1 X1 #1=5", "X#1=5", "G0 GOTO 5", "G1X1GOTO5", "O1 IF[1EQ1]GOTO5", "X1 (A) #2=3",
                           "END1 X5", "DO1 G1", "G1 WHILE[1EQ1]DO1", "G0 POPEN"}) {
    CHECK(parse_alarm(line) == 127);
  }
  CHECK(parse_alarm("N100000000 #1=2") == 3);
  CHECK(parse_alarm("/1/2 #1=2") == 0);
  CHECK(parse_alarm("(OPEN #1=2") == 0);
}

TEST_CASE("assignments") {
  MacroVariables variables;
  const auto run = [&](std::string_view line) {
    const MacroStatement statement = parse_statement(line, 8);
    REQUIRE(statement.kind == MacroStatementKind::assignment);
    execute_assignment(line, statement.body, 8, variables);
  };
  run("#1=10");
  run("N20 # 2 = #1 * 2 + SIN[90] (COMMENT #3=1)");
  run("#[#1+#2] = 5 ;");  // #31
  run("#[99+1]=-#31");
  CHECK(variables.read(1, 8, 1) == MacroValue{10.0});
  CHECK(variables.read(2, 8, 1) == MacroValue{21.0});
  CHECK(variables.read(31, 8, 1) == MacroValue{5.0});
  CHECK(variables.read(100, 8, 1) == MacroValue{-5.0});
  run("#1=#0");
  CHECK_FALSE(variables.read(1, 8, 1).has_value());
  run("#3=#1+0");
  CHECK(variables.read(3, 8, 1) == MacroValue{0.0});
}

TEST_CASE("alarms of assignments") {
  for (const char* line : {"", "1=2", "#1", "#1 2", "#1=", "#1=2#2=3", "#1=2 #2=3", "#1=[2", "#1=2]", "#1==2", "#1=2,3",
                           "#1=1EQ1", "##1=2", "#1=1E5", "#1.5=2"}) {
    CHECK(assignment_alarm(line) == 114);
  }
  CHECK(assignment_alarm("#0=1") == 116);
  CHECK(assignment_alarm("#34=1") == 115);
  CHECK(assignment_alarm("#[0-5]=1") == 115);
  CHECK(assignment_alarm("#1=5 G1") == 127);
  CHECK(assignment_alarm("#1=5 X1 Y2") == 127);
  CHECK(assignment_alarm("#1=2/0") == 112);
  CHECK(assignment_alarm("#1=2(OPEN") == 0);
}

TEST_CASE("#3000 is the program's own alarm with its text") {
  MacroVariables variables;
  const Error error = refusal([&] { execute_assignment("#3000=12(TOOL NOT FOUND)", 0, 8, variables); });
  CHECK(error.alarm() == 3012);
  CHECK(std::string(error.what()).find("TOOL NOT FOUND") != std::string::npos);
  CHECK(refusal([&] { execute_assignment("#3000=1", 0, 8, variables); }).alarm() == 3001);
  CHECK(assignment_alarm("#3000=-1") == 114);
  CHECK(assignment_alarm("#3000=1000") == 114);
}

TEST_CASE("targets of GOTO") {
  MacroVariables variables;
  variables.write(1, 30.0, 1, 1);
  CHECK(go_to_target("GOTO10", 4, 8, variables) == 10);
  CHECK(go_to_target("GOTO 99999999 (A)", 4, 8, variables) == 99999999);
  CHECK(go_to_target("GOTO#1", 4, 8, variables) == 30);
  CHECK(go_to_target("GOTO[#1*10+.4]", 4, 8, variables) == 300);
  for (const char* line : {"GOTO0", "GOTO-1", "GOTO#2", "GOTO100000000", "GOTO[0.4]"}) {
    CHECK(go_to_alarm(line) == 128);
  }
  CHECK(go_to_alarm("GOTO") == 114);
  CHECK(go_to_alarm("GOTO 1+2") == 114);
  CHECK(go_to_alarm("GOTO 10 X1") == 127);
}

TEST_CASE("a block of a million characters takes time in proportion") {
  CHECK(parse_alarm("IF" + std::string(1000000, '[')) == 114);
  CHECK(parse_alarm(std::string(1000000, 'A')) == 114);
  CHECK(parse_statement(std::string(1000000, ' '), 8).kind == MacroStatementKind::nc_block);
  std::string comments;
  for (int k = 0; k < 300000; ++k) {
    comments += "()";
  }
  CHECK(parse_statement(comments + "#1=2", 8).body == comments.size());
}
