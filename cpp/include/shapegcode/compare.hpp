#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

#include "shapegcode/program.hpp"

namespace shapegcode {

/// Kinds of program contents that are compared; also the kind of a difference.
enum class ComparedKind : std::uint8_t {
  cuts,           ///< sequences of cutting moves without interruption
  rapids,         ///< G00, and moves in machine coordinates: G28, G30, G53
  tools,          ///< T, M06
  spindle,        ///< S, M03, M04, M05, M19
  coolant,        ///< M07, M08, M09
  offsets,        ///< G43, G44, G49, H, G54 ... G59, G54.1, G10, G52, G92, G40, G41, G42, D
  cycles,         ///< blocks of a drilling cycle
  calls,          ///< M98, M198, G65, and codes bound to programs
  functions,      ///< other M codes, other G codes of the control, moves of further axes, macro statements
  dwells,         ///< G04
  stops,          ///< M00, M01, M02, M30, M99
  modal,          ///< modal state at the start of a cut, exact stops in it
  feeds,          ///< of a cut or a drilling cycle
  blocks,         ///< how many blocks a cut has
  path,           ///< distance of the paths of a cut
  order,          ///< the same contents in another order
  shaped_rapids,  ///< cutting moves, marked as such, instead of a rapid
  emission,       ///< lines around shaped cuts that the machine file requests
  units,          ///< G20 or G21
  end,            ///< one program ends early
};
inline constexpr std::size_t compared_kinds = 20;

struct ComparisonOptions {
  ReaderOptions reader;                     ///< with which both programs were read
  std::vector<std::string> emission_lines;  ///< capitals without blanks
  double joint_path_mm = 0.0;  ///< cuts are also the same if their paths, followed in parallel, are within it
};

/// One difference. Lines are those of the sources; 0: the program has nothing there.
struct ProgramDifference {
  ComparedKind kind = ComparedKind::cuts;
  std::uint32_t original_line = 0;
  std::uint32_t emitted_line = 0;
  std::string original;  ///< its contents, with the file if they are in a called one; empty: none
  std::string emitted;
  double distance_mm = 0.0;  ///< of paths
};

struct KindCount {
  std::size_t original = 0;
  std::size_t emitted = 0;
  std::size_t unchanged = 0;
};

struct ProgramComparison {
  std::array<KindCount, compared_kinds> counts;
  double path_mm = 0.0;  ///< largest distance between the paths of a cut in both programs, in either direction
  std::vector<ProgramDifference> differences;
};

/// Compares two programs by their words and canonical moves; both are aligned by their effects, not by their lines. For
/// a cut in both programs the paths are followed along each other, and the largest distance of each from the other
/// counts.
[[nodiscard]] ProgramComparison compare_programs(const Program& original, const Program& emitted,
                                                 const ComparisonOptions& options);

}  // namespace shapegcode
