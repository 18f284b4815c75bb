// Codes and addresses of a block.
#include <fmt/format.h>

#include "program/siemens/block_words.hpp"
#include "program/siemens/run.hpp"
#include "program/siemens/scanner.hpp"

namespace shapegcode::siemens {
namespace {

constexpr double mm_per_inch = 25.4;

std::string_view shown_motion(Motion motion) { return motion == Motion::none ? "no G code" : name_of(motion); }

}  // namespace

bool BlockWords::mode(const Word& word, Given& given) {
  Modes& modes = path_.modes;
  const auto offset_from = [&word](WordId first) { return static_cast<int>(word.id) - static_cast<int>(first); };
  if (is_between(word.id, WordId::g0, WordId::ct)) {
    modes.motion = static_cast<Motion>(1 + offset_from(WordId::g0));
  } else if (is_between(word.id, WordId::g17, WordId::g19)) {
    path_.set_plane(17 + offset_from(WordId::g17));
  } else if (is_between(word.id, WordId::g90, WordId::g91)) {
    modes.incremental = word.id == WordId::g91;
  } else if (is_between(word.id, WordId::g70, WordId::g710)) {
    modes.unit = word.id == WordId::g70 || word.id == WordId::g700 ? mm_per_inch : 1.0;
    modes.feed_unit = word.id == WordId::g700 ? mm_per_inch : 1.0;
  } else if (is_between(word.id, WordId::g93, WordId::g95)) {
    const int mode = 93 + offset_from(WordId::g93);
    if (modes.feed_mode != mode) {  // its number means another thing now
      modes.feed.reset();
      given.start_feed.reset();
    }
    modes.feed_mode = mode;
  } else if (is_between(word.id, WordId::flin, WordId::fnorm)) {
    modes.is_linear = word.id == WordId::flin;
  } else if (word.id == WordId::g9) {
    given.exact = true;
  } else {
    return false;
  }
  return true;
}

void BlockWords::code(const Word& word, Given& given) {
  if (word.id == WordId::ret || mode(word, given)) return;
  if (is_between(word.id, WordId::g60, WordId::g641)) {
    path_mode(word.id);
    return;
  }
  if (word.id == WordId::work_offset) {
    path_.set_offset(word.name);
    if (word.name.size() > 3) {  // G500 and above
      path_.name(offset_word(word.name), word.name);
      path_.note(fmt::format("{} is written as {}", word.name, offset_word(word.name)), word.name);
    }
    return;
  }
  const auto& left_out = path_.options().left_out;
  const auto found = left_out.find(word.name);
  if (found == left_out.end()) throw refusal(word);
  path_.note(found->second);
}

void BlockWords::path_mode(WordId id) {
  const std::string_view code = id == WordId::g60 ? "G61" : "G64";
  if (code != path_mode_) {
    path_mode_ = code;
    path_.put(code);
  }
  if (id == WordId::g641) {
    path_.note("G641 to G645 are read as G64: by how much the control rounds corners is its own", "G641");
  }
}

Error BlockWords::refusal(const Word& word) const {
  const std::string& name = word.name;
  if (path_.options().refused) {
    if (const std::string reason = path_.options().refused(name); !reason.empty()) {
      return word.error(fmt::format("{}: {}", name, reason));
    }
  }
  if (name.size() > 1 && name[0] == 'G' && is_digits(std::string_view(name).substr(1))) {
    return word.error(name + " is not a supported code");
  }
  if (word.value) {
    return word.error(name + "= is neither an address that is read nor a variable: DEF must come before");
  }
  return word.error(fmt::format(
      "{0} is neither a word that is read nor a program: {0}.SPF must be in the same folder as this one", name));
}

void BlockWords::address(const Word& word, Given& given, Rotary& rotary, Functions& functions) {
  if (run_.knows(word.name)) {
    run_.assign(word, value(word));
    return;
  }
  if (const int axis = index_from(word.id, WordId::x); axis >= 0) {
    const double to = length(word);
    given.axes.set(axis, {.value = to, .from_start = is_incremental(word), .column = word.column});
    return;
  }
  switch (word.id) {
    case WordId::i:
    case WordId::j:
    case WordId::k:
    case WordId::i1:
    case WordId::j1:
    case WordId::k1:
      centre(word, given);
      return;
    case WordId::cr:
    case WordId::ar:
    case WordId::turn:
    case WordId::ap:
    case WordId::rp:
      round_word(word, given);
      return;
    case WordId::f:
      feed(word, given);
      return;
    case WordId::rnd:
    case WordId::chr:
    case WordId::chf:
      given.corner = {static_cast<CornerKind>(static_cast<int>(word.id) - static_cast<int>(WordId::rnd)), length(word)};
      return;
    case WordId::rndm:
      path_.modes.rounding_mm = length(word);
      return;
    case WordId::m:
    case WordId::s:
    case WordId::t:
    case WordId::d:
    case WordId::spos:
    case WordId::sposa:
    case WordId::spindle_word:
      functions.push_back(&word);
      return;
    case WordId::rotary:
      rotary.emplace_back(word.name[0], number_of_word(word));
      return;
    default:
      break;
  }
  const auto& left_out = path_.options().left_out_addresses;
  const auto found = left_out.find(word.name);
  if (found == left_out.end()) throw refusal(word);
  path_.note(found->second);
}

void BlockWords::feed(const Word& word, Given& given) {
  Modes& modes = path_.modes;
  given.has_feed = true;
  modes.feed = number_of_word(word) * (modes.feed_mode != 93 ? modes.feed_unit : 1.0);
  if (*modes.feed <= 0.0) throw word.error(fmt::format("F{:g}: it must be more than 0", *modes.feed));
}

void BlockWords::centre(const Word& word, Given& given) const {
  const Motion motion = path_.modes.motion;
  const int middle = index_from(word.id, WordId::i1);
  const bool is_wrong = middle >= 0 ? motion != Motion::cip : !is_arc_by_centre(motion);
  if (is_wrong) {
    throw word.error(fmt::format("{} with {}: {} must be in force", word.name, shown_motion(motion),
                                 middle >= 0 ? "CIP" : "G2 or G3"));
  }
  const double value = length(word);
  if (middle >= 0) {
    given.middle.set(middle, {.value = value, .from_start = is_incremental(word), .column = word.column});
  } else {
    given.centre.set(index_from(word.id, WordId::i),
                     {.value = value, .from_start = word.mode != Mode::absolute, .column = word.column});
  }
}

void BlockWords::polar_word(const Word& word, Mode mode, Given& given) const {
  const bool is_angle = word.id == WordId::ap;
  const double value = is_angle ? number_of_word(word) : length(word);
  const PolarWord polar{.is_angle = is_angle, .value = value, .mode = mode, .column = word.column};
  for (PolarWord& each : given.polar) {
    if (each.is_angle != is_angle) continue;
    each = polar;
    return;
  }
  given.polar.push_back(polar);
}

void BlockWords::round_word(const Word& word, Given& given) const {
  const Motion motion = path_.modes.motion;
  switch (word.id) {
    case WordId::cr:
      given.radius = length(word);
      break;
    case WordId::ar:
      given.angle = number_of_word(word);
      break;
    case WordId::turn:
      given.turns = whole_of(word);
      if (given.turns < 0 || given.turns > 999) {
        throw word.error(fmt::format("TURN={}: it must be 0 to 999", given.turns));
      }
      break;
    default:
      polar_word(word, word.mode, given);
      if (word.id == WordId::rp && given.polar.back().value < 0.0) {
        throw word.error(fmt::format("RP={:g}: a polar radius must be 0 or more", given.polar.back().value));
      }
      return;
  }
  if (!is_arc_by_centre(motion)) {
    throw word.error(fmt::format("{}= with {}: G2 or G3 must be in force", word.name, shown_motion(motion)));
  }
}

}  // namespace shapegcode::siemens
