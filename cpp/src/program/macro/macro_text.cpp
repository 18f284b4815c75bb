#include "program/macro/macro_text.hpp"

#include <fmt/format.h>

#include <array>
#include <charconv>

#include "program/text/number_scan.hpp"

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

void skip_comment(std::string_view text, std::size_t& i, std::uint32_t line) {
  const std::size_t close = text.find(')', i);
  if (close == std::string_view::npos) {
    throw Error(ErrorKind::program, "comment does not close: '(' without ')'", line, column_of(i));
  }
  i = close + 1;
}

Constant scan_constant(std::string_view text, std::size_t& i, std::uint32_t line, unsigned max_digits) {
  constexpr unsigned max_decimals = 18;
  const std::size_t start = i;
  const ScannedNumber number = scan_number(text, i);
  if (number.significant > max_digits || number.decimals > max_decimals) {
    fail(3, fmt::format("number of more than {} digits", max_digits), line, start);
  }
  if (number.digits == 0) {
    fail(114, "number expected, " + name_at(text, start) + " found", line, start);
  }
  return {number.value, number.has_point};
}

}  // namespace shapegcode::macro
