#include "program/linuxcnc/interpreter.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <charconv>

#include "program/dialect/path_element.hpp"
#include "program/linuxcnc/program_text.hpp"
#include "program/text/characters.hpp"
#include "program/text/number_scan.hpp"
#include "shapegcode/error.hpp"

namespace shapegcode::linuxcnc {
namespace {

constexpr std::size_t n_words_end = 100'000;  // FANUC has N1 to N99999

/// The number of the N word with which a line begins, perhaps behind `/`; 0: none that FANUC has.
std::size_t n_word_of(std::string_view line) {
  std::size_t i = 0;
  skip_spaces(line, i);
  if (i < line.size() && line[i] == '/') ++i;
  skip_spaces(line, i);
  if (i == line.size() || upper(line[i]) != 'N') return 0;
  ++i;
  skip_spaces(line, i);
  const std::int64_t number = scan_whole(line, i);
  const bool has_point = i < line.size() && line[i] == '.';
  return has_point || number < 1 || number >= static_cast<std::int64_t>(n_words_end) ? 0
                                                                                     : static_cast<std::size_t>(number);
}

std::vector<std::uint8_t> count_n_words(std::string_view text) {
  std::vector<std::uint8_t> counts(n_words_end);
  for (std::size_t begin = 0; begin < text.size();) {
    const std::size_t end = std::min(text.find('\n', begin), text.size());
    std::uint8_t& count = counts[n_word_of(text.substr(begin, end - begin))];
    if (count < 2) ++count;
    begin = end + 1;
  }
  return counts;
}

/// The N word of a value as it is written, if it is one that FANUC has.
std::size_t written_n_word(double value) {
  if (!(value >= 0.5 && value < static_cast<double>(n_words_end))) return 0;
  const std::string text = fmt::format("{:g}", value);
  std::size_t number = 0;
  const auto read = std::from_chars(text.data(), text.data() + text.size(), number);
  return read.ptr == text.data() + text.size() && number < n_words_end ? number : 0;
}

bool is_system(int system) { return system >= 1 && system <= 9; }

State first_state(const LinuxcncOptions& options) {
  if (!is_system(options.work_offset)) throw Error(ErrorKind::argument, "a work offset of LinuxCNC is 1 to 9");
  State state;
  state.modes.units = options.inch ? 200 : 210;
  state.modes.system = options.work_offset;
  for (const auto& [system, offsets] : options.work_offsets_mm) {
    if (!is_system(system)) continue;  // another control has more
    for (std::size_t axis = 0; axis < 3; ++axis) state.offsets(system)[axis] = offsets[axis];
  }
  state.machine_unit_mm = options.machine_unit_mm;
  if (options.tool_table) {
    state.table = &*options.tool_table;
    state.machine_unit_mm = state.table->unit_mm;
    for (const auto& [number, tool] : state.table->tools) state.lengths[number] = tool.offset_mm[2];
  }
  for (const auto& [number, length] : options.tool_length_mm) state.lengths[number] = length;
  return state;
}

bool is_special(double function) {
  return (function >= 70.0 && function <= 73.0 && function == std::trunc(function)) || function == 98.0 ||
         function == 99.0;
}

}  // namespace

Interpreter::Interpreter(std::string_view text, const LinuxcncOptions& options)
    : options_(options),
      main_(options.file, text, 0),
      n_words_(count_n_words(text)),
      state_(first_state(options)),
      runner_(state_, lines_, {main_.text().size(), options.max_expansion_bytes}),
      parameters_(state_, frames_, names_),
      evaluate_(parameters_),
      value_(names_.id("_value")),
      value_returned_(names_.id("_value_returned")),
      read_lines_(main_.count()) {
  frames_.emplace_back().caller = &main_;
}

LinuxcncProgram Interpreter::run() {
  run_lines();
  const auto last_line = static_cast<std::uint32_t>(main_.count());
  if (!runner_.ended) {
    std::string_view begin = main_.text();
    while (!begin.empty() && is_white(begin.front())) begin.remove_prefix(1);
    if (!begin.starts_with('%')) {
      Error error(ErrorKind::program,
                  "the program has neither M2 or M30 nor '%' lines: LinuxCNC refuses it, it may be truncated",
                  last_line, 1);
      error.set_file(main_.name());
      throw error;
    }
    lines_.put("M30", last_line);
  }
  if (state_.table != nullptr) {
    lines_.note(1, fmt::format("{}: {} tools, lengths and diameters in {} (input.machine_unit, or the INI file)",
                               state_.table->file, state_.table->tools.size(), state_.table->unit));
  }
  return {.expanded = std::move(lines_).finish(last_line), .path_tolerance = runner_.path_tolerance()};
}

void Interpreter::enter_main() {
  for (std::size_t index = 0; index < main_.count(); ++index) {
    const std::string_view line = stripped(main_.line(index));
    if (line == "%") next_ = index + 1;
    if (!line.empty()) return;
  }
}

void Interpreter::run_lines() {
  enter_main();
  std::size_t here = 0;
  if (!options_.first_codes.empty()) runner_.put(options_.first_codes);
  try {
    while (!runner_.ended && next_ < file_->count()) {
      here = next_;
      if (!take_plain_lines()) step(here);
      require_steps();
    }
  } catch (const Error& error) {
    Error placed(ErrorKind::program, error.what() + call_stack(), static_cast<std::uint32_t>(here + 1), 1);
    placed.set_file(file_->name());
    throw placed;
  }
}

PlainLines Interpreter::find_plain_lines() {
  const Modes& modes = state_.modes;
  const std::size_t begin = file_->start(next_);
  if (modes.feed_mode == 930 || (next_ > slow_from_ && next_ < slow_to_)) return {};
  if (modes.motion != 0 && modes.motion != 10 && !begins_with_motion(file_->text(), begin)) return {};
  const std::span<const std::uint8_t> n_counts = file_ == &main_ ? n_words_ : std::span<const std::uint8_t>{};
  PlainLines lines = scan_plain_lines(file_->text(), begin, modes.centres == 911, n_counts);
  // The slow way says what is wrong with a centre perpendicular to the plane, or without a feed.
  std::size_t slow_lines = lines.last_centre[dialect::axes_of(modes.plane / 10).normal];
  if (modes.feed <= 0.0 && !lines.last_feed) slow_lines = lines.count;
  if (slow_lines == 0) return lines;
  slow_from_ = next_;
  slow_to_ = next_ + slow_lines;
  return {};
}

bool Interpreter::take_plain_lines() {
  const PlainLines lines = find_plain_lines();
  if (lines.count == 0) return false;
  for (const std::uint32_t number : lines.n_words) n_words_[number] = 0;
  const std::size_t begin = file_->start(next_);
  const auto line = static_cast<std::uint32_t>(next_ + 1);
  runner_.place = {line, file_->index(), {}};
  runner_.lead_in(lines.begins_with_g);
  follow(lines);
  const std::string_view text = file_->text().substr(begin, lines.end - begin);
  if (options_.adds_points) {
    lines_.put_lines(with_points(text), line, file_->index());
  } else {
    lines_.put_lines(text, line, file_->index());
  }
  next_ += lines.count;
  steps_ += lines.count;
  runner_.require_room();
  return true;
}

void Interpreter::follow(const PlainLines& lines) {
  Modes& modes = state_.modes;
  if (lines.last_motion >= 0) modes.motion = lines.last_motion * 10;
  modes.feed = lines.last_feed.value_or(modes.feed);
  runner_.follow_modes();
  const double unit = state_.unit_mm();
  for (std::size_t axis = 0; axis < 3; ++axis) {
    std::optional<double>& here = state_.position[axis];
    if (modes.distance == 900) {
      if (lines.last[axis]) here = *lines.last[axis] * unit;
    } else if (here) {
      here = *here + unit * lines.sum[axis];
    }
  }
}

void Interpreter::step(std::size_t index) {
  next_ = index + 1;
  ++steps_;
  runner_.place = {static_cast<std::uint32_t>(index + 1), file_->index(), {}};
  if (OLine* const o_line = file_->o_line(index)) {
    control(index, *o_line);
    return;
  }
  const Block* const words = block(index);
  if (words == nullptr || (words->skips && is_skipped())) return;
  run_block(index, *words);
}

void Interpreter::run_block(std::size_t index, const Block& block) {
  words_.words.clear();
  for (const WordText& word : block.words) words_.words.emplace_back(word.letter, evaluate_(word.value, block.code));
  set_.clear();
  for (const Setting& setting : block.settings) {
    const double parameter = setting.name ? 0.0 : evaluate_(setting.parameter, block.code);
    set_.emplace_back(parameter, evaluate_(setting.value, block.code));
  }
  for (std::size_t k = 0; k < set_.size(); ++k) {  // together, after all values are evaluated
    if (block.settings[k].name) {
      parameters_.set_named(*block.settings[k].name, set_[k].second);
    } else {
      parameters_.set_numbered(set_[k].first, set_[k].second);
    }
  }
  const auto special =
      std::ranges::find_if(words_.words, [](const auto& word) { return word.first == 'm' && is_special(word.second); });
  if (special != words_.words.end()) {
    WordValues all;
    for (const auto& [letter, value] : words_.words) all.set(letter, value);
    run_special(static_cast<int>(special->second), all, index);
    std::erase_if(words_.words,
                  [](const auto& word) { return word.first == 'm' || word.first == 'p' || word.first == 'l'; });
  }
  if (words_.words.empty() && block.comments.empty()) return;
  // N of the main program, once, and where no other line has the same.
  const auto n_word = std::ranges::find(words_.words, 'n', [](const auto& word) { return word.first; });
  if (n_word != words_.words.end() && file_ == &main_) {
    const std::size_t number = written_n_word(n_word->second);
    if (number > 0 && std::exchange(n_words_[number], std::uint8_t{0}) == 1) {
      runner_.place.number = fmt::format("N{}", number);
    }
  }
  runner_.run(words_, block.comments);
}

const Block* Interpreter::block(std::size_t index) {
  const bool may_come_again = file_->has_o_lines();
  if (may_come_again) {
    if (const Block* const kept = file_->block(index).get()) return kept;
  }
  const std::string_view line = file_->line(index);
  const std::string_view code = stripped(line);
  if (code.empty() || code == "%") {
    // What stands behind it is not read.
    if (!code.empty() && file_ == &main_) next_ = main_.count();
    return nullptr;
  }
  Block* found = &once_;
  if (may_come_again) found = (file_->block(index) = std::make_unique<Block>()).get();
  *found = {};
  read_block(line, names_, *found);
  return found;
}

bool Interpreter::is_skipped() {
  if (!options_.block_skip) {
    lines_.note(runner_.place.line,
                "`/` lines are executed, as with the block-skip switch off; input.block_skip states its position",
                "block skip");
  }
  return options_.block_skip.value_or(false);
}

void Interpreter::require_steps() const {
  if (steps_ <= read_lines_ || steps_ - read_lines_ <= options_.max_steps) return;
  refuse(
      fmt::format("more than {} lines executed beyond one for each line (controller.max_program_steps): the program "
                  "does not seem to end",
                  options_.max_steps));
}

}  // namespace shapegcode::linuxcnc

namespace shapegcode {

LinuxcncProgram read_linuxcnc(std::string_view text, const LinuxcncOptions& options) {
  return linuxcnc::Interpreter(text, options).run();
}

}  // namespace shapegcode
