#include "program/macro/macro_expression.hpp"

#include <fmt/format.h>

#include <array>
#include <cmath>
#include <string>

#include "program/macro/macro_text.hpp"
#include "program/text/number_scan.hpp"

namespace shapegcode {
namespace macro {

namespace {

constexpr int max_brackets = 5;               // alarm 118
constexpr unsigned max_constant_digits = 12;  // 30i and 0i-D; older controls take 8
constexpr int max_variable_number = 999999;

struct Value {
  MacroValue number;
  bool is_condition = false;
  bool truth = false;
};

struct NamedOperator {
  std::string_view name;
  Operator op;
};

constexpr std::array<NamedOperator, 10> word_operators = {{{"MOD", Operator::modulo},
                                                           {"AND", Operator::bit_and},
                                                           {"OR", Operator::bit_or},
                                                           {"XOR", Operator::bit_xor},
                                                           {"EQ", Operator::equal},
                                                           {"NE", Operator::not_equal},
                                                           {"GT", Operator::greater},
                                                           {"GE", Operator::greater_equal},
                                                           {"LT", Operator::less},
                                                           {"LE", Operator::less_equal}}};

enum class Rank : std::uint8_t { none, comparison, sum, product };

Rank rank_of(Operator op) noexcept {
  switch (op) {
    case Operator::none:
      return Rank::none;
    case Operator::multiply:
    case Operator::divide:
    case Operator::modulo:
    case Operator::bit_and:
      return Rank::product;
    case Operator::add:
    case Operator::subtract:
    case Operator::bit_or:
    case Operator::bit_xor:
      return Rank::sum;
    default:
      return Rank::comparison;
  }
}

// Recursive descent over the ranks; what bounds the recursion is the number of open brackets.
class Parser {
 public:
  Parser(std::string_view text, std::size_t& i, std::uint32_t line, VariableAccess& variables, int round_decimals = 0)
      : text_(text), i_(i), line_(line), variables_(variables), round_decimals_(round_decimals) {}

  Value comparison() {
    Value left = sum();
    const std::size_t at = i_;
    const Operator op = read_operator(Rank::comparison);
    if (op == Operator::none) {
      return left;
    }
    const Value right = sum();
    const MacroValue a = number_of(left, at);
    const MacroValue b = number_of(right, at);
    std::size_t next = i_;
    if (read_operator(Rank::comparison) != Operator::none) {
      fail(114, "second comparison in one bracket: each comparison needs brackets of its own", line_, next);
    }
    return {std::nullopt, true, compare(op, a, b)};
  }

  MacroValue number_of(const Value& value, std::size_t at) const {
    if (value.is_condition) {
      fail(114, "a comparison stands where a number is expected", line_, at);
    }
    return value.number;
  }

  // A sign makes <vacant> a 0, unless it belongs to an address ("X-#1").
  Value operand(bool sign_keeps_vacant) {
    skip();
    const std::size_t start = i_;
    bool signed_term = false;
    bool negative = false;
    if (i_ < text_.size() && (text_[i_] == '-' || text_[i_] == '+')) {
      signed_term = true;
      negative = text_[i_] == '-';
      ++i_;
      skip();
    }
    Value value = unsigned_operand();
    if (!signed_term) {
      return value;
    }
    MacroValue number = number_of(value, start);
    if (!number.has_value() && !sign_keeps_vacant) {
      number = 0.0;
    }
    if (number.has_value() && negative) {
      number = 0.0 - *number;
    }
    return {number};
  }

  int number_of_variable() {
    const std::size_t start = i_;
    ++i_;
    skip();
    if (i_ < text_.size() && text_[i_] == '[') {
      const std::size_t at = i_;
      const MacroValue number = number_of(bracket(), at);
      const double whole = std::round(number.value_or(-1.0));
      if (!(whole >= 0.0 && whole <= max_variable_number)) {
        fail(115, "there is no variable of number " + (number.has_value() ? shown(*number) : "<vacant>"), line_, start);
      }
      return static_cast<int>(whole);
    }
    if (i_ < text_.size() && text_[i_] == '-') {
      fail(115, "negative variable number", line_, start);
    }
    if (i_ >= text_.size() || !is_digit(text_[i_])) {
      fail(114, "'#' is followed by " + name_at(text_, i_) + ": a number or '[' is expected", line_, start);
    }
    const std::int64_t number = scan_whole(text_, i_);
    if (number > max_variable_number) {
      fail(115, fmt::format("variable number above {}", max_variable_number), line_, start);
    }
    return static_cast<int>(number);
  }

