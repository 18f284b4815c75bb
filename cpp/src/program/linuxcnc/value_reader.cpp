// Precedence and functions: LinuxCNC's G-code overview, "Binary operators" and "Functions"; its interpreter rs274
// confirms them (tests/python/test_input_linuxcnc.py).
#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <string>

#include "program/linuxcnc/expression.hpp"
#include "program/linuxcnc/program_text.hpp"
#include "program/text/characters.hpp"

namespace shapegcode::linuxcnc {
namespace {

constexpr int max_depth = 1000;  // brackets and signs within each other; a line of LinuxCNC has 255 characters

struct NamedFunction {
  std::string_view name;
  Operation operation;
};

constexpr std::array<NamedFunction, 14> functions = {{
    {"abs", Operation::abs},
    {"acos", Operation::acos},
    {"asin", Operation::asin},
    {"atan", Operation::atan},
    {"cos", Operation::cos},
    {"exists", Operation::exists},
    {"exp", Operation::exp},
    {"fix", Operation::fix},
    {"fup", Operation::fup},
    {"ln", Operation::ln},
    {"round", Operation::round},
    {"sin", Operation::sin},
    {"sqrt", Operation::sqrt},
    {"tan", Operation::tan},
}};

constexpr std::array<std::pair<std::string_view, BinaryOperator>, 15> operators = {{
    {"**", {Operation::power, 2, 6}},
    {"*", {Operation::multiply, 1, 5}},
    {"/", {Operation::divide, 1, 5}},
    {"+", {Operation::add, 1, 4}},
    {"-", {Operation::subtract, 1, 4}},
    {"mod", {Operation::modulo, 3, 5}},
    {"eq", {Operation::equal, 2, 3}},
    {"ne", {Operation::not_equal, 2, 3}},
    {"lt", {Operation::less, 2, 3}},
    {"gt", {Operation::greater, 2, 3}},
    {"le", {Operation::less_equal, 2, 3}},
    {"ge", {Operation::greater_equal, 2, 3}},
    {"and", {Operation::both, 3, 2}},
    {"or", {Operation::either, 2, 2}},
    {"xor", {Operation::one_of_both, 3, 2}},
}};

/// The number at text[at], with its sign.
std::optional<double> scan_literal(std::string_view text, std::size_t& at) {
  std::size_t i = at;
  const bool has_sign = i < text.size() && (text[i] == '+' || text[i] == '-');
  i += has_sign ? 1 : 0;
  const auto is_digit_at = [&](std::size_t k) { return k < text.size() && is_digit(text[k]); };
  const bool has_point_first = i < text.size() && text[i] == '.';
  if (!is_digit_at(i) && !(has_point_first && is_digit_at(i + 1))) return std::nullopt;
  const double value = scan_unsigned(text, i);
  const bool is_negative = text[at] == '-';
  at = i;
  return is_negative ? -value : value;
}

}  // namespace

std::int64_t parameter_number(double value) {
  constexpr double nearly = 1e-4;
  if (!std::isfinite(value)) refuse_too_large();
  if (std::abs(value - std::nearbyint(value)) > nearly) {
    refuse(fmt::format("parameter number {:g} is not whole", value));
  }
  return rounded(value);
}

bool ValueReader::take(std::string_view sign) noexcept {
  if (!left().starts_with(sign)) return false;
  at_ += sign.size();
  return true;
}

std::optional<NameId> ValueReader::take_name() {
  if (!left().starts_with("#<")) return std::nullopt;
  const std::size_t end = text_.find('>', at_ + 2);
  if (end == text_.npos) return std::nullopt;
  const NameId name = names_.id(text_.substr(at_ + 2, end - at_ - 2));
  at_ = end + 1;
  return name;
}

Value ValueReader::value() {
  const auto begin = static_cast<std::uint32_t>(code_.size());
  const std::optional<double> number = operand();
  return {.number = number.value_or(0.0), .begin = begin, .end = static_cast<std::uint32_t>(code_.size())};
}

Setting ValueReader::setting() {
  Setting setting;
  setting.name = take_name();
  if (!setting.name) {
    ++at_;
    setting.parameter = value();
  }
  if (!take("=")) refuse(fmt::format("= is expected at {}", quoted_begin(left())));
  setting.value = value();
  return setting;
}

std::optional<double> ValueReader::operand() {
  if (const std::optional<double> number = scan_literal(text_, at_)) return number;
  if (++depth_ > max_depth) refuse("the values of this line are nested too deep to be worked out");
  std::optional<double> number;
  if (take("-")) {
    append_operand();
    append(Operation::negate);
  } else if (take("+")) {
    number = operand();
  } else if (take("[")) {
    append_expression();
  } else if (!is_done() && front() == '#') {
    append_parameter();
  } else if (!append_function()) {
    refuse(is_done() ? "a value is missing at the end" : "a value is expected at " + quoted_begin(left()));
  }
  --depth_;
  return number;
}

void ValueReader::append_operand() {
  if (const std::optional<double> number = operand()) append(Operation::number, 0, *number);
}

void ValueReader::append_parameter() {
  if (const std::optional<NameId> name = take_name()) {
    append(Operation::named, *name);
    return;
  }
  ++at_;
  if (const std::optional<double> number = operand()) {
    append(Operation::numbered, parameter_number(*number));
  } else {
    append(Operation::numbered_by);
  }
}

bool ValueReader::append_function() {
  const std::string_view rest = left();
  const std::string_view name = rest.substr(0, rest.find('['));
  const auto* const found = std::ranges::find(functions, name, &NamedFunction::name);
  if (found == functions.end() || name.size() == rest.size()) return false;
  at_ += name.size() + 1;
  if (found->operation == Operation::exists) {
    append_exists();
    return true;
  }
  append_expression();
  if (found->operation == Operation::atan) {
    if (!take("/[")) refuse("ATAN takes two values: ATAN[y]/[x]");
    append_expression();
  }
  append(found->operation);
  return true;
}

void ValueReader::append_exists() {
  const std::optional<NameId> name = take_name();
  if (!name || !take("]")) refuse("EXISTS takes a named parameter: EXISTS[#<name>]");
  append(Operation::exists, *name);
}

void ValueReader::append_expression() {
  append_operation(0);
  if (!take("]")) refuse("an operator or ] is expected at " + quoted_begin(left()));
}

void ValueReader::append_operation(int above) {
  append_operand();
  for (auto found = operator_here(); found && found->rank > above; found = operator_here()) {
    at_ += found->length;
    append_operation(found->rank);
    append(found->operation);
  }
}

std::optional<BinaryOperator> ValueReader::operator_here() const noexcept {
  const std::string_view rest = left();
  if (rest.empty() || rest.front() == ']') return std::nullopt;
  for (const auto& [sign, what] : operators) {
    if (rest.starts_with(sign)) return what;
  }
  return std::nullopt;
}

}  // namespace shapegcode::linuxcnc
