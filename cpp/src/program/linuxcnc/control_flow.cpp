#include <fmt/format.h>

#include <algorithm>

#include "program/linuxcnc/interpreter.hpp"
#include "program/linuxcnc/program_text.hpp"

namespace shapegcode::linuxcnc {
namespace {

constexpr std::size_t max_nesting = 10;  // INTERP_SUB_ROUTINE_LEVELS

/// An O word in a message.
std::string named(const OLine& line) { return fmt::format("O{} {}", shown(line.label), uppered(line.word)); }

std::string label_of(std::int64_t number) { return fmt::format("{}", number); }

}  // namespace

void Interpreter::control(std::size_t index, OLine& line) {
  switch (line.keyword) {
    case Keyword::none: {  // the head of a program that M98 calls
      const std::string_view rest = stripped(line.rest);
      if (!rest.empty() && !rest.starts_with('(') && !rest.starts_with(';')) {
        refuse(fmt::format("O{}{}: no keyword of LinuxCNC", shown(line.label), shown(line.rest.substr(0, 20))));
      }
      return;
    }
    case Keyword::call:
      call(index, line);
      return;
    case Keyword::returns:
    case Keyword::endsub:
      return_from(line);
      return;
    case Keyword::opens_while:
      run_while(index, line);
      return;
    case Keyword::sub:
      next_ = behind(index, line, {Keyword::endsub}) + 1;
      return;
    case Keyword::opens_if:
      run_conditional(index, line);
      return;
    case Keyword::elseif:
    case Keyword::otherwise:
      next_ = behind(index, line, {Keyword::endif}) + 1;
      return;
    case Keyword::endwhile:
      next_ = opening(index, line, Keyword::opens_while);
      return;
    case Keyword::repeat:
      run_repeat(index, line);
      return;
    case Keyword::endrepeat:
      end_repeat(index, line);
      return;
    case Keyword::breaks:
      broke_ = true;
      next_ = loop_end(index, line) + 1;
      return;
    case Keyword::continues:
      next_ = loop_end(index, line);
      return;
    case Keyword::opens_do:
    case Keyword::endif:
      return;
    default:
      refuse(named(line) + " is not a keyword of LinuxCNC");
  }
}

void Interpreter::run_conditional(std::size_t index, OLine& line) {
  OLine* part = &line;
  while (condition(*part) == 0.0) {
    index = behind(index, *part, {Keyword::elseif, Keyword::otherwise, Keyword::endif});
    part = file_->o_line(index);
    if (part->keyword != Keyword::elseif) break;
  }
  next_ = index + 1;
}

void Interpreter::run_while(std::size_t index, OLine& line) {
  const bool holds = condition(line) != 0.0;
  if (!file_->closes_do(index, line.label)) {
    if (!holds) next_ = behind(index, line, {Keyword::endwhile}) + 1;
    return;
  }
  const auto begin = file_->before(index, line.label, {Keyword::opens_do});
  if (!holds || !begin) return;
  if (broke_) {
    lines_.note(static_cast<std::uint32_t>(index + 1),
                "a DO loop after a BREAK: read as documented; LinuxCNC 2.9.0~pre1 runs it once only", "DO after BREAK");
  }
  next_ = *begin + 1;
}

void Interpreter::run_repeat(std::size_t index, OLine& line) {
  const std::int64_t count = rounded(condition(line));  // 2.7 is 3, 2.5 is 2: as rs274 2.9 repeats
  if (count > 0) {
    frames_.back().repeats[index] = count;
  } else {
    next_ = behind(index, line, {Keyword::endrepeat}) + 1;
  }
}

void Interpreter::end_repeat(std::size_t index, OLine& line) {
  const std::size_t begin = opening(index, line, Keyword::repeat);
  const auto left = frames_.back().repeats.find(begin);
  if (left == frames_.back().repeats.end()) refuse(fmt::format("O{} ENDREPEAT without REPEAT", shown(line.label)));
  if (left->second-- > 1) next_ = begin + 1;
}

std::size_t Interpreter::opening(std::size_t index, const OLine& line, Keyword keyword) {
  const auto found = file_->before(index, line.label, {keyword});
  if (!found) refuse(fmt::format("{} without {}", named(line), uppered(text_of(keyword))));
  return *found;
}

std::size_t Interpreter::behind(std::size_t index, const OLine& line, std::initializer_list<Keyword> keywords) {
  const auto place = file_->after(index, line.label, keywords);
  if (place) return *place;
  std::string all;
  for (const Keyword keyword : keywords) all += (all.empty() ? "" : " OR ") + uppered(text_of(keyword));
  refuse(fmt::format("{}: no {} after it", named(line), all));
}

std::size_t Interpreter::loop_end(std::size_t index, const OLine& line) {
  const auto begin = file_->before(index, line.label, {Keyword::opens_do, Keyword::opens_while, Keyword::repeat});
  if (!begin) refuse(named(line) + " outside of a loop");
  switch (file_->o_line(*begin)->keyword) {
    case Keyword::opens_do:
      return behind(index, line, {Keyword::opens_while});
    case Keyword::opens_while:
      return behind(index, line, {Keyword::endwhile});
    default:
      return behind(index, line, {Keyword::endrepeat});
  }
}

std::vector<double> Interpreter::values(OLine& line) {
  std::vector<double> found;
  if (line.is_read) {
    for (const Value& value : line.values) found.push_back(evaluate_(value, line.code));
    return found;
  }
  std::vector<std::string> comments;
  const std::string text = without_comments(line.rest, comments);
  ValueReader reader(text, line.code, names_);
  while (!reader.is_done()) {
    if (reader.front() != '[') refuse("[ is expected at " + quoted_begin(reader.left()));
    line.values.push_back(reader.value());
    found.push_back(evaluate_(line.values.back(), line.code));
  }
  line.is_read = true;
  return found;
}

double Interpreter::condition(OLine& line) {
  const std::vector<double> found = values(line);
  if (found.size() != 1) refuse(named(line) + " needs one value in brackets");
  return found.front();
}

void Interpreter::call(std::size_t index, OLine& line) {
  std::string label = line.label;
  if (label.starts_with('[')) {
    Code code;
    const Value value = ValueReader(line.label, code, names_).value();
    label = label_of(rounded(evaluate_(value, code)));
  }
  const std::vector<double> arguments = values(line);
  if (arguments.size() > max_arguments) {
    refuse(fmt::format("{} arguments; a subroutine takes {}", arguments.size(), max_arguments));
  }
  const auto [file, begin] = subroutine(label, Keyword::sub);
  Frame& frame = enter(*file, begin + 1, index);
  std::ranges::copy(arguments, frame.locals.begin() + 1);
  parameters_.set_named(value_, 0.0);
  parameters_.set_named(value_returned_, 0.0);
}

std::pair<SourceFile*, std::size_t> Interpreter::subroutine(const std::string& label, Keyword keyword) {
  for (SourceFile* const file : {file_, &main_}) {
    if (const auto line = file->find(label, keyword)) return {file, *line};
  }
  SourceFile& file = load(label);
  const auto line = file.find(label, keyword);
  if (!line) refuse(fmt::format("{} contains no O{} {}", file.name(), shown(label), uppered(text_of(keyword))));
  return {&file, *line};
}

SourceFile& Interpreter::load(const std::string& label) {
  if (const auto loaded = files_.find(label); loaded != files_.end()) return *loaded->second;
  const std::size_t begin = std::min(label.find_first_not_of("<>"), label.size());
  const std::string name = label.substr(begin, label.find_last_not_of("<>") + 1 - begin);
  auto found = options_.find_subroutine ? options_.find_subroutine(shown(name)) : std::nullopt;
  if (!found) {
    refuse(fmt::format(
        "subroutine O{} is neither in the file nor is there {}.ngc in its folder or in input.program_folders",
        shown(label), shown(name)));
  }
  const std::uint32_t index = lines_.add_file(found->name);
  SourceFile& file = *(files_[label] = std::make_unique<SourceFile>(found->name, found->text, index));
  read_lines_ += file.count();
  return file;
}

Frame& Interpreter::enter(SourceFile& file, std::size_t begin, std::size_t index) {
  if (frames_.size() > max_nesting) refuse(fmt::format("subroutines are nested more than {} deep", max_nesting));
  Frame& frame = frames_.emplace_back();
  frame.back = index + 1;
  frame.caller = file_;
  frame.begin = begin;
  file_ = &file;
  next_ = begin;
  slow_to_ = 0;
  return frame;
}

void Interpreter::leave() {
  const Frame frame = std::move(frames_.back());
  frames_.pop_back();
  if (frame.restores && frame.saved) runner_.restore(*frame.saved);
  file_ = frame.caller;
  next_ = frame.back;
  slow_to_ = 0;
}

void Interpreter::return_from(OLine& line) {
  if (frames_.size() == 1 || frames_.back().by_m98) refuse(named(line) + " outside of a subroutine");
  const std::vector<double> found = values(line);
  if (found.size() > 1) refuse("a subroutine returns one value");
  if (!found.empty()) {
    parameters_.set_named(value_, found.front());
    parameters_.set_named(value_returned_, 1.0);
  }
  leave();
}

std::string Interpreter::call_stack() const {
  constexpr std::size_t most_shown = 3;
  std::string text;
  for (std::size_t k = frames_.size(); k > 1 && frames_.size() - k < most_shown; --k) {
    const Frame& frame = frames_[k - 1];
    text += fmt::format("{}{} line {}", text.empty() ? "; called from " : ", ", frame.caller->name(), frame.back);
  }
  return text;
}

void Interpreter::run_special(int code, const WordValues& values, std::size_t index) {
  Frame& frame = frames_.back();
  switch (code) {
    case 70:
    case 73:
      frame.saved = state_.modes;
      frame.restores = code == 73;
      if (code == 73 && frames_.size() == 1) refuse("M73 outside of a subroutine");
      return;
    case 71:
      frame.saved.reset();
      return;
    case 72:
      if (!frame.saved) refuse("M72 without M70 before it");
      runner_.restore(*frame.saved);
      return;
    case 98:
      call_program(values, index);
      return;
    default:
      end_program(index);
  }
}

void Interpreter::call_program(const WordValues& values, std::size_t index) {
  const std::int64_t times = truncated(values.get('l', 1.0));
  if (times < 1) return;
  const auto [file, begin] = subroutine(label_of(truncated(values.get('p', -1.0))), Keyword::none);
  Frame& called = enter(*file, begin + 1, index);
  called.by_m98 = true;
  called.again = times - 1;
}

void Interpreter::end_program(std::size_t index) {
  Frame& frame = frames_.back();
  if (frames_.size() == 1) {
    const auto line = static_cast<std::uint32_t>(index + 1);
    lines_.note(line, "M99 in the main program begins it again without end: read as its end", "M99");
    lines_.put("M30", line);
    runner_.ended = true;
  } else if (frame.again > 0) {
    --frame.again;
    next_ = frame.begin;
  } else {
    leave();
  }
}

}  // namespace shapegcode::linuxcnc
