#pragma once

#include <cstdint>
#include <numbers>
#include <string>
#include <string_view>

#include "shapegcode/error.hpp"

// Values of SINUMERIK programs. Comparisons with a relative tolerance of 1e-12: easymanua.ls 1572233 p. 37; conversions
// between types: 662833 p. 54. An Error of a word has its column and line 0, until who executes the block adds the
// line; one without a column says that a value is too large.
namespace shapegcode::siemens {

enum class Kind : std::uint8_t { real, whole, boolean, text };  // REAL, INT, BOOL, STRING

struct Value {
  Kind kind = Kind::real;
  double number = 0.0;  // a whole number is exact below 2^53
  std::string text;

  [[nodiscard]] bool is_text() const { return kind == Kind::text; }
};

[[nodiscard]] inline Value real_value(double number) { return {.kind = Kind::real, .number = number, .text = {}}; }
/// Never -0.
[[nodiscard]] inline Value whole_value(double number) {
  return {.kind = Kind::whole, .number = number + 0.0, .text = {}};
}
[[nodiscard]] inline Value truth(bool is) { return {.kind = Kind::boolean, .number = is ? 1.0 : 0.0, .text = {}}; }
[[nodiscard]] inline Value text_value(std::string_view text) {
  return {.kind = Kind::text, .number = 0.0, .text = std::string(text)};
}

[[nodiscard]] Error error_at(std::uint32_t column, const std::string& message);
[[nodiscard]] Error too_large();
[[nodiscard]] Error too_deep();

inline constexpr double to_radians = std::numbers::pi / 180.0;  // of degrees

/// Digits with an exponent behind `e`; what is too large is infinite.
[[nodiscard]] double number_of(std::string_view digits);

/// Rounded to decimals, as its text with that many reads.
[[nodiscard]] double rounded_to(double value, int decimals);

/// As a string holds it.
[[nodiscard]] std::string shown(const Value& value);

[[nodiscard]] bool is_true(const Value& value);
[[nodiscard]] bool is_equal(const Value& a, const Value& b);

/// A value as a number; a string is none.
[[nodiscard]] double number(const Value& value, std::uint32_t column);

/// A value as a whole number; `what` it is.
[[nodiscard]] std::int64_t whole(const Value& value, std::string_view what, std::uint32_t column);

/// To the nearest whole number; halves of positive numbers upwards.
[[nodiscard]] double rounded(double value, std::uint32_t column);

/// A value as the control keeps it in a variable of this kind.
[[nodiscard]] Value convert(const Value& value, Kind kind, std::uint32_t column);

}  // namespace shapegcode::siemens
