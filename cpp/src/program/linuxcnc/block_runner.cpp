// Order of execution: LinuxCNC's G-code overview, "G-Code Order of Execution".
#include "program/linuxcnc/block_runner.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <utility>

#include "program/linuxcnc/program_text.hpp"
#include "program/text/characters.hpp"

namespace shapegcode::linuxcnc {
namespace {

using dialect::number_text;

/// A comment that FANUC's reader takes; empty: LinuxCNC executes it.
std::string plain_comment(std::string_view text) {
  const std::string begin = lowered(text.substr(0, 6));
  for (const std::string_view executed : {"msg,", "debug,", "print,", "log", "probe"}) {
    if (begin.starts_with(executed)) return {};
  }
  std::string plain;
  for (const char c : text) {
    if (c == '\xdf') plain += "SS";  // the sharp s in capitals
    if (c >= ' ' && c <= '~' && std::string_view("()%;").find(c) == std::string_view::npos) plain += upper(c);
  }
  return std::string(stripped(plain));
}

/// What an M code does that moves nothing and is left out; empty: it is not one of these.
std::string_view left_out(std::int64_t function) {
  switch (function) {
    case 50:
      return "feed override";
    case 51:
      return "spindle override";
    case 52:
      return "adaptive feed";
    case 53:
      return "feed hold switch";
    case 62:
    case 63:
    case 64:
    case 65:
      return "digital output";
    case 67:
    case 68:
      return "analog output";
    default:
      return {};
  }
}

bool stands_before_motion(std::int64_t function) {
  return (function >= 3 && function <= 5) || (function >= 7 && function <= 9) || function == 19 || function == 48 ||
         function == 49;
}

bool has(const std::vector<std::int64_t>& functions, std::int64_t function) {
  return std::ranges::find(functions, function) != functions.end();
}

}  // namespace

BlockRunner::BlockRunner(State& state, dialect::ExpandedLines& lines, const Room& room)
    : state_(state), lines_(lines), room_(room), offsets_(state, [this](const std::string& text) { put(text); }) {}

void BlockRunner::put(const std::string& text) {
  if (place.number.empty() || text.starts_with('(')) {
    lines_.put(text, place.line, place.file);
  } else {
    lines_.put(place.number + text, place.line, place.file);
    place.number.clear();
  }
  require_room();
}

void BlockRunner::note(const std::string& text, std::string_view key) {
  if (place.file == 0) {
    lines_.note(place.line, text, key);
  } else {
    lines_.note(1, fmt::format("{}:{}: {}", lines_.files()[place.file - 1], place.line, text), key);
  }
}

void BlockRunner::require_room() const {
  if (lines_.characters() <= room_.program_bytes + room_.max_expansion_bytes) return;
  refuse(
      fmt::format("up to here the expanded program is more than {} bytes larger than the program "
                  "(controller.max_expansion_bytes)",
                  room_.max_expansion_bytes));
}

void BlockRunner::run(BlockWords& block, const std::vector<std::string>& comments) {
  block.sort();
  const WordValues& values = block.values;
  const GroupCodes codes = by_group_of(block);
  refuse_unused(state_.modes, codes, block);
  for (const std::string& comment : comments) {
    if (const std::string text = plain_comment(comment); !text.empty()) put("(" + text + ")");
  }
  if (block.words.empty()) return;
  run_feed(codes, values);
  run_tool(block);
  run_spindle_and_functions(block);
  if (codes.has(Group::dwell)) run_dwell(values);
  std::string pending = run_modal_codes(codes, values);
  run_axes(codes, values, std::move(pending));
  run_stops(block);
}

void BlockRunner::run_feed(const GroupCodes& codes, const WordValues& values) {
  Modes& modes = state_.modes;
  const int mode = codes.get(Group::feed).value_or(modes.feed_mode);
  if (mode != modes.feed_mode) {
    modes.feed_mode = mode;
    modes.feed = written_feed_ = 0.0;
  }
  if (!values.has('f')) return;
  if (values['f'] < 0.0) refuse(fmt::format("F{:g} is negative", values['f']));
  modes.feed = values['f'];
}

void BlockRunner::run_stops(const BlockWords& block) {
  for (const std::int64_t function : block.functions) {
    if (function != 60 && function != 30 && (function < 0 || function > 2)) continue;
    put(fmt::format("M{:02}", function == 60 ? 0 : function));
    ended = ended || function == 2 || function == 30;
    if (function == 60) note("M60 changes the pallet and stops: kept as M00", "M60");
  }
}

void BlockRunner::lead_in(bool begins_with_g) {
  sync();
  if (!begins_with_g && written_motion_ != state_.modes.motion) {
    put(fmt::format("G{:02}", state_.modes.motion / 10));
  }
}

void BlockRunner::follow_modes() noexcept {
  written_motion_ = state_.modes.motion;
  written_feed_ = state_.modes.feed;
  state_.cycle.reset();
}

void BlockRunner::sync() {
  const Modes& modes = state_.modes;
  if (const std::string code = distance_word(modes.distance); !code.empty()) put(code);
  if (written_feed_ != modes.feed && modes.feed > 0.0 && modes.feed_mode != 930) put(written_f());
}

std::string BlockRunner::distance_word(int code) {
  const bool changes = written_distance_ != code;
  written_distance_ = code;
  return changes ? fmt::format("G{}", code / 10) : std::string();
}

std::string BlockRunner::written_f() {
  written_feed_ = state_.modes.feed;
  return "F" + number_text(written_feed_);
}

void BlockRunner::flush(std::string& codes) {
  if (codes.empty()) return;
  put(codes);
  codes.clear();
}

void BlockRunner::run_tool(const BlockWords& block) {
  const WordValues& values = block.values;
  Modes& modes = state_.modes;
  if (values.has('s')) modes.speed = values['s'];
  std::string line;
  if (values.has('t')) {
    state_.selected = rounded(values['t']);
    line = fmt::format("T{}", state_.selected);
  }
  if (has(block.functions, 6)) {
    state_.tool = state_.selected;
    modes.spindle = 5;
    line += "M06";
  }
  if (has(block.functions, 61)) {
    state_.tool = truncated(values.get('q', 0.0));
    note(fmt::format("M61 Q{} states the tool in the spindle: no motion", state_.tool), "M61");
  }
  flush(line);
}

void BlockRunner::run_spindle_and_functions(const BlockWords& block) {
  constexpr std::size_t most_in_a_block = 3;  // no more M codes than every FANUC control takes
  Modes& modes = state_.modes;
  std::vector<std::string> words;
  if (block.values.has('s')) words.push_back(fmt::format("S{}", rounded(block.values['s'])));
  for (const std::int64_t function : block.functions) {
    if (stands_before_motion(function)) {
      words.push_back(fmt::format("M{:02}", function));
      if (function >= 3 && function <= 5) modes.spindle = function;
      modes.mist = (modes.mist || function == 7) && function != 9;
      modes.flood = (modes.flood || function == 8) && function != 9;
    } else if (const std::string_view what = left_out(function); !what.empty()) {
      note(fmt::format("M{} ({}) moves nothing and is left out", function, what), fmt::format("M{}", function));
    } else if (function >= 100 && function <= 199) {
      words.push_back(fmt::format("M{}", function));
      note(words.back() + " runs a program of the machine's own: it is kept without P and Q", words.back());
    }
  }
  std::string line;
  for (std::size_t k = 0; k < words.size(); ++k) {
    if (k % most_in_a_block == 0) flush(line);
    line += words[k];
  }
  flush(line);
}

void BlockRunner::run_dwell(const WordValues& values) {
  if (!values.has('p')) refuse("G4 needs P, the dwell in seconds");
  const double seconds = values['p'];
  if (seconds < 0.0) refuse(fmt::format("G4 P{:g} is negative", seconds));
  put("G04X" + number_text(seconds));
  note(fmt::format("G4 P{:g} is a dwell of {:g} s on LinuxCNC; on FANUC P counts milliseconds", seconds, seconds),
       "G4 P");
}

std::string BlockRunner::run_modal_codes(const GroupCodes& codes, const WordValues& values) {
  Modes& modes = state_.modes;
  std::string pending;
  const auto add = [&pending](int code) { pending += fmt::format("G{}", code / 10); };
  if (codes.has(Group::feed)) add(modes.feed_mode);
  if (const auto plane = codes.get(Group::plane)) {
    modes.plane = *plane;
    add(modes.plane);
  }
  if (const auto unit = codes.get(Group::units)) pending += set_unit(*unit, values);
  if (const auto spindle = codes.get(Group::spindle)) {
    if (*spindle == 960) refuse("G96 is constant surface speed of a lathe: it is not read");
    pending += "G97";
  }
  if (codes.has(Group::compensation)) pending += "G40";
  if (const auto length = codes.get(Group::length)) {
    sync();
    offsets_.length(*length, values);
  }
  if (const auto system = codes.get(Group::system)) {
    state_.select_system(system_of(*system));
    put(system_words(modes.system));
  }
  if (const auto path = codes.get(Group::path)) pending += set_path_mode(*path, values);
  if (const auto distance = codes.get(Group::distance)) {
    modes.distance = written_distance_ = *distance;
    add(modes.distance);
  }
  modes.centres = codes.get(Group::centres).value_or(modes.centres);
  if (const auto retract = codes.get(Group::retract)) {
    modes.retract = *retract;
    add(modes.retract);
  }
  return pending;
}

std::string BlockRunner::set_unit(int code, const WordValues& values) {
  Modes& modes = state_.modes;
  const double before = state_.unit_mm();
  modes.units = code;
  const bool is_same = before == state_.unit_mm();
  if (values.has('f') && !is_same) {
    note(
        fmt::format("F{:g} in the block of G{} is in {} still: LinuxCNC sets F before the unit; FANUC would read it in "
                    "{}",
                    values['f'], code / 10, code == 200 ? "mm" : "inch", code == 200 ? "inch" : "mm"),
        "F and unit");
  }
  // The feed in force stays what it is in mm.
  if (modes.feed_mode != 930) {
    modes.feed *= before / state_.unit_mm();
    if (!is_same) written_feed_ = 0.0;
  }
  return fmt::format("G{}", code / 10);
}

std::string BlockRunner::set_path_mode(int code, const WordValues& values) {
  state_.modes.path = code;
  if (code == 611) {
    note("G61.1 stops at the end of every block: FANUC's G61", "G61.1");
    return "G61";
  }
  if (code == 610) {
    note(
        "G61 follows the path exactly and does not stop where it is smooth; FANUC's G61 would stop in every block: "
        "read "
        "as G64",
        "G61");
    has_other_tolerances_ = true;
    return "G64";
  }
  LinuxcncPathTolerance tolerance;
  if (values.has('p')) tolerance.p_mm = values['p'] * state_.unit_mm();
  if (values.has('q')) tolerance.q_mm = values['q'] * state_.unit_mm();
  add_tolerance(tolerance);
  if (tolerance.p_mm) {
    note(fmt::format("G64 P: blends leave the path by up to {:g} mm (FANUC's G64 has no P); the planner model takes it "
                     "from controller.linuxcnc.blend_tolerance_mm, for the original and for what is left unchanged",
                     *tolerance.p_mm),
         "G64 P");
  }
  return "G64";
}

void BlockRunner::add_tolerance(const LinuxcncPathTolerance& tolerance) {
  has_other_tolerances_ = has_other_tolerances_ || (tolerance_ && *tolerance_ != tolerance);
  tolerance_ = tolerance;
}

std::optional<LinuxcncPathTolerance> BlockRunner::path_tolerance() const {
  return has_other_tolerances_ ? std::nullopt : tolerance_;
}

void BlockRunner::restore(const Modes& saved) {
  const Modes modes = state_.modes;
  state_.select_system(saved.system);
  Modes kept = saved;
  kept.motion = modes.motion;
  std::string codes;
  const auto add = [&codes](int code) { codes += fmt::format("G{}", code / 10); };
  if (kept.plane != modes.plane) add(kept.plane);
  if (kept.units != modes.units) add(kept.units);
  if (kept.retract != modes.retract) add(kept.retract);
  if (kept.feed_mode != modes.feed_mode) add(kept.feed_mode);
  if (kept.path != modes.path) codes += kept.path == 611 ? "G61" : "G64";
  flush(codes);
  put(system_words(saved.system));
  if (kept.speed != modes.speed) put(fmt::format("S{}", rounded(kept.speed)));
  if (kept.spindle != modes.spindle) put(fmt::format("M{:02}", kept.spindle));
  if (kept.mist != modes.mist || kept.flood != modes.flood) {
    put("M09");
    if (kept.mist) put("M07");
    if (kept.flood) put("M08");
  }
  state_.modes = kept;
}

}  // namespace shapegcode::linuxcnc
