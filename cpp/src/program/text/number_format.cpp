#include "program/text/number_format.hpp"

#include <charconv>

namespace shapegcode {
namespace {

std::int64_t power_of_ten(int exponent) noexcept {
  std::int64_t power = 1;
  for (int i = 0; i < exponent; ++i) {
    power *= 10;
  }
  return power;
}

}  // namespace

void append_decimal(std::string& text, std::int64_t value, int decimals) {
  if (value < 0) {
    text += '-';
    value = -value;
  }
  const std::int64_t unit = power_of_ten(decimals);
  const std::int64_t whole = value / unit;
  std::int64_t fraction = value % unit;
  if (whole > 0 || fraction == 0) {
    char buffer[24];
    const auto result = std::to_chars(buffer, buffer + sizeof buffer, whole);
    text.append(buffer, result.ptr);
  }
  text += '.';
  for (std::int64_t digit = unit / 10; fraction > 0; digit /= 10) {
    text += static_cast<char>('0' + fraction / digit);
    fraction %= digit;
  }
}

void append_feed(std::string& text, std::int64_t value, int decimals) {
  text += 'F';
  append_decimal(text, value, decimals);
  const std::int64_t unit = power_of_ten(decimals);
  if (value < 10 * unit && value % unit == 0) {
    text += '0';
  }
}

}  // namespace shapegcode
