#include "program/linuxcnc/program_text.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <charconv>
#include <cmath>
#include <iterator>
#include <limits>
#include <system_error>

#include "program/text/characters.hpp"
#include "program/text/number_scan.hpp"

namespace shapegcode::linuxcnc {
namespace {

constexpr std::size_t shown_characters = 12;

std::int64_t as_whole(double value) noexcept {
  constexpr double most = 9.2e18;
  if (!(value < most)) return std::numeric_limits<std::int64_t>::max();
  return value > -most ? static_cast<std::int64_t>(value) : std::numeric_limits<std::int64_t>::min();
}

void append_utf8(std::string& text, unsigned char code) {
  if (code < 0x80) {
    text += static_cast<char>(code);
  } else {
    text += static_cast<char>(0xc0 | (code >> 6U));
    text += static_cast<char>(0x80 | (code & 0x3fU));
  }
}

}  // namespace

std::string_view stripped(std::string_view text) noexcept {
  while (!text.empty() && is_white(text.front())) text.remove_prefix(1);
  while (!text.empty() && is_white(text.back())) text.remove_suffix(1);
  return text;
}

std::string lowered(std::string_view text) {
  std::string result(text);
  std::ranges::transform(result, result.begin(), lower);
  return result;
}

std::string uppered(std::string_view ascii) {
  std::string result(ascii);
  std::ranges::transform(result, result.begin(), upper);
  return result;
}

std::string shown(std::string_view text) {
  std::string result;
  result.reserve(text.size());
  for (const char c : text) {
    if (c == '\0') {
      result += "\\x00";  // a message ends at a zero byte
    } else {
      append_utf8(result, static_cast<unsigned char>(c));
    }
  }
  return result;
}

std::string quoted_begin(std::string_view text) {
  text = text.substr(0, shown_characters);
  const char quote = text.find('\'') != text.npos && text.find('"') == text.npos ? '"' : '\'';
  std::string result(1, quote);
  for (const char c : text) {
    const auto code = static_cast<unsigned char>(c);
    if (c == '\\' || c == quote) {
      result += '\\';
      result += c;
    } else if (c == '\n' || c == '\r' || c == '\t') {
      result += c == '\n' ? "\\n" : c == '\r' ? "\\r" : "\\t";
    } else if (code < 0x20 || (code >= 0x7f && code <= 0xa0) || code == 0xad) {
      fmt::format_to(std::back_inserter(result), "\\x{:02x}", code);
    } else {
      append_utf8(result, code);
    }
  }
  return result + quote;
}

std::int64_t rounded(double value) noexcept { return as_whole(std::nearbyint(value)); }

std::int64_t truncated(double value) noexcept { return as_whole(std::trunc(value)); }

double scan_unsigned(std::string_view text, std::size_t& i) {
  constexpr unsigned exact_digits = 15;
  constexpr unsigned exact_decimals = 18;
  const std::size_t begin = i;
  const ScannedNumber number = scan_number(text, i);
  if (number.significant <= exact_digits && number.decimals <= exact_decimals) return number.value;
  double value = 0.0;
  const auto found = std::from_chars(text.data() + begin, text.data() + i, value, std::chars_format::fixed);
  if (found.ec != std::errc::result_out_of_range) return value;
  const std::string_view before_point = text.substr(begin, text.find('.', begin) - begin).substr(0, i - begin);
  const bool is_large = before_point.find_first_not_of('0') != before_point.npos;
  return is_large ? std::numeric_limits<double>::infinity() : 0.0;
}

}  // namespace shapegcode::linuxcnc
