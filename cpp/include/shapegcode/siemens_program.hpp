#pragma once

#include <array>
#include <cstdint>
#include <functional>
#include <map>
#include <optional>
#include <string>
#include <string_view>
#include <unordered_map>
#include <utility>
#include <vector>

#include "shapegcode/expanded_program.hpp"
#include "shapegcode/program.hpp"

namespace shapegcode {

/// Settings for reading a SINUMERIK program.
struct SiemensOptions {
  std::string file;  ///< name of the program's file in messages
  std::string name;  ///< of a program without a header %_N_NAME_MPF, in capitals
  double least_increment_mm = 0.001;
  double arc_radius_tolerance_mm = 0.01;
  std::int64_t max_program_steps = 1'000'000;    ///< maximum number of blocks executed beyond one for each line
  std::int64_t max_expansion_moves = 1'000'000;  ///< maximum number of moves, likewise
  std::optional<bool> block_skip;                ///< whether `/` blocks are skipped; none: not known, they are refused
  std::string tool_change_unknown_axes;          ///< axes of "XYZ" whose position is not known after M6
  std::map<std::string, std::array<double, 3>, std::less<>> work_offsets;  ///< by name ("G54", "G54.1P5"), mm
  /// Words, and addresses of values, that are left out, each with the note about it (empty: none).
  std::unordered_map<std::string, std::string> left_out, left_out_addresses;
  /// Returns why a word is refused; empty: no reason is known.
  std::function<std::string(const std::string& word)> refused;
  /// Returns a called program by its name in capitals, with its text in UTF-8; none: there is no such program.
  std::function<std::optional<SourceText>(const std::string& name)> called;
};

struct SiemensProgram {
  ExpandedProgram expanded;
  /// Words that replace words of the source, to write the program for that control again: {"T901", "T=\"MILL\""}.
  std::vector<std::pair<std::string, std::string>> names;
};

/// Executes a SINUMERIK program in DIN words, UTF-8, as the control would. Throws Error(program) with file, line and
/// column.
[[nodiscard]] SiemensProgram read_siemens(std::string_view text, const SiemensOptions& options);

}  // namespace shapegcode
