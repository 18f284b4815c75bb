#include "program/text/lexer.hpp"

#include <fmt/format.h>

#include <string>

#include "program/text/characters.hpp"
#include "program/text/number_scan.hpp"
#include "shapegcode/error.hpp"

namespace shapegcode {
namespace {

constexpr unsigned max_digits = 8;  // FANUC alarm 003: eight digits, point not counted

[[noreturn]] void alarm(int number, const std::string& message, std::uint32_t line, std::size_t index) {
  throw alarm_error(number, message, line, static_cast<std::uint32_t>(index + 1));
}

[[noreturn]] void fail(const std::string& message, std::uint32_t line, std::size_t index) {
  throw Error(ErrorKind::program, message, line, static_cast<std::uint32_t>(index + 1));
}

std::string quoted(char c) {
  if (c >= ' ' && c <= '~') {
    return std::string("'") + c + "'";
  }
  constexpr const char* hex = "0123456789ABCDEF";
  const auto byte = static_cast<unsigned char>(c);
  return std::string("byte 0x") + hex[byte >> 4] + hex[byte & 15];
}

bool is_macro_keyword(std::string_view text, std::size_t i) noexcept {
  std::array<char, 5> run{};
  std::size_t size = 0;
  for (std::size_t k = i; k < text.size() && is_letter(text[k]) && size < run.size(); ++k) {
    run[size++] = upper(text[k]);
  }
  const std::string_view word(run.data(), size);
  for (const std::string_view keyword :
       {"IF", "THEN", "GOTO", "WHILE", "DO", "END", "POPEN", "DPRNT", "PCLOS", "BPRNT"}) {
    if (abbreviates(word, keyword) || word.starts_with(keyword)) {
      return true;
    }
  }
  return false;
}

// Reads the number after a letter; i is at its first character and ends after it. False at a macro expression or
// keyword.
bool scan_operand(std::string_view text, std::uint32_t line, std::size_t& i, std::size_t letter_at, Word& word) {
  const std::size_t n = text.size();
  skip_spaces(text, i);
  bool negative = false;
  if (i < n && (text[i] == '-' || text[i] == '+')) {
    negative = text[i] == '-';
    ++i;
  }
  const ScannedNumber number = scan_number(text, i);
  if (number.digits == 0) {
    if ((i < n && (text[i] == '#' || text[i] == '[')) || is_macro_keyword(text, letter_at)) {
      return false;
    }
    alarm(5, fmt::format("address {} has no number", upper(text[letter_at])), line, letter_at);
  }
  if (number.significant > max_digits) {
    alarm(3, fmt::format("too many digits in address {}: {} (limit {})", word.letter, number.significant, max_digits),
          line, letter_at);
  }
  word.value = negative ? -number.value : number.value;
  word.has_point = number.has_point;
  word.digits = static_cast<std::uint8_t>(number.significant);
  word.end = static_cast<std::uint32_t>(i);
  return true;
}

// Reads the word whose letter stands before i under the name `name`. False at a macro expression or keyword.
bool scan_word(std::string_view text, std::uint32_t line, std::size_t& i, char name, Block& block) {
  if (block.word_count == Block::max_words) {
    fail(fmt::format("more than {} words in a block", Block::max_words), line, i - 1);
  }
  Word& word = block.words[block.word_count];
  word = Word{};
  word.letter = name;
  word.column = static_cast<std::uint32_t>(i);
  if (!scan_operand(text, line, i, i - 1, word)) {
    return false;
  }
  ++block.word_count;
  return true;
}

void scan_comment(std::string_view text, std::uint32_t line, std::size_t& i, Block& block) {
  const std::size_t close = text.find(')', i);
  if (close == std::string_view::npos) {
    fail("comment does not close: '(' without ')'", line, i);
  }
  if (block.comment_count == Block::max_comments) {
    fail(fmt::format("more than {} comments in a block", Block::max_comments), line, i);
  }
  block.comments[block.comment_count++] = text.substr(i, close + 1 - i);
  i = close + 1;
}

void scan_block_skip(std::string_view text, std::uint32_t line, std::size_t& i, Block& block) {
  if (block.word_count > 1 || (block.word_count == 1 && block.words[0].letter != 'N')) {
    fail("'/' inside a block: only a block skip at its start is supported", line, i);
  }
  block.optional_skip = true;
  block.skip_switch = scan_skip_switch(text, i);
}

// ",R" ",C": read as words of their own so that they can be named. False at a macro expression.
bool scan_corner_word(std::string_view text, std::uint32_t line, std::size_t& i, Block& block) {
  const char kind = i + 1 < text.size() ? upper(text[i + 1]) : ' ';
  if ((kind != 'R' && kind != 'C') || block.word_count == Block::max_words) {
    alarm(9, "',' without R or C", line, i);
  }
  const auto column = static_cast<std::uint32_t>(i + 1);
  i += 2;
  Word& word = block.words[block.word_count];
  if (!scan_word(text, line, i, kind == 'R' ? '<' : '>', block)) {
    return false;
  }
  word.column = column;
  return true;
}

// "<NAME>" or "O<NAME>" in the place of an O number.
bool scan_program_name(std::string_view text, std::uint32_t line, std::size_t& i, Block& block) {
  std::size_t open = i + (upper(text[i]) == 'O' ? 1 : 0);
  skip_spaces(text, open);
  if (open >= text.size() || text[open] != '<' || block.word_count > 0) {
    return false;
  }
  constexpr std::size_t longest_name = 32;
  const std::size_t close = text.find('>', open);
  if (close == std::string_view::npos || close == open + 1 || close - open - 1 > longest_name) {
    fail(fmt::format("a program name is <...> of 1 to {} characters", longest_name), line, open);
  }
  block.program_name = text.substr(open, close + 1 - open);
  i = close + 1;
  return true;
}

[[noreturn]] void refuse_character(std::string_view text, std::uint32_t line, std::size_t i, const Block& block) {
  const char c = text[i];
  if ((c == '.' || c == '-') && block.word_count > 0 && block.words[block.word_count - 1].end == i) {
    const char letter = block.words[block.word_count - 1].letter;
    const std::string name = letter == '<' ? ",R" : letter == '>' ? ",C" : std::string(1, letter);
    alarm(c == '.' ? 7 : 6,
          (c == '.' ? "second decimal point in address " : "minus sign behind the number of address ") + name, line, i);
  }
  if (is_digit(c) || c == '.' || c == '-' || c == '+') {
    alarm(4, quoted(c) + " stands where an address is expected", line, i);
  }
  alarm(9, quoted(c) + " is no program character", line, i);
}

}  // namespace

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

void scan_block(std::string_view text, std::uint32_t line, std::size_t max_length, Block& block) {
  block.word_count = 0;
  block.comment_count = 0;
  block.optional_skip = false;
  block.program_name = {};
  block.folder = false;
  block.macro = false;
  const std::size_t n = text.size();
  if (n > max_length) {
    fail(fmt::format("line of {} characters (limit {})", n, max_length), line, max_length);
  }
  std::size_t i = 0;
  while (i < n && !block.macro) {
    const char c = text[i];
    if ((c == '<' || upper(c) == 'O') && scan_program_name(text, line, i, block)) {
      continue;
    }
    if (is_letter(c)) {
      ++i;
      block.macro = !scan_word(text, line, i, upper(c), block);
    } else if (is_blank(c)) {
      ++i;
    } else if (c == '(') {
      scan_comment(text, line, i, block);
    } else if (c == ':' && block.word_count == 0) {
      ++i;  // ISO tapes write :0001 for O0001
      block.macro = !scan_word(text, line, i, 'O', block);
    } else if (c == '&' && block.word_count == 0) {
      block.folder = true;
      i = n;
    } else if (c == '/') {
      scan_block_skip(text, line, i, block);
    } else if (c == '#' || c == '[' || c == ']' || c == '=') {
      block.macro = true;
    } else if (c == ',') {
      block.macro = !scan_corner_word(text, line, i, block);
    } else {
      refuse_character(text, line, i, block);
    }
  }
}

}  // namespace shapegcode
