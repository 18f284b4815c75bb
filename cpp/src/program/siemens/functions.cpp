// M, S, T and D of a block.
#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "program/siemens/block_words.hpp"
#include "program/siemens/run.hpp"

namespace shapegcode::siemens {
namespace {

bool is_behind(std::int64_t code) {
  return code == 0 || code == 1 || code == 2 || code == 5 || code == 9 || code == 30;
}

}  // namespace

std::vector<std::int64_t> BlockWords::before(const Functions& functions) {
  const Word* change = nullptr;
  for (const Word* word : functions) {
    if (word->id == WordId::m && whole_of(*word) == 6 && change == nullptr) change = word;
  }
  std::vector<std::int64_t> codes;
  for (const Word* word : functions) function(*word, codes);
  if (change != nullptr) change_tool();
  for (const Word* word : functions) {
    if (word->id == WordId::d) edge(*word, change != nullptr);
  }
  if (change != nullptr && edge_ < 0) offset(next_edge_ >= 0 ? next_edge_ : 1, change->column);
  for (const std::int64_t code : codes) {
    if (!is_behind(code) && code != 6 && code != 17) path_.put(fmt::format("M{:02d}", code));
  }
  std::erase_if(codes, [](std::int64_t code) { return !is_behind(code) || code == 2 || code == 30; });
  return codes;
}

void BlockWords::function(const Word& word, std::vector<std::int64_t>& codes) {
  const std::string& name = word.name;
  if (word.id == WordId::spindle_word && name[1] != '1') {
    throw word.error(fmt::format("{}= is one of spindle {}: only spindle 1 is read", name, name[1]));
  }
  if (word.id == WordId::spos || word.id == WordId::sposa) {
    path_.put("M19");
    path_.note("SPOS is written as M19", "SPOS");
  } else if (name[0] == 'S') {
    spindle(word);
  } else if (word.id == WordId::t) {
    select_tool(word);
  } else if (name[0] == 'M') {
    codes.push_back(whole_of(word));
  }
}

void BlockWords::spindle(const Word& word) {
  spindle_ = number_of_word(word);
  const double rounded = std::nearbyint(spindle_) + 0.0;
  if (spindle_ != rounded) path_.note(fmt::format("S{:g} is written without decimals", spindle_), "S");
  path_.put(fmt::format("S{:.0f}", rounded));
}

void BlockWords::select_tool(const Word& word) {
  const Value given = value(word);
  std::int64_t tool = 0;
  if (given.is_text()) {
    const auto [found, is_new] = tools_.emplace(given.text, 901 + static_cast<std::int64_t>(tools_.size()));
    tool = found->second;
    if (is_new) {
      const std::string written = fmt::format("T{}", tool);
      const std::string original = fmt::format("T=\"{}\"", given.text);
      path_.name(written, original);
      path_.note(fmt::format("{} is written as {}", original, written), "T " + given.text);
    }
  } else {
    tool = whole(given, "T", word.column);
  }
  path_.put(fmt::format("T{}", tool));
  next_tool_ = tool;
  next_edge_ = -1;
  if (uses_m6_) return;
  change_tool();
  path_.note("T changes the tool: the program has no M6", "T");
  offset(1, word.column);
}

void BlockWords::change_tool() {
  if (uses_m6_) {
    path_.put("M06");
    path_.forget(path_.options().tool_change_unknown_axes);
  }
  if (next_tool_ != 0) tool_ = next_tool_;
  next_tool_ = 0;
  edge_ = -1;
}

void BlockWords::edge(const Word& word, bool changes) {
  const std::int64_t number = whole_of(word);
  if (number < 0 || number > 9) throw word.error(fmt::format("D{}: it must be 0 to 9", number));
  if (changes || !uses_m6_ || next_tool_ == 0) {
    offset(number, word.column);
  } else {
    next_edge_ = number;
  }
}

void BlockWords::offset(std::int64_t edge, std::uint32_t column) {
  if (edge == edge_) return;
  if (path_.modes.plane != 17 && edge != 0) {
    throw error_at(column, fmt::format("D{} in G{}: G17 must be in force, a length along Z", edge, path_.modes.plane));
  }
  edge_ = edge;
  const std::int64_t number = offset_number(edge);
  path_.put(edge == 0 ? "G49" : fmt::format("G43H{}", number));
  path_.forget("Z", true);
}

std::int64_t BlockWords::offset_number(std::int64_t edge) {
  const std::int64_t tool = tool_ != 0 ? tool_ : edge;
  if (edge <= 1 && (tool <= 800 || tool > 900) && tool <= 999) return tool;
  const std::int64_t next = 801 + static_cast<std::int64_t>(offsets_.size());
  const std::int64_t found = offsets_.emplace(std::pair(tool, edge), next).first->second;
  const std::string written = fmt::format("H{}", found);
  path_.name(written, fmt::format("D{}", edge));
  path_.note(fmt::format("D{} of T{} is written as {}", edge, tool, written), written);
  return found;
}

}  // namespace shapegcode::siemens
