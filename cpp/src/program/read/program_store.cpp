#include "program/read/program_store.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cstring>

#include "base/text.hpp"
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

// The number of "DO m" or "END m" at the end of a macro line: 0 if it is none. A comment may hold anything.
int loop_number(std::string_view line, std::string_view keyword) {
  std::string plain;
  bool comment = false;
  for (const char c : line) {
    comment = comment || c == '(';
    if (!comment && c != ' ' && c != '\t') {
      plain += upper(c);
    }
    comment = comment && c != ')';
  }
  const auto at = plain.rfind(keyword);
  if (at == std::string::npos || at + keyword.size() >= plain.size()) {
    return 0;
  }
  const char digit = plain[at + keyword.size()];
  // Not the tail of another word, as in WHILE[..]DO1 the DO is preceded by a bracket or stands first.
  const bool own = at == 0 || !(plain[at - 1] >= 'A' && plain[at - 1] <= 'Z');
  return own && digit >= '1' && digit <= '3' ? digit - '0' : 0;
}

// The lines that begin with O, in their order. Only the letters O are looked at: a plain program of a million lines has
// hardly any.
class ProgramHeads {
 public:
  struct Head {
    std::size_t begin;  // of the line
    std::int64_t number;
  };

  ProgramHeads(const std::string& text, const TapeFrame& frame)
      : text_(std::string_view(text).substr(0, frame.end)),
        from_(frame.begin),
        next_{find('O', frame.begin), find('o', frame.begin)} {}

  std::optional<Head> next() {
    for (;;) {
      const std::size_t at = std::min(next_[0], next_[1]);
      if (at == text_.size()) {
        return std::nullopt;
      }
      const std::size_t which = next_[0] == at ? 0 : 1;
      next_[which] = find(which == 0 ? 'O' : 'o', at + 1);
      const std::size_t newline = at == 0 ? std::string_view::npos : text_.rfind('\n', at - 1);
      const std::size_t begin = std::max(newline == std::string_view::npos ? 0 : newline + 1, from_);
      const std::int64_t number = leading_number(text_.substr(begin), 'O');
      std::size_t first = begin;
      skip_spaces(text_, first);
      if (number >= 0 && first == at) {
        return Head{begin, number};
      }
    }
  }

 private:
  [[nodiscard]] std::size_t find(char letter, std::size_t from) const noexcept {
    return std::min(text_.find(letter, from), text_.size());
  }

  std::string_view text_;
  std::size_t from_;
  std::array<std::size_t, 2> next_;
};

}  // namespace

// Where the program text proper begins and ends: between the first '%' and the next one.
TapeFrame find_frame(const std::string& text) {
  if (text.find_first_not_of(" \t\r\n") == std::string::npos) {
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
  TapeFrame frame;
  frame.framed = first != std::string::npos;
  // One '%' alone is half a tape: the other half is missing. None at all is a text without tape marks; then M30 or M02
  // must show that it is whole.
  if (frame.framed && second == std::string::npos) {
    if (leads) {
      throw Error(ErrorKind::program, "no line '%' at the end of the program: truncated?", last_line, 1);
    }
    throw Error(ErrorKind::program, "a line '%' at the end of the program, but none at its start", 1, 1);
  }
  frame.begin = 0;
  frame.end = text.size();
  if (frame.framed) {
    frame.begin = std::min(text.find('\n', first), text.size() - 1) + 1;
    frame.end = second;
  }
  frame.first_line = static_cast<std::uint32_t>(
      1 + std::count(text.begin(), text.begin() + static_cast<std::ptrdiff_t>(frame.begin), '\n'));
  return frame;
}

bool ProgramUnit::next_line(LinePlace& place, std::string_view& line, std::size_t& begin) const noexcept {
  if (place.at >= end) {
    return false;
  }
  const char* data = text->data();
  begin = place.at;
  const void* hit = std::memchr(data + begin, '\n', end - begin);
  const std::size_t next = hit == nullptr ? end : static_cast<std::size_t>(static_cast<const char*>(hit) - data) + 1;
  std::size_t stop = next;
  while (stop > begin && (data[stop - 1] == '\n' || data[stop - 1] == '\r')) {
    --stop;
  }
  line = std::string_view(data + begin, stop - begin);
  place.at = next;
  ++place.line;
  return true;
}

void ProgramUnit::index_numbers() {
  indexed_ = true;
  LinePlace place = first;
  std::string_view line;
  std::size_t begin = 0;
  for (LinePlace here = place; next_line(place, line, begin); here = place) {
    const std::int64_t n = leading_number(line, 'N');
    if (n >= 0) {
      numbers_[n].push_back(here);
    }
  }
}

std::optional<LinePlace> ProgramUnit::find_n(std::int64_t n, std::size_t from) {
  if (!indexed_) {
    index_numbers();
  }
  const auto found = numbers_.find(n);
  if (found == numbers_.end()) {
    return std::nullopt;
  }
  const auto& places = found->second;
  const auto behind = std::lower_bound(places.begin(), places.end(), from,
                                       [](const LinePlace& place, std::size_t at) { return place.at < at; });
  return behind == places.end() ? places.front() : *behind;
}

std::optional<LinePlace> ProgramUnit::behind_end(int loop, const LinePlace& from) {
  const auto key = std::pair(from.at, loop);
  const auto known = ends_.find(key);
  if (known != ends_.end()) {
    return known->second;
  }
  LinePlace place = from;
  std::string_view line;
  std::size_t begin = 0;
  std::optional<LinePlace> found;
  while (!found && next_line(place, line, begin)) {
    if (loop_number(line, "END") == loop) {
      found = place;
    }
  }
  ends_[key] = found;
  return found;
}

void ProgramStore::add(const std::string& text, const TapeFrame& frame, std::uint32_t file) {
  const auto unit_at = [&](const LinePlace& first, std::int64_t number) {
    auto unit = std::make_unique<ProgramUnit>();
    unit->number = number;
    unit->file = file;
    unit->text = &text;
    unit->first = first;
    unit->end = frame.end;
    return unit;
  };
  auto unit = unit_at({frame.begin, frame.first_line}, -1);
  const auto close = [&](std::size_t at) {
    const ProgramUnit* twin = unit->number < 0 ? nullptr : find(unit->number);
    if (twin != nullptr && twin->file == file) {
      throw alarm_error(
          73, fmt::format("program O{} stands twice in the file, first in line {}", unit->number, twin->first.line),
          unit->first.line, 1);
    }
    unit->end = at;
    units_.push_back(std::move(unit));
  };
  ProgramHeads heads(text, frame);
  LinePlace here = unit->first;
  while (const auto head = heads.next()) {
    here.line += static_cast<std::uint32_t>(std::count(text.begin() + static_cast<std::ptrdiff_t>(here.at),
                                                       text.begin() + static_cast<std::ptrdiff_t>(head->begin), '\n'));
    here.at = head->begin;
    if (head->number == 0 || head->number > 99'999'999) {
      throw alarm_error(74, fmt::format("program number O{} outside 1 ... 99999999", head->number), here.line, 1);
    }
    if (unit->number < 0) {
      unit->number = head->number;  // what stands before the first O line belongs to its program
      continue;
    }
    close(head->begin);
    unit = unit_at(here, head->number);
  }
  close(frame.end);
}

ProgramUnit* ProgramStore::find(std::int64_t number) noexcept {
  for (const auto& unit : units_) {
    if (unit->number == number) {
      return unit.get();
    }
  }
  return nullptr;
}

}  // namespace shapegcode::detail