  // i stands on '['; the level is not counted for the bracket of a condition.
  Value bracket(bool counts = true) {
    const std::size_t open = i_;
    enter(counts);
    const Value value = comparison();
    leave(open, counts);
    return value;
  }

 private:
  void skip() noexcept { skip_blanks(text_, i_); }

  void enter(bool counts) {
    if (counts && ++depth_ > max_brackets) {
      fail(118, fmt::format("more than {} levels of brackets", max_brackets), line_, i_);
    }
    ++i_;
  }

  void leave(std::size_t open, bool counts) {
    skip();
    if (i_ >= text_.size()) {
      fail(114, "'[' without ']'", line_, open);
    }
    if (text_[i_] != ']') {
      fail(114, "operator or ']' expected, " + name_at(text_, i_) + " found" + hint(), line_, i_);
    }
    depth_ -= counts ? 1 : 0;
    ++i_;
  }

  [[nodiscard]] std::string hint() const {
    switch (upper(text_[i_])) {
      case '(':
        return " (parentheses hold comments; brackets are '[' and ']')";
      case '<':
      case '>':
      case '=':
        return " (comparisons are EQ NE GT GE LT LE)";
      default:
        return {};
    }
  }

  Operator peek_operator(std::size_t& length) const noexcept {
    length = 1;
    if (i_ >= text_.size()) {
      return Operator::none;
    }
    switch (text_[i_]) {
      case '*':
        return Operator::multiply;
      case '/':
        return Operator::divide;
      case '+':
        return Operator::add;
      case '-':
        return Operator::subtract;
      default:
        break;
    }
    for (const NamedOperator& candidate : word_operators) {
      length = candidate.name.size();
      if (text_.size() - i_ >= length && abbreviates(text_.substr(i_, length), candidate.name)) {
        return candidate.op;
      }
    }
    return Operator::none;
  }

  // Takes the operator if it is of that rank.
  Operator read_operator(Rank rank) noexcept {
    skip();
    std::size_t length = 0;
    const Operator op = peek_operator(length);
    if (op == Operator::none || rank_of(op) != rank) {
      return Operator::none;
    }
    i_ += length;
    return op;
  }

  Value join(const Value& left, Operator op, const Value& right, std::size_t at) const {
    const bool joins_conditions = op == Operator::bit_and || op == Operator::bit_or || op == Operator::bit_xor;
    if (joins_conditions && left.is_condition && right.is_condition) {
      const bool truth = op == Operator::bit_and  ? left.truth && right.truth
                         : op == Operator::bit_or ? left.truth || right.truth
                                                  : left.truth != right.truth;
      return {std::nullopt, true, truth};
    }
    const double a = number_of(left, at).value_or(0.0);
    const double b = number_of(right, at).value_or(0.0);
    return {combine(op, a, b, {line_, at})};
  }

  Value product() {
    Value left = operand(false);
    for (;;) {
      skip();
      const std::size_t at = i_;
      const Operator op = read_operator(Rank::product);
      if (op == Operator::none) {
        return left;
      }
      left = join(left, op, operand(false), at);
    }
  }

  Value sum() {
    Value left = product();
    for (;;) {
      skip();
      const std::size_t at = i_;
      const Operator op = read_operator(Rank::sum);
      if (op == Operator::none) {
        return left;
      }
      left = join(left, op, product(), at);
    }
  }

  Value unsigned_operand() {
    if (i_ >= text_.size()) {
      fail(114, "the block ends where a value is expected", line_, i_);
    }
    const char c = text_[i_];
    if (c == '#') {
      const std::size_t start = i_;
      const int number = number_of_variable();
      return {variables_.read(number, line_, column_of(start))};
    }
    if (c == '[') {
      return bracket();
    }
    if (is_digit(c) || c == '.') {
      return {constant()};
    }
    if (is_letter(c)) {
      return function();
    }
    fail(114, "value expected, " + name_at(text_, i_) + " found" + hint(), line_, i_);
  }

