#include "program/siemens/block_words.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <unordered_set>

#include "program/siemens/line_text.hpp"
#include "program/siemens/run.hpp"

namespace shapegcode::siemens {
namespace {

struct Group {
  WordId first;
  WordId last;
};
// Of each only one word is allowed in a block.
constexpr std::array<Group, 7> groups = {{{WordId::g0, WordId::ct},
                                          {WordId::g17, WordId::g19},
                                          {WordId::g90, WordId::g91},
                                          {WordId::g70, WordId::g710},
                                          {WordId::g93, WordId::g95},
                                          {WordId::flin, WordId::fnorm},
                                          {WordId::g60, WordId::g641}}};

// Codes that have a block of their own, the first of them counts.
constexpr std::array<WordId, 8> own_blocks = {WordId::g4,  WordId::g110, WordId::g111, WordId::g112,
                                              WordId::g74, WordId::g75,  WordId::g25,  WordId::g26};

/// Words that exclude each other.
std::span<const std::string_view> excluded(WordId id) {
  static constexpr std::array<std::string_view, 2> sizes = {"CR", "AR"};
  static constexpr std::array<std::string_view, 3> corners = {"RND", "CHF", "CHR"};
  if (id == WordId::cr || id == WordId::ar) return sizes;
  if (is_between(id, WordId::rnd, WordId::chf)) return corners;
  return {};
}

bool is_bare(const Word& word) { return !word.value; }

}  // namespace

void BlockWords::comment(std::string_view text) {
  constexpr std::size_t longest = 100;
  if (text.empty() || text.starts_with("$PATH")) return;
  std::string shown = "(";
  bool is_gap = false;
  for (const char c : text) {
    if (!begins_character(c)) continue;
    const char letter = upper(c);
    if (!is_capital(letter) && !is_digit(letter) && letter != '.' && letter != '-') {
      is_gap = shown.size() > 1;
      continue;
    }
    if (is_gap) shown += ' ';
    is_gap = false;
    shown += letter;
  }
  if (shown.size() == 1) return;
  shown.resize(std::min(shown.size(), longest + 1));
  path_.put(shown + ")");
}

bool BlockWords::may_be_call(const Word& word) const {
  const std::string& name = word.name;
  if (is_frame(word.id) || path_.options().left_out.contains(name)) return false;
  switch (word.id) {
    case WordId::cip:
    case WordId::ct:
    case WordId::flin:
    case WordId::supa:
    case WordId::ret:
      return false;
    default:
      break;
  }
  const auto is_start = [](char c) { return is_capital(c) || c == '_'; };
  if (name.size() < 2 || !is_start(name[0])) return false;
  const std::string_view rest = std::string_view(name).substr(1);
  if (name[0] == 'L' && std::ranges::all_of(rest, is_digit)) return true;
  return is_start(name[1]) && std::ranges::all_of(rest, is_name_character);
}

void BlockWords::restore(const Modes& modes) {
  path_.set_plane(modes.plane);
  if (!modes.offset.empty()) path_.set_offset(modes.offset);
  path_.set_frame(modes.frame);
  path_.modes = modes;
}

Value BlockWords::value(const Word& word) const {
  if (!word.value) throw word.error(fmt::format("{} without a value: = and a value must follow", word.name));
  return word.value(run_);
}

double BlockWords::number_of_word(const Word& word) const { return number(value(word), word.column); }
double BlockWords::length(const Word& word) const { return number_of_word(word) * path_.modes.unit; }
std::int64_t BlockWords::whole_of(const Word& word) const { return whole(value(word), word.name, word.column); }

bool BlockWords::is_incremental(const Word& word) const {
  return word.mode == Mode::incremental || (word.mode == Mode::none && path_.modes.incremental);
}

void BlockWords::refuse_twice(const Words& words) const {
  std::unordered_set<std::string_view> seen;
  for (const Word& word : words) {
    if (is_bare(word) || word.id == WordId::m || run_.knows(word.name)) continue;
    const std::string_view own = word.name;
    const std::span<const std::string_view> group = excluded(word.id);
    for (const std::string_view other : group.empty() ? std::span(&own, 1) : group) {
      if (!seen.contains(other)) continue;
      const std::string what = other == own ? fmt::format("{} twice", other) : fmt::format("{}= and {}=", other, own);
      throw word.error(what + " in one block: leave one of them out");
    }
    seen.insert(own);
  }
  if (!seen.contains("CR")) return;
  for (const std::string_view other : {"I", "J", "K"}) {
    if (seen.contains(other)) {
      throw words[0].error(fmt::format("CR= and {} in one block: leave one of them out", other));
    }
  }
}

void BlockWords::refuse_groups(const Block& block) const {
  for (const auto& [first, last] : groups) {
    std::vector<std::string_view> names;
    for (const Word& word : block.words) {
      if (is_bare(word) && is_between(word.id, first, last)) names.push_back(word.name);
    }
    if (names.size() < 2) continue;
    std::ranges::sort(names);
    names.erase(std::unique(names.begin(), names.end()), names.end());
    if (names.size() > 1) {
      throw error_at(block.column, fmt::format("{} and {} in one block: leave one of them out", names[0], names[1]));
    }
  }
}

bool BlockWords::own_block(const Block& block) {
  const Words& words = block.words;
  if (is_frame(words[0].id)) {
    frame(words);
    return true;
  }
  for (const WordId id : own_blocks) {
    for (const Word& word : words) {
      if (!is_bare(word) || word.id != id) continue;
      special(word, words);
      return true;
    }
  }
  if (words[0].id != WordId::call && words[0].id != WordId::extcall) return false;
  call(words[0], words.size() == 1);
  return true;
}

void BlockWords::call(const Word& word, bool is_alone) {
  Value called;
  if (is_alone && !word.given.empty() && word.given[0]) called = word.given[0](run_);
  if (!called.is_text()) {
    throw word.error(
        fmt::format("{0}: the name of a program in quotes and brackets must follow: {0}(\"NAME\")", word.name));
  }
  run_.call_named(called.text, word);
}

End BlockWords::execute(const Block& block) {
  refuse_twice(block.words);
  return own_block(block) ? End::none : moves(block);
}

End BlockWords::moves(const Block& block) {
  Given given;
  given.column = block.column;
  given.start_feed = path_.modes.feed;
  std::string own_frame;
  bool returns = false;
  for (const Word& word : block.words) {
    if (is_of_the_machine(word.id)) own_frame = word.name;
    returns |= is_bare(word) && word.id == WordId::ret;
  }
  refuse_groups(block);
  for (const Word& word : block.words) {
    if (is_bare(word) && !is_of_the_machine(word.id)) code(word, given);
  }
  Rotary rotary;
  Functions functions;
  for (const Word& word : block.words) {
    if (word.value) address(word, given, rotary, functions);
  }
  const std::vector<std::int64_t> behind = before(functions);
  go(given, rotary, own_frame);
  for (const std::int64_t each : behind) path_.put(fmt::format("M{:02d}", each));
  if (returns) return End::m17;
  End end = End::none;
  for (const Word* word : functions) {
    if (word->id != WordId::m) continue;
    const std::int64_t number = whole_of(*word);
    if (number == 17) return End::m17;
    if (number == 2) end = End::m2;
    if (number == 30 && end == End::none) end = End::m30;
  }
  return end;
}

void BlockWords::go(Given& given, const Rotary& rotary, const std::string& own_frame) {
  if (!rotary.empty()) {
    if (!given.axes.empty() || !given.polar.empty() || path_.modes.motion != Motion::g0) {
      throw given.error(
          fmt::format("{}: moves of rotary axes are read with G0 alone, in a block of their own", rotary[0].first));
    }
    std::string text = "G00";
    for (const auto& [axis, value] : rotary) {
      text += axis;
      text += dialect::number_text(value);
    }
    path_.put(text);
  }
  if (!own_frame.empty()) {
    in_machine(given, own_frame);
  } else if (!given.axes.empty() || !given.polar.empty() ||
             (!given.centre.empty() && is_arc_by_centre(path_.modes.motion))) {
    path_.move(given);
  } else if (given.corner || given.radius || !given.middle.empty()) {
    throw given.error("a word of a contour without an axis: the end of the block must be programmed");
  }
}

void BlockWords::in_machine(const Given& given, const std::string& code) {
  if (given.axes.empty()) return;
  if (path_.modes.motion != Motion::g0 || !given.polar.empty()) {
    const std::string_view motion = path_.modes.motion == Motion::none ? "no G code" : name_of(path_.modes.motion);
    throw given.error(fmt::format("{} with {}: it is read with G0 and axes alone", code, motion));
  }
  std::array<std::optional<double>, 3> to;
  std::string axes;
  for (std::size_t k = 0; k < given.axes.size(); ++k) {
    const Coordinate& word = given.axes.coordinate(k);
    if (word.from_start) {
      throw error_at(word.column, fmt::format("{} incrementally: the axis must be programmed absolutely", code));
    }
    const auto axis = static_cast<std::size_t>(given.axes.axis(k));
    to[axis] = rounded_to(word.value, 5);
    axes += "XYZ"[axis];
  }
  path_.put("G53G00" + dialect::axis_words(to));
  path_.forget(axes);
  path_.note(fmt::format("{} is written as G53: which offsets it suppresses is set by the machine builder", code),
             "SUPA");
}

}  // namespace shapegcode::siemens
