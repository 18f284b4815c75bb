#include "program/read/program_store.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cstring>

#include "program/text/characters.hpp"
#include "program/text/lexer.hpp"
#include "program/text/number_scan.hpp"
#include "shapegcode/error.hpp"

namespace shapegcode::detail {
namespace {

// The number behind a letter at the start of a line ("N10", "/2 N10", "O0001"), -1 if the line has none.
std::int64_t leading_number(std::string_view line, char letter) noexcept {
  std::size_t i = 0;
  skip_spaces(line, i);
  if (i < line.size() && line[i] == '/') {
    scan_skip_switch(line, i);
    skip_spaces(line, i);
  }
  if (i >= line.size() || upper(line[i]) != letter) {
    return -1;
  }
  ++i;
  skip_spaces(line, i);
  return scan_whole(line, i);
}

// The number of "END m" or "EN m" at the end of a macro line: 0 if it is none. A comment may hold anything.
int end_number(std::string_view line) {
  std::string plain;
  bool comment = false;
  for (const char c : line) {
    comment = comment || c == '(';
    if (!comment && c != ' ' && c != '\t' && c != '\r') {
      plain += upper(c);
    }
    comment = comment && c != ')';
  }
  std::size_t digits = plain.size();
  while (digits > 0 && is_digit(plain[digits - 1])) {
    --digits;
  }
  std::size_t letters = digits;
  while (letters > 0 && plain[letters - 1] >= 'A' && plain[letters - 1] <= 'Z') {
    --letters;
  }
  const std::string_view word = std::string_view(plain).substr(letters, digits - letters);
  const bool one_digit = digits + 1 == plain.size() && plain[digits] >= '1' && plain[digits] <= '3';
  return one_digit && abbreviates(word, "END") ? plain[digits] - '0' : 0;
}

// The lines that begin a program (O, a colon, a name in < >) or a folder (&F=), in their order. Only those characters
// are looked at: a plain program of a million lines has hardly any.
std::string_view line_at(std::string_view text, std::size_t begin) {
  return text.substr(begin, text.find('\n', begin) - begin);
}

// What stands behind the first of one character, up to the first of another one or to the end, without blanks around.
std::string between(std::string_view line, char open, char close) {
  const std::size_t begin = std::min(line.find(open), line.size() - 1) + 1;
  std::string_view inside = line.substr(begin, line.find(close, begin) - begin);
  inside.remove_prefix(std::min(inside.find_first_not_of(" \t\r"), inside.size()));
  const std::size_t last = inside.find_last_not_of(" \t\r");
  return std::string(inside.substr(0, last == std::string_view::npos ? 0 : last + 1));
}

// A CR with text on both sides ends a line for who wrote it; read as a blank it would join two blocks.
void refuse_lone_carriage_return(const std::string& text) {
  for (std::size_t at = text.find('\r'); at != std::string::npos; at = text.find('\r', at)) {
    const std::size_t behind = std::min(text.find_first_not_of(" \t\r", at), text.size());
    const bool begins_line = at == 0 || text[at - 1] == '\n';
    if (!begins_line && behind < text.size() && text[behind] != '\n') {
      const std::size_t line_start = text.rfind('\n', at) + 1;  // npos + 1 is 0
      const auto line = static_cast<std::uint32_t>(
          1 + std::count(text.begin(), text.begin() + static_cast<std::ptrdiff_t>(at), '\n'));
      throw Error(ErrorKind::program, "a line ends with CR alone: write line ends as LF or CR LF", line,
                  static_cast<std::uint32_t>(at - line_start + 1));
    }
    at = behind;
  }
}

// The first line behind the one at `end`, where a control stops reading, that holds more than blanks and '%'; 0: none.
std::uint32_t text_line_behind(const std::string& text, std::size_t end) {
  const std::size_t next_line = text.find('\n', end);
  const std::size_t at = next_line == std::string::npos ? next_line : text.find_first_not_of(" \t\r\n%", next_line);
  return at == std::string::npos
             ? 0U
             : static_cast<std::uint32_t>(
                   1 + std::count(text.begin(), text.begin() + static_cast<std::ptrdiff_t>(at), '\n'));
}

class ProgramHeads {
 public:
  enum class Kind : std::uint8_t { number, name, folder };
  struct Head {
    std::size_t begin;  // of the line
    Kind kind;
    std::int64_t number;  // -1: has none
  };

  ProgramHeads(const std::string& text, const TapeFrame& frame)
      : text_(std::string_view(text).substr(0, frame.end)), from_(frame.begin) {
    for (std::size_t k = 0; k < marks.size(); ++k) {
      next_[k] = find(marks[k], frame.begin);
    }
  }

