#include "program/linuxcnc/block.hpp"

#include <fmt/format.h>

#include <cstddef>
#include <cstdint>

#include "program/linuxcnc/program_text.hpp"
#include "program/linuxcnc/word_values.hpp"
#include "program/text/characters.hpp"

namespace shapegcode::linuxcnc {
namespace {

constexpr char comment_mark = '\0';  // where a comment stood

/// What LinuxCNC leaves out; other blanks it refuses.
bool is_left_out(char c) { return c == ' ' || c == '\t' || c == '\r'; }

/// Behind the comment in brackets at text[at]; npos: it does not close, or another one begins in it.
std::size_t behind_comment(std::string_view text, std::size_t at) {
  const std::size_t end = text.find_first_of("()", at + 1);
  return end == text.npos || text[end] == '(' ? text.npos : end + 1;
}

bool may_go_on(char c) {
  return (c >= 'a' && c <= 'z') || std::string_view("#=+*[-").find(c) != std::string_view::npos;
}

bool continues(char c) { return is_digit(c) || std::string_view(".=+*]").find(c) != std::string_view::npos; }

bool is_word_letter(char c) { return (c >= 'a' && c <= 'z' && c != 'o') || c == '@' || c == '^' || c == '$'; }

}  // namespace

std::string without_comments(std::string_view line, std::vector<std::string>& comments) {
  const bool has_comments = line.find_first_of("(;") != line.npos;
  std::string code;
  code.reserve(line.size());
  bool in_a_word = false;
  const auto take_comment = [&](std::string_view text) {
    comments.emplace_back(stripped(text));
    if (code.empty() || code.back() != comment_mark) {
      in_a_word = in_a_word || (!code.empty() && may_go_on(code.back()));
      code += comment_mark;
    }
  };
  const auto refuse_comment = [] { refuse("a comment does not close, or is inside another one"); };
  if (has_comments && line.find(comment_mark) != line.npos) refuse_comment();
  for (std::size_t i = 0; i < line.size();) {
    const char c = line[i];
    if (has_comments && (c == '(' || c == ')')) {
      const std::size_t end = c == '(' ? behind_comment(line, i) : line.npos;
      if (end == line.npos) refuse_comment();
      take_comment(line.substr(i + 1, end - i - 2));
      i = end;
    } else if (has_comments && c == ';') {
      take_comment(line.substr(i + 1));
      break;
    } else {
      if (!is_left_out(c)) {
        in_a_word = in_a_word || (has_comments && !code.empty() && code.back() == comment_mark && continues(c));
        code += lower(c);
      }
      ++i;
    }
  }
  if (in_a_word) refuse("a comment is inside a word: `X1(a)2` is not X12");
  if (has_comments) std::erase(code, comment_mark);
  return code;
}

void read_block(std::string_view line, ParameterNames& names, Block& block) {
  const std::string code = without_comments(line, block.comments);
  block.skips = code.starts_with('/');
  if (code.starts_with("/o")) refuse("an O word after `/` is not read; remove the `/`, or the line");
  ValueReader reader(std::string_view(code).substr(block.skips ? 1 : 0), block.code, names);
  std::uint32_t seen = 0;
  while (!reader.is_done()) {
    const char letter = reader.front();
    if (letter == '#') {
      block.settings.push_back(reader.setting());
      continue;
    }
    if (!is_word_letter(letter)) refuse(quoted_begin(reader.left()) + " is not a word");
    reader.skip();
    const std::uint32_t bit = 1U << place_of(letter);
    if ((seen & bit) != 0 && letter != 'g' && letter != 'm') {
      refuse(fmt::format("{} is twice in a block", upper(letter)));
    }
    seen |= bit;
    block.words.push_back({letter, reader.value()});
  }
}

}  // namespace shapegcode::linuxcnc
