#include "program/siemens/value.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <charconv>
#include <cmath>
#include <cstdlib>
#include <limits>
#include <string>
#include <system_error>

namespace shapegcode::siemens {
namespace {

constexpr double relative = 1e-12;
constexpr double most_whole = 9e18;

}  // namespace

Error error_at(std::uint32_t column, const std::string& message) { return {ErrorKind::program, message, 0, column}; }

Error too_large() { return {ErrorKind::program, "a value is too large to be computed"}; }

Error too_deep() { return error_at(1, "the values of this block are nested too deep to be worked out"); }

double number_of(std::string_view digits) {
  if (digits.starts_with('+')) digits.remove_prefix(1);
  double value = 0.0;
  if (std::from_chars(digits.data(), digits.data() + digits.size(), value).ec == std::errc::result_out_of_range) {
    value = std::strtod(std::string(digits).c_str(), nullptr);  // infinite, or next to nothing
  }
  return value;
}

double rounded_to(double value, int decimals) {
  return std::isfinite(value) ? number_of(fmt::format("{:.{}f}", value, decimals)) : value;
}

std::string shown(const Value& value) {
  if (value.is_text()) return value.text;
  if (value.kind == Kind::boolean) return value.number != 0.0 ? "True" : "False";
  if (value.kind == Kind::whole) return fmt::format("{:.0f}", value.number);
  std::string text = fmt::format("{}", value.number);
  return text.find_first_not_of("-0123456789") == std::string::npos ? text + ".0" : text;
}

bool is_true(const Value& value) { return value.is_text() ? !value.text.empty() : value.number != 0.0; }

bool is_equal(const Value& a, const Value& b) {
  if (a.is_text() || b.is_text()) return a.is_text() && b.is_text() && a.text == b.text;
  return std::abs(a.number - b.number) <= relative * std::max(std::abs(a.number), std::abs(b.number));
}

double number(const Value& value, std::uint32_t column) {
  if (value.is_text()) throw error_at(column, fmt::format("\"{}\" where a number is expected", value.text));
  if (!std::isfinite(value.number)) {
    if (value.kind == Kind::whole) throw too_large();
    throw error_at(column, "a value is too large to be computed");
  }
  return value.number;
}

std::int64_t whole(const Value& value, std::string_view what, std::uint32_t column) {
  const double given = number(value, column);
  if (given != std::trunc(given)) {
    throw error_at(column, fmt::format("{} of {:g}: it must be a whole number", what, given));
  }
  if (std::abs(given) > most_whole) throw too_large();
  return static_cast<std::int64_t>(given);
}

double rounded(double value, std::uint32_t column) {
  if (value < 0.0 && value - std::floor(value) == 0.5) {
    throw error_at(column, fmt::format("{:g} lies between two whole numbers: to which one the control rounds it is not "
                                       "known",
                                       value));
  }
  return std::floor(value + 0.5);
}

Value convert(const Value& value, Kind kind, std::uint32_t column) {
  if (kind == Kind::text) {
    if (!value.is_text()) throw error_at(column, fmt::format("{} where a string is expected", shown(value)));
    return value;
  }
  const double given = number(value, column);
  if (kind == Kind::boolean) return truth(given != 0.0);
  return kind == Kind::whole ? whole_value(rounded(given, column)) : real_value(given);
}

}  // namespace shapegcode::siemens
