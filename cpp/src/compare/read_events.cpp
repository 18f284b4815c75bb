// The words of a program, line by line, with its canonical moves.
#include <fmt/format.h>

#include <algorithm>
#include <string_view>

#include "compare/cut_collector.hpp"
#include "compare/events.hpp"
#include "program/interpret/input_rules.hpp"
#include "program/read/program_store.hpp"
#include "program/text/characters.hpp"
#include "program/text/parsed_block.hpp"

namespace shapegcode::detail {
namespace {

constexpr std::uint32_t xyz_letters = letter_mask("XYZ");
constexpr std::uint32_t arc_letters = letter_mask("IJK");
constexpr std::uint32_t further_axes = letter_mask("ABCUVW");
constexpr double stop_before_rapid_s = 0.01;  // what a shaped rapid has before it

// Capitals without blanks, N word and comments.
std::string plain_text(std::string_view text) {
  std::string plain;
  bool comment = false;
  for (const char c : text) {
    comment = comment || c == '(';
    if (!comment && !is_blank(c)) {
      plain += upper(c);
    }
    comment = comment && c != ')';
  }
  std::size_t behind = 0;
  if (plain.starts_with('N')) {
    behind = 1;
    while (behind < plain.size() && is_digit(plain[behind])) ++behind;
  }
  return plain.substr(behind);
}

class EventReader {
 public:
  EventReader(const Program& program, const ComparisonOptions& options)
      : program_(program), options_(options), cuts_(program, events_) {
    const ModalState& on = options.reader.power_on;
    modes_ = {on.plane, on.distance, on.feed_mode, on.exact_stop, on.cycle_return};
    motion_ = on.motion;
    units_ = on.units;
    compensation_ = on.compensation;
    coordinate_tenths_ = on.coordinate_system * 10;
  }

  Events read() {
    const TapeFrame frame = find_frame(program_.text);
    ProgramUnit unit;
    unit.text = &program_.text;
    unit.end = frame.end;
    LinePosition next{frame.begin, frame.first_line};
    std::string_view text;
    std::size_t begin = 0;
    for (LinePosition here = next; !ended_ && unit.next_line(next, text, begin); here = next) {
      line_ = here.line;
      calls_before_line();
      block_.read(text, line_, options_.reader.max_line_length);
      if (block_.optional_skip && block_skip(options_.reader, block_.skip_switch).value_or(false)) {
        continue;
      }
      const bool head = block_.folder || !block_.program_name.empty() || (!block_.macro && block_.sorted().has('O'));
      if (head && events_.last_line > 0) {
        break;  // the next program of the file
      }
      if (head || block_.macro || block_.word_count > 0) {
        events_.last_line = line_;
      }
      if (!head) {
        block();
      }
    }
    close();
    return std::move(events_);
  }

 private:
  [[nodiscard]] const BlockWords& words() const noexcept { return block_.sorted(); }

  void calls_before_line() {
    for (; call_ < program_.calls.size() && program_.calls[call_].line <= line_; ++call_) {
      events_.all.push_back(event(ComparedKind::calls, fmt::format("call of O{:04}", program_.calls[call_].number)));
      events_.all.back().call = &program_.calls[call_];
    }
  }

  [[nodiscard]] Event event(ComparedKind kind, std::string word) const {
    Event event;
    event.kind = kind;
    event.optional = block_.optional_skip;
    event.line = line_;
    event.word = std::move(word);
    return event;
  }

  Event& add(ComparedKind kind, std::string word) {
    close();
    in_shaped_cut_ = false;
    events_.all.push_back(event(kind, std::move(word)));
    return events_.all.back();
  }

  void close() {
    cuts_.close();
    in_rapid_ = has_entry_ = false;
  }

  void marks() {
    for (std::size_t i = 0; i < block_.comment_count; ++i) {
      const std::string_view comment = block_.comments[i];
      emitted_ = emitted_ || comment.starts_with("(SHAPEGCODE ");
      if (emitted_ && comment == "(SHAPED RAPID)") {
        auto& all = events_.all;
        if (!all.empty() && all.back().kind == ComparedKind::dwells &&
            all.back().position_mm[0] < stop_before_rapid_s) {
          all.pop_back();
        }
        close();
        in_rapid_ = true;
      } else if (emitted_ && comment == "(SHAPED)") {
        if (in_rapid_) {
          close();
        }
        in_shaped_cut_ = true;
      }
    }
  }

