#include "shapegcode/gcode/interpreter.hpp"

#include <algorithm>
#include <cstdio>
#include <cstring>
#include <optional>

#include "interpreter_impl.hpp"
#include "shapegcode/error.hpp"

namespace shapegcode::detail {

void Interpreter::fail(const std::string& message, std::uint32_t column) const {
  throw Error(ErrorKind::program, message, line_number_, std::max<std::uint32_t>(column, 1));
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
    const auto at = static_cast<std::uint32_t>(
        1 + std::count(text.begin(), text.begin() + static_cast<std::ptrdiff_t>(junk), '\n'));
    const std::size_t line_start = junk == 0 ? 0 : text.rfind('\n', junk - 1) + 1;
    throw Error(ErrorKind::program, "byte 0x00 at offset " + std::to_string(junk) + ": this is no program text", at,
                static_cast<std::uint32_t>(junk - line_start + 1));
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
  first_body_line_ = static_cast<std::uint32_t>(
      1 + std::count(text.begin(), text.begin() + static_cast<std::ptrdiff_t>(body_begin_), '\n'));
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
  for (std::size_t i = 0; i < block_.comment_count; ++i) {
    const std::string_view comment = block_.comments[i];
    entry.comment_offset = static_cast<std::uint32_t>(comment.data() - program_.text.data());
    entry.comment_length = static_cast<std::uint32_t>(comment.size());
    region_->notes.push_back(entry);
  }
  if (words_.has('N')) {
    entry.comment_length = 0;
    entry.n_number = static_cast<std::int32_t>(words_['N'].value);
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
    add_step(StepKind::region, program_.regions.size());
    program_.steps.back().line = region_->first_line;
    program_.regions.push_back(std::move(region_));
  }
  segments_ = {};
  region_.reset();
}

void Interpreter::add_step(StepKind kind, std::size_t index) {
  program_.steps.push_back({kind, static_cast<std::uint32_t>(index), line_number_});
}

void Interpreter::add_move(const OtherMove& move) {
  close_region();
  if (move.dwell_s > 0.0 || move.segment.length_mm > 0.0) {
    add_step(StepKind::move, program_.other_moves.size());
    program_.other_moves.push_back(move);
  }
}

void Interpreter::line(std::string_view text, std::size_t begin, std::size_t end) {
  scan_block(text, line_number_, options_.max_line_length, block_);
  detail::sort_words(block_, line_number_, words_);
  if (block_.word_count > 0) {
    ++program_.block_count;
  }
  if (words_.has('N')) {
    const double n = words_['N'].value;
    if (n < 0.0 || n > 99'999'999.0) {
      fail("sequence number N" + std::to_string(static_cast<std::int64_t>(n)) + " outside 0 ... 99999999",
           words_['N'].column);
    }
  }
  const ModalState before = state_;
  const std::uint32_t foreign_before = foreign_;
  LineFlow flow;
  flow.stop = block_.optional_skip || words_.has_any(~region_letters & ~letter_mask("G"));
  read_codes(flow);
  if (words_.has('F')) {
    const double feed = words_['F'].value;
    if (feed < 0.0) {
      char value[48];
      std::snprintf(value, sizeof value, "feed F%g is negative", feed);
      fail(value, words_['F'].column);
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
    if (program_.regions.empty() && region_ == nullptr) {
      program_.header_offset = end;
    }
  }
  flow.motion = words_.has_any(axis_letters | centre_letters) && !one_shot_axes_;
  if (words_.has_any(other_axis_letters)) {
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
  if (block_.optional_skip) {
    optional_skip_block(before);
    foreign_ |= foreign_before;
  }
}

}  // namespace shapegcode::detail

namespace shapegcode {

Program read_program(std::string text, const ReaderOptions& options) {
  return detail::Interpreter(std::move(text), options).run();
}

}  // namespace shapegcode
