// Private: characters of a program, which are Latin-1, and how messages show them.
#pragma once

#include <cstddef>
#include <cstdint>
#include <string>
#include <string_view>

#include "shapegcode/error.hpp"

namespace shapegcode::linuxcnc {

/// Refuses the line that is executed: its place is added where lines are executed.
[[noreturn]] inline void refuse(const std::string& message) { throw Error(ErrorKind::program, message); }

/// White space of Latin-1.
[[nodiscard]] constexpr bool is_white(char c) noexcept {
  const auto code = static_cast<unsigned char>(c);
  return (code >= 0x09 && code <= 0x0d) || (code >= 0x1c && code <= 0x20) || code == 0x85 || code == 0xa0;
}

[[nodiscard]] constexpr bool is_space_or_tab(char c) noexcept { return c == ' ' || c == '\t'; }

[[nodiscard]] constexpr char lower(char c) noexcept {
  const auto code = static_cast<unsigned char>(c);
  const bool is_capital = (code >= 'A' && code <= 'Z') || (code >= 0xc0 && code <= 0xde && code != 0xd7);
  return is_capital ? static_cast<char>(code + 0x20) : c;
}

[[nodiscard]] std::string_view stripped(std::string_view text) noexcept;
[[nodiscard]] std::string lowered(std::string_view text);
[[nodiscard]] std::string uppered(std::string_view ascii);

/// A text of the program in a message, which is UTF-8.
[[nodiscard]] std::string shown(std::string_view text);

/// The beginning of a text in quotes, what cannot be printed escaped.
[[nodiscard]] std::string quoted_begin(std::string_view text);

/// The nearest whole number, of two the even one; the farthest there is where it is too large.
[[nodiscard]] std::int64_t rounded(double value) noexcept;
/// Without its decimals, likewise.
[[nodiscard]] std::int64_t truncated(double value) noexcept;

/// Reads digits with at most one point at text[i]; `i` ends behind them. There must be a digit.
[[nodiscard]] double scan_unsigned(std::string_view text, std::size_t& i);

}  // namespace shapegcode::linuxcnc
