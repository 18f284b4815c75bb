#pragma once

// Common parts of the custom macro sources: characters, errors at an index, and private parts of the evaluator.

#include <cstddef>
#include <cstdint>
#include <string>
#include <string_view>

#include "program/macro/macro_expression.hpp"
#include "program/text/characters.hpp"
#include "program/text/lexer.hpp"

namespace shapegcode::macro {

inline void skip_blanks(std::string_view text, std::size_t& i) noexcept {
  while (i < text.size() && is_blank(text[i])) {
    ++i;
  }
}

inline std::uint32_t column_of(std::size_t index) noexcept { return static_cast<std::uint32_t>(index + 1); }

[[noreturn]] inline void fail(int alarm, const std::string& message, std::uint32_t line, std::size_t index) {
  throw alarm_error(alarm, message, line, column_of(index));
}

/// The character for a message: quoted, or its byte, or the end of the block.
std::string name_at(std::string_view text, std::size_t i);

/// The shortest text that reads back as `value`.
std::string shown(double value);

/// The letters in a row that begin at `i`.
std::string_view letters_at(std::string_view text, std::size_t i) noexcept;

/// `i` stands on '('; goes behind the ')'. Throws Error(program) if the comment does not close.
void skip_comment(std::string_view text, std::size_t& i, std::uint32_t line);

/// A constant without its sign, or alarm 3 if it has more than `max_digits` significant digits.
struct Constant {
  double value = 0.0;
  bool has_point = false;
};
Constant scan_constant(std::string_view text, std::size_t& i, std::uint32_t line, unsigned max_digits);

/// `i` stands on '#': the number of the variable; `i` ends behind it.
int variable_number(std::string_view text, std::size_t& i, std::uint32_t line, VariableAccess& variables);

/// evaluate_term where ROUND rounds to `round_decimals` decimals: behind an address ROUND means its least increment.
MacroValue evaluate_operand(std::string_view text, std::size_t& i, std::uint32_t line, VariableAccess& variables,
                            int round_decimals);

/// Where in the text an operation stands.
struct TextPosition {
  std::uint32_t line;
  std::size_t index;
};

/// Functions of one or two arguments.
enum class Function : std::uint8_t {
  sine,
  cosine,
  tangent,
  arc_sine,
  arc_cosine,
  arc_tangent,
  square_root,
  absolute,
  round,
  fix,
  fup,
  logarithm,
  exponential,
  power,
  from_bcd,
  to_bcd
};
/// Whether `run` names a function (or abbreviates one).
bool find_function(std::string_view run, Function& function) noexcept;
double apply(Function function, double x, int round_decimals, bool signed_angles, TextPosition at);
double arc_tangent(double y, double x, bool signed_angles, TextPosition at);
double power(double x, double y, TextPosition at);

/// Operators between two numbers.
enum class Operator : std::uint8_t {
  none,
  multiply,
  divide,
  modulo,
  bit_and,
  add,
  subtract,
  bit_or,
  bit_xor,
  equal,
  not_equal,
  greater,
  greater_equal,
  less,
  less_equal
};
double combine(Operator op, double a, double b, TextPosition at);
bool compare(Operator op, MacroValue a, MacroValue b) noexcept;

/// `value`, or alarm 111 if it is not finite.
double finite(double value, TextPosition at);

}  // namespace shapegcode::macro
