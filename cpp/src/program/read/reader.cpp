// Texts, lines, and their ends.
#include <fmt/format.h>

#include <algorithm>
#include <iterator>

#include "program/read/reader_impl.hpp"
#include "shapegcode/error.hpp"
#include "shapegcode/program.hpp"

namespace shapegcode::detail {
namespace {

constexpr std::size_t max_alarms = 200;  // collected in one reading
constexpr std::size_t max_names = 20;    // of programs, in one message

// "O1, O2, O3"
std::string program_names(std::span<const std::int64_t> numbers) {
  std::string names;
  for (const std::int64_t number : numbers.first(std::min(numbers.size(), max_names))) {
    names += fmt::format("{}O{}", names.empty() ? "" : ", ", number);
  }
  return numbers.size() > max_names ? fmt::format("{} and {} more", names, numbers.size() - max_names) : names;
}

std::string line_end_of(const std::string& text) {
  const auto end_of_line = text.find('\n');
  if (end_of_line != std::string::npos && end_of_line > 0 && text[end_of_line - 1] == '\r') {
    return "\r\n";
  }
  return end_of_line != std::string::npos && text.compare(end_of_line, 3, "\n\r\r") == 0 ? "\n\r\r" : "\n";
}

}  // namespace

Reader::Reader(std::string text, const ReaderOptions& options, std::span<const std::int64_t> shut, std::uint64_t steps)
    : options_(options),
      shut_(shut),
      interpreter_(program_, options),
      rewriter_(options, program_, interpreter_,
                [this](std::string_view flat, const LineOrigin& origin) { put(flat, origin); }),
      control_(options, interpreter_, rewriter_),
      variables_(options.retained_variables, &control_),
      steps_(steps) {
  sources_.push_back({"", std::move(text)});
  program_.files.emplace_back();
}

void Reader::fail(const std::string& message, std::uint32_t column) const {
  throw Error(ErrorKind::program, message, here_.line, column);
}

void Reader::warn(const std::string& message) { interpreter_.warn_at(origin_, message); }

void Reader::alarm(int number, const std::string& message, std::uint32_t column) const {
  throw alarm_error(number, message, here_.line, column);
}

void Reader::load_main() {
  std::string& given = sources_.front().text;
  if (given.starts_with(byte_order_mark)) {
    given.erase(0, byte_order_mark.size());
    program_.warnings.push_back({1, "a byte-order mark (UTF-8) before the first line is left out", 0, 0, ""});
  }
  const std::string& text = given;
  require_room_for(text);
  const TapeFrame frame = find_frame(text);
  framed_ = frame.framed;
  program_.line_end = line_end_of(text);
  if (frame.no_start) {
    program_.warnings.push_back(
        {1, "no line '%' at the start: a control that reads from a tape skips all before one", 0, 0, ""});
  }
  if (frame.unread_line > 0) {
    program_.warnings.push_back({frame.unread_line,
                                 "text behind the '%' that ends the program: a control stops reading there, as "
                                 "shapegcode does",
                                 0, 0, ""});
  }
  program_.header_offset = frame.begin;
  program_.line_count = static_cast<std::uint32_t>(lines_read_) - (text.back() == '\n' ? 1U : 0U);
  store_.add(text, frame, 0);
  for (const auto& unit : store_.units()) {
    if (unit->number >= 0) {
      program_.program_numbers.push_back(unit->number);
    }
  }
  ProgramUnit* main = options_.program < 0 ? store_.units().front().get() : store_.find(options_.program);
  if (options_.program_index >= 0) {
    const auto index = static_cast<std::size_t>(options_.program_index);
    if (index >= store_.units().size()) {
      fail(fmt::format("the file holds {} programs, number {} is asked for", store_.units().size(), index + 1));
    }
    main = store_.units()[index].get();
  }
  if (main == nullptr) {
    throw alarm_error(
        78,
        fmt::format("program O{} is not in the file (it holds {})", options_.program,
                    program_.program_numbers.empty() ? "no O number" : program_names(program_.program_numbers)),
        1, 1);
  }
  program_.program_number = main->number;
  control_.program = main->number;
  frames_.push_back({main, main->first, {}, false, false, false, 1, {}});
  here_ = main->first;
  if (main != store_.units().front().get() || options_.program_index >= 0) {
    // Another program than the first, or one of several: what is written is this one alone.
    expand_from(0);
    if (framed_) {
      put_raw("%", {1, 0});
    }
    program_.header_offset = program_.text.size();
  }
}

// From here on the text is rewritten; so far it is as handed over.
void Reader::expand_from(std::size_t begin) {
  if (program_.expanded) {
    return;
  }
  program_.expanded = true;
  const std::string& original = sources_.front().text;
  program_.text = original.substr(0, begin);
  const auto lines = static_cast<std::size_t>(
      std::count(original.begin(), original.begin() + static_cast<std::ptrdiff_t>(begin), '\n'));
  program_.origins.reserve(lines + 1000);
  for (std::size_t i = 0; i < lines; ++i) {
    program_.origins.push_back({static_cast<std::uint32_t>(i + 1), 0});
  }
}

void Reader::put_raw(std::string_view flat, const LineOrigin& origin) {
  program_.text += flat;
  program_.text += program_.line_end;
  program_.origins.push_back(origin);
}

void Reader::put(std::string_view flat, const LineOrigin& origin) {
  const std::size_t begin = program_.text.size();
  put_raw(flat, origin);
  written_.read(std::string_view(program_.text).substr(begin, flat.size()), origin.line, options_.max_line_length);
  run_written(written_, origin, begin);
}

void Reader::put(const ParsedBlock& block, const LineOrigin& origin) {
  const std::size_t begin = program_.text.size();
  put_raw(block.text(), origin);
  run_written(block, origin, begin);
}

// The last line of the text, which begins at `begin`.
void Reader::run_written(const ParsedBlock& block, const LineOrigin& origin, std::size_t begin) {
  try {
    interpreter_.execute(block, static_cast<std::uint32_t>(program_.origins.size()), origin, begin,
                         program_.text.size());
  } catch (const Error& error) {
    // The interpreter counts the lines of the expanded text.
    throw Error(error.kind(), error.what(), origin.line, error.column(), error.alarm());
  }
}

Error Reader::located(const Error& error) const {
  // An error of a block that waited (compensation, corners) carries that block's line.
  // Whatever is refused while a text is read is refused because of the text.
  Error result(ErrorKind::program, error.what() + call_stack(), error.line() > 0 ? error.line() : here_.line,
               std::max<std::uint32_t>(error.column(), 1), error.alarm());
  const std::string& file = program_.files[frames_.empty() ? 0 : frames_.back().unit->file];
  result.set_file(error.file().empty() ? file : error.file());
  return result;
}

std::string Reader::call_stack() const {
  constexpr std::size_t max_callers = 3;
  std::string stack;
  for (std::size_t k = frames_.size(); k-- > 1;) {
    if (frames_.size() - k > max_callers) {
      return fmt::format("{}; and {} more", stack, k);
    }
    const Frame& caller = frames_[k - 1];
    const std::string& file = program_.files[caller.unit->file];
    stack += fmt::format("; called by {} line {}{}",
                         caller.unit->number >= 0 ? fmt::format("O{}", caller.unit->number) : "the main program",
                         caller.next.line - 1, file.empty() ? "" : " of " + file);
  }
  return stack;
}

bool Reader::record(const Error& error) {
  if (!options_.collect_alarms) {
    return false;
  }
  const Error at = located(error);
  program_.alarms.push_back({at.line(), at.what(), at.column(), at.alarm(), at.file()});
  return program_.alarms.size() < max_alarms;
}

Program Reader::run() {
  try {
    load_main();
  } catch (const Error& error) {
    if (!record(error)) {
      throw;
    }
    return result();
  }
  const auto& probes = options_.probe_lines;
  program_.probed.reserve(probes.size());
  const auto probe = [&](std::uint32_t line_done) {
    while (program_.probed.size() < probes.size() && probes[program_.probed.size()] <= line_done) {
      program_.probed.push_back(interpreter_.state());
    }
  };
  probe(here_.line - 1);
  bool running = true;
  while (running) {
    try {
      running = step();
    } catch (const UnknownValue& unknown) {
      // A macro of a probe asks what only the control knows: it is read again as a call that nobody looks into.
      if (frames_.size() > 1 && !is_shut(frames_.back().unit->number)) {
        throw OpaqueProgram{frames_.back().unit->number};
      }
      if (!options_.collect_alarms) {
        throw located(unknown);
      }
      running = record(unknown);
    } catch (const Error& error) {
      if (!options_.collect_alarms) {
        throw located(error);
      }
      running = record(error);
    }
    if (frames_.size() == 1) {
      probe(here_.line);
    }
  }
  finish();
  return result();
}

bool Reader::is_shut(std::int64_t number) const noexcept { return std::ranges::find(shut_, number) != shut_.end(); }

Program Reader::result() {
  (program_.expanded ? program_.unexpanded : program_.text) = std::move(sources_.front().text);
  return std::move(program_);
}

// Counted before a line is executed, so that no reading does more than the limits say.
void Reader::require_room() {
  const WorkLimits& limits = options_.limits;
  ++steps_;
  if (steps_ > lines_read_ && steps_ - lines_read_ > limits.steps) {
    interpreter_.end();
    fail(
        fmt::format("more than {} blocks executed beyond one for each line (controller.max_program_steps): the "
                    "program does not seem to end",
                    limits.steps));
  }
  const std::uint64_t size = program_.text.size();
  if (size > bytes_read_ && size - bytes_read_ > limits.expansion_bytes) {
    interpreter_.end();
    fail(
        fmt::format("up to here the expanded program is more than {} bytes longer than the text "
                    "(controller.max_expansion_bytes)",
                    limits.expansion_bytes));
  }
}

// Of all files of a reading together.
void Reader::require_room_for(const std::string& text) {
  bytes_read_ += text.size();
  const auto lines = static_cast<std::uint64_t>(1 + std::count(text.begin(), text.end(), '\n'));
  lines_read_ += lines;
  interpreter_.add_lines(lines);
  const std::uint64_t limit = options_.limits.bytes;
  if (bytes_read_ <= limit) {
    return;
  }
  const auto inside =
      static_cast<std::ptrdiff_t>(text.size() - std::min<std::uint64_t>(text.size(), bytes_read_ - limit));
  Error error(ErrorKind::program,
              fmt::format("more than {} bytes of program text (controller.max_program_bytes)", limit),
              static_cast<std::uint32_t>(1 + std::count(text.begin(), text.begin() + inside, '\n')), 1);
  interpreter_.end();
  throw error;
}

// Executes the next line. False at the end of the program.
bool Reader::step() {
  Frame& frame = frames_.back();
  std::string_view text;
  std::size_t begin = 0;
  here_ = frame.next;
  if (interpreter_.ended()) {
    return false;
  }
  const bool goes_on = frame.unit->next_line(frame.next, text, begin);
  if (goes_on) {
    origin_ = {here_.line, frame.unit->file};
  } else if (frames_.size() == 1) {
    return false;
  }
  require_room();
  if (!goes_on) {
    warn(fmt::format("program O{} ends without M99", frame.unit->number));
    leave();
    return true;
  }
  line(text, begin, frame.next.at);
  return true;
}

void Reader::line(std::string_view text, std::size_t begin, std::size_t end) {
  line_.read(text, here_.line, options_.max_line_length);
  if (line_.optional_skip && block_skip(options_, line_.skip_switch).value_or(false)) {
    interpreter_.close_region();  // the switch is on: the control does not run it
    return;                       // an expanded text leaves it out
  }
  if (line_.macro) {
    macro_line(begin);
  } else if (line_.folder || !line_.program_name.empty() || (line_.sorted().has('O') && !is_call(line_.sorted()))) {
    program_line(end);
  } else {
    plain_line(begin, end);
  }
}

// The O line at a program's head: that of a called program becomes a comment.
void Reader::program_line(std::size_t end) {
  interpreter_.require_plain_words(line_.sorted(), here_.line);
  const bool numbered = line_.sorted().has('O');
  const auto number = numbered ? static_cast<std::int64_t>(line_.sorted()['O'].value) : -1;
  if (number == 0) {
    warn("program number O0: a control gives it another one or refuses it (alarm 0074)");
  }
  std::string comments;
  for (std::size_t i = 0; i < line_.comment_count; ++i) {
    comments += line_.comments[i];
  }
  if (frames_.size() > 1) {
    // A call does not stop the motion: its comment may stand inside of a region.
    if (!line_.folder) {
      const std::string_view name = line_.program_name;
      rewriter_.comment(
          "(" + (numbered ? program_name(number) : std::string(name.substr(1, name.size() - 2))) + ")" + comments,
          origin_);
    }
    return;
  }
  interpreter_.close_region();
  ++program_.block_count;
  if (program_.expanded) {
    put_raw(line_.text(), origin_);
  }
  if (program_.regions.empty()) {
    program_.header_offset = program_.expanded ? program_.text.size() : end;
  }
}

void Reader::plain_line(std::size_t begin, std::size_t end) {
  const BlockWords& words = line_.sorted();
  if (!program_.expanded && (is_call(words) || rewriter_.wants(words))) {
    expand_from(begin);
  }
  if (program_.expanded) {
    run_block(line_, line_.text());
    return;
  }
  note_words(words);
  rewriter_.pass(words);
  interpreter_.execute(line_, here_.line, origin_, begin, end);
}

// Executes a block; `raw` is its line as written.
void Reader::run_block(const ParsedBlock& block, std::string_view raw) {
  const BlockWords& words = block.sorted();
  if (is_call(words)) {
    note_number(words);
    call_block(block, raw);
    return;
  }
  note_words(words);
  put_block(block);
  modal_calls();
}

// Executes a block that calls nothing, under the coordinate modes that are on.
void Reader::put_block(const ParsedBlock& block) {
  if (rewriter_.wants(block.sorted())) {
    rewriter_.block(block, origin_);
  } else {
    rewriter_.pass(block.sorted());
    put(block, origin_);
  }
}

void Reader::note_number(const BlockWords& words) {
  if (words.has('N')) {
    control_.last_n = static_cast<std::int64_t>(words['N'].value);
  }
}

// What macro statements may ask about the block before theirs, and modal calls about the one at hand.
void Reader::note_words(const BlockWords& words) {
  note_number(words);
  if (words.m_count > 0) {
    control_.last_m = words.m_codes[static_cast<std::size_t>(words.m_count - 1)];
  }
  moved_ = words.has_any(axis_letters) && (words.groups & (group_bit(Group::none) | group_bit(Group::call))) == 0;
}

void Reader::finish() {
  const std::uint32_t last_of_text = std::max<std::uint32_t>(program_.line_count, 1);
  try {
    rewriter_.flush();
  } catch (const Error& error) {
    if (!record(error)) {
      throw located(error);
    }
  }
  interpreter_.finish();
  for (std::size_t k = 0; k < store_.units().size(); ++k) {
    if (store_.units()[k]->called) {
      program_.called.push_back(k);
    }
  }
  if (program_.expanded) {
    if (framed_) {
      put_raw("%", {program_.line_count, 0});
    }
    program_.line_count = static_cast<std::uint32_t>(program_.origins.size());
  }
  const std::uint32_t last = here_.line;
  std::vector<std::int64_t> others;
  std::ranges::copy_if(program_.program_numbers, std::back_inserter(others), [this](std::int64_t number) {
    return number != program_.program_number && !called_.contains(number);
  });
  if (!others.empty() && options_.program_index < 0) {
    program_.warnings.push_back({1,
                                 fmt::format("O{} is used; the file also holds {} (--program picks another)",
                                             program_.program_number, program_names(others)),
                                 0, 0, ""});
  }
  // Behind the last alarm that is collected nothing was read: what is missing there may well be there.
  const bool read_to_the_end = program_.alarms.size() < max_alarms;
  if (!interpreter_.ended() && !framed_ && read_to_the_end) {
    const Error error(ErrorKind::program, "the program has neither '%' lines nor an end M30 or M02: truncated?",
                      last_of_text, 1);
    if (!record(error)) {
      throw error;
    }
  } else if (!interpreter_.ended() && read_to_the_end) {
    program_.warnings.push_back({last, "the program does not end with M30, M02 or M99", 0, 0, ""});
  } else if (!framed_) {
    program_.warnings.push_back(
        {1, "the program has no '%' lines; a control that reads it from a serial line or tape needs them", 0, 0, ""});
  }
  program_.probed.resize(options_.probe_lines.size(), interpreter_.state());
}

}  // namespace shapegcode::detail

namespace shapegcode {

std::vector<ProgramEntry> list_programs(const std::string& text) {
  detail::ProgramStore store;
  store.add(text, detail::find_frame(text), 0);
  std::vector<ProgramEntry> entries;
  entries.reserve(store.units().size());
  for (const auto& unit : store.units()) {
    entries.push_back({unit->number, unit->name, unit->folder_name, unit->first.line, unit->first.at, unit->end});
  }
  return entries;
}

Program read_program(std::string text, const ReaderOptions& options) {
  std::vector<std::int64_t> shut;
  std::uint64_t steps = 0;  // of all readings of the text
  for (;;) {
    detail::Reader reader(std::move(text), options, shut, steps);
    try {
      return reader.run();
    } catch (const detail::OpaqueProgram& opaque) {
      text = reader.take_text();
      steps = reader.steps();
      shut.push_back(opaque.number);
    }
  }
}

}  // namespace shapegcode
