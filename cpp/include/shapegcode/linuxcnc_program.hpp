#pragma once

#include <array>
#include <cstdint>
#include <functional>
#include <map>
#include <optional>
#include <string>
#include <string_view>

#include "shapegcode/expanded_program.hpp"
#include "shapegcode/program.hpp"

namespace shapegcode {

/// A row of LinuxCNC's tool table.
struct LinuxcncTool {
  std::array<double, 3> offset_mm{};  ///< X, Y, Z
  double diameter_mm = 0.0;           ///< 0: none is given
};

/// The tools by number.
struct LinuxcncToolTable {
  std::map<std::int64_t, LinuxcncTool> tools;
  std::string file;  ///< its name in messages
  std::string unit = "mm";
  double unit_mm = 1.0;
};

/// Settings of the machine for reading a LinuxCNC program.
struct LinuxcncOptions {
  std::string file;         ///< name of the program in messages
  std::string first_codes;  ///< put before the program: LinuxCNC's initial modes where the machine's differ
  bool inch = false;        ///< unit in force at the first line
  int work_offset = 1;      ///< in force at the first line, 1 ... 9: G54 ... G59.3
  std::map<int, std::array<double, 3>> work_offsets_mm;
  std::optional<LinuxcncToolTable> tool_table;
  std::map<std::int64_t, double> tool_length_mm;  ///< by H number; they override the table
  double machine_unit_mm = 1.0;                   ///< length of the machine's own unit
  bool adds_points = false;                       ///< whole numbers need a decimal point in the expanded program
  std::optional<bool> block_skip;                 ///< whether `/` lines are skipped; none: not known, they are executed
  std::uint64_t max_steps = 4'000'000;            ///< maximum number of lines executed beyond one for each line
  std::uint64_t max_expansion_bytes = 400'000'000;
  /// Name and text of the file of a subroutine, by the name that the call gives; none: there is no such file.
  std::function<std::optional<SourceText>(const std::string& name)> find_subroutine;
};

/// P and Q of G64, mm; none: the word is left out.
struct LinuxcncPathTolerance {
  std::optional<double> p_mm;
  std::optional<double> q_mm;

  bool operator==(const LinuxcncPathTolerance&) const = default;
};

struct LinuxcncProgram {
  ExpandedProgram expanded;
  std::optional<LinuxcncPathTolerance> path_tolerance;  ///< common to all its G64; none: there are several, or no G64
};

/// Distance to which a peck of G73 and G83 returns.
inline constexpr double linuxcnc_peck_clearance_mm = 0.254;

/// Executes a LinuxCNC program as its interpreter does, and writes what it executes in FANUC's words. Bytes of the text
/// above 127 are characters of Latin-1. Words that are not supported throw Error(program) with file (empty: the
/// program itself), line and column; the supported ones: docs/reference/input_dialects.md.
[[nodiscard]] LinuxcncProgram read_linuxcnc(std::string_view text, const LinuxcncOptions& options);

}  // namespace shapegcode
