#include "program/linuxcnc/drilling.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <optional>

#include "program/dialect/expanded_lines.hpp"
#include "program/dialect/path_element.hpp"
#include "program/linuxcnc/program_text.hpp"
#include "program/text/characters.hpp"

namespace shapegcode::linuxcnc {
namespace {

using dialect::number_text;

struct Levels {
  double r;
  double bottom;
  double clear;
};

/// One block of a cycle.
class Drill {
 public:
  Drill(State& state, int code, const WordValues& words, const WriteLine& write)
      : state_(state),
        code_(code),
        words_(words),
        write_(write),
        axes_(dialect::axes_of(state.modes.plane / 10)),
        unit_(state.unit_mm()),
        normal_(axis_letters[axes_.normal]) {
    if (!state.cycle)
      state.cycle = CycleWords{.initial = position(), .r = {}, .bottom = {}, .peck = {}, .dwell = {}, .entered = {}};
  }

  void run(bool is_first) {
    read_words(is_first);
    const Levels levels = find_levels();
    const double repeats = words_.get('l', 1.0);
    if (repeats != std::trunc(repeats) || repeats < 1.0 || repeats > static_cast<double>(max_cycle_repeats)) {
      refuse(fmt::format("L{:g}: a cycle is repeated 1 to {} times", repeats, max_cycle_repeats));
    }
    approach(levels, static_cast<int>(repeats));
  }

 private:
  [[nodiscard]] bool is_pecking() const noexcept { return code_ == 730 || code_ == 830; }
  [[nodiscard]] bool is_tapping() const noexcept { return code_ == 740 || code_ == 840; }
  [[nodiscard]] CycleWords& row() { return *state_.cycle; }
  [[nodiscard]] std::optional<double>& position() { return state_.position[axes_.normal]; }
  [[nodiscard]] std::string axis_word(double level_mm) const { return upper(normal_) + number_text(level_mm / unit_); }

  /// What the block says of the cycle; what it does not say holds on in a row.
  void read_words(bool is_first) {
    CycleWords& words = row();
    if (is_first && !words_.has(normal_)) {
      refuse(fmt::format("a drilling cycle begins without {}", upper(normal_)));
    }
    if (is_first) words.peck = words.dwell = std::nullopt;
    const auto read = [this](char letter, std::optional<double>& value) {
      if (words_.has(letter)) value = words_[letter];
    };
    read('r', words.r);
    read(normal_, words.bottom);
    read('q', words.peck);
    read('p', words.dwell);
    if (!words.r) refuse("a drilling cycle begins without R");
    if (is_pecking() && words.peck.value_or(0.0) <= 0.0) {
      refuse(fmt::format("G{} needs Q, the depth of a peck, greater than 0", code_ / 10));
    }
    if ((code_ == 820 || code_ == 860 || code_ == 890) && !words.dwell) {
      refuse(fmt::format("G{} needs P, the dwell in seconds", code_ / 10));
    }
    if (is_tapping() && !words.dwell) words.dwell = state_.cycle_dwell;
    state_.cycle_dwell = words.dwell.value_or(state_.cycle_dwell);
  }

  /// R, the bottom and the level between the holes, mm; the tool goes up to R where the row begins below.
  Levels find_levels() {
    CycleWords& words = row();
    double r = words.r.value_or(0.0) * unit_;
    double bottom = words.bottom.value_or(0.0) * unit_;
    if (is_incremental()) {
      if (!words.initial) refuse_unknown(normal_, "from which G91 counts");
      r = *words.initial + r;
      bottom = r + bottom;
    }
    if (bottom > r) refuse(fmt::format("R {:g} is below the bottom {:g} of the hole", r / unit_, bottom / unit_));
    return {r, bottom, r};
  }

  void approach(Levels levels, int repeats) {
    std::optional<double> here = position();
    std::optional<double> initial = row().initial ? row().initial : here;
    if (state_.modes.retract == 980 && !initial) refuse_unknown(normal_, "to which G98 returns");
    if (initial && *initial < levels.r) {
      if (here != levels.r) {
        write_("G00" + axis_word(levels.r));
        position() = levels.r;
        row().entered.reset();
      }
      here = initial = levels.r;
    }
    if (state_.modes.retract != 990 && initial) levels.clear = *initial;
    // The first hole of a block is approached at this level, straight from where the tool is.
    std::optional<double> lift;
    if (state_.modes.retract == 980) {
      lift = levels.clear;
    } else if (here) {
      lift = std::max(*here, levels.r);
    }
    if (lift == here) lift.reset();
    for (int k = 0; k < repeats; ++k) {
      const std::string place = next_place();
      if (lift) {
        write_("G00" + place + axis_word(*lift));
        position() = lift;
        row().entered.reset();
        lift.reset();
      }
      make_hole(place, levels);
      position() = levels.clear;
    }
  }

  /// The axis words of the next hole.
  std::string next_place() {
    std::array<std::optional<double>, 3> words;
    for (std::size_t axis = 0; axis < 3; ++axis) {
      if (axis == axes_.normal) continue;
      std::optional<double>& here = state_.position[axis];
      if (words_.has(axis_letters[axis])) {
        if (is_incremental() && !here) refuse_unknown(axis_letters[axis], "from which G91 counts");
        here = words_[axis_letters[axis]] * unit_ + (is_incremental() ? *here : 0.0);
      }
      if (here) words[axis] = *here / unit_;
    }
    return dialect::axis_words(words);
  }