  std::optional<Head> next() {
    for (;;) {
      const auto nearest = std::min_element(next_.begin(), next_.end());
      const std::size_t at = *nearest;
      if (at == text_.size()) {
        return std::nullopt;
      }
      const char mark = marks[static_cast<std::size_t>(nearest - next_.begin())];
      *nearest = find(mark, at + 1);
      // Back over blanks alone: a line may be as long as the text, and full of marks.
      std::size_t begin = at;
      while (begin > from_ && (text_[begin - 1] == ' ' || text_[begin - 1] == '\t' || text_[begin - 1] == '\r')) {
        --begin;
      }
      if (begin > from_ && text_[begin - 1] != '\n') {
        continue;
      }
      const std::string_view line = text_.substr(at);
      const auto has_name = [&] { return line.substr(0, line.find('\n')).find('>') != std::string_view::npos; };
      if (mark == '&' || (mark == '<' && has_name())) {
        return Head{begin, mark == '&' ? Kind::folder : Kind::name, -1};
      }
      const std::int64_t number = leading_number(line, mark == ':' ? ':' : 'O');
      std::size_t behind = 1;
      skip_spaces(line, behind);
      if (number >= 0 || (behind < line.size() && line[behind] == '<' && mark != ':' && has_name())) {
        return Head{begin, number >= 0 ? Kind::number : Kind::name, number};
      }
    }
  }

 private:
  [[nodiscard]] std::size_t find(char letter, std::size_t from) const noexcept {
    return std::min(text_.find(letter, from), text_.size());
  }

  static constexpr std::array<char, 5> marks = {'O', 'o', ':', '<', '&'};

