#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "shapegcode/gcode/modal_state.hpp"
#include "shapegcode/path/path.hpp"

namespace shapegcode {

/// How a program text is to be read: the controller's settings that change its meaning.
struct ReaderOptions {
  bool calculator_decimal_point = true;  ///< parameter 3401#0: X10 is 10 mm (true) or 10 least increments (false)
  bool absolute_arc_centres = false;     ///< I J K are positions, not distances from the start (not FANUC)
  double least_increment_mm = 0.001;     ///< of metric input
  double least_increment_inch = 0.0001;  ///< of inch input
  double arc_tolerance_mm = 0.01;        ///< largest difference of start and end radius
  std::size_t max_line_length = 250;     ///< characters
  std::array<bool, axis_count> unknown_after_tool_change = {true, true, true};
  std::vector<std::array<double, axis_count>> work_offsets_mm;  ///< G54 ... G59, empty if not known
  ModalState power_on;                                          ///< state at the first block
  std::vector<std::uint32_t> probe_lines;  ///< ascending lines behind which the modal state is kept (Program::probed)
};

/// Something to tell the user about one place of the text.
struct Finding {
  std::uint32_t line = 0;
  std::string message;
};

/// A block's N word or comment inside a region, and the segment before which it stood.
struct RegionNote {
  std::uint32_t segment = 0;
  std::int32_t n_number = -1;        ///< -1: none
  std::uint32_t comment_offset = 0;  ///< into the text
  std::uint32_t comment_length = 0;
};

/// A run of cutting moves between two stops: what the converter may rewrite.
struct Region {
  std::uint32_t first_line = 0;  ///< from 1, first line with a cutting move
  std::uint32_t last_line = 0;   ///< last line with a cutting move
  std::size_t text_begin = 0;    ///< byte range of these lines, line ends included
  std::size_t text_end = 0;
  std::shared_ptr<const Path> path;  ///< zero-length moves left out
  std::vector<RegionNote> notes;
  ModalState entry;                ///< before the first line
  ModalState exit;                 ///< after the last line
  bool incremental = false;        ///< moves an axis whose position is not known: origin arbitrary, G91
  bool exact_stop_at_end = false;  ///< the last block carried G09 or stood in G61
  bool look_ahead_mode = false;    ///< the program switched a look-ahead mode on before it (G05.1 Q1, G08 P1)
  std::uint32_t blocks = 0;        ///< source blocks with a cutting move
};

/// A move or a wait outside of the regions, for the clock only.
struct OtherMove {
  Segment segment;       ///< axes of unknown position stay where they are
  double dwell_s = 0.0;  ///< a wait instead of a move when > 0
};

/// M, S and T words of one block: what the clock may charge for, and which tool is in use.
struct MachineFunction {
  std::array<int, 6> m_codes = {};
  int m_count = 0;
  std::int64_t tool = -1;             ///< T, -1 if the block has none
  double spindle_rev_per_min = -1.0;  ///< S, -1 if the block has none
};

enum class StepKind : std::uint8_t { region, move, function };

/// What the machine does, in order: a region, another move or dwell, or machine functions.
struct ProgramStep {
  StepKind kind = StepKind::move;
  std::uint32_t index = 0;  ///< into Program::regions, other_moves or functions
  std::uint32_t line = 0;
};

/// A program read: the text to the letter, its regions, and everything between them.
struct Program {
  std::string text;
  std::string line_end = "\n";
  std::uint32_t line_count = 0;
  std::uint32_t block_count = 0;     ///< lines with at least one word
  std::size_t header_offset = 0;     ///< where a header comment may be inserted: behind the O line
  std::int64_t program_number = -1;  ///< O number, -1 if none
  std::vector<std::shared_ptr<Region>> regions;
  std::vector<OtherMove> other_moves;
  std::vector<MachineFunction> functions;
  std::vector<ProgramStep> steps;  ///< all of the three in the order in which they happen
  std::vector<Finding> warnings;
  ModalState final_state;
  std::vector<ModalState> probed;  ///< state behind each of ReaderOptions::probe_lines
};

}  // namespace shapegcode
