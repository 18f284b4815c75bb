#include "program/linuxcnc/codes.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <string_view>

#include "program/dialect/path_element.hpp"
#include "program/linuxcnc/program_text.hpp"
#include "program/text/characters.hpp"

namespace shapegcode::linuxcnc {
namespace {

bool is_one_shot(std::int64_t code) {
  switch (code) {
    case 100:
    case 280:
    case 281:
    case 300:
    case 301:
    case 520:
    case 920:
    case 921:
    case 922:
    case 923:
      return true;
    default:
      return false;
  }
}

std::optional<Group> group_of(std::int64_t code) {
  if (is_cycle(code)) return Group::motion;
  if (is_one_shot(code)) return Group::one_shot;
  switch (code) {
    case 0:
    case 10:
    case 20:
    case 30:
    case 800:
      return Group::motion;
    case 40:
      return Group::dwell;
    case 530:
      return Group::machine;
    case 170:
    case 180:
    case 190:
      return Group::plane;
    case 900:
    case 910:
      return Group::distance;
    case 901:
    case 911:
      return Group::centres;
    case 930:
    case 940:
    case 950:
      return Group::feed;
    case 200:
    case 210:
      return Group::units;
    case 400:
      return Group::compensation;
    case 430:
    case 431:
    case 490:
      return Group::length;
    case 610:
    case 611:
    case 640:
      return Group::path;
    case 980:
    case 990:
      return Group::retract;
    case 960:
    case 970:
      return Group::spindle;
    case 80:
      return Group::lathe;
    default:
      return system_of(static_cast<int>(std::clamp<std::int64_t>(code, 0, 1000))) > 0 ? std::optional(Group::system)
                                                                                      : std::nullopt;
  }
}

/// What a G code of tenths is that is not read; empty: it is not one of these.
std::string_view refused_code(std::int64_t code) {
  constexpr std::string_view compensation =
      "cutter compensation, which rounds outer corners with arcs where FANUC's lengthens the lines: write the path of "
      "the tool's centre";
  switch (code) {
    case 50:
      return "a cubic spline";
    case 51:
      return "a quadratic spline";
    case 52:
    case 60:
    case 61:
    case 62:
      return "a NURBS block";
    case 53:
      return "the end of a NURBS block";
    case 70:
      return "diameter mode of a lathe";
    case 171:
      return "the UV plane";
    case 181:
      return "the WU plane";
    case 191:
      return "the VW plane";
    case 330:
      return "motion that the spindle's encoder leads";
    case 331:
      return "rigid tapping, led by the spindle's encoder";
    case 382:
    case 383:
    case 384:
    case 385:
      return "a probing move: where it ends, only the machine knows";
    case 410:
    case 411:
    case 420:
    case 421:
      return compensation;
    case 432:
      return "a second tool length offset added to the first";
    case 700:
    case 710:
    case 711:
    case 712:
    case 720:
    case 721:
    case 722:
      return "a turning cycle";
    case 760:
      return "a threading cycle (FANUC's G76 is fine boring)";
    case 870:
      return "back boring, which LinuxCNC moves otherwise than FANUC";
    case 880:
      return "boring that waits for the operator";
    default:
      return {};
  }
}

constexpr std::int64_t waits_for_input = 66;

/// M codes of which a block has one.
int function_group_of(std::int64_t function) {
  switch (function) {
    case 0:
    case 1:
    case 2:
    case 30:
    case 60:
      return 1;
    case 3:
    case 4:
    case 5:
    case 19:
      return 2;
    case 6:
    case 61:
      return 3;
    case 7:
    case 8:
    case 9:
      return 4;
    case 48:
    case 49:
    case 50:
    case 51:
    case 52:
    case 53:
      return 5;
    default:
      return 0;
  }
}

bool is_arc(int code) { return code == 20 || code == 30; }

/// Whether a G code of tenths uses a letter.
bool code_uses(char letter, int code) {
  switch (letter) {
    case 'd':
      return code == 960;  // G41, G42 and G96 are refused
    case 'h':
      return code == 430;
    case 'i':
    case 'j':
      return is_arc(code) || code == 100;
    case 'k':
      return is_arc(code);
    case 'l':
      return is_cycle(code) || code == 100;
    case 'p':
      return is_arc(code) || code == 40 || code == 100 || code == 640 || code == 740 || code == 820 || code == 840 ||
             code == 860 || code == 890;
    case 'q':
      return code == 100 || code == 640 || code == 730 || code == 830;
    case 'r':
      return is_arc(code) || is_cycle(code) || code == 100;
    default:
      return false;
  }
}

bool function_uses(char letter, std::int64_t function) {
  const bool is_own_program = function >= 100 && function <= 199;
  switch (letter) {
    case 'e':
      return function == 67 || function == 68;
    case 'p':
      return is_own_program || function == 19 || (function >= 50 && function <= 53) ||
             (function >= 62 && function <= 65);
    case 'q':
      return is_own_program || function == 19 || function == 61 || function == 67 || function == 68;
    case 'r':
      return function == 19;
    default:
      return false;
  }
}

bool is_whole(double value, double tolerance) { return std::abs(value - std::nearbyint(value)) <= tolerance; }

void refuse_two_functions(const std::vector<std::int64_t>& functions) {
  for (int group = 1; group <= 5; ++group) {
    std::optional<std::int64_t> first;
    for (const std::int64_t function : functions) {
      if (function_group_of(function) != group) continue;
      if (first) refuse(fmt::format("M{} and M{} in one block", *first, function));
      first = function;
    }
  }
}

}  // namespace

int system_of(int code) noexcept {
  if (code >= 540 && code <= 590 && code % 10 == 0) return (code - 530) / 10;
  return code >= 591 && code <= 593 ? code - 584 : 0;
}

std::string code_text(std::int64_t code) {
  return code % 10 == 0 ? fmt::format("G{}", code / 10) : fmt::format("G{}.{}", code / 10, code % 10);
}

void BlockWords::sort() {
  codes.clear();
  functions.clear();
  values = {};
  for (const auto& [letter, value] : words) {
    if (letter == 'g') {
      if (!is_whole(value * 10.0, 1e-3) || value < 0.0) refuse(fmt::format("G{:g} is not a G code of LinuxCNC", value));
      codes.push_back(rounded(value * 10.0));
    } else if (letter == 'm') {
      if (!is_whole(value, 1e-4) || value < 0.0) refuse(fmt::format("M{:g} is not an M code of LinuxCNC", value));
      functions.push_back(rounded(value));
    } else if (letter != 'n') {
      values.set(letter, value);
    }
  }
}

GroupCodes by_group_of(const BlockWords& block) {
  for (const std::int64_t code : block.codes) {
    if (const std::string_view what = refused_code(code); !what.empty()) {
      refuse(fmt::format("{} is {}: it is not read", code_text(code), what));
    }
    if (!group_of(code)) refuse(code_text(code) + " is not a G code of LinuxCNC");
  }
  if (std::ranges::find(block.functions, waits_for_input) != block.functions.end()) {
    refuse("M66 is a wait for an input: its result, #5399, only the machine knows: it is not read");
  }
  if (const char letter = block.values.first_of(letter_set("uvw")); letter != '\0') {
    refuse(fmt::format("{} is a further axis on LinuxCNC, and has another meaning on FANUC: it is not read",
                       upper(letter)));
  }
  if (block.values.get('$', 0.0) != 0.0) refuse("$ selects another spindle: it is not read");
  GroupCodes found;
  for (const std::int64_t code : block.codes) {
    const Group group = *group_of(code);
    const std::optional<int> other = found.get(group);
    const std::int64_t first = other.value_or(static_cast<int>(code));
    if (first != code || std::ranges::count(block.codes, code) > 1) {
      refuse(fmt::format("{} and {} in one block", code_text(first), code_text(code)));
    }
    found.set(group, static_cast<int>(code));
  }
  return found;
}

void refuse_unused(const Modes& modes, const GroupCodes& codes, const BlockWords& block) {
  const WordValues& values = block.values;
  const bool ends_motion = codes.has(Group::one_shot) || codes.has(Group::dwell);
  const bool goes_on = values.has_any(letter_set("xyzabcijk@^")) && !ends_motion;
  std::optional<int> motion = codes.get(Group::motion);
  if (!motion && goes_on) motion = modes.motion;
  for (const char letter : std::string_view("dehijklpqr")) {
    if (!values.has(letter)) continue;
    const auto uses = [letter](int code) { return code_uses(letter, code); };
    const auto needs = [letter](std::int64_t function) { return function_uses(letter, function); };
    if (codes.any(uses) || (motion && uses(*motion)) || std::ranges::any_of(block.functions, needs)) continue;
    refuse(fmt::format("{}{:g} and no word in the block that uses it: LinuxCNC refuses it", upper(letter),
                       values[letter]));
  }
  const int plane = codes.get(Group::plane).value_or(modes.plane);
  const char normal_centre = centre_letters[dialect::axes_of(plane / 10).normal];
  if (motion && is_arc(*motion) && values.has(normal_centre)) {
    refuse(fmt::format("{} is not a centre word of an arc in {}: LinuxCNC refuses it", upper(normal_centre),
                       code_text(plane)));
  }
  if (const char axis = values.first_of(letter_set("abc")); motion && is_cycle(*motion) && axis != '\0') {
    refuse(fmt::format("{} in a drilling cycle: LinuxCNC refuses it", upper(axis)));
  }
  if (values.has('t') && !is_whole(values['t'], 1e-4)) refuse(fmt::format("T{:g} is not a whole number", values['t']));
  if (values.get('s', 0.0) < 0.0) refuse(fmt::format("S{:g} is negative", values['s']));
  refuse_two_functions(block.functions);
}

}  // namespace shapegcode::linuxcnc
