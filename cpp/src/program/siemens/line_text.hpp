#pragma once

#include <cstddef>
#include <cstdint>
#include <string>
#include <string_view>
#include <utility>

#include "program/text/characters.hpp"

// Characters of a line of a SINUMERIK program, UTF-8: a column counts characters, and a message cuts none in two.
namespace shapegcode::siemens {

[[nodiscard]] constexpr bool is_capital(char c) noexcept { return c >= 'A' && c <= 'Z'; }
/// Of a name, behind its first character.
[[nodiscard]] constexpr bool is_name_character(char c) noexcept { return is_capital(c) || is_digit(c) || c == '_'; }
[[nodiscard]] constexpr bool begins_character(char c) noexcept {
  return (static_cast<unsigned char>(c) & 0xC0) != 0x80;
}

/// Bytes of the white space at text[i]; 0: there is none.
[[nodiscard]] std::size_t space_at(std::string_view text, std::size_t i) noexcept;

/// Goes behind white space.
void skip_spaces_of_any_kind(std::string_view text, std::size_t& i) noexcept;

[[nodiscard]] std::string_view without_end_spaces(std::string_view text) noexcept;
[[nodiscard]] std::string_view without_spaces(std::string_view text) noexcept;

/// The first characters of a text.
[[nodiscard]] std::string_view first_characters(std::string_view text, std::size_t count) noexcept;

[[nodiscard]] std::uint32_t count_characters(std::string_view text) noexcept;

/// In capitals; of letters beyond ASCII those of Latin-1.
[[nodiscard]] std::string capitals(std::string_view text);

/// Whether a text holds another one in capitals, its own letters taken for capitals.
[[nodiscard]] bool holds_word(std::string_view text, std::string_view word) noexcept;

/// A line without its comment, and the comment.
[[nodiscard]] std::pair<std::string_view, std::string_view> split_comment(std::string_view line) noexcept;

}  // namespace shapegcode::siemens
