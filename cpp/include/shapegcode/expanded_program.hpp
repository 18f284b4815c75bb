#pragma once

#include <cstdint>
#include <string>
#include <vector>

namespace shapegcode {

/// A note about a line of a program for another control.
struct SourceNote {
  std::uint32_t line = 0;  ///< of the source, from 1
  std::string text;        ///< one sentence, with both meanings of a word that has another one on FANUC
};

/// A program for another control, translated into FANUC's words: loops, calls and expressions are executed, numbers
/// have a decimal point where their unit depends on it, I J K are distances from the start, dwells are G04 X in
/// seconds. It begins and ends with a line `%`.
struct ExpandedProgram {
  std::string text;
  std::vector<std::uint32_t> lines;  ///< for each line of the text, from 0, the line of the source, from 1
  std::vector<SourceNote> notes;     ///< ascending by line
  std::vector<std::string> files;    ///< names of other files whose lines are in it (subprograms)
  /// For each line of the text its file: 0 the source, n the n-th of `files`; empty: all of the source.
  std::vector<std::uint32_t> line_files;
};

}  // namespace shapegcode