  // The line as it stands in the source: a macro statement of the plain program has values in the place of variables.
  std::string_view source_line() {
    if (!program_.expanded || program_.origins[line_ - 1].file != 0) {
      return block_.text();
    }
    const std::string& source = program_.unexpanded;
    if (source_lines_.empty()) {
      source_lines_.push_back(0);
      for (std::size_t at = source.find('\n'); at != std::string::npos; at = source.find('\n', at + 1)) {
        source_lines_.push_back(at + 1);
      }
    }
    const std::size_t begin = source_lines_[program_.origins[line_ - 1].line - 1];
    return std::string_view(source).substr(begin, source.find('\n', begin) - begin);
  }

  // Whether the machine file has the line written around shaped cuts: it does not end a cut.
  bool emission() {
    const auto& lines = options_.emission_lines;
    if (lines.empty()) {
      return false;
    }
    if (!block_.macro && words().g_count == 0 && words().m_count == 0) {
      return false;  // nearly every line of a shaped cut
    }
    std::string text = plain_text(block_.macro ? source_line() : block_.text());
    if (std::ranges::find(lines, text) == lines.end()) {
      return false;
    }
    events_.all.push_back(event(ComparedKind::emission, std::move(text)));
    return true;
  }

  void block() {
    marks();
    if (emission()) {
      return;
    }
    if (block_.macro) {
      add(ComparedKind::functions, plain_text(block_.text()));
      return;
    }
    const CutModes before = modes_;
    one_shot_ = false;
    bool cutting_code = false;
    if (is_call()) {
      add(ComparedKind::calls, plain_text(block_.text()));
      return;
    }
    if (words().has_any(letter_mask("TSM"))) {
      machine_functions(false);
    }
    for (int k = 0; k < words().g_count; ++k) {
      const auto i = static_cast<std::size_t>(k);
      code(words().g_tenths[i], words().g_group[i]);
      cutting_code = cutting_code || (words().g_group[i] == Group::motion && motion_ != 0);
    }
    offsets_by_number();
    feed();
    if (!one_shot_) {
      motion(before, cutting_code);
    }
    if (words().m_count > 0) {
      machine_functions(true);
    }
  }

  [[nodiscard]] bool is_call() const noexcept {
    const auto codes = std::span(words().m_codes).first(static_cast<std::size_t>(words().m_count));
    return (words().groups & group_bit(Group::call)) != 0 ||
           std::ranges::any_of(codes, [](int m) { return m == 98 || m == 198; });
  }

  // T, S and M words: those that act with the move of the block, then those that stop the program behind it.
  void machine_functions(bool stops) {
    std::string tool = words().has('T') ? fmt::format("T{:.0f}", words()['T'].value) : "";
    std::string spindle = words().has('S') ? fmt::format("S{:.10g}", words()['S'].value) : "";
    std::string coolant;
    std::string other;
    std::string stop;
    for (int k = 0; k < words().m_count; ++k) {
      const int m = words().m_codes[static_cast<std::size_t>(k)];
      const bool ends = m == 2 || m == 30 || m == 99;
      std::string& word = m == 6                          ? tool
                          : (m >= 3 && m <= 5) || m == 19 ? spindle
                          : m >= 7 && m <= 9              ? coolant
                          : ends || m == 0 || m == 1      ? stop
                                                          : other;
      word += fmt::format("{}M{:02}", word.empty() ? "" : " ", m);
      ended_ = ended_ || (stops && ends && !block_.optional_skip);
    }
    const auto put = [this](ComparedKind kind, std::string& word) {
      if (!word.empty()) add(kind, std::move(word));
    };
    if (stops) {
      put(ComparedKind::stops, stop);
      return;
    }
    if (!other.empty() && words().has('P') && words().g_count == 0) {
      other += fmt::format(" P{:.10g}", words()['P'].value);
    }
    put(ComparedKind::tools, tool);
    put(ComparedKind::spindle, spindle);
    put(ComparedKind::coolant, coolant);
    put(ComparedKind::functions, other);
  }

  // Where the state of a group is kept that changes nothing but how further blocks are read.
  [[nodiscard]] int* mode(Group group) noexcept {
    switch (group) {
      case Group::plane:
        return &modes_.plane;
      case Group::distance:
        return &modes_.distance;
      case Group::feed_mode:
        return &modes_.feed_mode;
      case Group::exact_stop:
        return &modes_.exact_stop;
      case Group::cycle_return:
        return &modes_.cycle_return;
      case Group::cycle:
        return &cycle_;
      default:
        return nullptr;
    }
  }

