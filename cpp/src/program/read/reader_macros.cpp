// Macro statements: assignments, GOTO, IF, WHILE.
#include <fmt/format.h>

#include <algorithm>

#include "program/macro/macro_expression.hpp"
#include "program/read/reader_impl.hpp"
#include "program/text/characters.hpp"
#include "program/text/number_scan.hpp"
#include "shapegcode/error.hpp"

namespace shapegcode::detail {
namespace {

constexpr int first_lasting_variable = 500;  // from here on a value outlives the program

// Passes everything on, and remembers what was written.
class Recorder : public VariableAccess {
 public:
  explicit Recorder(VariableAccess& variables) : variables_(variables) {}
  MacroValue read(int number, std::uint32_t line, std::uint32_t column) override {
    lasting_only = lasting_only && number >= first_lasting_variable;
    return variables_.read(number, line, column);
  }
  void write(int number, MacroValue value, std::uint32_t line, std::uint32_t column) override {
    written = number;
    result = value;
    variables_.write(number, value, line, column);
  }
  bool signed_angles() const noexcept override { return variables_.signed_angles(); }

  int written = -1;
  MacroValue result;
  bool lasting_only = true;  // every variable that was read is one that the control keeps

 private:
  VariableAccess& variables_;
};

std::string number_text(double value) {
  std::string result = fmt::format("{:.6f}", value);
  while (result.back() == '0') {
    result.pop_back();
  }
  return result;
}

// The number of "#500=..." at `at` if it outlives the program, else 0.
int lasting_target(std::string_view text, std::size_t at) noexcept {
  std::size_t i = at + 1;
  skip_spaces(text, i);
  const std::int64_t target = scan_whole(text, i);
  return target >= first_lasting_variable && target < 1'000'000 ? static_cast<int>(target) : 0;
}

}  // namespace

WordFormat Reader::word_format() const {
  WordFormat format;
  format.length_decimals = length_decimals(options_, rewriter_.programmed().units);
  return format;
}

// An argument without a decimal point counts least increments where a coordinate would.
std::array<double, 26> Reader::argument_scale() const {
  std::array<double, 26> scale;
  scale.fill(1.0);
  if (!options_.calculator_decimal_point) {
    const double increment = min_increment(options_, rewriter_.programmed().units);
    for (const char letter : {'A', 'B', 'C', 'I', 'J', 'K', 'Q', 'R', 'U', 'V', 'W', 'X', 'Y', 'Z'}) {
      scale[static_cast<std::size_t>(letter - 'A')] = increment;
    }
  }
  return scale;
}

void Reader::macro_line(std::size_t begin) {
  const std::string_view text = line_.text();
  expand_from(begin);
  const MacroStatement statement = parse_statement(text, here_.line);
  if (statement.n_number >= 0) {
    control_.last_n = statement.n_number;
  }
  if (statement.optional_skip) {
    const auto known = block_skip(options_, statement.skip_switch);
    if (known.value_or(false)) {
      return;  // the switch is on: the control does not run it
    }
    if (!known) {
      fail(
          "'/' before a macro statement: whether it runs decides what the program does; say it in the machine file "
          "(input.block_skip)");
    }
  }
  switch (statement.kind) {
    case MacroStatementKind::nc_block:
      nc_block(text);
      return;
    case MacroStatementKind::assignment:
      assignment(text, statement.body);
      return;
    case MacroStatementKind::go_to:
      jump(go_to_target(text, statement.body, here_.line, variables_), static_cast<std::uint32_t>(statement.body + 1));
      return;
    case MacroStatementKind::if_go_to:
    case MacroStatementKind::if_then: {
      std::size_t i = statement.condition;
      if (statement.kind == MacroStatementKind::if_then && lasting_target(text, statement.body) > 0) {
        conditional_lasting(text, statement);
        return;
      }
      if (!evaluate_condition(text, i, here_.line, variables_)) {
        return;
      }
      if (statement.kind == MacroStatementKind::if_then) {
        assignment(text, statement.body);
      } else {
        jump(go_to_target(text, statement.body, here_.line, variables_),
             static_cast<std::uint32_t>(statement.body + 1));
      }
      return;
    }
    case MacroStatementKind::while_do:
    case MacroStatementKind::do_loop:
      loop_start(text, statement, here_);
      return;
    case MacroStatementKind::end_loop:
      loop_end(statement);
      return;
    case MacroStatementKind::output:
      rewriter_.flush();
      put_raw(with_values(text), origin_);
      return;
  }
}

void Reader::nc_block(std::string_view text) {
  computed_.read_and_keep(substitute(text, here_.line, variables_, word_format()), here_.line,
                          options_.max_line_length);
  if (computed_.macro) {
    alarm(114, "macro expression is not understood");
  }
  if (computed_.word_count == 0 && computed_.comment_count == 0) {
    return;  // every word was vacant
  }
  run_block(computed_, text);
}

// The text with the values of local and common variables in place of their names; those that the control keeps stay.
std::string Reader::with_values(std::string_view text) {
  std::string result;
  for (std::size_t i = 0; i < text.size(); ++i) {
    if (text[i] != '#' || i + 1 >= text.size() || !is_digit(text[i + 1])) {
      result += text[i];
      continue;
    }
    std::size_t k = i + 1;
    const std::int64_t number = scan_whole(text, k);
    MacroValue value;
    if (number > 0 && number < first_lasting_variable) {
      value = variables_.read(static_cast<int>(number), here_.line, static_cast<std::uint32_t>(i + 1));
    }
    if (number >= first_lasting_variable || !value) {
      result += number >= first_lasting_variable ? std::string(text.substr(i, k - i)) : "#0";
    } else {
      result += *value < 0.0 ? "[" + number_text(*value) + "]" : number_text(*value);
    }
    i = k - 1;
  }
  return result;
}

// What outlives the program is written too, with the values that it comes to; the rest has done its work here.
void Reader::assignment(std::string_view text, std::size_t at) {
  const std::string_view statement = text.substr(at);
  Recorder recorder(variables_);
  try {
    execute_assignment(text, at, here_.line, recorder);
  } catch (const UnknownValue& unknown) {
    if (recorder.written >= 0 || unknown.number() < first_lasting_variable) {
      throw;
    }
    // "#500=#500+1": a counter in the control. Kept, if the variable that is set is one of those.
    const int target = lasting_target(text, at);
    if (target == 0) {
      throw;
    }
    keep_for_control(statement, target);
    return;
  }
  if (recorder.written >= first_lasting_variable) {
    rewriter_.flush();
    interpreter_.close_region();
    put_raw(recorder.lasting_only ? std::string(statement) : with_values(statement), origin_);
  }
}

void Reader::keep_for_control(std::string_view statement, int target) {
  variables_.forget(target);
  rewriter_.flush();
  interpreter_.close_region();
  put_raw(with_values(statement), origin_);
}

// "IF[#500GT100]THEN#3000=1(TOOL LIFE)": a guard that must still stand in the plain program, whatever it says today.
void Reader::conditional_lasting(std::string_view text, const MacroStatement& statement) {
  try {
    std::size_t i = statement.condition;
    if (evaluate_condition(text, i, here_.line, variables_)) {
      Recorder recorder(variables_);
      execute_assignment(text, statement.body, here_.line, recorder);
    }
    rewriter_.flush();
    interpreter_.close_region();
    put_raw(with_values(text), origin_);
  } catch (const UnknownValue& unknown) {
    if (unknown.number() < first_lasting_variable) {
      throw;
    }
    keep_for_control(text, lasting_target(text, statement.body));
  }
}

void Reader::jump(std::int64_t n, std::uint32_t column) {
  Frame& frame = frames_.back();
  const auto position = frame.unit->find_n(n, frame.next.at);
  if (!position) {
    alarm(78, fmt::format("sequence number N{} is not in the program", n), column);
  }
  frame.next = *position;
  // A jump out of a loop ends it.
  std::erase_if(frame.loops,
                [&](const Loop& loop) { return position->at < loop.start.at || position->at >= loop.end; });
}

void Reader::loop_start(std::string_view text, const MacroStatement& statement, const LinePosition& here) {
  Frame& frame = frames_.back();
  const auto behind = frame.unit->behind_end(statement.loop, frame.next);
  if (!behind) {
    alarm(124, fmt::format("DO{} has no END{}", statement.loop, statement.loop));
  }
  // A loop that is still open under this number was left by a jump to its own start, or crosses this one.
  std::erase_if(frame.loops, [&](const Loop& loop) {
    return loop.number == statement.loop || here.at < loop.start.at || here.at >= loop.end;
  });
  bool enters = true;
  if (statement.kind == MacroStatementKind::while_do) {
    std::size_t i = statement.condition;
    enters = evaluate_condition(text, i, here_.line, variables_);
  }
  if (!enters) {
    frame.next = *behind;
    return;
  }
  frame.loops.push_back({statement.loop, here, behind->at});
}

void Reader::loop_end(const MacroStatement& statement) {
  Frame& frame = frames_.back();
  while (!frame.loops.empty() && frame.loops.back().number != statement.loop) {
    frame.loops.pop_back();
  }
  if (frame.loops.empty()) {
    alarm(124, fmt::format("END{} without its DO{}", statement.loop, statement.loop));
  }
  frame.next = frame.loops.back().start;
  frame.loops.pop_back();
}

}  // namespace shapegcode::detail
