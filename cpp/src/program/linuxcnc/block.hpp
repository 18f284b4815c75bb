// Private: the words of a line that is no O line.
#pragma once

#include <string>
#include <string_view>
#include <vector>

#include "program/linuxcnc/expression.hpp"

namespace shapegcode::linuxcnc {

struct WordText {
  char letter;
  Value value;
};

/// A line: its words in order, its settings, its comments.
struct Block {
  std::vector<WordText> words;
  std::vector<Setting> settings;
  std::vector<std::string> comments;
  bool skips = false;
  Code code;
};

/// A line without comments and blanks, its letters small; the comments are appended.
[[nodiscard]] std::string without_comments(std::string_view line, std::vector<std::string>& comments);

void read_block(std::string_view line, ParameterNames& names, Block& block);

}  // namespace shapegcode::linuxcnc