  double constant() {
    const std::size_t start = i_;
    const double value = scan_constant(text_, i_, line_, max_constant_digits).value;
    if (i_ + 1 < text_.size() && upper(text_[i_]) == 'E' &&
        (is_digit(text_[i_ + 1]) || text_[i_ + 1] == '+' || text_[i_ + 1] == '-')) {
      fail(114, "numbers have no exponent here", line_, start);
    }
    return value;
  }

  Value function() {
    const TextPosition at{line_, i_};
    const std::string_view run = letters_at(text_, i_);
    Function function{};
    if (!find_function(run, function)) {
      fail(114, "'" + std::string(run.substr(0, 20)) + "' is no function", line_, i_);
    }
    i_ += run.size();
    skip();
    if (i_ >= text_.size() || text_[i_] != '[') {
      fail(114, "'[' expected behind " + std::string(run) + ", " + name_at(text_, i_) + " found", line_, i_);
    }
    const bool takes_two = function == Function::arc_tangent || function == Function::power;
    const std::size_t open = i_;
    enter(true);
    const double first = number_of(comparison(), open).value_or(0.0);
    skip();
    if (takes_two && i_ < text_.size() && text_[i_] == ',') {
      ++i_;
      const double second = number_of(comparison(), open).value_or(0.0);
      leave(open, true);
      return {function == Function::power ? power(first, second, at)
                                          : arc_tangent(first, second, variables_.signed_angles(), at)};
    }
    leave(open, true);
    if (function == Function::arc_tangent) {
      // "ATAN[y]/[x]" is one function; "ATAN[y]/2" divides.
      std::size_t next = i_;
      skip_blanks(text_, next);
      if (next < text_.size() && text_[next] == '/') {
        ++next;
        skip_blanks(text_, next);
        if (next < text_.size() && text_[next] == '[') {
          i_ = next;
          const double second = number_of(bracket(), next).value_or(0.0);
          return {arc_tangent(first, second, variables_.signed_angles(), at)};
        }
      }
    }
    return {apply(function, first, round_decimals_, variables_.signed_angles(), at)};
  }

  std::string_view text_;
  std::size_t& i_;
  std::uint32_t line_;
  VariableAccess& variables_;
  int round_decimals_;
  int depth_ = 0;
};

}  // namespace

int variable_number(std::string_view text, std::size_t& i, std::uint32_t line, VariableAccess& variables) {
  return Parser(text, i, line, variables).number_of_variable();
}

MacroValue evaluate_operand(std::string_view text, std::size_t& i, std::uint32_t line, VariableAccess& variables,
                            int round_decimals) {
  const std::size_t start = i;
  Parser parser(text, i, line, variables, round_decimals);
  return parser.number_of(parser.operand(true), start);
}

}  // namespace macro

MacroValue evaluate_term(std::string_view text, std::size_t& i, std::uint32_t line, VariableAccess& variables) {
  return macro::evaluate_operand(text, i, line, variables, 0);
}

MacroValue evaluate_expression(std::string_view text, std::size_t& i, std::uint32_t line, VariableAccess& variables) {
  const std::size_t start = i;
  macro::Parser parser(text, i, line, variables);
  return parser.number_of(parser.comparison(), start);
}

bool evaluate_condition(std::string_view text, std::size_t& i, std::uint32_t line, VariableAccess& variables) {
  const std::size_t start = i;
  if (i >= text.size() || text[i] != '[') {
    macro::fail(114, "condition in brackets expected, " + macro::name_at(text, i) + " found", line, i);
  }
  macro::Parser parser(text, i, line, variables);
  const macro::Value value = parser.bracket(false);
  if (!value.is_condition) {
    macro::fail(114, "condition without comparison (EQ NE GT GE LT LE)", line, start);
  }
  return value.truth;
}

}  // namespace shapegcode
