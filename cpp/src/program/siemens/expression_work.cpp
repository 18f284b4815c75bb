// What operators and functions of expressions do. Angles are in degrees.
#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <string>

#include "program/siemens/expression.hpp"

namespace shapegcode::siemens {
namespace {

constexpr double to_degrees = 180.0 / std::numbers::pi;

constexpr std::array<FunctionName, 17> functions = {{{"SIN", Function::sin, 1},
                                                     {"COS", Function::cos, 1},
                                                     {"TAN", Function::tan, 1},
                                                     {"ASIN", Function::asin, 1},
                                                     {"ACOS", Function::acos, 1},
                                                     {"ATAN2", Function::atan2, 2},
                                                     {"SQRT", Function::sqrt, 1},
                                                     {"POT", Function::pot, 1},
                                                     {"ABS", Function::abs, 1},
                                                     {"TRUNC", Function::trunc, 1},
                                                     {"ROUND", Function::round, 1},
                                                     {"ROUNDUP", Function::roundup, 1},
                                                     {"LN", Function::ln, 1},
                                                     {"EXP", Function::exp, 1},
                                                     {"MINVAL", Function::minval, 2},
                                                     {"MAXVAL", Function::maxval, 2},
                                                     {"BOUND", Function::bound, 3}}};  // of ATAN2(30.5, 80.1): 20.8455

std::string_view sign_of(Operation operation) {
  constexpr std::array<std::string_view, 19> signs = {"==", "<>",  ">",   "<",    ">=",    "<=",    "<<",
                                                      "OR", "XOR", "AND", "B_OR", "B_XOR", "B_AND", "+",
                                                      "-",  "*",   "/",   "DIV",  "MOD"};
  return signs[static_cast<std::size_t>(operation) - static_cast<std::size_t>(Operation::equal)];
}

bool is_greater(const Value& a, const Value& b) { return a.is_text() ? a.text > b.text : a.number > b.number; }

double divided(const Value& a, const Value& b, std::uint32_t column) {
  const double divisor = number(b, column);
  if (divisor == 0.0) throw error_at(column, "division by 0: the divisor must be another number");
  return number(a, column) / divisor;
}

Value calculated(Operation operation, const Value& a, const Value& b, std::uint32_t column) {
  const double left = number(a, column);
  const double right = number(b, column);
  const double result = operation == Operation::sum          ? left + right
                        : operation == Operation::difference ? left - right
                                                             : left * right;
  return a.kind == Kind::real || b.kind == Kind::real ? real_value(result) : whole_value(result);
}

Value of_bits(Operation operation, const Value& a, const Value& b, std::uint32_t column) {
  const std::int64_t left = whole(a, sign_of(operation), column);
  const std::int64_t right = whole(b, sign_of(operation), column);
  if (operation == Operation::remainder) {
    if (left < 0 || right <= 0) {
      throw error_at(column,
                     fmt::format("{} MOD {}: the first must be 0 or more and the second more than 0", left, right));
    }
    return whole_value(static_cast<double>(left % right));
  }
  const std::int64_t result = operation == Operation::bit_or    ? left | right
                              : operation == Operation::bit_and ? left & right
                                                                : left ^ right;
  return whole_value(static_cast<double>(result));
}

Value compared(Operation operation, const Value& a, const Value& b) {
  const bool equal = is_equal(a, b);
  switch (operation) {
    case Operation::equal:
      return truth(equal);
    case Operation::unequal:
      return truth(!equal);
    case Operation::at_least:
      return truth(equal || is_greater(a, b));
    case Operation::at_most:
      return truth(equal || is_greater(b, a));
    case Operation::greater:
      return truth(!equal && is_greater(a, b));
    default:
      return truth(!equal && is_greater(b, a));
  }
}

[[noreturn]] void refuse_values(Function function, std::span<const Value> given, std::uint32_t column) {
  std::string values;
  for (const Value& each : given) values += fmt::format("{}{:g}", values.empty() ? "" : ", ", each.number);
  const std::string_view name = name_of(function);
  throw error_at(column,
                 fmt::format("{}({}) is not a number: the value is outside the domain of {}", name, values, name));
}

/// Of functions whose value is real; what is none is not finite.
double real_function(Function function, double a, double b) {
  switch (function) {
    case Function::sin:
      return std::sin(a * to_radians);
    case Function::cos:
      return std::cos(a * to_radians);
    case Function::tan:
      return std::tan(a * to_radians);
    case Function::asin:
      return std::asin(a) * to_degrees;
    case Function::acos:
      return std::acos(a) * to_degrees;
    case Function::atan2:
      return std::atan2(a, b) * to_degrees;
    case Function::sqrt:
      return std::sqrt(a);
    case Function::ln:
      return std::log(a);
    default:
      return std::exp(a);
  }
}

}  // namespace

std::optional<FunctionName> function_of(std::string_view name) {
  const auto* found = std::ranges::find(functions, name, &FunctionName::name);
  return found == functions.end() ? std::nullopt : std::optional(*found);
}

std::string_view name_of(Function function) { return functions[static_cast<std::size_t>(function)].name; }

Value work(Operation operation, const Value& a, const Value& b, std::uint32_t column) {
  if (a.is_text() != b.is_text() && operation != Operation::join) {
    throw error_at(column, fmt::format("{} of a number and a string: both must be of one kind", sign_of(operation)));
  }
  switch (operation) {
    case Operation::join:
      return text_value(shown(a) + shown(b));
    case Operation::either:
      return truth(is_true(a) || is_true(b));
    case Operation::exclusive:
      return truth(is_true(a) != is_true(b));
    case Operation::both:
      return truth(is_true(a) && is_true(b));
    case Operation::bit_or:
    case Operation::bit_xor:
    case Operation::bit_and:
    case Operation::remainder:
      return of_bits(operation, a, b, column);
    case Operation::sum:
    case Operation::difference:
    case Operation::product:
      return calculated(operation, a, b, column);
    case Operation::quotient:
      return real_value(divided(a, b, column));
    case Operation::whole_quotient:
      return whole_value(std::trunc(number(real_value(divided(a, b, column)), column)));
    default:
      return compared(operation, a, b);
  }
}

Value work(Function function, std::span<const Value> given, std::uint32_t column) {
  const Value& a = given[0];
  switch (function) {
    case Function::pot:
      return {.kind = a.kind, .number = a.number * a.number, .text = {}};
    case Function::abs:
      return {.kind = a.kind, .number = std::abs(a.number), .text = {}};
    case Function::trunc:
      return whole_value(std::trunc(a.number));
    case Function::round:
      return whole_value(rounded(a.number, column));
    case Function::roundup:
      return whole_value(std::ceil(a.number));
    case Function::minval:
      return given[1].number < a.number ? given[1] : a;
    case Function::maxval:
      return given[1].number > a.number ? given[1] : a;
    case Function::bound: {
      if (a.number > given[1].number) refuse_values(function, given, column);
      const Value& least = a.number > given[2].number ? a : given[2];
      return given[1].number < least.number ? given[1] : least;
    }
    default:
      break;
  }
  const double value = real_function(function, a.number, given.size() > 1 ? given[1].number : 0.0);
  if (!std::isfinite(value)) refuse_values(function, given, column);
  return real_value(value);
}

}  // namespace shapegcode::siemens