  void make_hole(const std::string& place, const Levels& levels) {
    CycleWords& words = row();
    const std::string at_r = axis_word(levels.r);
    const std::string at_bottom = axis_word(levels.bottom);
    const std::string at_clear = axis_word(levels.clear);
    const std::optional<double> begun = position();
    const bool returns_to_r = levels.clear == levels.r;
    const bool enters_here = returns_to_r || words.entered == levels.clear || begun == levels.clear;
    if (!moves_as_fanuc(levels) || !enters_here) {
      words.entered.reset();
      write_(place.empty() ? "G00" : "G00" + place);
      move_down(at_r, at_bottom, levels);
      move_out(at_r, at_clear);
      return;
    }
    if (words.entered && !returns_to_r && words.entered != levels.clear) {
      write_("G80");  // the level of G98 is that at which FANUC's row begins
      words.entered.reset();
    }
    if (!words.entered) words.entered = begun;
    std::string line = fmt::format("G{}{}{}{}R{}", code_ / 10, returns_to_r ? "G99" : "G98", place, at_bottom,
                                   std::string_view(at_r).substr(1));
    if (is_pecking()) line += "Q" + number_text(words.peck.value_or(0.0));
    if (code_ == 820 || code_ == 890) line += fmt::format("P{}", rounded(dwell() * 1e3));
    write_(line);
  }

  void move_down(const std::string& at_r, const std::string& at_bottom, const Levels& levels) {
    write_("G00" + at_r);
    if (is_pecking()) {
      for_each_peck(levels, [&](double depth) {
        write_(fmt::format("G01{}{}", upper(normal_), number_text(depth)));
        if (code_ == 830) write_("G00" + at_r);
        write_(fmt::format("G00{}{}", upper(normal_), number_text(depth + linuxcnc_peck_clearance_mm / unit_)));
        return true;
      });
    }
    write_("G01" + at_bottom);
  }

  void move_out(const std::string& at_r, const std::string& at_clear) {
    const std::int64_t spindle = state_.modes.spindle;
    if (is_tapping()) {
      write_("M05");
      write_(spindle == 4 ? "M03" : "M04");
    }
    if (code_ != 850 && dwell() > 0.0) write_("G04X" + number_text(dwell()));
    if (code_ == 860) write_("M05");
    if (code_ == 850) write_("G01" + at_r);
    write_((is_tapping() || code_ == 890 ? "G01" : "G00") + at_clear);
    if (is_tapping()) write_("M05");
    if (is_tapping() || code_ == 860) write_(fmt::format("M{:02}", spindle));
  }

  /// Where the pecks before the last one end, in the program's unit, summed up as LinuxCNC does; until `take` says no.
  template <class Take>
  void for_each_peck(const Levels& levels, const Take& take) {
    const double peck = row().peck.value_or(0.0);
    const double bottom = levels.bottom / unit_;
    for (double depth = levels.r / unit_ - peck; depth > bottom && take(depth);) depth -= peck;
  }

  /// Whether FANUC's cycle of the same number makes the same moves and waits.
  bool moves_as_fanuc(const Levels& levels) {
    const bool returns_to_r = levels.clear == levels.r;
    if (is_pecking()) return pecks_as_fanuc(levels);
    if (is_tapping()) return dwell() == 0.0 && returns_to_r;
    if (code_ == 820 || code_ == 890) {  // FANUC's P is whole milliseconds
      const double wait_ms = dwell() * 1e3;
      return std::abs(wait_ms - std::nearbyint(wait_ms)) < 1e-9 && (code_ == 820 || returns_to_r);
    }
    return code_ == 810 || code_ == 850;
  }

  /// Depths are summed up: the last peck may be one more than the division says, of next to nothing.
  bool pecks_as_fanuc(const Levels& levels) {
    constexpr double most_pecks = 1e6;
    const double peck = row().peck.value_or(0.0);
    const double count = std::ceil((levels.r - levels.bottom) / unit_ / peck);
    if (peck * unit_ <= linuxcnc_peck_clearance_mm || count > most_pecks) return false;
    double before_last = 0.0;
    for_each_peck(levels, [&before_last](double) { return ++before_last <= most_pecks; });
    return before_last == count - 1.0;
  }

  [[nodiscard]] bool is_incremental() const noexcept { return state_.modes.distance == 910; }
  [[nodiscard]] double dwell() { return row().dwell.value_or(0.0); }

  [[noreturn]] static void refuse_unknown(char axis, std::string_view use) {
    refuse(fmt::format("the position of {} is not known, {}", upper(axis), use));
  }

  State& state_;
  int code_;
  const WordValues& words_;
  const WriteLine& write_;
  dialect::PlaneAxes axes_;
  double unit_;
  char normal_;
};

}  // namespace

void drill(State& state, int code, const WordValues& words, bool is_first, const WriteLine& write) {
  Drill(state, code, words, write).run(is_first);
}

}  // namespace shapegcode::linuxcnc
