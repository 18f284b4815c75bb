#include <fmt/format.h>

#include <cmath>
#include <numbers>
#include <string>
#include <string_view>

#include "program/linuxcnc/expression.hpp"
#include "program/linuxcnc/parameter_table.hpp"
#include "program/linuxcnc/program_text.hpp"

namespace shapegcode::linuxcnc {
namespace {

// EQ, NE: values nearer to each other are equal; in later versions than 2.9.0~pre1 for LE and GE too.
constexpr double nearly_equal = 1e-4;
constexpr double degrees_per_rad = 180.0 / std::numbers::pi;

double radians(double degrees) {
  if (!std::isfinite(degrees)) refuse_too_large();
  return degrees * std::numbers::pi / 180.0;
}

/// A value that can be made whole; a zero has no sign then.
double measured(double value) {
  if (!std::isfinite(value)) refuse_too_large();
  return value + 0.0;
}

void require(bool holds, std::string_view name, double value, std::string_view must) {
  if (!holds && !std::isnan(value)) refuse(fmt::format("{} of {:g}: it must {}", name, value, must));
}

double exponential(double value) {
  const double result = std::exp(value);
  if (std::isinf(result) && std::isfinite(value)) refuse_too_large();
  return result;
}

double of_one(Operation operation, double value) {
  switch (operation) {
    case Operation::negate:
      return -value;
    case Operation::abs:
      return std::abs(value);
    case Operation::acos:
      require(std::abs(value) <= 1.0, "ACOS", value, "be -1 to 1");
      return std::acos(value) * degrees_per_rad;
    case Operation::asin:
      require(std::abs(value) <= 1.0, "ASIN", value, "be -1 to 1");
      return std::asin(value) * degrees_per_rad;
    case Operation::cos:
      return std::cos(radians(value));
    case Operation::exp:
      return exponential(value);
    case Operation::fix:
      return measured(std::floor(value));
    case Operation::fup:
      return measured(std::ceil(value));
    case Operation::ln:
      require(value > 0.0, "LN", value, "be positive");
      return std::log(value);
    case Operation::round:
      return measured(std::trunc(value + (value >= 0.0 ? 0.5 : -0.5)));
    case Operation::sin:
      return std::sin(radians(value));
    case Operation::sqrt:
      require(value >= 0.0, "SQRT", value, "not be negative");
      return std::sqrt(value);
    default:
      return std::tan(radians(value));
  }
}

double power(double a, double b) {
  if (a < 0.0 && !std::isfinite(b)) refuse_too_large();
  if ((a < 0.0 && b != std::floor(b)) || (a == 0.0 && b < 0.0)) {
    refuse(fmt::format("{:g} to the power of {:g} has no value", a, b));
  }
  const double result = std::pow(a, b);
  if (std::isinf(result) && std::isfinite(a) && std::isfinite(b)) refuse_too_large();
  return result;
}

double modulo(double a, double b) {
  if (b == 0.0) refuse("MOD by zero");
  if (std::isinf(a)) refuse_too_large();
  const double rest = std::fmod(a, b);
  return rest < 0.0 ? rest + std::abs(b) : rest;
}

double divided(double a, double b) {
  if (b == 0.0) refuse("division by zero");
  return a / b;
}

double of_two(Operation operation, double a, double b) {
  switch (operation) {
    case Operation::atan:
      return std::atan2(a, b) * degrees_per_rad;
    case Operation::power:
      return power(a, b);
    case Operation::multiply:
      return a * b;
    case Operation::divide:
      return divided(a, b);
    case Operation::modulo:
      return modulo(a, b);
    case Operation::add:
      return a + b;
    case Operation::subtract:
      return a - b;
    case Operation::equal:
      return std::abs(a - b) < nearly_equal ? 1.0 : 0.0;
    case Operation::not_equal:
      return std::abs(a - b) >= nearly_equal ? 1.0 : 0.0;
    case Operation::less:
      return a < b ? 1.0 : 0.0;
    case Operation::greater:
      return a > b ? 1.0 : 0.0;
    case Operation::less_equal:
      return a <= b ? 1.0 : 0.0;
    case Operation::greater_equal:
      return a >= b ? 1.0 : 0.0;
    case Operation::both:
      return a != 0.0 && b != 0.0 ? 1.0 : 0.0;
    case Operation::either:
      return a != 0.0 || b != 0.0 ? 1.0 : 0.0;
    default:
      return (a != 0.0) != (b != 0.0) ? 1.0 : 0.0;
  }
}

}  // namespace

void refuse_too_large() { refuse("a value is too large to be computed"); }

double Evaluator::operator()(const Value& value, const Code& code) {
  double result = value.number;
  if (!value.is_number()) {
    stack_.clear();
    for (std::uint32_t k = value.begin; k < value.end; ++k) run(code[k]);
    result = take();
  }
  if (!std::isfinite(result)) refuse_too_large();
  return result;
}

void Evaluator::run(const Step& step) {
  switch (step.operation) {
    case Operation::number:
      stack_.push_back(step.number);
      return;
    case Operation::numbered:
      stack_.push_back(parameters_.numbered(step.index));
      return;
    case Operation::numbered_by:
      stack_.push_back(parameters_.numbered(parameter_number(take())));
      return;
    case Operation::named:
      stack_.push_back(parameters_.named(static_cast<NameId>(step.index)));
      return;
    case Operation::exists:
      stack_.push_back(parameters_.exists(static_cast<NameId>(step.index)) ? 1.0 : 0.0);
      return;
    default:
      break;
  }
  if (step.operation < Operation::atan) {
    stack_.back() = of_one(step.operation, stack_.back());
    return;
  }
  const double second = take();
  stack_.back() = of_two(step.operation, stack_.back(), second);
}

}  // namespace shapegcode::linuxcnc
