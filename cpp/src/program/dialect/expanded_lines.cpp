#include "program/dialect/expanded_lines.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <utility>

#include "shapegcode/error.hpp"

namespace shapegcode::dialect {

std::string number_text(double value) {
  const double size = std::abs(value);
  if (!(size < 1e8)) {
    throw Error(ErrorKind::program, fmt::format("{:g} has more than {} digits before its point", value, max_digits));
  }
  int decimals = max_digits;
  for (double bound = 1.0; size >= bound; bound *= 10.0) --decimals;
  std::string text = fmt::format("{:#.{}f}", value, decimals);
  text.erase(text.find_last_not_of('0') + 1);
  return text == "-0." ? "0." : text;
}

std::string axis_words(const std::array<std::optional<double>, 3>& values) {
  std::string words;
  for (std::size_t axis = 0; axis < 3; ++axis) {
    if (values[axis]) words += "XYZ"[axis] + number_text(*values[axis]);
  }
  return words;
}

void ExpandedLines::keep_number(std::uint32_t line, std::uint32_t file) {
  if (file != 0) return;
  while (program_.lines.size() + 1 < line) {
    program_.lines.push_back(static_cast<std::uint32_t>(program_.lines.size()) + 1);
    program_.line_files.push_back(0);
    program_.text += '\n';
  }
}

void ExpandedLines::put(std::string_view text, std::uint32_t line, std::uint32_t file) {
  keep_number(line, file);
  program_.text += text;
  program_.text += '\n';
  program_.lines.push_back(line);
  program_.line_files.push_back(file);
}

void ExpandedLines::put_lines(std::string_view text, std::uint32_t first_line, std::uint32_t file) {
  keep_number(first_line, file);
  program_.text += text;
  const auto count = static_cast<std::uint32_t>(std::ranges::count(text, '\n'));
  for (std::uint32_t line = first_line; line < first_line + count; ++line) program_.lines.push_back(line);
  program_.line_files.insert(program_.line_files.end(), count, file);
}

void ExpandedLines::note(std::uint32_t line, std::string_view text, std::string_view key) {
  if (told_.emplace(key.empty() ? text : key).second) program_.notes.push_back({line, std::string(text)});
}

std::uint32_t ExpandedLines::add_file(std::string name) {
  program_.files.push_back(std::move(name));
  return static_cast<std::uint32_t>(program_.files.size());
}

ExpandedProgram ExpandedLines::finish(std::uint32_t last_line) && {
  put("%", last_line);
  std::ranges::stable_sort(program_.notes, {}, &SourceNote::line);
  if (program_.files.empty()) program_.line_files.clear();
  return std::move(program_);
}

}  // namespace shapegcode::dialect
