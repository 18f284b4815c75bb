#pragma once

#include <array>
#include <cstdint>
#include <string_view>

namespace shapegcode {

/// One word of a block: an address letter and its number.
struct Word {
  double value = 0.0;
  std::uint32_t column = 0;  ///< of the letter, from 1
  char letter = 0;           ///< upper case
  bool has_point = false;
  std::uint8_t digits = 0;  ///< digits written, leading zeros not counted
  std::uint32_t end = 0;    ///< index behind the word in its line
};

/// What one line of program text holds. Views point into the text handed to `scan_block`.
struct Block {
  static constexpr std::size_t max_words = 40;
  std::array<Word, max_words> words;
  std::size_t word_count = 0;
  static constexpr std::size_t max_comments = 8;
  std::array<std::string_view, max_comments> comments;  ///< each with its parentheses
  std::size_t comment_count = 0;
  bool optional_skip = false;
  int skip_switch = 1;            ///< of "/" or "/1" ... "/9"
  std::string_view program_name;  ///< of a line "<NAME>" or "O<NAME>", with its brackets; empty: none
  bool folder = false;            ///< a line "&F=/..." of a memory punch: the folder of the programs behind it
  bool macro = false;  ///< a custom macro statement, or words with expressions: words and comments are not complete

  [[nodiscard]] const Word* begin() const noexcept { return words.data(); }
  [[nodiscard]] const Word* end() const noexcept { return words.data() + word_count; }
};

/// Whether `run` is a word of the control such as WHILE, or its beginning of at least two letters, in either case of
/// letters: WH[...]DO1 ... EN1.
[[nodiscard]] bool abbreviates(std::string_view run, std::string_view name) noexcept;

/// Splits one line (without its line end) into words. A colon in the place of an O number is read as O. `line` counts
/// from 1 and goes into errors. Throws Error(program) with line and column on: a byte that is no program character, a
/// letter without a number, a comment that does not close, more than 40 words or 8 comments, more than 8 digits in a
/// number, a decimal point in an address that takes whole numbers, a line longer than `max_length` characters. Stops
/// with `block.macro` at the first sign of a custom macro statement.
void scan_block(std::string_view text, std::uint32_t line, std::size_t max_length, Block& block);

}  // namespace shapegcode
