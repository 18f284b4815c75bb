#include "program/siemens/run.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <limits>
#include <ranges>

#include "program/siemens/line_text.hpp"
#include "program/siemens/quick_move.hpp"
#include "program/siemens/scanner.hpp"

namespace shapegcode::siemens {
namespace {

/// Whether a text holds M6, which changes the tool.
bool changes_tool(std::string_view text) {
  for (std::size_t i = text.find_first_of("Mm"); i != std::string_view::npos; i = text.find_first_of("Mm", i + 1)) {
    if (i > 0 && is_name_character(upper(text[i - 1]))) continue;
    std::size_t at = i + 1;
    while (at < text.size() && text[at] == '0') ++at;
    const bool is_six = at < text.size() && text[at] == '6';
    if (is_six && (at + 1 == text.size() || !is_digit(text[at + 1]))) return true;
  }
  return false;
}

/// The number of R and digits; none: it is another name.
std::optional<std::int64_t> r_number(const std::string& name) {
  if (name.size() < 2 || name[0] != 'R' || !is_digits(std::string_view(name).substr(1))) return std::nullopt;
  constexpr std::size_t most_r_digits = 18;
  const std::string_view digits = without_zeros(std::string_view(name).substr(1));
  if (digits.size() > most_r_digits) throw too_large();
  return std::stoll(std::string(digits));
}

/// The name of a program as its comment has it.
std::string title(std::string_view name) {
  constexpr std::size_t longest = 32;
  std::string found;
  for (const char c : name) {
    if (c == '_') {
      found += ' ';
    } else if (is_name_character(c) || c == ' ' || c == '.' || c == '-') {
      found += c;
    }
  }
  found.resize(std::min(found.size(), longest));
  return found;
}

}  // namespace

Run::Run(std::string_view text, const SiemensOptions& options)
    : options_(options), path_(options), words_(path_, *this, changes_tool(text)) {
  for (const Program& each : programs_of_text(text, options.file, options.name)) {
    if (main_ == nullptr) main_ = each;
    programs_[each->name] = each;
  }
  const std::int64_t lines = std::ranges::count(text, '\n') + 1;
  steps_left_ = options.max_program_steps + lines;
  moves_left_ = options.max_expansion_moves + lines;
}

SiemensProgram Run::program() {
  path_.line = main_->first;
  const std::string name = title(main_->name);
  path_.put(name.empty() ? "O0001" : fmt::format("O0001({})", name));
  path_.put("G21G17G90G94G40");
  Variables variables;
  const End end = execute(*main_, variables);
  path_.release();
  path_.put(end == End::m2 ? "M02" : "M30");
  const std::uint32_t last = path_.line;
  return {.expanded = std::move(path_.out).finish(last), .names = path_.take_names()};
}

Value Run::value_of(const std::string& name, std::span<const Value> index, std::uint32_t column) {
  const Variables& variables = *locals_.back();
  if (const auto found = variables.find(name); found != variables.end()) return found->second.read(name, index, column);
  const std::optional<std::int64_t> parameter = parameter_number(name, index, column);
  if (!parameter) {
    throw error_at(column, name + " is not a variable of this program: DEF must define it before");
  }
  const auto found = r_.find(*parameter);
  if (found == r_.end()) {
    throw error_at(column,
                   fmt::format("R{} is read before the program sets it: its value is in the control", *parameter));
  }
  return real_value(found->second);
}

bool Run::knows(const std::string& name) const {
  return name == "R" || r_number(name).has_value() || locals_.back()->contains(name);
}

std::optional<std::int64_t> Run::parameter_number(const std::string& name, std::span<const Value> index,
                                                  std::uint32_t column) const {
  if (name == "R" && index.size() == 1) return whole(index[0], "R[ ]", column);
  return index.empty() ? r_number(name) : std::nullopt;
}

std::vector<Value> Run::worked_out(const std::vector<Expression>& expressions) {
  std::vector<Value> values;
  values.reserve(expressions.size());
  for (const Expression& each : expressions) values.push_back(each(*this));
  return values;
}

void Run::assign(const Word& word, const Value& value) {
  assign(word.name, worked_out(word.index), value, word.column);
}

void Run::assign(const std::string& name, std::span<const Value> index, const Value& value, std::uint32_t column) {
  Variables& variables = *locals_.back();
  if (const auto found = variables.find(name); found != variables.end()) {
    found->second.write(name, index, value, column);
    return;
  }
  const std::optional<std::int64_t> parameter = parameter_number(name, index, column);
  if (!parameter) {
    throw error_at(column, name + " alone: its number must follow (R1= or R[1]=); the radius of an arc is CR=");
  }
  r_[*parameter] = number(value, column);
}

End Run::execute(ProgramLines& program, Variables& variables) {
  if (const auto wrong = program.find_structure()) throw located(program, wrong->index, 1, wrong->message);
  locals_.push_back(&variables);
  Flow flow{.program = program, .again = {}};
  std::uint32_t file = 0;
  if (program.file != options_.file) {
    const std::vector<std::string>& files = path_.out.files();
    file = static_cast<std::uint32_t>(std::ranges::find(files, program.file) - files.begin()) + 1;
  }
  End end = End::none;
  std::optional<std::size_t> index = 0;
  while (index && *index < program.size()) {
    path_.line = program.first + static_cast<std::uint32_t>(*index);
    path_.file = file;
    --steps_left_;
    try {
      index = step(flow, *index, end);
    } catch (const Error& error) {
      if (error.line() != 0) throw;  // of a program that is called
      const bool has_column = error.column() != 0;
      throw located(program, *index, has_column ? error.column() : 1, has_column ? error.what() : too_large().what());
    }
  }
  locals_.pop_back();
  return end;
}

std::optional<std::size_t> Run::step(Flow& flow, std::size_t index, End& end) {
  require_limits();
  if (const auto quick = read_quick_move(flow.program.line(index)); quick && path_.quick_move(*quick)) return index + 1;
  const std::shared_ptr<const Block> block = flow.program.block(index);
  if (block->kind != BlockKind::words) return control(flow, *block, index);
  if (!is_skipped(*block)) end = words(*block);
  return end == End::none ? std::optional(index + 1) : std::nullopt;
}

void Run::require_limits() const {
  if (steps_left_ < 0) {
    throw error_at(1, fmt::format("more blocks are executed than controller.max_program_steps = {}: an endless loop "
                                  "must end",
                                  options_.max_program_steps));
  }
  if (path_.moves() > moves_left_) {
    throw error_at(1, fmt::format("loops and calls make more moves than controller.max_expansion_moves = {}",
                                  options_.max_expansion_moves));
  }
}

Error Run::located(const ProgramLines& program, std::size_t index, std::uint32_t column,
                   const std::string& message) const {
  const std::uint32_t line = program.first + static_cast<std::uint32_t>(index);
  std::string text = message;
  for (auto call = calls_.rbegin(); call != calls_.rend(); ++call) {
    text += fmt::format("{}line {}", call == calls_.rbegin() ? "; called from " : ", ", *call);
  }
  Error error(ErrorKind::program, text, line, column);
  error.set_file(program.file);
  return error;
}

bool Run::is_skipped(const Block& block) const {
  if (!block.is_skipped) return false;
  if (!options_.block_skip) {
    throw error_at(1, "/: whether the block runs must be known: input.block_skip = \"on\" or \"off\"");
  }
  return *options_.block_skip;
}

End Run::words(const Block& block) {
  words_.comment(block.comment);
  if (block.words.empty()) return End::none;
  const Word& first = block.words[0];
  const Program found = !first.value && words_.may_be_call(first) ? find(first.name) : nullptr;
  if (found == nullptr) return words_.execute(block);
  const auto others = std::span(block.words).subspan(1);
  for (const Word& word : others) {
    if (word.name != "P") {
      throw word.error(
          fmt::format("{} with the call of {}: the call must be in a separate block", word.name, first.name));
    }
  }
  const auto count_word = std::ranges::find_if(others, [](const Word& word) { return bool(word.value); });
  const std::int64_t count = count_word == others.end() ? 1 : whole(count_word->value(*this), "P", count_word->column);
  for (std::int64_t k = 0; k < count; ++k) call(found, first.name, first.column, first.given);
  return End::none;
}

}  // namespace shapegcode::siemens

namespace shapegcode {

SiemensProgram read_siemens(std::string_view text, const SiemensOptions& options) {
  return siemens::Run(text, options).program();
}

}  // namespace shapegcode
