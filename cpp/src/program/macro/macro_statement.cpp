#include "program/macro/macro_statement.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <string>

#include "program/macro/macro_text.hpp"
#include "program/text/number_scan.hpp"

namespace shapegcode {

using macro::fail;
using macro::letters_at;
using macro::name_at;
using macro::skip_blanks;

namespace {

constexpr std::int64_t max_sequence_number = 99999999;

enum class Keyword : std::uint8_t { none, if_, then, go_to, while_, do_, end, output };

struct NamedKeyword {
  std::string_view name;
  Keyword keyword;
};

constexpr std::array<NamedKeyword, 10> keywords = {{{"IF", Keyword::if_},
                                                    {"THEN", Keyword::then},
                                                    {"GOTO", Keyword::go_to},
                                                    {"WHILE", Keyword::while_},
                                                    {"DO", Keyword::do_},
                                                    {"END", Keyword::end},
                                                    {"POPEN", Keyword::output},
                                                    {"PCLOS", Keyword::output},
                                                    {"BPRNT", Keyword::output},
                                                    {"DPRNT", Keyword::output}}};

Keyword keyword_of(std::string_view run) noexcept {
  for (const NamedKeyword& candidate : keywords) {
    if (abbreviates(run, candidate.name)) {
      return candidate.keyword;
    }
  }
  return Keyword::none;
}

// Blanks and comments.
void skip_filling(std::string_view line, std::size_t& i, std::uint32_t line_number) {
  skip_blanks(line, i);
  while (i < line.size() && line[i] == '(') {
    macro::skip_comment(line, i, line_number);
    skip_blanks(line, i);
  }
}

// What may still stand behind a macro statement is a comment.
void expect_end(std::string_view line, std::size_t i, std::uint32_t line_number) {
  skip_filling(line, i, line_number);
  if (i == line.size()) {
    return;
  }
  const std::string found = name_at(line, i);
  if (is_letter(line[i])) {
    fail(127, found + " behind a macro statement: it takes a block of its own", line_number, i);
  }
  if (line[i] == '#') {
    fail(114, "second assignment in a block: each takes a block of its own", line_number, i);
  }
  fail(114, found + " behind the end of the macro statement", line_number, i);
}

std::size_t behind_bracket(std::string_view line, std::size_t open, std::uint32_t line_number) {
  std::size_t depth = 0;
  for (std::size_t i = open; i < line.size() && line[i] != '('; ++i) {
    if (line[i] == '[') {
      ++depth;
    } else if (line[i] == ']' && --depth == 0) {
      return i + 1;
    }
  }
  fail(114, "'[' without ']'", line_number, open);
}

// An assignment has '=' outside brackets; that it is missing must show before the statement runs.
void expect_equals_sign(std::string_view line, std::size_t at, std::uint32_t line_number) {
  for (std::size_t i = at; i < line.size() && line[i] != '('; ++i) {
    if (line[i] == '=') {
      return;
    }
  }
  fail(114, "'=' expected behind the variable", line_number, at);
}

// Looks through the words of an NC block for a macro statement among them.
void check_nc_block(std::string_view line, std::size_t i, std::uint32_t line_number) {
  int depth = 0;
  while (i < line.size()) {
    const char c = line[i];
    if (c == '(') {
      macro::skip_comment(line, i, line_number);
      continue;
    }
    depth += c == '[' ? 1 : c == ']' ? -1 : 0;
    if (c == '=') {
      fail(127, "'=' in a block with words: an assignment takes a block of its own", line_number, i);
    }
    if (depth <= 0 && is_letter(c)) {
      const std::string_view run = letters_at(line, i);
      if (keyword_of(run) != Keyword::none) {
        fail(127, std::string(run) + " in a block with words: it takes a block of its own", line_number, i);
      }
      if (run.size() > 1) {
        fail(114, "'" + std::string(run.substr(0, 20)) + "' is neither an address nor a macro statement", line_number,
             i);
      }
    }
    ++i;
  }
}

void read_loop_number(std::string_view line, std::size_t i, std::uint32_t line_number, MacroStatement& statement) {
  skip_blanks(line, i);
  const std::size_t start = i;
  const std::int64_t number = scan_whole(line, i);
  if (number < 0) {
    fail(126, "number 1 ... 3 expected behind DO or END, " + name_at(line, i) + " found", line_number, start);
  }
  if (number < 1 || number > 3) {
    fail(126, fmt::format("loop number {} (limit 1 ... 3)", number), line_number, start);
  }
  expect_end(line, i, line_number);
  statement.loop = static_cast<int>(number);
}

void read_go_to(std::string_view line, std::size_t i, std::uint32_t line_number, MacroStatement& statement) {
  skip_blanks(line, i);
  if (i == line.size()) {
    fail(114, "sequence number expected behind GOTO", line_number, i);
  }
  statement.body = i;
}

void read_condition(std::string_view line, std::size_t& i, std::uint32_t line_number, MacroStatement& statement) {
  skip_blanks(line, i);
  if (i == line.size() || line[i] != '[') {
    fail(114, "condition in brackets expected, " + name_at(line, i) + " found", line_number, i);
  }
  statement.condition = i;
  i = behind_bracket(line, i, line_number);
  skip_filling(line, i, line_number);
}

void read_if(std::string_view line, std::size_t i, std::uint32_t line_number, MacroStatement& statement) {
  read_condition(line, i, line_number, statement);
  std::string_view run = letters_at(line, i);
  Keyword keyword = keyword_of(run);
  const bool has_then = keyword == Keyword::then;
  if (has_then) {
    i += run.size();
    skip_blanks(line, i);
    if (i < line.size() && line[i] == '#') {
      statement.kind = MacroStatementKind::if_then;
      statement.body = i;
      expect_equals_sign(line, i, line_number);
      return;
    }
    run = letters_at(line, i);
    keyword = keyword_of(run);
  }
  if (keyword != Keyword::go_to) {
    fail(114,
         std::string(has_then ? "assignment or GOTO expected behind THEN, "
                              : "GOTO or THEN expected behind IF [...], ") +
             name_at(line, i) + " found",
         line_number, i);
  }
  statement.kind = MacroStatementKind::if_go_to;
  read_go_to(line, i + run.size(), line_number, statement);
}

// Leading '/' and N; i ends on what follows.
void read_head(std::string_view line, std::size_t& i, std::uint32_t line_number, MacroStatement& statement) {
  for (;;) {
    skip_filling(line, i, line_number);
    if (i == line.size()) {
      return;
    }
    if (line[i] == '/') {
      if (statement.optional_skip) {
        throw Error(ErrorKind::program, "more than one block skip in a block is not supported", line_number,
                    macro::column_of(i));
      }
      statement.optional_skip = true;
      statement.skip_switch = scan_skip_switch(line, i);
    } else if (upper(line[i]) == 'N' && statement.n_number < 0) {
      std::size_t k = i + 1;
      skip_blanks(line, k);
      const std::int64_t number = scan_whole(line, k);
      if (number < 0) {
        return;  // not a sequence number: refused with the words of the block
      }
      if (number > max_sequence_number) {
        fail(3, "sequence number of more than 8 digits", line_number, i);
      }
      statement.n_number = number;
      i = k;
    } else {
      return;
    }
  }
}

// "#3000=n(TEXT)": the program stops with its own alarm.
[[noreturn]] void raise_own_alarm(std::string_view line, std::size_t i, std::size_t at, std::uint32_t line_number,
                                  MacroValue value) {
  const double number = std::round(value.value_or(0.0));
  if (!(number >= 0.0 && number <= 999.0)) {
    fail(114, "#3000 = " + macro::shown(value.value_or(0.0)) + ": the number of an alarm is 0 ... 999", line_number,
         at);
  }
  const std::size_t open = line.find('(', i);
  const std::size_t close = open == std::string_view::npos ? open : line.find(')', open);
  const std::string text(close == std::string_view::npos ? std::string_view{}
                                                         : line.substr(open + 1, close - open - 1));
  fail(3000 + static_cast<int>(number), "the program raises an alarm of its own" + (text.empty() ? "" : ": " + text),
       line_number, at);
}

}  // namespace

MacroStatement parse_statement(std::string_view line, std::uint32_t line_number) {
  MacroStatement statement;
  std::size_t i = 0;
  read_head(line, i, line_number, statement);
  if (i == line.size()) {
    return statement;
  }
  if (line[i] == '#') {
    statement.kind = MacroStatementKind::assignment;
    statement.body = i;
    expect_equals_sign(line, i, line_number);
    return statement;
  }
  const std::string_view run = letters_at(line, i);
  const std::size_t behind = i + run.size();
  switch (keyword_of(run)) {
    case Keyword::if_:
      read_if(line, behind, line_number, statement);
      break;
    case Keyword::go_to:
      statement.kind = MacroStatementKind::go_to;
      read_go_to(line, behind, line_number, statement);
      break;
    case Keyword::while_: {
      std::size_t k = behind;
      read_condition(line, k, line_number, statement);
      const std::string_view next = letters_at(line, k);
      if (keyword_of(next) != Keyword::do_) {
        fail(114, "DO expected behind WHILE [...], " + name_at(line, k) + " found", line_number, k);
      }
      statement.kind = MacroStatementKind::while_do;
      read_loop_number(line, k + next.size(), line_number, statement);
      break;
    }
    case Keyword::do_:
      statement.kind = MacroStatementKind::do_loop;
      read_loop_number(line, behind, line_number, statement);
      break;
    case Keyword::end:
      statement.kind = MacroStatementKind::end_loop;
      read_loop_number(line, behind, line_number, statement);
      break;
    case Keyword::output:
      statement.kind = MacroStatementKind::output;
      break;
    case Keyword::then:
      fail(114, "THEN without IF [...]", line_number, i);
    case Keyword::none:
      check_nc_block(line, i, line_number);
      break;
  }
  return statement;
}

void execute_assignment(std::string_view line, std::size_t at, std::uint32_t line_number, VariableAccess& variables) {
  std::size_t i = at;
  if (i >= line.size() || line[i] != '#') {
    fail(114, "variable expected, " + name_at(line, i) + " found", line_number, i);
  }
  const int number = macro::variable_number(line, i, line_number, variables);
  skip_blanks(line, i);
  if (i >= line.size() || line[i] != '=') {
    fail(114, "'=' expected behind the variable, " + name_at(line, i) + " found", line_number, i);
  }
  ++i;
  const MacroValue value = evaluate_expression(line, i, line_number, variables);
  expect_end(line, i, line_number);
  if (number == 3000) {
    raise_own_alarm(line, i, at, line_number, value);
  }
  variables.write(number, value, line_number, macro::column_of(at));
}

std::int64_t go_to_target(std::string_view line, std::size_t at, std::uint32_t line_number, VariableAccess& variables) {
  std::size_t i = at;
  const MacroValue value = evaluate_term(line, i, line_number, variables);
  expect_end(line, i, line_number);
  const double number = std::round(value.value_or(0.0));
  if (!(number >= 1.0 && number <= static_cast<double>(max_sequence_number))) {
    fail(128,
         fmt::format("GOTO {}: sequence numbers are 1 ... {}", value.has_value() ? macro::shown(*value) : "<vacant>",
                     max_sequence_number),
         line_number, at);
  }
  return static_cast<std::int64_t>(number);
}

}  // namespace shapegcode
