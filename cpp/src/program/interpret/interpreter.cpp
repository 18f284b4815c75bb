#include <fmt/format.h>

#include <algorithm>
#include <utility>

#include "program/interpret/interpreter_impl.hpp"
#include "program/text/characters.hpp"
#include "shapegcode/error.hpp"

namespace shapegcode::detail {
namespace {

constexpr std::size_t max_warnings_of_one_kind = 100;
// Comments of a shaped program: the start of its header, and the mark before each shaped region.
constexpr std::string_view shaped_header = "(SHAPEGCODE ";
constexpr std::string_view shaped_mark = "(SHAPED)";
constexpr std::string_view shaped_rapid_mark = "(SHAPED RAPID)";

}  // namespace

void Interpreter::fail(const std::string& message, std::uint32_t column) const {
  throw Error(ErrorKind::program, message, line_number_, std::max<std::uint32_t>(column, 1));
}

void Interpreter::alarm(int number, const std::string& message, std::uint32_t column) const {
  throw alarm_error(number, message, line_number_, std::max<std::uint32_t>(column, 1));
}

void Interpreter::warn_at(const LineOrigin& origin, const std::string& message) {
  Warned& warned = warned_[message];
  if (warned.lines.contains({origin.file, origin.line})) {
    return;
  }
  if (warned.lines.size() >= max_warnings_of_one_kind) {
    ++warned.further;
    warned.last = origin;
    return;
  }
  warned.lines.emplace(origin.file, origin.line);
  program_.warnings.push_back({origin.line, message, 0, 0, program_.files[origin.file]});
}

void Interpreter::tell_further_warnings() {
  for (const auto& [message, warned] : warned_) {
    if (warned.further > 0) {
      program_.warnings.push_back({warned.last.line,
                                   fmt::format("{} more like this, the last one here: {}", warned.further, message), 0,
                                   0, program_.files[warned.last.file]});
    }
  }
  warned_.clear();
}

void Interpreter::warn_once(std::uint32_t& seen, const std::string& message) {
  if (seen++ == 0) {
    warn(message);
  }
}

double Interpreter::length_mm(const Word& word) const noexcept {
  const bool counts_increments = !word.has_point && !options_.calculator_decimal_point;
  const double length = counts_increments ? word.value * min_increment(options_, state_.units) : word.value;
  return length * unit_mm(state_.units);
}

double Interpreter::feed_mm_per_s(double move_length_mm) const {
  if (state_.feed_mode == 93) {
    if (!words().has('F')) {
      fail("G93 needs F in every cutting block");
    }
    return state_.feed * move_length_mm / 60.0;
  }
  const double per_turn = state_.feed_mode == 95 ? state_.spindle_rev_per_min : 1.0;
  return state_.feed * per_turn * unit_mm(state_.units) / 60.0;
}

void Interpreter::forget_axes(std::uint32_t letters) noexcept {
  for (int axis = 0; axis < axis_count; ++axis) {
    if ((letters >> ('X' - 'A' + axis)) & 1U) {
      state_.known[static_cast<std::size_t>(axis)] = false;
    }
  }
}

void Interpreter::unknown_move(std::uint32_t letters, bool from_unknown) {
  MachineFunction function;
  for (std::size_t axis = 0; axis < axis_count; ++axis) {
    const bool named = ((letters >> (static_cast<std::size_t>('X' - 'A') + axis)) & 1U) != 0;
    function.unknown_move[axis] = named && !(from_unknown && state_.known[axis]);
  }
  if (std::ranges::find(function.unknown_move, true) != function.unknown_move.end()) {
    close_region();
    add_step(StepKind::function, program_.functions.size());
    program_.functions.push_back(function);
  }
}

void Interpreter::note(std::size_t segment) {
  RegionNote entry;
  entry.segment = static_cast<std::uint32_t>(segment);
  for (std::size_t i = 0; i < block_->comment_count; ++i) {
    const std::string_view comment = block_->comments[i];
    entry.comment_offset = static_cast<std::uint32_t>(begin_ + block_->offset_of(comment));
    entry.comment_length = static_cast<std::uint32_t>(comment.size());
    region_->notes.push_back(entry);
  }
  if (words().has('N')) {
    entry.comment_length = 0;
    const std::string_view written = block_->text_of(words()['N']);
    entry.n_number = static_cast<std::int32_t>(words()['N'].value);
    entry.n_digits = static_cast<std::uint32_t>(std::ranges::count_if(written, is_digit));
    region_->notes.push_back(entry);
  }
}

// A shaped program says so in its header, and before each shaped region.
void Interpreter::read_header_comments() {
  for (std::size_t i = 0; i < block_->comment_count; ++i) {
    const std::string_view comment = block_->comments[i];
    emitted_ = emitted_ || comment.starts_with(shaped_header);
    if (emitted_ && (comment == shaped_mark || comment == shaped_rapid_mark)) {
      close_region();
      shaped_next_ = true;
      rapid_next_ = comment == shaped_rapid_mark;
    }
  }
}

void Interpreter::close_region() {
  if (region_ == nullptr) {
    return;
  }
  region_->notes.resize(notes_kept_);
  if (segments_.size() > 0) {
    region_->shaped = std::exchange(shaped_next_, false);
    region_->was_rapid = std::exchange(rapid_next_, false);
    region_->path = std::make_shared<const Path>(segments_.path());
    add_step(StepKind::region, program_.regions.size());
    program_.steps.back().line = region_->first_line;
    program_.regions.push_back(std::move(region_));
  }
  segments_ = PathBuilder();
  region_.reset();
}

void Interpreter::add_step(StepKind kind, std::size_t index) {
  program_.steps.push_back({kind, static_cast<std::uint32_t>(index), line_number_});
}

void Interpreter::add_move(const OtherMove& move) {
  close_region();
  if (move.dwell_s > 0.0 || move.segment.length_mm > 0.0) {
    require_room(move.dwell_s > 0.0 ? work_.wait(move.dwell_s, "dwell") : work_.move(move.segment));
    add_step(StepKind::move, program_.other_moves.size());
    program_.other_moves.push_back(move);
  }
}

void Interpreter::require_room(const std::optional<std::string>& passed) {
  if (passed) {
    ended_ = true;
    fail(*passed);
  }
}

void Interpreter::require_plain_words(const BlockWords& words, std::uint32_t line) const {
  const auto refuse = [&](int number, const Word& word, const std::string& what) {
    throw alarm_error(number, what + " in address " + std::string(1, word.letter) + ", which takes whole numbers", line,
                      word.column);
  };
  if (words.fractional != nullptr) {
    refuse(7, *words.fractional, "decimal point");
  }
  if (words.negative != nullptr && words.negative->letter != 'S') {
    refuse(6, *words.negative, "minus sign");
  }
  if (words.duplicate != nullptr) {
    throw Error(ErrorKind::program,
                "address " + std::string(1, words.duplicate->letter) + " is given twice in one block", line,
                words.duplicate->column);
  }
  for (const char letter : {'H', 'D'}) {
    if (words.has(letter) && words[letter].value > 999.0) {
      throw alarm_error(
          30, fmt::format("offset number {}{} outside 0 ... 999", letter, static_cast<int>(words[letter].value)), line,
          words[letter].column);
    }
  }
  int motion = state_.motion;
  for (int k = 0; k < words.g_count; ++k) {
    const auto i = static_cast<std::size_t>(k);
    motion = words.g_group[i] == Group::motion ? words.g_tenths[i] / 10 : motion;
  }
  if (words.has('E') && motion != 33) {
    throw alarm_error(9, "address E is used with threading G33 only", line, words['E'].column);
  }
}

void Interpreter::finish() {
  close_region();
  tell_further_warnings();
  program_.final_state = state_;
  program_.move_count = work_.moves();
  program_.least_time_s = work_.seconds();
}

void Interpreter::execute(const ParsedBlock& block, std::uint32_t line, const LineOrigin& origin, std::size_t begin,
                          std::size_t end) {
  block_ = &block;
  line_number_ = line;
  origin_ = origin;
  begin_ = begin;
  require_plain_words(words(), line);
  if (block_->word_count > 0) {
    ++program_.block_count;
  }
  read_header_comments();
  steps_before_block_ = program_.steps.size();
  const ModalState before = state_;
  const std::uint32_t foreign_before = foreign_;
  LineFlow flow;
  flow.stop = block_->optional_skip || words().has_any(~region_letters & ~letter_mask("G"));
  read_codes(flow);
  if (words().has('F')) {
    const double feed = words()['F'].value;
    if (feed < 0.0) {
      fail(fmt::format("feed F{} is negative", feed), words()['F'].column);
    }
    const bool hundredths = state_.units == 20 && !words()['F'].has_point && !options_.calculator_decimal_point;
    state_.feed = hundredths ? feed * 0.01 : feed;
    state_.uncertain_groups &= ~feed_bit;
  }
  if (words().has('S')) {
    state_.spindle_rev_per_min = words()['S'].value;
  }
  flow.motion = words().has_any(state_.cycle != 80 ? hole_letters : axis_letters | centre_letters) && !one_shot_axes_;
  if (words().has_any(other_axis_letters)) {
    if (state_.motion != 0 && state_.cycle == 80) {
      warn("move of a rotary or additional axis is passed through untouched");
    }
  }
  if (flow.motion) {
    move(flow, before, begin, end);
    forget_uncertain_end();
  } else if (flow.stop) {
    close_region();
  } else if (region_ != nullptr) {
    note(segments_.size());
  }
  m_codes(flow);
  if (block_->optional_skip && !block_skip(options_, block_->skip_switch)) {
    optional_skip_block(before);
    foreign_ |= foreign_before;
  }
}

}  // namespace shapegcode::detail
