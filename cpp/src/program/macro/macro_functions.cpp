#include <array>
#include <cmath>
#include <numbers>
#include <string>

#include "program/macro/macro_text.hpp"

namespace shapegcode::macro {
namespace {

constexpr double degrees_per_radian = 180.0 / std::numbers::pi;

struct NamedFunction {
  std::string_view name;
  Function function;
};

// ADP, PRM and the named variables #_... of later software are not among them: refused as unknown.
constexpr std::array<NamedFunction, 16> functions = {{{"SIN", Function::sine},
                                                      {"COS", Function::cosine},
                                                      {"TAN", Function::tangent},
                                                      {"ASIN", Function::arc_sine},
                                                      {"ACOS", Function::arc_cosine},
                                                      {"ATAN", Function::arc_tangent},
                                                      {"SQRT", Function::square_root},
                                                      {"ABS", Function::absolute},
                                                      {"ROUND", Function::round},
                                                      {"FIX", Function::fix},
                                                      {"FUP", Function::fup},
                                                      {"LN", Function::logarithm},
                                                      {"EXP", Function::exponential},
                                                      {"POW", Function::power},
                                                      {"BIN", Function::from_bcd},
                                                      {"BCD", Function::to_bcd}}};

struct SineCosine {
  double sine;
  double cosine;
};

// Reduced in degrees, so that multiples of 90 degrees give 0 and 1 exactly.
SineCosine sine_cosine(double degrees) noexcept {
  int quadrant = 0;
  const double rest = std::remquo(degrees, 90.0, &quadrant) / degrees_per_radian;
  const double s = std::sin(rest);
  const double c = std::cos(rest);
  switch (quadrant & 3) {
    case 0:
      return {s, c};
    case 1:
      return {c, -s};
    case 2:
      return {-s, -c};
    default:
      return {-c, s};
  }
}

[[noreturn]] void out_of_range(const std::string& what, double value, const std::string& limit, TextPosition at) {
  fail(119, what + " of " + shown(value) + ", which must be " + limit, at.line, at.index);
}

std::int32_t to_bits(double value, TextPosition at) {
  const double whole = std::round(value);
  if (!(std::abs(whole) <= 2147483647.0)) {
    out_of_range("logical operation", value, "within +-2147483647", at);
  }
  return static_cast<std::int32_t>(whole);
}

// Eight decimal digits, four bits each.
double bcd_to_number(double value, TextPosition at) {
  const double whole = std::round(value);
  if (!(whole >= 0.0 && whole <= 4294967295.0)) {
    out_of_range("BIN", value, "0 ... 99999999 in binary coded decimals", at);
  }
  auto bits = static_cast<std::uint32_t>(whole);
  double number = 0.0;
  for (double unit = 1.0; bits != 0; unit *= 10.0, bits >>= 4) {
    if ((bits & 15U) > 9U) {
      out_of_range("BIN", value, "made of binary coded decimals 0 ... 9", at);
    }
    number += unit * (bits & 15U);
  }
  return number;
}

double number_to_bcd(double value, TextPosition at) {
  const double whole = std::round(value);
  if (!(whole >= 0.0 && whole <= 99999999.0)) {
    out_of_range("BCD", value, "0 ... 99999999", at);
  }
  auto rest = static_cast<std::uint32_t>(whole);
  double bcd = 0.0;
  for (double unit = 1.0; rest != 0; unit *= 16.0, rest /= 10) {
    bcd += unit * (rest % 10);
  }
  return bcd;
}

double arc_sine_or_cosine(Function function, double x, bool signed_angles, TextPosition at) {
  const bool is_sine = function == Function::arc_sine;
  if (!(x >= -1.0 && x <= 1.0)) {
    out_of_range(is_sine ? "ASIN" : "ACOS", x, "within -1 ... 1", at);
  }
  if (!is_sine) {
    return std::acos(x) * degrees_per_radian;
  }
  const double angle = std::asin(x) * degrees_per_radian;
  return angle < 0.0 && !signed_angles ? angle + 360.0 : angle;
}

double round_to(double x, int decimals) noexcept {
  const double unit = std::pow(10.0, decimals);
  const double scaled = x * unit;
  return std::isfinite(scaled) ? std::round(scaled) / unit : x;
}

}  // namespace

bool find_function(std::string_view run, Function& function) noexcept {
  for (const NamedFunction& candidate : functions) {
    if (abbreviates(run, candidate.name) && (candidate.function != Function::power || run.size() == 3)) {
      function = candidate.function;
      return true;
    }
  }
  return false;
}

double finite(double value, TextPosition at) {
  if (!std::isfinite(value)) {
    fail(111, "the result is too large to hold", at.line, at.index);
  }
  return value;
}

double arc_tangent(double y, double x, bool signed_angles, TextPosition at) {
  if (x == 0.0 && y == 0.0) {
    fail(112, "ATAN[0]/[0] has no direction", at.line, at.index);
  }
  const double angle = std::atan2(y, x) * degrees_per_radian;
  return angle < 0.0 && !signed_angles ? angle + 360.0 : angle;
}

double power(double x, double y, TextPosition at) {
  if (x == 0.0 && y < 0.0) {
    fail(112, "POW of 0 to the negative power " + shown(y) + " divides by zero", at.line, at.index);
  }
  if (x < 0.0 && y != std::floor(y)) {
    out_of_range("POW to the power " + shown(y), x, "0 or more", at);
  }
  return finite(std::pow(x, y), at);
}

double apply(Function function, double x, int round_decimals, bool signed_angles, TextPosition at) {
  switch (function) {
    case Function::sine:
      return sine_cosine(x).sine;
    case Function::cosine:
      return sine_cosine(x).cosine;
    case Function::tangent: {
      const SineCosine sc = sine_cosine(x);
      if (sc.cosine == 0.0) {
        fail(112, "TAN of " + shown(x) + " degrees divides by zero", at.line, at.index);
      }
      return sc.sine / sc.cosine;
    }
    case Function::arc_sine:
    case Function::arc_cosine:
      return arc_sine_or_cosine(function, x, signed_angles, at);
    case Function::arc_tangent:
      return std::atan(x) * degrees_per_radian;
    case Function::square_root:
      if (x < 0.0) {
        out_of_range("SQRT", x, "0 or more", at);
      }
      return std::sqrt(x);
    case Function::absolute:
      return std::abs(x);
    case Function::round:
      return round_to(x, round_decimals);
    case Function::fix:
      return std::trunc(x);
    case Function::fup:
      return x < 0.0 ? std::floor(x) : std::ceil(x);
    case Function::logarithm:
      if (!(x > 0.0)) {
        out_of_range("LN", x, "more than 0", at);
      }
      return std::log(x);
    case Function::exponential:
      return finite(std::exp(x), at);
    case Function::from_bcd:
      return bcd_to_number(x, at);
    case Function::to_bcd:
      return number_to_bcd(x, at);
    case Function::power:
      break;
  }
  fail(114, "POW takes two arguments: POW[base,exponent]", at.line, at.index);
}

double combine(Operator op, double a, double b, TextPosition at) {
  switch (op) {
    case Operator::multiply:
      return finite(a * b, at);
    case Operator::divide:
      if (b == 0.0) {
        fail(112, "division of " + shown(a) + " by zero", at.line, at.index);
      }
      return finite(a / b, at);
    case Operator::modulo: {
      const double divisor = std::round(b);
      if (divisor == 0.0) {
        fail(112, shown(a) + " MOD " + shown(b) + " divides by zero", at.line, at.index);
      }
      return std::fmod(std::round(a), divisor);
    }
    case Operator::bit_and:
      return to_bits(a, at) & to_bits(b, at);
    case Operator::bit_or:
      return to_bits(a, at) | to_bits(b, at);
    case Operator::bit_xor:
      return to_bits(a, at) ^ to_bits(b, at);
    case Operator::add:
      return finite(a + b, at);
    case Operator::subtract:
      return finite(a - b, at);
    default:
      fail(114, "a comparison is no number", at.line, at.index);
  }
}

bool compare(Operator op, MacroValue a, MacroValue b) noexcept {
  const double x = a.value_or(0.0);
  const double y = b.value_or(0.0);
  const bool same = a.has_value() == b.has_value() && x == y;
  switch (op) {
    case Operator::equal:
      return same;
    case Operator::not_equal:
      return !same;
    case Operator::greater:
      return x > y;
    case Operator::greater_equal:
      return x >= y;
    case Operator::less:
      return x < y;
    default:
      return x <= y;
  }
}

}  // namespace shapegcode::macro
