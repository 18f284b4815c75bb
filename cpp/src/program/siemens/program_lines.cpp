#include "program/siemens/program_lines.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <utility>

#include "program/siemens/line_text.hpp"

namespace shapegcode::siemens {
namespace {

constexpr std::size_t most_blocks = 65536;  // of a program that are kept
constexpr std::uint64_t jumps_in_a_block = 64;

struct Ends {
  BlockKind begin;
  BlockKind end;
  std::string_view begins;
  std::string_view ends;
};

// The last one of those with an equal begin is what must close it.
constexpr std::array<Ends, 6> all_ends = {{{BlockKind::if_begins, BlockKind::else_begins, "IF", "ELSE"},
                                           {BlockKind::if_begins, BlockKind::if_ends, "IF", "ENDIF"},
                                           {BlockKind::while_begins, BlockKind::while_ends, "WHILE", "ENDWHILE"},
                                           {BlockKind::for_begins, BlockKind::for_ends, "FOR", "ENDFOR"},
                                           {BlockKind::loop_begins, BlockKind::loop_ends, "LOOP", "ENDLOOP"},
                                           {BlockKind::repeat_begins, BlockKind::until, "REPEAT", "UNTIL"}}};

const Ends* by_end(BlockKind kind) {
  const auto* found = std::ranges::find(all_ends, kind, &Ends::end);
  return found == all_ends.end() ? nullptr : found;
}

bool is_begin(BlockKind kind) { return std::ranges::find(all_ends, kind, &Ends::begin) != all_ends.end(); }

/// Each word of a structure holds one of these.
bool may_be_structure(std::string_view line) {
  for (std::size_t i = 0; i + 1 < line.size(); ++i) {
    std::string_view word;
    switch (upper(line[i])) {
      case 'I':
        word = "IF";
        break;
      case 'E':
        word = "ELSE";
        break;
      case 'W':
        word = "WHILE";
        break;
      case 'F':
        word = "FOR";
        break;
      case 'L':
        word = "LOOP";
        break;
      case 'R':
        word = "REPEAT";
        break;
      case 'U':
        word = "UNTIL";
        break;
      default:
        continue;
    }
    if (std::ranges::equal(line.substr(i, word.size()), word, {}, upper)) return true;
  }
  return false;
}

/// The name in a head `%_N_NAME_MPF`; empty: the line is none.
std::string name_of_head(std::string_view line) {
  const std::string code = capitals(split_comment(line).first);
  std::string_view text = without_spaces(code);
  if (!text.starts_with('%')) return {};
  text = without_spaces(text.substr(1));
  if (!std::ranges::all_of(text, is_name_character)) return {};
  if (text.size() > 3 && text.starts_with("_N_")) text.remove_prefix(3);
  if (text.size() > 4 && (text.ends_with("_MPF") || text.ends_with("_SPF"))) text.remove_suffix(4);
  return std::string(text);
}

/// A block ends with LF alone; CR before it belongs to it, another one is a blank. A zero byte, which would end a
/// message, is read as its symbol.
std::string with_one_end(std::string_view text) {
  std::string found;
  found.reserve(text.size());
  for (std::size_t i = 0; i < text.size(); ++i) {
    if (text[i] == '\0') {
      found += "\xE2\x90\x80";
    } else if (text[i] != '\r') {
      found += text[i];
    } else if (i + 1 == text.size() || text[i + 1] != '\n') {
      found += ' ';
    }
  }
  if (found.ends_with('\n')) found.pop_back();
  return found;
}

}  // namespace

ProgramLines::ProgramLines(std::string name_, std::string file_, std::uint32_t first_,
                           std::shared_ptr<const std::string> text, std::vector<std::string_view> lines)
    : name(std::move(name_)),
      file(std::move(file_)),
      first(first_),
      text_(std::move(text)),
      lines_(std::move(lines)),
      blocks_(lines_.size()) {}

std::shared_ptr<const Block> ProgramLines::block(std::size_t index) {
  if (blocks_[index] == nullptr) {
    if (block_count_ >= most_blocks) {
      std::ranges::fill(blocks_, nullptr);
      block_count_ = 0;
    }
    blocks_[index] = read_block(lines_[index]);
    ++block_count_;
  }
  return blocks_[index];
}

std::optional<StructureError> ProgramLines::find_structure() {
  if (!structure_.empty()) return std::nullopt;
  struct Open {
    BlockKind kind;
    std::size_t first;
    std::size_t last;  // line that it led to
  };
  std::vector<Open> open;
  structure_.resize(lines_.size() + 1);
  const auto wrong = [this](std::size_t index, std::string message) {
    structure_.clear();
    return StructureError{.index = index, .message = std::move(message)};
  };
  for (std::size_t index = 0; index < lines_.size(); ++index) {
    if (!may_be_structure(lines_[index])) continue;
    BlockKind kind = BlockKind::words;
    try {
      kind = block(index)->kind;
    } catch (const Error&) {
      continue;  // said when it is reached
    }
    if (is_begin(kind)) {
      open.push_back({kind, index, index});
    } else if (const Ends* ends = by_end(kind)) {
      if (open.empty() || open.back().kind != ends->begin) {
        return wrong(index,
                     fmt::format("{} without {}: {} must come before it", ends->ends, ends->begins, ends->begins));
      }
      const Open begun = open.back();
      open.pop_back();
      structure_[begun.last].partner = index;
      structure_[index].start = begun.first;
      structure_[begun.first].end = index;
      if (kind == BlockKind::else_begins) open.push_back({BlockKind::if_begins, begun.first, index});
    }
  }
  if (!open.empty()) {
    const Ends* ends = by_end(BlockKind::if_ends);
    for (const Ends& each : all_ends) {
      if (each.begin == open.back().kind) ends = &each;
    }
    return wrong(open.back().first, fmt::format("{} is never closed: {} must follow", ends->begins, ends->ends));
  }
  find_surroundings();
  return std::nullopt;
}

void ProgramLines::find_surroundings() {
  std::vector<std::size_t> open;
  for (std::size_t index = 0; index < lines_.size(); ++index) {
    if (!open.empty() && structure_[open.back()].end == index) open.pop_back();
    structure_[index].around = open.empty() ? nowhere : open.back();
    if (structure_[index].end > index) open.push_back(index);
  }
}

bool ProgramLines::is_reached(std::size_t index, std::size_t from) const {
  const std::size_t around = structure_[index].around;
  std::size_t outer = structure_[from].around;
  while (outer != around && outer != nowhere) outer = structure_[outer].around;
  return outer == around;
}

bool ProgramLines::is_at(std::size_t index, const std::string& target) {
  const std::string_view sign = std::string_view(target).substr(target.starts_with('N') ? 1 : 0);
  if (!holds_word(lines_[index], sign)) return false;
  const std::shared_ptr<const Block> found = block(index);
  return !target.empty() && (target == found->label || target == found->number);
}

std::optional<std::size_t> ProgramLines::looked_for(const Jump& jump, std::size_t index) {
  if (jump.kind != JumpKind::backward) {
    for (std::size_t line = index + 1; line < lines_.size(); ++line) {
      if (is_at(line, jump.target) && is_reached(line, index)) return line;
    }
  }
  if (jump.kind != JumpKind::forward) {
    for (std::size_t line = index + 1; line-- > 0;) {
      if (is_at(line, jump.target) && is_reached(line, index)) return line;
    }
  }
  return std::nullopt;
}

std::optional<std::size_t> ProgramLines::target(const Jump& jump, std::size_t index, std::size_t ordinal) {
  if (ordinal >= jumps_in_a_block) return looked_for(jump, index);
  const std::uint64_t key = index * jumps_in_a_block + ordinal;
  const auto known = targets_.find(key);
  if (known != targets_.end()) return known->second;
  const std::optional<std::size_t> found = looked_for(jump, index);
  targets_.emplace(key, found);
  return found;
}

std::optional<std::size_t> ProgramLines::label_before(const std::string& label, std::size_t index) {
  while (index-- > 0) {
    if (is_at(index, label)) return index;
  }
  return std::nullopt;
}

std::vector<std::shared_ptr<ProgramLines>> programs_of_text(std::string_view source, const std::string& file,
                                                            const std::string& name) {
  const auto text = std::make_shared<const std::string>(with_one_end(source));
  std::vector<std::string_view> lines;
  std::string_view rest = *text;
  while (true) {
    const std::size_t end = rest.find('\n');
    lines.push_back(rest.substr(0, end));
    if (end == std::string_view::npos) break;
    rest.remove_prefix(end + 1);
  }
  std::vector<std::pair<std::size_t, std::string>> heads;
  for (std::size_t index = 0; index < lines.size(); ++index) {
    std::size_t begin = 0;
    skip_spaces_of_any_kind(lines[index], begin);
    if (begin >= lines[index].size() || lines[index][begin] != '%') continue;
    std::string found = name_of_head(lines[index]);
    if (!found.empty()) heads.emplace_back(index, std::move(found));
  }
  if (heads.empty()) return {std::make_shared<ProgramLines>(name, file, 1, text, std::move(lines))};
  std::vector<std::shared_ptr<ProgramLines>> programs;
  for (std::size_t k = 0; k < heads.size(); ++k) {
    const auto begin = static_cast<std::ptrdiff_t>(heads[k].first + 1);
    const auto end = static_cast<std::ptrdiff_t>(k + 1 < heads.size() ? heads[k + 1].first : lines.size());
    programs.push_back(
        std::make_shared<ProgramLines>(heads[k].second, file, static_cast<std::uint32_t>(begin + 1), text,
                                       std::vector<std::string_view>(lines.begin() + begin, lines.begin() + end)));
  }
  return programs;
}

}  // namespace shapegcode::siemens
