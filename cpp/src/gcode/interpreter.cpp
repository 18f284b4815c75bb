#include "shapegcode/gcode/interpreter.hpp"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstring>
#include <optional>
#include <string_view>
#include <utility>

#include "block_words.hpp"
#include "shapegcode/error.hpp"
#include "shapegcode/gcode/arc_geometry.hpp"
#include "shapegcode/gcode/canned_cycle.hpp"
#include "shapegcode/gcode/lexer.hpp"

namespace shapegcode {
namespace {

using detail::BlockWords;
using detail::Group;
using detail::letter_mask;

constexpr double mm_per_inch = 25.4;
constexpr std::uint32_t axis_letters = letter_mask("XYZ");
constexpr std::uint32_t centre_letters = letter_mask("IJK");
constexpr std::uint32_t other_axis_letters = letter_mask("ABCUVW");
// What a block of a region may carry beside G codes; any other word makes it a stop.
constexpr std::uint32_t region_letters = letter_mask("XYZIJKRFN");

std::uint32_t bit(Group group) noexcept { return 1U << static_cast<unsigned>(group); }
constexpr std::uint32_t feed_bit = 1U;

int plane_normal(int plane) noexcept { return plane == 17 ? 2 : plane == 18 ? 1 : 0; }

class Interpreter {
 public:
  Interpreter(std::string text, const ReaderOptions& options) : options_(options) {
    program_.text = std::move(text);
    state_ = options.power_on;
  }

  Program run();

 private:
  struct LineFlow {
    bool stop = false;      ///< ends a region, text kept
    bool motion = false;    ///< the block moves axes
  };

  void frame();
  void line(std::string_view text, std::size_t begin, std::size_t end);
  void optional_skip_block(const ModalState& before);
  void read_codes(LineFlow& flow);
  void one_shot(int g_tenths, LineFlow& flow);
  void m_codes(LineFlow& flow);
  void move(LineFlow& flow, const ModalState& before, std::size_t begin, std::size_t end);
  void cut(const char* why_kept, const ModalState& before, std::size_t begin, std::size_t end);
  void cycle_block();
  void foreign_switch(int g_tenths);
  void change_coordinates(int number);
  void close_region();
  void note(std::size_t segment);
  void warn(const std::string& message);
  void warn_once(std::uint32_t& seen, const std::string& message);
  [[noreturn]] void fail(const std::string& message, std::uint32_t column = 0) const;

  [[nodiscard]] double length_mm(const Word& word) const noexcept;
  [[nodiscard]] double feed_mm_per_s(double move_length_mm) const;
  [[nodiscard]] bool target(Vector3& end, std::array<bool, 3>& known_after, bool& relative) const noexcept;
  [[nodiscard]] Segment cutting_segment(const Vector3& end) const;
  void forget_axes(std::uint32_t letters) noexcept;
  void forget_all() noexcept { state_.known = {false, false, false}; }

