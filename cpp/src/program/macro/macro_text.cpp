#include "program/macro/macro_text.hpp"

#include <array>
#include <charconv>
#include <cmath>

namespace shapegcode::macro {

std::string name_at(std::string_view text, std::size_t i) {
  if (i >= text.size()) {
    return "the end of the block";
  }
  if (text[i] >= ' ' && text[i] <= '~') {
    return std::string("'") + text[i] + "'";
  }
  constexpr const char* hex = "0123456789ABCDEF";
  const auto byte = static_cast<unsigned char>(text[i]);
  return std::string("byte 0x") + hex[byte >> 4] + hex[byte & 15];
}

std::string shown(double value) {
  std::array<char, 32> buffer{};
  const auto result = std::to_chars(buffer.data(), buffer.data() + buffer.size(), value);
  return {buffer.data(), result.ptr};
}

std::string_view letters_at(std::string_view text, std::size_t i) noexcept {
  std::size_t end = i;
  while (end < text.size() && is_letter(text[end])) {
    ++end;
  }
  return text.substr(i, end - i);
}

bool abbreviates(std::string_view run, std::string_view name) noexcept {
  if (run.size() < 2 || run.size() > name.size()) {
    return false;
  }
  for (std::size_t k = 0; k < run.size(); ++k) {
    if (upper(run[k]) != name[k]) {
      return false;
    }
  }
  return true;
}

void skip_comment(std::string_view text, std::size_t& i, std::uint32_t line) {
  const std::size_t close = text.find(')', i);
  if (close == std::string_view::npos) {
    throw Error(ErrorKind::program, "comment does not close: '(' without ')'", line, column_of(i));
  }
  i = close + 1;
}

Constant scan_constant(std::string_view text, std::size_t& i, std::uint32_t line, int max_digits) {
  constexpr int max_decimals = 18;
  const std::size_t start = i;
  std::uint64_t mantissa = 0;
  int decimals = 0;
  int significant = 0;
  bool has_digit = false;
  Constant constant;
  for (; i < text.size(); ++i) {
    if (text[i] == '.' && !constant.has_point) {
      constant.has_point = true;
    } else if (is_digit(text[i])) {
      has_digit = true;
      significant += mantissa != 0 || text[i] != '0' ? 1 : 0;
      decimals += constant.has_point ? 1 : 0;
      if (significant > max_digits || decimals > max_decimals) {
        fail(3, "number of more than " + std::to_string(max_digits) + " digits", line, start);
      }
      mantissa = mantissa * 10 + static_cast<unsigned>(text[i] - '0');
    } else {
      break;
    }
  }
  if (!has_digit) {
    fail(114, "number expected, " + name_at(text, start) + " found", line, start);
  }
  // At most 12 digits over an exact power of ten: the correctly rounded decimal.
  constant.value = static_cast<double>(mantissa) / std::pow(10.0, decimals);
  return constant;
}

}  // namespace shapegcode::macro
