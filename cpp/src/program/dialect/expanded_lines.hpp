#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <unordered_set>
#include <vector>

#include "shapegcode/expanded_program.hpp"

namespace shapegcode::dialect {

/// Digits of a word that FANUC's reader takes (alarm 0003).
inline constexpr int max_digits = 8;

/// A number as a word of the expanded program has it: with a point and at most `max_digits` digits. A larger one throws
/// an Error without a line.
[[nodiscard]] std::string number_text(double value);

/// Words X, Y, Z of the values that are given.
[[nodiscard]] std::string axis_words(const std::array<std::optional<double>, 3>& values);

/// Collects the lines of an expanded program, each with the line of the source from which it comes.
class ExpandedLines {
 public:
  /// Begins with the line `%`.
  ExpandedLines() : program_{.text = "%\n", .lines = {1}, .notes = {}, .files = {}, .line_files = {0}} {}

  /// Add one line, without its end; `file`: 0 the source, n the n-th of the files.
  void put(std::string_view text, std::uint32_t line, std::uint32_t file = 0);

  /// Add lines of the source as they are, each with its line end.
  void put_lines(std::string_view text, std::uint32_t first_line, std::uint32_t file = 0);

  /// Tell something once: of two notes with one key (empty: the text itself) the first counts.
  void note(std::uint32_t line, std::string_view text, std::string_view key = {});

  /// The number of a further file, from 1.
  std::uint32_t add_file(std::string name);

  [[nodiscard]] const std::vector<std::string>& files() const { return program_.files; }
  [[nodiscard]] std::size_t characters() const { return program_.text.size(); }

  /// Close it with the line `%`.
  [[nodiscard]] ExpandedProgram finish(std::uint32_t last_line) &&;

 private:
  /// Blank lines, so that a line keeps its number as long as that is possible.
  void keep_number(std::uint32_t line, std::uint32_t file);

  ExpandedProgram program_;
  std::unordered_set<std::string> told_;
};

}  // namespace shapegcode::dialect