  const ReaderOptions& options_;
  Program program_;
  ModalState state_;
  Block block_;
  BlockWords words_;
  std::uint32_t line_number_ = 0;
  std::size_t line_begin_ = 0;
  std::size_t body_begin_ = 0;
  std::size_t body_end_ = 0;
  std::uint32_t first_body_line_ = 1;
  std::shared_ptr<Region> region_;
  std::vector<Segment> segments_;  ///< of the open region
  std::size_t notes_kept_ = 0;
  std::uint32_t foreign_ = 0;       ///< modes passed through untouched that are on
  bool corner_pending_ = false;     ///< the block before carried ,R or ,C
  bool explicit_exact_stop_ = false;
  bool one_shot_axes_ = false;      ///< axis words belong to a one-shot code
  bool motion_code_ = false;
  bool distance_given_ = false;
  bool ended_ = false;
  bool framed_ = false;  ///< has its '%' lines
  Vector3 local_offset_ = Vector3::Zero();
  CannedCycle cycle_;
  double cycle_r_ = 0.0;
  double cycle_z_ = 0.0;
  std::uint32_t seen_no_point_ = 0;
  std::uint32_t seen_distance_ = 0;
  std::uint32_t kept_run_line_ = 0;
};

void Interpreter::fail(const std::string& message, std::uint32_t column) const {
  throw Error(ErrorKind::program, message, line_number_, column);
}

void Interpreter::warn(const std::string& message) { program_.warnings.push_back({line_number_, message}); }

void Interpreter::warn_once(std::uint32_t& seen, const std::string& message) {
  if (seen++ == 0) {
    warn(message);
  }
}

// Where the program text proper begins and ends: between the first '%' and the next one.
void Interpreter::frame() {
  const std::string& text = program_.text;
  if (text.find_first_not_of(" \t\r\n") == std::string::npos) {
    throw Error(ErrorKind::program, "the file is empty", 1, 1);
  }
  const auto junk = text.find('\0');
  if (junk != std::string::npos) {
    const auto at = static_cast<std::uint32_t>(1 + std::count(text.begin(), text.begin() + static_cast<std::ptrdiff_t>(junk), '\n'));
    throw Error(ErrorKind::program, "byte 0x00 at offset " + std::to_string(junk) + ": this is no program text", at, 1);
  }
  const auto end_of_line = text.find('\n');
  if (end_of_line != std::string::npos && end_of_line > 0 && text[end_of_line - 1] == '\r') {
    program_.line_end = "\r\n";
  }
  // Offsets of lines that start with '%'.
  const auto percent_line = [&](std::size_t from) {
    for (std::size_t at = text.find('%', from); at != std::string::npos; at = text.find('%', at + 1)) {
      std::size_t k = at;
      while (k > 0 && (text[k - 1] == ' ' || text[k - 1] == '\t' || text[k - 1] == '\r')) {
        --k;
      }
      if (k == 0 || text[k - 1] == '\n') {
        return at;
      }
    }
    return std::string::npos;
  };
  const std::size_t first = percent_line(0);
  const bool leads = first != std::string::npos && text.find_first_not_of(" \t\r\n") == first;
  const std::size_t second = first == std::string::npos ? first : percent_line(first + 1);
  const auto last_line = static_cast<std::uint32_t>(1 + std::count(text.begin(), text.end(), '\n'));
  framed_ = first != std::string::npos;
  // One '%' alone is half a tape: the other half is missing. None at all is a text without tape marks; then M30 or M02
  // must show that it is whole.
  if (framed_ && second == std::string::npos) {
    if (leads) {
      throw Error(ErrorKind::program, "no line '%' at the end of the program: truncated?", last_line, 1);
    }
    throw Error(ErrorKind::program, "a line '%' at the end of the program, but none at its start", 1, 1);
  }
  body_begin_ = 0;
  body_end_ = text.size();
  if (framed_) {
    body_begin_ = std::min(text.find('\n', first), text.size() - 1) + 1;
    body_end_ = second;
  }
  first_body_line_ =
      static_cast<std::uint32_t>(1 + std::count(text.begin(), text.begin() + static_cast<std::ptrdiff_t>(body_begin_), '\n'));
  program_.header_offset = body_begin_;
  program_.line_count = last_line - (text.back() == '\n' ? 1U : 0U);
}

Program Interpreter::run() {
  frame();
  const char* data = program_.text.data();
  line_number_ = first_body_line_ - 1;
  std::size_t begin = body_begin_;
  const auto& probes = options_.probe_lines;
  program_.probed.reserve(probes.size());
  const auto probe = [&](std::uint32_t line_done) {
    while (program_.probed.size() < probes.size() && probes[program_.probed.size()] <= line_done) {
      program_.probed.push_back(state_);
    }
  };
  probe(line_number_);
  while (begin < body_end_) {
    const void* hit = std::memchr(data + begin, '\n', body_end_ - begin);
    const std::size_t next =
        hit == nullptr ? body_end_ : static_cast<std::size_t>(static_cast<const char*>(hit) - data) + 1;
    std::size_t stop = next;
    while (stop > begin && (data[stop - 1] == '\n' || data[stop - 1] == '\r')) {
      --stop;
    }
    ++line_number_;
    if (!ended_) {
      line(std::string_view(data + begin, stop - begin), begin, next);
    }
    probe(line_number_);
    begin = next;
  }
  close_region();
  if (!ended_ && !framed_) {
    throw Error(ErrorKind::program, "the program has neither '%' lines nor an end M30 or M02: truncated?",
                program_.line_count, 1);
  }
  if (!ended_) {
    warn("the program does not end with M30 or M02");
  } else if (!framed_) {
    warn("the program has no '%' lines; a control that reads it over a line or from a tape needs them");
  }
  program_.final_state = state_;
  program_.probed.resize(probes.size(), state_);
  return std::move(program_);
}

double Interpreter::length_mm(const Word& word) const noexcept {
  const bool inch = state_.units == 20;
  if (word.has_point || options_.calculator_decimal_point) {
    return inch ? word.value * mm_per_inch : word.value;
  }
  return inch ? word.value * options_.least_increment_inch * mm_per_inch : word.value * options_.least_increment_mm;
}

double Interpreter::feed_mm_per_s(double move_length_mm) const {
  if (state_.feed_mode == 93) {
    if (!words_.has('F')) {
      fail("G93 needs F in every cutting block");
    }
    return state_.feed * move_length_mm / 60.0;
  }
  return state_.feed * (state_.units == 20 ? mm_per_inch : 1.0) / 60.0;
}

void Interpreter::forget_axes(std::uint32_t letters) noexcept {
  for (int axis = 0; axis < axis_count; ++axis) {
    if ((letters >> ('X' - 'A' + axis)) & 1U) {
      state_.known[static_cast<std::size_t>(axis)] = false;
    }
  }
}

void Interpreter::note(std::size_t segment) {
  RegionNote entry;
  entry.segment = static_cast<std::uint32_t>(segment);
  if (words_.has('N')) {
    entry.n_number = static_cast<std::int32_t>(words_['N'].value);
  }
  if (!block_.comment.empty()) {
    entry.comment_offset = static_cast<std::uint32_t>(block_.comment.data() - program_.text.data());
    entry.comment_length = static_cast<std::uint32_t>(block_.comment.size());
  }
  if (entry.n_number >= 0 || entry.comment_length > 0) {
    region_->notes.push_back(entry);
  }
}

void Interpreter::close_region() {
  if (region_ == nullptr) {
    return;
  }
  region_->notes.resize(notes_kept_);
  if (!segments_.empty()) {
    region_->path = std::make_shared<const Path>(std::move(segments_));
    program_.regions.push_back(std::move(region_));
  }
  segments_ = {};
  region_.reset();
}

void Interpreter::line(std::string_view text, std::size_t begin, std::size_t end) {
  line_begin_ = begin;
  scan_block(text, line_number_, options_.max_line_length, block_);
  detail::sort_words(block_, line_number_, words_);
  if (block_.word_count > 0) {
    ++program_.block_count;
  }
  if (words_.has('N')) {
    const double n = words_['N'].value;
    if (n < 0.0 || n > 99'999'999.0) {
      fail("sequence number N outside 0 ... 99999999", words_['N'].column);
    }
  }
  const ModalState before = state_;
  LineFlow flow;
  flow.stop = block_.optional_skip || words_.has_any(~region_letters & ~letter_mask("G"));
  read_codes(flow);
  if (words_.has('F')) {
    const double feed = words_['F'].value;
    if (feed < 0.0) {
      fail("feed F is negative", words_['F'].column);
    }
    const bool hundredths = state_.units == 20 && !words_['F'].has_point && !options_.calculator_decimal_point;
    state_.feed = hundredths ? feed * 0.01 : feed;
    state_.uncertain_groups &= ~feed_bit;
  }
  if (words_.has('O')) {
    const auto number = static_cast<std::int64_t>(words_['O'].value);
    if (program_.program_number >= 0) {
      fail("second program O" + std::to_string(number) + " in one file is not supported yet", words_['O'].column);
    }
    program_.program_number = number;
    program_.header_offset = end;
  }
  flow.motion = words_.has_any(axis_letters | centre_letters) && !one_shot_axes_;
  if (words_.has_any(other_axis_letters)) {
    if (state_.motion != 0 && state_.cycle == 80) {
      warn("move of a rotary or additional axis is passed through untouched");
    }
  }
  if (flow.motion) {
    move(flow, before, begin, end);
  } else if (flow.stop) {
    close_region();
  } else if (region_ != nullptr) {
    note(segments_.size());
  }
  m_codes(flow);
  if (block_.optional_skip) {
    optional_skip_block(before);
  }
}

// Whether a '/' block runs is the operator's choice: whatever it may change is not known afterwards.
void Interpreter::optional_skip_block(const ModalState& before) {
  std::uint32_t changed = 0;
  const auto differ = [&](int a, int b, Group group) {
    if (a != b) {
      changed |= bit(group);
    }
  };
  differ(before.motion, state_.motion, Group::motion);
  differ(before.plane, state_.plane, Group::plane);
  differ(before.distance, state_.distance, Group::distance);
  differ(before.feed_mode, state_.feed_mode, Group::feed_mode);
  differ(before.units, state_.units, Group::units);
  differ(before.compensation, state_.compensation, Group::compensation);
  differ(before.length_offset, state_.length_offset, Group::length_offset);
  differ(before.cycle, state_.cycle, Group::cycle);
  differ(before.cycle_return, state_.cycle_return, Group::cycle_return);
  differ(before.coordinate_system, state_.coordinate_system, Group::coordinates);
  differ(before.exact_stop, state_.exact_stop, Group::exact_stop);
  if (before.feed != state_.feed) {
    changed |= feed_bit;
  }
  if (changed != 0) {
    warn("block skip '/' changes the modal state: nothing is shaped until that group is given again");
  }
  state_.uncertain_groups |= changed;
  for (std::size_t axis = 0; axis < axis_count; ++axis) {
    const auto i = static_cast<Eigen::Index>(axis);
    if (before.position_mm[i] != state_.position_mm[i] || before.known[axis] != state_.known[axis]) {
      state_.known[axis] = false;
    }
  }
}

void Interpreter::read_codes(LineFlow& flow) {
  motion_code_ = false;
  explicit_exact_stop_ = false;
  one_shot_axes_ = false;
  for (int k = 0; k < words_.g_count; ++k) {
    const int g = words_.g_tenths[static_cast<std::size_t>(k)];
    const std::uint32_t column = words_.g_column[static_cast<std::size_t>(k)];
    const int whole = g / 10;
    const Group group = detail::group_of(g);
    // A no-op (G40 where nothing is compensated) leaves a block inside its region; a change ends it.
    const auto set = [&](int& field, bool keeps_region) {
      if (field != whole && !keeps_region) {
        flow.stop = true;
      }
      field = whole;
      state_.uncertain_groups &= ~bit(group);
    };
    switch (group) {
      case Group::motion:
        set(state_.motion, true);
        if (state_.cycle != 80) {
          state_.cycle = 80;
          flow.stop = true;
        }
        motion_code_ = true;
        break;
      case Group::plane:
        set(state_.plane, true);
        break;
      case Group::distance:
        set(state_.distance, true);
        distance_given_ = true;
        break;
      case Group::feed_mode:
        if (whole != state_.feed_mode) {
          state_.feed = 0.0;  // the old F has another unit
        }
        set(state_.feed_mode, true);
        break;
      case Group::units:
        set(state_.units, false);
        break;
      case Group::compensation:
        if (whole == 40 && state_.compensation != 40) {
          // The tool leaves the offset with the next move of the plane; until then its position is not the programmed.
          const int normal = plane_normal(state_.plane);
          for (int i : {(normal + 1) % 3, (normal + 2) % 3}) {
            state_.known[static_cast<std::size_t>(i)] = false;
          }
        }
        if (whole != 40 && state_.compensation == 40) {
          warn("cutter compensation G" + std::to_string(whole) + " is not supported yet: passed through untouched");
        }
        set(state_.compensation, false);
        break;
      case Group::length_offset: {
        const int number = words_.has('H') ? static_cast<int>(words_['H'].value) : state_.length_number;
        if (whole != state_.length_offset || (whole != 49 && number != state_.length_number)) {
          flow.stop = true;
          state_.known[2] = false;
        }
        if (whole == 49) {
          foreign_ &= ~4U;
        }
        set(state_.length_offset, false);
        break;
      }
      case Group::cycle:
        flow.stop = true;
        if (whole == 80) {
          state_.cycle = 80;
        } else {
          if (state_.cycle == 80) {
            cycle_ = CannedCycle{};
            cycle_.initial_mm = state_.position_mm[2];
          }
          state_.cycle = whole;
        }
        state_.uncertain_groups &= ~bit(Group::cycle);
        break;
      case Group::cycle_return:
        set(state_.cycle_return, false);
        break;
      case Group::coordinates:
        if (whole != state_.coordinate_system) {
          change_coordinates(whole);
        }
        set(state_.coordinate_system, false);
        break;
      case Group::exact_stop:
        set(state_.exact_stop, false);
        break;
      case Group::none:
        one_shot(g, flow);
        break;
      case Group::foreign:
        flow.stop = true;
        foreign_switch(g);
        break;
      case Group::harmless:
        flow.stop = true;
        one_shot_axes_ = true;
        break;
      case Group::unknown_position:
        flow.stop = true;
        one_shot_axes_ = true;
        if (words_.has_any(axis_letters) && g != 100 && g != 541) {
          forget_axes(words_.present);
        } else {
          forget_all();
        }
        warn("G" + std::to_string(whole) + (g % 10 != 0 ? "." + std::to_string(g % 10) : "") +
             " is passed through untouched: position not known afterwards");
        break;
      case Group::refused:
        fail("G" + std::to_string(whole) + (g % 10 != 0 ? "." + std::to_string(g % 10) : "") +
                 " is not supported yet (macro call or cylindrical interpolation)",
             column);
      case Group::invalid:
      default:
        fail("unknown G code G" + std::to_string(whole) + (g % 10 != 0 ? "." + std::to_string(g % 10) : ""), column);
    }
  }
  if (words_.has('H')) {
    const int number = static_cast<int>(words_['H'].value);
    if (state_.length_offset != 49 && number != state_.length_number) {
      state_.known[2] = false;
    }
    state_.length_number = number;
  }
}

void Interpreter::one_shot(int g_tenths, LineFlow& flow) {
  switch (g_tenths) {
    case 90:
      explicit_exact_stop_ = true;
      flow.stop = flow.stop || !words_.has_any(axis_letters | centre_letters);
      return;
    case 40: {
      flow.stop = true;
      one_shot_axes_ = true;
      double seconds = 0.0;
      if (words_.has('P')) {
        const Word& p = words_['P'];
        if (p.has_point) {
          fail("G04 P takes whole milliseconds: no decimal point (alarm 0007)", p.column);
        }
        seconds = p.value * 1e-3;
      } else if (words_.has('X')) {
        const Word& x = words_['X'];
        seconds = x.has_point || options_.calculator_decimal_point ? x.value : x.value * 1e-3;
      } else {
        fail("G04 needs P (milliseconds) or X (seconds)");
      }
      if (seconds < 0.0) {
        fail("dwell G04 is negative");
      }
      program_.other_moves.push_back({make_line(state_.position_mm, state_.position_mm, 0.0, line_number_), seconds});
      return;
    }
    case 920:
      flow.stop = true;
      one_shot_axes_ = true;
      for (int axis = 0; axis < axis_count; ++axis) {
        const char letter = static_cast<char>('X' + axis);
        if (words_.has(letter)) {
          state_.position_mm[axis] = length_mm(words_[letter]);
          state_.known[static_cast<std::size_t>(axis)] = true;
        }
      }
      return;
    case 520:
      flow.stop = true;
      one_shot_axes_ = true;
      for (int axis = 0; axis < axis_count; ++axis) {
        const char letter = static_cast<char>('X' + axis);
        if (words_.has(letter)) {
          const double offset = length_mm(words_[letter]);
          state_.position_mm[axis] -= offset - local_offset_[axis];
          local_offset_[axis] = offset;
        }
      }
      return;
    default:  // G28, G30, G53: machine coordinates
      flow.stop = true;
      one_shot_axes_ = true;
      forget_axes(words_.present);
      return;
  }
}

void Interpreter::foreign_switch(int g_tenths) {
  std::uint32_t mode = 0;
  bool on = true;
  const char* name = "";
  switch (g_tenths) {
    case 150:
    case 160:
      mode = 1;
      on = g_tenths == 160;
      name = "polar coordinates G16";
      break;
    case 500:
    case 510:
      mode = 2;
      on = g_tenths == 510;
      name = "scaling G51";
      break;
    case 501:
    case 511:
      mode = 8;
      on = g_tenths == 511;
      name = "mirror G51.1";
      break;
    case 680:
    case 690:
      mode = 16;
      on = g_tenths == 680;
      name = "rotation G68";
      break;
    case 121:
    case 131:
      mode = 32;
      on = g_tenths == 121;
      name = "polar interpolation G12.1";
      break;
    default:
      mode = 4;
      name = "tool axis offset G43.x";
      state_.known[2] = false;
  }
  one_shot_axes_ = true;
  if (on && (foreign_ & mode) == 0) {
    warn(std::string(name) + " is not supported yet: passed through untouched until it is cancelled");
  }
  if (on || (foreign_ & mode) != 0) {
    forget_all();
  }
  foreign_ = on ? foreign_ | mode : foreign_ & ~mode;
}

void Interpreter::change_coordinates(int number) {
  const auto& offsets = options_.work_offsets_mm;
  const auto index = [](int g) { return static_cast<std::size_t>(g - 54); };
  if (index(number) < offsets.size() && index(state_.coordinate_system) < offsets.size()) {
    for (std::size_t axis = 0; axis < axis_count; ++axis) {
      state_.position_mm[static_cast<Eigen::Index>(axis)] +=
          offsets[index(state_.coordinate_system)][axis] - offsets[index(number)][axis];
    }
  } else {
    forget_all();
  }
}

void Interpreter::m_codes(LineFlow& flow) {
  for (int k = 0; k < words_.m_count; ++k) {
    flow.stop = true;
    switch (words_.m_codes[static_cast<std::size_t>(k)]) {
      case 2:
      case 30:
        close_region();
        ended_ = true;
        break;
      case 6:
        for (std::size_t axis = 0; axis < axis_count; ++axis) {
          if (options_.unknown_after_tool_change[axis]) {
            state_.known[axis] = false;
          }
        }
        break;
      case 98:
      case 99:
      case 198:
        fail("subprograms (M" + std::to_string(words_.m_codes[static_cast<std::size_t>(k)]) + ") are not supported yet",
             words_['M'].column);
      default:
        break;
    }
  }
}

// End point of a block from its X Y Z words. False if an absolute word moves an axis from where it is not known.
bool Interpreter::target(Vector3& end, std::array<bool, 3>& known_after, bool& relative) const noexcept {
  bool from_known = true;
  relative = false;
  end = state_.position_mm;
  known_after = state_.known;
  for (int axis = 0; axis < axis_count; ++axis) {
    const char letter = static_cast<char>('X' + axis);
    if (!words_.has(letter)) {
      continue;
    }
    const auto i = static_cast<std::size_t>(axis);
    const double value = length_mm(words_[letter]);
    if (state_.distance == 90) {
      from_known = from_known && state_.known[i];
      end[axis] = value;
      known_after[i] = true;
    } else {
      relative = relative || !state_.known[i];
      end[axis] += value;
    }
  }
  return from_known;
}

Segment Interpreter::cutting_segment(const Vector3& end) const {
  if (state_.motion == 1) {
    Segment segment = make_line(state_.position_mm, end, 0.0, line_number_);
    segment.feed_mm_per_s = feed_mm_per_s(segment.length_mm);
    return segment;
  }
  ArcWords arc;
  arc.start_mm = state_.position_mm;
  arc.end_mm = end;
  arc.clockwise = state_.motion == 2;
  arc.normal = plane_normal(state_.plane);
  arc.tolerance_mm = options_.arc_tolerance_mm;
  std::uint32_t column = 0;
  if (words_.has('R')) {
    arc.radius_mm = length_mm(words_['R']);
    column = words_['R'].column;
  } else {
    arc.centre_mm = options_.absolute_arc_centres ? Vector3(Vector3::Zero()) : arc.start_mm;
    bool given = false;
    for (int axis = 0; axis < axis_count; ++axis) {
      const char letter = static_cast<char>('I' + axis);
      if (words_.has(letter) && axis != arc.normal) {
        arc.centre_mm[axis] += length_mm(words_[letter]);
        column = words_[letter].column;
        given = true;
      } else if (options_.absolute_arc_centres) {
        arc.centre_mm[axis] = arc.start_mm[axis];
      }
    }
    if (!given) {
      fail("arc without R or I J K in its plane G" + std::to_string(state_.plane) + " (alarm 0022)",
           words_.g_count > 0 ? words_.g_column[0] : 1);
    }
  }
  Segment segment = resolve_arc(arc, 0.0, line_number_, column);
  segment.feed_mm_per_s = feed_mm_per_s(segment.length_mm);
  return segment;
}

void Interpreter::move(LineFlow& flow, const ModalState& before, std::size_t begin, std::size_t end) {
  if (!distance_given_) {
    warn_once(seen_distance_, "neither G90 nor G91 before the first move: G" + std::to_string(state_.distance) +
                                  " assumed (power_on.distance)");
  }
  for (char letter : {'X', 'Y', 'Z', 'I', 'J', 'K', 'R'}) {
    if (words_.has(letter) && !words_[letter].has_point && words_[letter].value != 0.0) {
      warn_once(seen_no_point_,
                std::string("numbers without a decimal point are read as ") +
                    (options_.calculator_decimal_point ? "mm or inch" : "least increments") +
                    " (controller.calculator_decimal_point)");
    }
  }
  if (state_.cycle != 80) {
    close_region();
    cycle_block();
    return;
  }
  if (state_.motion == 0) {
    close_region();
    Vector3 to;
    std::array<bool, 3> known_after{};
    bool relative = false;
    const bool measurable = target(to, known_after, relative);
    if (foreign_ == 0) {
      OtherMove rapid{make_line(measurable ? state_.position_mm : to, to, 0.0, line_number_), 0.0};
      rapid.segment.kind = SegmentKind::rapid;
      if (rapid.segment.length_mm > 0.0) {
        program_.other_moves.push_back(rapid);
      }
      state_.position_mm = to;
      state_.known = known_after;
    }
    corner_pending_ = false;
    return;
  }
  const char* why_kept = nullptr;
  if (flow.stop) {
    why_kept = "it shares its block with another function";
  }
  if (state_.motion == 33) {
    why_kept = "threading G33 is not supported yet";
  } else if (foreign_ != 0) {
    why_kept = "a coordinate mode that is not supported yet is on";
  } else if (state_.compensation != 40) {
    why_kept = "cutter compensation is not supported yet";
  } else if (state_.feed_mode == 95) {
    why_kept = "feed per revolution G95 is not supported yet";
  } else if (state_.exact_stop == 63 || state_.exact_stop == 62) {
    why_kept = state_.exact_stop == 63 ? "tapping mode G63 is not supported yet"
                                       : "automatic corner override G62 is not supported yet";
  } else if (words_.corner != nullptr || corner_pending_) {
    why_kept = "corner words ,R ,C are not supported yet";
  } else if (state_.uncertain_groups != 0) {
    why_kept = "the modal state depends on the block-skip switch";
  }
  cut(why_kept, before, begin, end);
  corner_pending_ = words_.corner != nullptr;
}

void Interpreter::cut(const char* why_kept, const ModalState& before, std::size_t begin, std::size_t end) {
  if (!(state_.feed > 0.0)) {
    fail(words_.has('F') ? "cutting move with feed F0 (alarm 0011)" : "cutting move, but no feed F was given (alarm 0011)",
         words_.has('F') ? words_['F'].column : 1);
  }
  Vector3 to;
  std::array<bool, 3> known_after{};
  bool relative = false;
  if (!target(to, known_after, relative) && why_kept == nullptr) {
    why_kept = "the position before it is not known";
  }
  if (why_kept != nullptr) {
    close_region();
    // Kept to the letter. Its length is known only where start and path are.
    if (foreign_ == 0) {
      const bool plain = state_.motion == 1 || state_.compensation != 40 || state_.motion == 33;
      const double rate = state_.feed_mode == 94 ? feed_mm_per_s(0.0) : 0.0;
      Segment segment = make_line(state_.position_mm, to, rate, line_number_);
      if (!plain && target(to, known_after, relative)) {
        segment = cutting_segment(to);
      }
      if (target(to, known_after, relative) && segment.feed_mm_per_s > 0.0 && segment.length_mm > 0.0) {
        program_.other_moves.push_back({segment, 0.0});
      }
      state_.position_mm = to;
      state_.known = known_after;
    }
    // One warning for a run of such blocks.
    if (kept_run_line_ + 1 != line_number_) {
      warn(std::string("cutting move kept untouched: ") + why_kept);
    }
    kept_run_line_ = line_number_;
    return;
  }
  Segment segment = cutting_segment(to);
  const bool stops = explicit_exact_stop_ || state_.exact_stop == 61;
  if (region_ == nullptr) {
    region_ = std::make_shared<Region>();
    region_->first_line = line_number_;
    region_->text_begin = begin;
    region_->entry = before;
    notes_kept_ = 0;
  }
  note(segments_.size());
  region_->incremental = region_->incremental || relative;
  segment.stop_at_end = stops;
  if (segment.length_mm > 0.0) {
    segments_.push_back(segment);
  }
  state_.position_mm = to;
  state_.known = known_after;
  region_->last_line = line_number_;
  region_->text_end = end;
  region_->exit = state_;
  region_->exact_stop_at_end = stops;
  ++region_->blocks;
  notes_kept_ = region_->notes.size();
  if (stops) {
    close_region();
  }
}

void Interpreter::cycle_block() {
  const int axis = plane_normal(state_.plane);
  const auto z = static_cast<std::size_t>(axis);
  const char depth_letter = static_cast<char>('X' + axis);
  const bool incremental = state_.distance == 91;
  if (words_.has('R')) {
    cycle_r_ = length_mm(words_['R']);
  }
  if (words_.has(depth_letter)) {
    cycle_z_ = length_mm(words_[depth_letter]);
  }
  if (words_.has('Q')) {
    cycle_.peck_mm = std::abs(length_mm(words_['Q']));
  }
  if (words_.has('P')) {
    cycle_.dwell_s = words_['P'].value * 1e-3;
  }
  cycle_.code = state_.cycle;
  cycle_.return_to_r = state_.cycle_return == 99;
  int repeats = 1;
  for (char letter : {'K', 'L'}) {
    if (words_.has(letter)) {
      repeats = static_cast<int>(std::clamp(words_[letter].value, 0.0, 9999.0));
    }
  }
  if (!(state_.feed > 0.0) && repeats > 0) {
    fail("drilling cycle G" + std::to_string(state_.cycle) + " without a feed F (alarm 0011)");
  }
  const double level = cycle_.initial_mm;
  cycle_.r_mm = incremental ? level + cycle_r_ : cycle_r_;
  cycle_.bottom_mm = incremental ? cycle_.r_mm + cycle_z_ : cycle_z_;
  const double rate = state_.feed_mode == 94 ? feed_mm_per_s(0.0) : 0.0;
  for (int k = 0; k < repeats && foreign_ == 0; ++k) {
    Vector3 hole = state_.position_mm;
    for (int i = 0; i < axis_count; ++i) {
      const char letter = static_cast<char>('X' + i);
      if (i == axis || !words_.has(letter)) {
        continue;
      }
      const double value = length_mm(words_[letter]);
      hole[i] = incremental ? hole[i] + value : value;
      if (!incremental) {
        state_.known[static_cast<std::size_t>(i)] = true;
      }
    }
    OtherMove approach{make_line(state_.position_mm, hole, 0.0, line_number_), 0.0};
    approach.segment.kind = SegmentKind::rapid;
    if (approach.segment.length_mm > 0.0) {
      program_.other_moves.push_back(approach);
    }
    if (state_.known[z] && rate > 0.0) {
      state_.position_mm = expand_cycle(cycle_, hole, axis, rate, line_number_, program_.other_moves);
    } else {
      state_.position_mm = hole;
      if (cycle_.return_to_r) {
        state_.position_mm[axis] = cycle_.r_mm;
        state_.known[z] = !incremental && state_.known[z];
      }
    }
  }
}

}  // namespace

Program read_program(std::string text, const ReaderOptions& options) {
  return Interpreter(std::move(text), options).run();
}

}  // namespace shapegcode