  void code(int tenths, Group group) {
    const int whole = tenths / 10;
    if (int* const changed = mode(group)) {
      *changed = whole;
      return;
    }
    switch (group) {
      case Group::motion:
        motion_ = whole;
        cycle_ = 80;
        if (whole == 0 && in_rapid_) {
          close();  // the last line of a shaped rapid
        }
        return;
      case Group::units:
        if (whole != units_ && events_.units_line > 0) {
          add(ComparedKind::functions, fmt::format("G{}", whole));
        }
        units_ = whole;
        return;
      case Group::compensation:
        if (whole != compensation_) {
          add(ComparedKind::offsets, with_words(tenths, "D"));
        }
        compensation_ = whole;
        return;
      case Group::length_offset:
        add(ComparedKind::offsets, with_words(tenths, "H"));
        return;
      case Group::coordinates:
        if (in_shaped_cut_ && tenths == coordinate_tenths_ && tenths != 541 && words().has_any(xyz_letters)) {
          return;  // a restart point in a shaped cut names what is in force
        }
        coordinate_tenths_ = tenths;
        add(ComparedKind::offsets, with_words(tenths, cycle_ == 80 ? "P" : ""));
        return;
      case Group::none:
        one_shot(tenths);
        return;
      case Group::unknown_position:
        one_shot_ = true;
        with_positions(add(ComparedKind::rapids, with_words(tenths, "P")));
        return;
      case Group::harmless:
        one_shot_ = one_shot_ || tenths == 220;
        add(ComparedKind::functions, with_words(tenths, "PQR"));
        return;
      default:
        one_shot_ = true;
        add(ComparedKind::functions, plain_text(block_.text()));
    }
  }

  void one_shot(int tenths) {
    if (tenths == 90) {
      return;  // G09: an exact stop of the move itself
    }
    one_shot_ = true;
    if (tenths == 40) {
      const bool milliseconds = words().has('P');
      const char letter = milliseconds ? 'P' : words().has('X') ? 'X' : 'U';
      Event& dwell = add(ComparedKind::dwells, "G04");
      if (words().has(letter)) {
        const bool counts = milliseconds || (!words()[letter].has_point && !options_.reader.calculator_decimal_point);
        dwell.position_mm[0] = words()[letter].value * (counts ? 1e-3 : 1.0);
        dwell.known = dwell.named = 1;
      }
    } else if (tenths == 100 || tenths == 520 || tenths == 920) {
      with_positions(add(ComparedKind::offsets, with_words(tenths, "LP")));
    } else if (words().has_any(xyz_letters | further_axes)) {
      with_positions(add(ComparedKind::rapids, with_words(tenths, "PABC")));
    } else {
      add(ComparedKind::functions, with_words(tenths, "P"));
    }
  }

  // H or D alone: another offset in force.
  void offsets_by_number() {
    if (!words().has_any(letter_mask("HD")) || one_shot_) {
      return;
    }
    const bool length = words().has('H') && (words().groups & group_bit(Group::length_offset)) == 0;
    const bool radius = words().has('D') && (words().groups & group_bit(Group::compensation)) == 0;
    if (length) {
      add(ComparedKind::offsets, fmt::format("H{:.0f}", words()['H'].value));
    }
    if (radius) {
      add(ComparedKind::offsets, fmt::format("D{:.0f}", words()['D'].value));
    }
  }

  void feed() noexcept {
    if (words().has('F')) {
      feed_ = words()['F'].value * (modes_.feed_mode == 93 ? 1.0 : unit_mm(units_)) / 60.0;
    }
  }

  // The code, and the numbers of some letters that stand beside it.
  [[nodiscard]] std::string with_words(int tenths, std::string_view letters) const {
    std::string text = g_code_name(tenths);
    for (const char letter : letters) {
      if (words().has(letter)) {
        text += fmt::format(" {}{:.10g}", letter, words()[letter].value);
      }
    }
    return text;
  }

  // The lengths of a block as they are written, mm.
  void with_positions(Event& event) const {
    const std::string_view letters = "XYZR";
    for (std::size_t i = 0; i < letters.size(); ++i) {
      if (words().has(letters[i])) {
        const Word& word = words()[letters[i]];
        const bool counts = !word.has_point && !options_.reader.calculator_decimal_point;
        event.position_mm[i] = word.value * unit_mm(units_) * (counts ? min_increment(options_.reader, units_) : 1.0);
        event.known = event.named = static_cast<std::uint8_t>(event.known | (1U << i));
      }
    }
    if (modes_.distance == 91 && event.known != 0) {
      event.word += " G91";
    }
  }

