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

/// What a SINUMERIK program does not say of itself.
struct SiemensOptions {
  std::string file;  ///< name of the program's file, as errors name it
  std::string name;  ///< of a program without a head %_N_NAME_MPF, in capitals
  double least_increment_mm = 0.001;
  double arc_radius_tolerance_mm = 0.01;
  std::int64_t max_program_steps = 1'000'000;    ///< blocks that are executed, beside those of the text
  std::int64_t max_expansion_moves = 1'000'000;  ///< moves, likewise
  std::optional<bool> block_skip;                ///< whether `/` blocks are skipped; none: not known, they are refused
  std::string tool_change_unknown_axes;          ///< axes of "XYZ" whose position is not known behind M6
  std::map<std::string, std::array<double, 3>, std::less<>> work_offsets;  ///< by name ("G54", "G54.1P5"), mm
  /// Words, and addresses of values, that are left out, each with what is told of it (empty: nothing).
  std::unordered_map<std::string, std::string> left_out, left_out_addresses;
  /// Why a word is refused; empty: no reason is known.
  std::function<std::string(const std::string& word)> refused;
  /// A program that is called, by its name in capitals, its text UTF-8; none: there is no such program.
  std::function<std::optional<SourceText>(const std::string& name)> called;
};

struct SiemensProgram {
  ExpandedProgram expanded;
  /// Words that stand for others of the source, for who writes for that control again: {"T901", "T=\"MILL\""}.
  std::vector<std::pair<std::string, std::string>> names;
};

/// Executes a SINUMERIK program in DIN words, UTF-8, as the control would. Throws Error(program) with file, line and
/// column.
[[nodiscard]] SiemensProgram read_siemens(std::string_view text, const SiemensOptions& options);

}  // namespace shapegcode
