// Subprograms M98/M99/M198, macro calls G65/G66/G67, codes bound to programs by the machine builder.
#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "program/read/reader_impl.hpp"
#include "shapegcode/error.hpp"

namespace shapegcode::detail {
namespace {

constexpr int macro_nesting = 4;

bool has_m(const BlockWords& words, int code) noexcept {
  const auto* end = words.m_codes.data() + words.m_count;
  return std::find(words.m_codes.data(), end, code) != end;
}

bool is_m(const Word& word, int code) noexcept { return word.letter == 'M' && static_cast<int>(word.value) == code; }

}  // namespace

std::string program_name(std::int64_t number) { return fmt::format("O{:04}", number); }

bool Reader::is_call(const BlockWords& words) const noexcept {
  if ((words.groups & group_bit(Group::call)) != 0) {
    return true;
  }
  const CodeBindings& bound = options_.bindings;
  for (int k = 0; k < words.m_count; ++k) {
    const int m = words.m_codes[static_cast<std::size_t>(k)];
    if (m == 98 || m == 99 || m == 198 || bound.m_macros.contains(m) || bound.m_subprograms.contains(m)) {
      return true;
    }
  }
  if (bound.tool_program >= 0 && words.has('T')) {
    return true;
  }
  for (int k = 0; !bound.g_macros.empty() && k < words.g_count; ++k) {
    if (bound.g_macros.contains(words.g_tenths[static_cast<std::size_t>(k)])) {
      return true;
    }
  }
  return false;
}

// `block` holds plain numbers, `raw` is the line as written: arguments keep their full precision.
void Reader::call_block(const ParsedBlock& block, std::string_view raw) {
  const BlockWords& words = block.sorted();
  if (block.optional_skip && !block_skip(options_, block.skip_switch).has_value()) {
    fail(
        "'/' before a call: whether the block runs decides where the program goes; say it in the machine file "
        "(input.block_skip)");
  }
  for (int k = 0; k < words.g_count; ++k) {
    const int g = words.g_tenths[static_cast<std::size_t>(k)];
    if (g == 650 || g == 660 || g == 661 || g == 670) {
      macro_call(block, raw, g);
      return;
    }
  }
  if (has_m(words, 99) && (has_m(words, 98) || has_m(words, 198))) {
    fail("M99 in one block with M98 or M198: a block either calls or returns", words['M'].column);
  }
  if (has_m(words, 99)) {
    subprogram_return(block);
  } else if (has_m(words, 98) || has_m(words, 198)) {
    subprogram_call(block);
  } else {
    bound_call(block, raw);
  }
}

// Executes what stands in the block beside the call.
void Reader::put_without(const ParsedBlock& block, const std::function<bool(const Word&)>& left_out) {
  std::string rest;
  bool words = false;
  for (const Word& word : block) {
    if (left_out(word)) {
      continue;
    }
    words = words || word.letter != 'N';
    rest += (rest.empty() ? "" : " ");
    rest += block.text_of(word);
  }
  for (std::size_t i = 0; i < block.comment_count; ++i) {
    rest += (rest.empty() ? "" : " ");
    rest += block.comments[i];
  }
  if (!words && block.comment_count == 0) {
    return;
  }
  rest_.read_and_keep(std::move(rest), here_.line, options_.max_line_length);
  put_block(rest_);
}

void Reader::subprogram_call(const ParsedBlock& block) {
  const BlockWords& words = block.sorted();
  if (!words.has('P')) {
    alarm(76, "M98 without a program number P", words['M'].column);
  }
  if (words['P'].has_point) {
    alarm(7, "decimal point in the program number P of M98", words['P'].column);
  }
  if (words.has('L') && words['L'].has_point) {
    alarm(7, "decimal point in the repetitions L of M98", words['L'].column);
  }
  const auto p = static_cast<std::int64_t>(words['P'].value);
  std::int64_t number = p;
  std::int64_t repeats = 1;
  if (words.has('L')) {
    repeats = static_cast<std::int64_t>(words['L'].value);
  } else if (p > 9999 && store_.find(p) == nullptr) {
    repeats = p / 10000;  // P0030100: three times O0100
    number = p % 10000;
  }
  if (number < 1 || repeats < 0 || repeats > 99'999'999) {
    alarm(76, fmt::format("M98 P{} names no program", p), words['P'].column);
  }
  const std::uint32_t column = words['P'].column;
  put_without(block, [](const Word& word) {
    return word.letter == 'P' || word.letter == 'L' || is_m(word, 98) || is_m(word, 198);
  });
  if (repeats > 0) {
    MacroArguments called;
    called.program = number;
    called.repeats = static_cast<int>(repeats);
    enter(called, false, column, block.text());
  }
}

void Reader::subprogram_return(const ParsedBlock& block) {
  const BlockWords& words = block.sorted();
  const std::int64_t target = words.has('P') ? static_cast<std::int64_t>(words['P'].value) : -1;
  const std::uint32_t column = words.has('P') ? words['P'].column : words['M'].column;
  put_without(block, [&](const Word& word) { return is_m(word, 99) || (target >= 0 && word.letter == 'P'); });
  if (frames_.size() == 1) {
    if (target >= 0) {
      jump(target, column);
      return;
    }
    rewriter_.flush();
    put("M99", origin_);
    warn("M99 at the end of the main program: it runs for ever; one pass is read");
    interpreter_.end();
    return;
  }
  const bool again = frames_.back().repeats > 1;
  leave();
  if (target >= 0 && !again) {
    jump(target, column);
  }
}

void Reader::macro_call(const ParsedBlock& block, std::string_view raw, int g_tenths) {
  if (g_tenths == 670) {
    if (!modal_calls_.empty()) {
      modal_calls_.pop_back();
    }
    control_.modal_call = modal_calls_.empty() ? 67 : 66;
    // Other codes may share the block with G67.
    if (block.word_count > 1) {
      put_without(block, [](const Word& word) { return word.letter == 'G' && word.value == 67.0; });
    }
    return;
  }
  MacroArguments arguments = parse_arguments(raw, here_.line, variables_, argument_scale());
  if (arguments.program < 1) {
    alarm(76, fmt::format("G{} without a program number P", g_tenths / 10));
  }
  if (arguments.repeats < 0 || arguments.repeats > 99'999'999) {
    alarm(76, fmt::format("repetitions L{} outside 0 ... 99999999", arguments.repeats));
  }
  if (g_tenths == 650) {
    if (arguments.repeats > 0) {
      enter(arguments, true, 1, block.text());
    }
    return;
  }
  if (modal_calls_.size() >= macro_nesting) {
    alarm(122, "more than 4 modal calls G66 at the same time");
  }
  if (lookup(arguments.program) == nullptr) {
    alarm(78, "program " + program_name(arguments.program) + " of G66 is not found");
  }
  modal_calls_.push_back({arguments, g_tenths == 661});
  control_.modal_call = 66;
}

// A G, M or T code that the machine builder bound to a program; inside of such a program codes are ordinary.
void Reader::bound_call(const ParsedBlock& block, std::string_view raw) {
  const BlockWords& words = block.sorted();
  const CodeBindings& bound = options_.bindings;
  const bool inside = std::any_of(frames_.begin(), frames_.end(), [](const Frame& frame) { return frame.by_code; });
  if (inside) {
    put_block(block);
    return;
  }
  // The program does not name what it calls: a message has to say who does.
  const auto call = [&](std::int64_t number, MacroArguments arguments, bool macro, const Word& word, const char* key) {
    const std::string by = fmt::format(" that {} calls ({})", block.text_of(word), key);
    const std::uint32_t column = macro ? word.column : 1;
    arguments.program = number;
    if (enter(arguments, macro, column, block.text(), by)) {
      frames_.back().by_code = true;
    }
  };
  const auto call_macro = [&](std::int64_t number, const Word& word, const char* key) {
    call(number, parse_arguments(raw, here_.line, variables_, argument_scale()), true, word, key);
  };
  for (const Word& word : block) {
    if (word.letter == 'G') {
      const auto found = bound.g_macros.find(static_cast<int>(std::lround(word.value * 10.0)));
      if (found != bound.g_macros.end()) {
        call_macro(found->second, word, "input.g_macros, parameters 6050 to 6059");
        return;
      }
    } else if (word.letter == 'M') {
      const auto found = bound.m_macros.find(static_cast<int>(word.value));
      if (found != bound.m_macros.end()) {
        call_macro(found->second, word, "input.m_macros, parameters 6080 to 6089");
        return;
      }
    }
  }
  for (const Word& word : block) {
    const auto found =
        word.letter == 'M' ? bound.m_subprograms.find(static_cast<int>(word.value)) : bound.m_subprograms.end();
    if (found != bound.m_subprograms.end()) {
      const int m = found->first;
      put_without(block, [m](const Word& other) { return is_m(other, m); });
      call(found->second, {}, false, word, "input.m_subprograms, parameters 6071 to 6079");
      return;
    }
  }
  // is_call() left nothing else.
  variables_.write(149, words['T'].value, here_.line, words['T'].column);
  put_without(block, [](const Word& word) { return word.letter == 'T'; });
  call(bound.tool_program, {}, false, words['T'], "input.tool_program, parameter 6001#5");
}

// Behind a block with a move: the macro of G66, the one given last first; its own moves call the one before it.
void Reader::modal_calls() {
  std::size_t inside = 0;
  for (const Frame& frame : frames_) {
    inside += frame.modal ? 1U : 0U;
  }
  if (inside >= modal_calls_.size()) {
    return;
  }
  const ModalCall& call = modal_calls_[modal_calls_.size() - 1 - inside];
  if ((moved_ || call.every_block) && call.arguments.repeats > 0) {
    if (enter(call.arguments, true, 1, "")) {
      frames_.back().modal = true;
    }
  }
}

ProgramUnit* Reader::lookup(std::int64_t number) {
  ProgramUnit* unit = store_.find(number, frames_.empty() ? nullptr : frames_.back().unit);
  if (unit != nullptr || !options_.load_program || sought_.contains(number)) {
    return unit;
  }
  sought_.insert(number);
  auto source = options_.load_program(number);
  if (!source) {
    return nullptr;
  }
  sources_.push_back(std::move(*source));
  program_.files.push_back(sources_.back().name);
  const auto file = static_cast<std::uint32_t>(program_.files.size() - 1);
  try {
    require_room_for(sources_.back().text);
    store_.add(sources_.back().text, find_frame(sources_.back().text), file);
  } catch (Error& error) {
    error.set_file(sources_.back().name);
    throw;
  }
  unit = store_.find(number);
  if (unit == nullptr && store_.units().back()->number < 0) {
    unit = store_.number_last(number);  // a file without an O line goes by its name
  }
  return unit;
}

bool Reader::enter(const MacroArguments& arguments, bool macro, std::uint32_t column, std::string_view text,
                   const std::string& by) {
  const std::int64_t number = arguments.program;
  ProgramUnit* unit = lookup(number);
  const bool shut = unit != nullptr && is_shut(number);
  if (shut && text.empty()) {
    fail("program " + program_name(number) + by + " asks for values that only the control knows", column);
  }
  if (unit == nullptr || shut) {
    if (shut || (!text.empty() && number >= options_.opaque_programs[0] && number <= options_.opaque_programs[1])) {
      // A macro of the machine or of a probe: kept, and what it did is not known.
      rewriter_.flush();
      interpreter_.close_region();
      put_raw(text, origin_);
      interpreter_.forget_all();
      variables_.forget();
      warn("program " + program_name(number) + by +
           (shut ? " asks for values that only the control knows" : " is not at hand") +
           ": the call is kept, position and variables are not known afterwards" +
           (shut ? "" : "; a file " + program_name(number) + " beside this program makes them known"));
      return false;
    }
    alarm(78, "program " + program_name(number) + by + " is not found", column);
  }
  std::size_t macros = 0;
  for (const Frame& frame : frames_) {
    macros += frame.macro ? 1U : 0U;
  }
  if (macro && macros >= macro_nesting) {
    alarm(122, fmt::format("macro calls nested deeper than {} at the call of {}", macro_nesting, program_name(number)),
          column);
  }
  if (frames_.size() - macros > static_cast<std::size_t>(options_.subprogram_nesting) && !macro) {
    alarm(77,
          fmt::format("subprograms nested deeper than {} (controller.nesting_limit_subprogram) at the call of {}",
                      options_.subprogram_nesting, program_name(number)),
          column);
  }
  called_.insert(number);
  unit->called = true;
  if (program_.calls.empty() || program_.calls.back().origin != origin_ || program_.calls.back().number != number) {
    program_.calls.push_back({static_cast<std::uint32_t>(program_.origins.size() + 1), origin_, number});
  }
  if (macro) {
    variables_.push_level(arguments.locals, here_.line, column);
  }
  Frame frame;
  frame.unit = unit;
  frame.next = unit->first;
  frame.macro = macro;
  frame.repeats = arguments.repeats;
  frame.arguments = arguments;
  frames_.push_back(std::move(frame));
  return true;
}

void Reader::leave() {
  Frame& frame = frames_.back();
  if (frame.macro) {
    variables_.pop_level();
  }
  if (--frame.repeats > 0) {
    if (frame.macro) {
      variables_.push_level(frame.arguments.locals, here_.line, 1);
    }
    frame.next = frame.unit->first;
    frame.loops.clear();
    return;
  }
  frames_.pop_back();
}

}  // namespace shapegcode::detail