  void motion(const CutModes& before, bool cutting_code) {
    const bool drills = cycle_ != 80 && words().has_any(xyz_letters | letter_mask("R"));
    const bool moves = words().has_any(motion_ == 0 ? xyz_letters : xyz_letters | arc_letters);
    if (events_.units_line == 0 && (drills || moves)) {
      events_.units = units_;
      events_.units_line = line_;
    }
    if (words().has_any(further_axes) && (motion_ != 0 || cycle_ != 80)) {
      add(ComparedKind::functions, further(fmt::format("G{:02}", motion_)));
    }
    if (drills) {
      Event& cycle =
          add(ComparedKind::cycles, fmt::format("{} G{}", with_words(cycle_ * 10, "PK"), modes_.cycle_return));
      cycle.feed_mm_per_s = feed_;
      with_positions(cycle);
      if (words().has('Q')) {
        cycle.word += fmt::format(" Q{:.3f}", words()['Q'].value * unit_mm(units_));
      }
    } else if (cycle_ == 80 && motion_ == 0) {
      if (moves || words().has_any(further_axes)) {
        rapid();
      }
    } else if (cycle_ == 80 && (moves || cutting_code)) {
      if (!has_entry_) {
        entry_ = before;
        has_entry_ = true;
      }
      if (moves) {
        cut();
      }
    }
  }

  [[nodiscard]] std::string further(std::string text) const {
    for (const char letter : std::string_view("ABCUVW")) {
      if (words().has(letter)) {
        text += fmt::format(" {}{:.10g}", letter, words()[letter].value);
      }
    }
    return text;
  }

  // The end of this line's move, if the reader noted it.
  [[nodiscard]] const MoveEnd* move_end() noexcept {
    const auto& ends = program_.move_ends;
    while (end_ < ends.size() && ends[end_].line < line_) ++end_;
    return end_ < ends.size() && ends[end_].line == line_ ? &ends[end_] : nullptr;
  }

  void rapid() {
    Event& rapid = add(ComparedKind::rapids, further("G00"));
    const MoveEnd* const end = move_end();
    if (end == nullptr) {
      with_positions(rapid);
      return;
    }
    for (std::size_t i = 0; i < axis_count; ++i) {
      rapid.position_mm[i] = end->position_mm[static_cast<Eigen::Index>(i)];
      // In G91 the number counts although nobody knows from where.
      const bool is_named = words().has(static_cast<char>('X' + static_cast<int>(i)));
      rapid.named = static_cast<std::uint8_t>(rapid.named | (is_named ? 1U << i : 0U));
      rapid.known = static_cast<std::uint8_t>(rapid.known | (end->known[i] || is_named ? 1U << i : 0U));
    }
  }

  void cut() {
    if (move_end() != nullptr) {
      add(ComparedKind::cuts, plain_text(block_.text()));  // nobody knows its path
      return;
    }
    cuts_.add(line_, entry_, [this] {
      Event opened = event(in_rapid_ ? ComparedKind::rapids : ComparedKind::cuts, in_rapid_ ? "G00" : "");
      opened.known = in_rapid_ ? 7 : 0;
      return opened;
    });
    if (in_rapid_ && cuts_.is_open()) {
      const Vector3& end = events_.cuts.back().end_mm;
      std::copy(end.begin(), end.end(), cuts_.event().position_mm.begin());
    }
  }

  const Program& program_;
  const ComparisonOptions& options_;
  Events events_;
  CutCollector cuts_;
  ParsedBlock block_;
  CutModes modes_;
  CutModes entry_;                         // before the block that sets a cutting mode, or cuts first
  std::vector<std::size_t> source_lines_;  // where each begins, once somebody asks
  std::uint32_t line_ = 0;
  int motion_ = 0;
  int cycle_ = 80;
  int units_ = 21;
  int compensation_ = 40;
  bool in_shaped_cut_ = false;
  int coordinate_tenths_ = 540;  // of the coordinate system in force
  double feed_ = 0.0;
  bool one_shot_ = false;  // the axis words belong to a code of their own
  bool in_rapid_ = false;
  bool has_entry_ = false;
  bool emitted_ = false;
  bool ended_ = false;
  std::size_t call_ = 0;
  std::size_t end_ = 0;
};

}  // namespace

Events read_events(const Program& program, const ComparisonOptions& options) {
  return EventReader(program, options).read();
}

}  // namespace shapegcode::detail
