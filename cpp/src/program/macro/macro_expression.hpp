#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>
#include <string_view>

#include "shapegcode/error.hpp"

namespace shapegcode {

/// Value of a custom macro variable; std::nullopt: <vacant>, which is not 0.
using MacroValue = std::optional<double>;

/// The value of a variable is in the control only: a program that needs it cannot be foreseen.
class UnknownValue : public Error {
 public:
  UnknownValue(int number, const std::string& message, std::uint32_t line = 0, std::uint32_t column = 0)
      : Error(ErrorKind::program, message, line, column), number_(number) {}
  [[nodiscard]] int number() const noexcept { return number_; }

 private:
  int number_;
};

/// What expressions read and assignments write. `line` and `column` count from 1 and go into errors.
class VariableAccess {
 public:
  virtual ~VariableAccess() = default;
  /// Value of #number. Throws Error(program): alarm 115 if there is no such variable.
  [[nodiscard]] virtual MacroValue read(int number, std::uint32_t line, std::uint32_t column) = 0;
  /// Sets #number. Throws Error(program): alarm 115 if there is no such variable, 116 if it is read only.
  virtual void write(int number, MacroValue value, std::uint32_t line, std::uint32_t column) = 0;
  /// Range of ASIN and of ATAN with two arguments (parameter 6004#0, NAT): false (bit 0): 270 ... 90 and 0 ... 360
  /// degrees; true (bit 1): -90 ... 90 and -180 ... 180 degrees.
  [[nodiscard]] virtual bool signed_angles() const noexcept { return false; }
};

// Custom macro B as the operator's manuals of 0i-D and 30i describe it (B-64304EN, B-63944EN, chapter "Custom macro"):
//  - priorities: functions; * / MOD AND; + - OR XOR; comparisons; equal ones from the left. Angles in degrees.
//  - functions: SIN COS TAN ASIN ACOS ATAN[y]/[x] ATAN[y,x] SQRT ABS ROUND FIX FUP LN EXP POW[x,y] BIN BCD; a name may
//  be
//    cut down to its first two letters, except POW. FIX cuts towards zero, FUP goes away from zero, ROUND rounds halves
//    away from zero.
//  - <vacant> is 0 in arithmetic; alone it stays vacant; EQ and NE tell it from 0, the other comparisons do not.
//  - MOD, AND, OR, XOR, BIN, BCD round their operands to whole numbers; AND, OR, XOR work on 32 bits with sign.
//  - the number in #[expression] is rounded to a whole number, as the control does with every number it wants whole.
// Lower case is read as upper case. Errors (Error(program) with the alarm number, line and column): 3 constant of more
// than 12 digits; 111 overflow; 112 division by zero (TAN of 90 degrees and ATAN[0]/[0] as well: the manuals name no
// alarm for them); 114 malformed; 115 variable number; 118 more than five levels of brackets; 119 argument outside the
// range of a function.

/// Reads one term at text[i] (#n, #[expression], [expression], FUNCTION[expression], number, each with or without a
/// sign); `i` ends behind it. A vacant variable behind a sign stays vacant here, so that "X-#1" can be dropped.
[[nodiscard]] MacroValue evaluate_term(std::string_view text, std::size_t& i, std::uint32_t line,
                                       VariableAccess& variables);

/// Reads an expression without its enclosing bracket, such as the right side of '='. `i` ends on the first character
/// that cannot continue it (a closing bracket, comment, end of the text ...), blanks skipped.
[[nodiscard]] MacroValue evaluate_expression(std::string_view text, std::size_t& i, std::uint32_t line,
                                             VariableAccess& variables);

/// Reads the condition of IF or WHILE: "[a EQ b]" with EQ NE GT GE LT LE, comparisons in brackets joined by AND, OR,
/// XOR
/// ("[[a EQ b] AND [c GT d]]"). `i` stands on '[' and ends behind the matching ']'. The bracket of the condition itself
/// is not counted as a level of nesting (the manuals leave that open). Both sides are always evaluated.
[[nodiscard]] bool evaluate_condition(std::string_view text, std::size_t& i, std::uint32_t line,
                                      VariableAccess& variables);

}  // namespace shapegcode
