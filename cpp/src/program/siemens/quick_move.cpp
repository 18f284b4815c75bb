#include "program/siemens/quick_move.hpp"

#include "program/siemens/line_text.hpp"
#include "program/siemens/scanner.hpp"
#include "program/siemens/value.hpp"

namespace shapegcode::siemens {
namespace {

char character(std::string_view line, std::size_t at) { return at < line.size() ? line[at] : '\0'; }

/// G0, G1, G00, G01 and white space at an index; false: there is something else.
bool read_code(std::string_view line, std::size_t& at, char& code) {
  std::size_t end = at + 1;
  if (character(line, end) == '0' && (character(line, end + 1) == '0' || character(line, end + 1) == '1')) ++end;
  code = character(line, end);
  if (code != '0' && code != '1') return false;
  ++end;
  if (space_at(line, end) == 0) return false;
  skip_spaces_of_any_kind(line, end);
  at = end;
  return true;
}

}  // namespace

std::optional<QuickMove> read_quick_move(std::string_view line) {
  std::size_t at = 0;
  skip_spaces_of_any_kind(line, at);
  if (character(line, at) == 'N') {
    const std::size_t end = digits_end(line, at + 1);
    if (end == at + 1) return std::nullopt;
    at = end;
    skip_spaces_of_any_kind(line, at);
  }
  QuickMove found;
  if (character(line, at) == 'G' && !read_code(line, at, found.code)) return std::nullopt;
  bool has_axis = false;
  while (character(line, at) >= 'X' && character(line, at) <= 'Z') {
    std::optional<double>& value = found.values[static_cast<std::size_t>(line[at] - 'X')];
    const std::size_t begin = at + 1;
    const std::size_t digits = begin + (character(line, begin) == '-' ? 1 : 0);
    const std::size_t end = decimal_end(line, digits);
    if (end == digits || value) return std::nullopt;
    value = number_of(line.substr(begin, end - begin));
    has_axis = true;
    at = end;
    skip_spaces_of_any_kind(line, at);
  }
  if (has_axis && character(line, at) == 'F') {
    const std::size_t end = decimal_end(line, at + 1);
    if (!is_digit(character(line, at + 1))) return std::nullopt;
    found.feed = number_of(line.substr(at + 1, end - at - 1));
    at = end;
    skip_spaces_of_any_kind(line, at);
  }
  return has_axis && at == line.size() ? std::optional(found) : std::nullopt;
}

}  // namespace shapegcode::siemens
