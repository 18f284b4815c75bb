#include "program/siemens/line_text.hpp"

#include <algorithm>

namespace shapegcode::siemens {
namespace {

bool is_ascii_space(char c) noexcept { return (c >= '\t' && c <= '\r') || (c >= '\x1c' && c <= ' '); }

std::size_t wide_space_at(std::string_view text, std::size_t i) noexcept {
  const std::string_view two = text.substr(i, 2);
  if (two == "\xC2\x85" || two == "\xC2\xA0") return 2;
  const std::string_view three = text.substr(i, 3);
  if (three == "\xE1\x9A\x80" || three == "\xE2\x81\x9F" || three == "\xE3\x80\x80") return 3;
  if (three.size() < 3 || !three.starts_with("\xE2\x80")) return 0;
  const auto last = static_cast<unsigned char>(three[2]);
  return (last >= 0x80 && last <= 0x8A) || last == 0xA8 || last == 0xA9 || last == 0xAF ? 3 : 0;
}

}  // namespace

std::size_t space_at(std::string_view text, std::size_t i) noexcept {
  if (i >= text.size()) return 0;
  if (static_cast<unsigned char>(text[i]) < 0x80) return is_ascii_space(text[i]) ? 1 : 0;
  return wide_space_at(text, i);
}

void skip_spaces_of_any_kind(std::string_view text, std::size_t& i) noexcept {
  while (const std::size_t size = space_at(text, i)) i += size;
}

std::string_view without_end_spaces(std::string_view text) noexcept {
  while (!text.empty()) {
    std::size_t last = text.size() - 1;
    while (last > 0 && !begins_character(text[last])) --last;
    if (space_at(text, last) != text.size() - last) break;
    text = text.substr(0, last);
  }
  return text;
}

std::string_view without_spaces(std::string_view text) noexcept {
  std::size_t begin = 0;
  skip_spaces_of_any_kind(text, begin);
  return without_end_spaces(text.substr(begin));
}

std::string_view first_characters(std::string_view text, std::size_t count) noexcept {
  std::size_t end = 0;
  for (; end < text.size(); ++end) {
    if (begins_character(text[end]) && count-- == 0) break;
  }
  return text.substr(0, end);
}

std::uint32_t count_characters(std::string_view text) noexcept {
  return static_cast<std::uint32_t>(std::ranges::count_if(text, begins_character));
}

std::string capitals(std::string_view text) {
  std::string found;
  found.reserve(text.size());
  for (std::size_t i = 0; i < text.size(); ++i) {
    const char next = i + 1 < text.size() ? text[i + 1] : '\0';
    const auto second = static_cast<unsigned char>(next);
    if (text[i] == '\xC3' && second >= 0x9F && second <= 0xBF && second != 0xB7) {
      ++i;
      if (next == '\x9F') {
        found += "SS";
      } else if (next == '\xBF') {
        found += "\xC5\xB8";
      } else {
        found += '\xC3';
        found += static_cast<char>(second - 0x20);
      }
    } else if (text[i] == '\xC2' && next == '\xB5') {
      ++i;
      found += "\xCE\x9C";
    } else {
      found += upper(text[i]);
    }
  }
  return found;
}

bool holds_word(std::string_view text, std::string_view word) noexcept {
  const auto is_same = [](char a, char b) { return upper(a) == b; };
  return word.empty() || std::search(text.begin(), text.end(), word.begin(), word.end(), is_same) != text.end();
}

std::pair<std::string_view, std::string_view> split_comment(std::string_view line) noexcept {
  bool quoted = false;
  for (std::size_t at = 0; at < line.size(); ++at) {
    if (line[at] == '"') quoted = !quoted;
    if (line[at] == ';' && !quoted) return {line.substr(0, at), without_spaces(line.substr(at + 1))};
  }
  return {line, {}};
}

}  // namespace shapegcode::siemens
