#include "base/refuse.hpp"

#include <charconv>
#include <cmath>

namespace shapegcode::detail {
namespace {

/// `form` is empty, "g" or ".10g".
void append(std::string& text, double value, std::string_view form) {
  if (!std::isfinite(value)) {
    text += std::signbit(value) ? "-" : "";
    text += std::isnan(value) ? "nan" : "inf";
    return;
  }
  std::array<char, 64> digits;
  char* const end = digits.data() + digits.size();
  std::to_chars_result written{};
  if (form.empty()) {
    const double size = std::abs(value);
    const bool is_fixed = size == 0.0 || (size >= 1e-4 && size < 1e16);
    written =
        std::to_chars(digits.data(), end, value, is_fixed ? std::chars_format::fixed : std::chars_format::scientific);
  } else {
    int precision = 6;
    if (form.front() == '.') std::from_chars(form.data() + 1, form.data() + form.size(), precision);
    written = std::to_chars(digits.data(), end, value, std::chars_format::general, precision);
  }
  text.append(digits.data(), written.ptr);
}

void append(std::string& text, std::string_view value, std::string_view /*form*/) { text += value; }

template <std::integral Value>
void append(std::string& text, Value value, std::string_view /*form*/) {
  text += std::to_string(value);
}

}  // namespace

std::string message_of(std::string_view pattern, std::span<const MessageValue> values) {
  std::string text;
  for (const MessageValue& value : values) {
    const std::size_t open = pattern.find('{');
    const std::size_t close = pattern.find('}', open);
    text += pattern.substr(0, open);
    const std::string_view form = close > open + 1 ? pattern.substr(open + 2, close - open - 2) : std::string_view();
    std::visit([&](const auto& shown) { append(text, shown, form); }, value);
    pattern.remove_prefix(close + 1);
  }
  text += pattern;
  return text;
}

}  // namespace shapegcode::detail