  std::string_view text_;
  std::size_t from_;
  std::array<std::size_t, marks.size()> next_{};
};

}  // namespace

// Where the program text proper begins and ends: between the first '%' and the next one.
TapeFrame find_frame(const std::string& text) {
  const std::size_t start = text.starts_with(byte_order_mark) ? byte_order_mark.size() : 0;
  const std::size_t first_mark = text.find_first_not_of(" \t\r\n", start);
  if (first_mark == std::string::npos) {
    throw Error(ErrorKind::program, "the file is empty", 1, 1);
  }
  const auto junk = text.find('\0');
  if (junk != std::string::npos) {
    const auto at = static_cast<std::uint32_t>(
        1 + std::count(text.begin(), text.begin() + static_cast<std::ptrdiff_t>(junk), '\n'));
    const std::size_t line_start = junk == 0 ? 0 : text.rfind('\n', junk - 1) + 1;
    throw Error(ErrorKind::program, fmt::format("byte 0x00 at offset {}: this is no program text", junk), at,
                static_cast<std::uint32_t>(junk - line_start + 1));
  }
  refuse_lone_carriage_return(text);
  // Offsets of lines that start with '%'.
  const auto percent_line = [&](std::size_t from) {
    for (std::size_t at = text.find('%', from); at != std::string::npos; at = text.find('%', at + 1)) {
      std::size_t k = at;
      while (k > start && (text[k - 1] == ' ' || text[k - 1] == '\t' || text[k - 1] == '\r')) {
        --k;
      }
      if (k == start || text[k - 1] == '\n') {
        return at;
      }
    }
    return std::string::npos;
  };
  const std::size_t first = percent_line(start);
  const bool leads = first != std::string::npos && first_mark == first;
  const std::size_t second = first == std::string::npos ? first : percent_line(first + 1);
  const auto last_line = static_cast<std::uint32_t>(1 + std::count(text.begin(), text.end(), '\n'));
  TapeFrame frame;
  frame.framed = first != std::string::npos;
  // A '%' at the start alone is half a tape: the end is missing. None at all is a text without tape marks; then M30 or
  // M02 must show that it is whole. One at the end alone was left behind when the start was cut off: nothing is lost.
  if (frame.framed && second == std::string::npos && leads) {
    throw Error(ErrorKind::program, "no line '%' at the end of the program: truncated?", last_line, 1);
  }
  frame.begin = start;
  frame.end = text.size();
  frame.no_start = frame.framed && second == std::string::npos;
  if (frame.no_start) {
    frame.end = first;
  } else if (frame.framed) {
    frame.begin = std::min(text.find('\n', first), text.size() - 1) + 1;
    frame.end = second;
  }
  frame.first_line = static_cast<std::uint32_t>(
      1 + std::count(text.begin(), text.begin() + static_cast<std::ptrdiff_t>(frame.begin), '\n'));
  frame.unread_line = frame.framed ? text_line_behind(text, frame.end) : 0;
  return frame;
}

bool ProgramUnit::next_line(LinePosition& position, std::string_view& line, std::size_t& begin) const noexcept {
  if (position.at >= end) {
    return false;
  }
  const char* data = text->data();
  begin = position.at;
  const void* hit = std::memchr(data + begin, '\n', end - begin);
  const std::size_t next = hit == nullptr ? end : static_cast<std::size_t>(static_cast<const char*>(hit) - data) + 1;
  std::size_t stop = next;
  while (stop > begin && (data[stop - 1] == '\n' || data[stop - 1] == '\r')) {
    --stop;
  }
  line = std::string_view(data + begin, stop - begin);
  // A punched end of block may be LF CR CR.
  const bool punched = next + 2 <= end && data[next - 1] == '\n' && data[next] == '\r' && data[next + 1] == '\r';
  position.at = next + (punched ? 2 : 0);
  ++position.line;
  return true;
}

void ProgramUnit::index_numbers() {
  indexed_ = true;
  LinePosition position = first;
  std::string_view line;
  std::size_t begin = 0;
  for (LinePosition here = position; next_line(position, line, begin); here = position) {
    const std::int64_t n = leading_number(line, 'N');
    if (n >= 0) {
      numbers_[n].push_back(here);
    }
  }
}

std::optional<LinePosition> ProgramUnit::find_n(std::int64_t n, std::size_t from) {
  if (!indexed_) {
    index_numbers();
  }
  const auto found = numbers_.find(n);
  if (found == numbers_.end()) {
    return std::nullopt;
  }
  const auto& positions = found->second;
  const auto behind = std::lower_bound(positions.begin(), positions.end(), from,
                                       [](const LinePosition& position, std::size_t at) { return position.at < at; });
  return behind == positions.end() ? positions.front() : *behind;
}

void ProgramUnit::index_ends() {
  ends_indexed_ = true;
  LinePosition position = first;
  std::string_view line;
  std::size_t begin = 0;
  while (next_line(position, line, begin)) {
    if (const int loop = end_number(line); loop > 0) {
      ends_[loop].push_back(position);
    }
  }
}

std::optional<LinePosition> ProgramUnit::behind_end(int loop, const LinePosition& from) {
  if (!ends_indexed_) {
    index_ends();
  }
  const auto& positions = ends_[loop];
  // Positions lie behind their END: the one of a line that begins at `from` or later.
  const auto found = std::upper_bound(positions.begin(), positions.end(), from.at,
                                      [](std::size_t at, const LinePosition& position) { return at < position.at; });
  return found == positions.end() ? std::nullopt : std::optional(*found);
}

void ProgramStore::add(const std::string& text, const TapeFrame& frame, std::uint32_t file) {
  const auto unit_at = [&](const LinePosition& first, std::int64_t number) {
    auto unit = std::make_unique<ProgramUnit>();
    unit->number = number;
    unit->file = file;
    unit->text = &text;
    unit->first = first;
    unit->end = frame.end;
    return unit;
  };
  auto unit = unit_at({frame.begin, frame.first_line}, -1);
  bool headed = false;  // the unit has its O number or name
  const auto close = [&](std::size_t at) {
    const ProgramUnit* twin = unit->number <= 0 ? nullptr : find(unit->number, unit.get());
    if (twin != nullptr && twin->file == file && twin->folder == unit->folder) {
      throw alarm_error(
          73, fmt::format("program O{} stands twice in the file, first in line {}", unit->number, twin->first.line),
          unit->first.line, 1);
    }
    unit->end = at;
    note(*unit);
    units_.push_back(std::move(unit));
  };
  ProgramHeads heads(text, frame);
  LinePosition here = unit->first;
  while (const auto head = heads.next()) {
    here.line += static_cast<std::uint32_t>(std::count(text.begin() + static_cast<std::ptrdiff_t>(here.at),
                                                       text.begin() + static_cast<std::ptrdiff_t>(head->begin), '\n'));
    here.at = head->begin;
    if (head->number > 99'999'999) {
      throw alarm_error(74, fmt::format("program number O{} outside 1 ... 99999999", head->number), here.line, 1);
    }
    if (headed) {
      const std::uint32_t folder = unit->folder;
      const std::string folder_name = unit->folder_name;
      close(head->begin);
      unit = unit_at(here, -1);
      unit->folder = folder;
      unit->folder_name = folder_name;
      headed = false;
    }
    if (head->kind == ProgramHeads::Kind::folder) {
      ++unit->folder;
      unit->folder_name = between(line_at(text, head->begin), '=', '\r');
    } else {
      unit->number = head->number;  // what stands before the first head belongs to its program
      if (head->kind == ProgramHeads::Kind::name) {
        unit->name = "<" + between(line_at(text, head->begin), '<', '>') + ">";
      }
      headed = true;
    }
  }
  if (headed || units_.empty() || unit->first.at < frame.end) {
    close(frame.end);
  }
}

void ProgramStore::note(ProgramUnit& unit) {
  placed_.try_emplace({unit.file, unit.folder, unit.number}, &unit);
  first_.try_emplace(unit.number, &unit);
}

ProgramUnit* ProgramStore::find(std::int64_t number, const ProgramUnit* from) const {
  if (from != nullptr) {
    const auto here = placed_.find({from->file, from->folder, number});
    if (here != placed_.end()) {
      return here->second;
    }
  }
  const auto found = first_.find(number);
  return found == first_.end() ? nullptr : found->second;
}

ProgramUnit* ProgramStore::number_last(std::int64_t number) {
  ProgramUnit& unit = *units_.back();
  unit.number = number;
  note(unit);
  return &unit;
}

}  // namespace shapegcode::detail
