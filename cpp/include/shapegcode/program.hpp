#pragma once

#include <array>
#include <cstdint>
#include <functional>
#include <limits>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "shapegcode/path.hpp"
#include "shapegcode/samples.hpp"

namespace shapegcode {

/// The modal state of the control between blocks, as G numbers.
struct ModalState {
  int motion = 0;                    ///< group 01: 0, 1, 2, 3
  int plane = 17;                    ///< group 02: 17, 18, 19
  int distance = 90;                 ///< group 03: 90, 91
  int feed_mode = 94;                ///< group 05: 93, 94, 95
  int units = 21;                    ///< group 06: 20, 21
  int compensation = 40;             ///< group 07: 40, 41, 42
  int length_offset = 49;            ///< group 08: 43, 44, 49
  int length_number = 0;             ///< H
  int cycle = 80;                    ///< group 09: 73 ... 89, 80
  int cycle_return = 98;             ///< group 10: 98, 99
  int coordinate_system = 54;        ///< group 14; 541 for G54.1
  int coordinate_number = 0;         ///< P of G54.1
  int exact_stop = 64;               ///< group 15: 61, 62, 63, 64
  double feed = 0.0;                 ///< F as programmed (mm or inch per minute, per revolution; 1/min); 0: none yet
  double spindle_rev_per_min = 0.0;  ///< S, 0 before the first
  Vector3 position_mm = Vector3::Zero();  ///< in the active work coordinates
  std::array<bool, axis_count> known = {false, false, false};
  /// Modal groups whose value depends on the block-skip switch (bit n = group n; bit 0 = F).
  std::uint32_t uncertain_groups = 0;
};

/// A program file that a call refers to, loaded by the caller.
struct SourceText {
  std::string name;  ///< for messages
  std::string text;
};

/// Offsets of one tool, mm; no value: not known.
struct ToolOffset {
  std::optional<double> length_mm;
  std::optional<double> length_wear_mm;
  std::optional<double> radius_mm;
  std::optional<double> radius_wear_mm;
};

/// Codes that the machine builder bound to programs (parameters 6050 ... 6089).
struct CodeBindings {
  std::map<int, std::int64_t> g_macros;       ///< G code in tenths -> program, called like G65
  std::map<int, std::int64_t> m_macros;       ///< M code -> program, called like G65
  std::map<int, std::int64_t> m_subprograms;  ///< M code -> program, called like M98
  std::int64_t tool_program = -1;             ///< T calls it with T in #149; -1: none
};

/// Limits of the work that a program may cause when read and simulated. They are checked while the text is read, and
/// reading ends at the line that exceeds one, before it is expanded further. A program without calls and loops may have
/// any length within `bytes` and `moves`; expansion has separate limits.
struct WorkLimits {
  std::uint64_t steps = 4'000'000;             ///< lines executed, not counting the first time of each
  std::uint64_t moves = 100'000'000;           ///< moves, dwells, and blocks with machine functions
  std::uint64_t bytes = 1'000'000'000;         ///< of program texts read
  std::uint64_t expansion_moves = 800'000;     ///< moves beyond one for each line of the texts
  std::uint64_t expansion_bytes = 33'554'432;  ///< of the expanded program beyond those of the texts
  double seconds = 100'000.0;                  ///< minimum time: moves within feeds and axis limits; dwells; M codes
  Vector3 feed_mm_per_s = Vector3::Constant(std::numeric_limits<double>::infinity());   ///< of each axis while cutting
  Vector3 rapid_mm_per_s = Vector3::Constant(std::numeric_limits<double>::infinity());  ///< of each axis in a rapid
  double tool_change_s = 0.0;                                                           ///< of an M06
  double m_function_s = 0.0;                                                            ///< of any other M code
};

/// Settings of the control that change the meaning of a program.
struct ReaderOptions {
  bool calculator_decimal_point = true;     ///< parameter 3401#0: X10 is 10 mm (true) or 10 least increments (false)
  bool absolute_arc_centres = false;        ///< I J K are positions, not distances from the start (not on FANUC)
  double least_increment_mm = 0.001;        ///< of metric input
  double least_increment_inch = 0.0001;     ///< of inch input
  double arc_tolerance_mm = 0.01;           ///< largest difference of start and end radius
  bool arc_without_centre_is_line = false;  ///< parameter 3403#5 = 0: G02, G03 without R, I, J, K; else alarm 0022
  std::size_t max_line_length = 250;        ///< characters
  std::array<bool, axis_count> unknown_after_tool_change = {true, true, true};
  std::vector<std::array<double, axis_count>> work_offsets_mm;          ///< G54 ... G59, empty if not known
  std::map<int, std::array<double, axis_count>> extra_work_offsets_mm;  ///< G54.1 P1 ...
  std::map<int, ToolOffset> tool_offsets;                               ///< by H and D number
  char offset_memory = 'C';                                             ///< A, B or C: see SystemVariables
  std::map<int, double> retained_variables;                             ///< #500 ... #999
  CodeBindings bindings;
  std::int64_t program = -1;        ///< O number of the program to use in a multi-program file; -1: the first
  std::int64_t program_index = -1;  ///< the same by its index in `list_programs`; -1: by number
  std::function<std::optional<SourceText>(std::int64_t)> load_program;  ///< loads programs that are not in the file
  std::array<std::int64_t, 2> opaque_programs = {9000, 9999};           ///< if not found: called, but not expanded
  int subprogram_nesting = 10;
  WorkLimits limits;
  std::array<std::optional<bool>, 9> block_skip;  ///< switch on, off, or not known, of / ... /9
  bool expand_compensation = true;                ///< G41/G42 become simple moves; false: left unchanged
  char compensation_start_up = 'A';               ///< type A or B (parameter 5003)
  double scale_unit = 0.001;                      ///< of P, I, J, K of G51 without a point (parameter 5400#7)
  double peck_clearance_mm = 0.5;                 ///< of G73 and G83 (parameters 5114, 5115)
  bool collect_alarms = false;                    ///< continue after an alarm, and store all in Program::alarms
  ModalState power_on;                            ///< state at the first block
  /// Ascending lines of the source after which the modal state is stored (Program::probed); calls count as one line.
  std::vector<std::uint32_t> probe_lines;
};

/// A message to the user about one line of the program.
struct Finding {
  std::uint32_t line = 0;
  std::string message;
  std::uint32_t column = 0;
  int alarm = 0;     ///< the control's number, 0: none
  std::string file;  ///< name of the text, empty: the program's own
};

/// Source line of a line of an expanded program.
struct LineOrigin {
  std::uint32_t line = 0;  ///< from 1
  std::uint32_t file = 0;  ///< into Program::files

  friend bool operator==(const LineOrigin&, const LineOrigin&) = default;
};

/// A block's N word or comment inside a region, and the segment that follows it.
struct RegionNote {
  std::uint32_t segment = 0;
  std::int32_t n_number = -1;        ///< -1: none
  std::uint32_t n_digits = 0;        ///< as written: N0010 has four
  std::uint32_t comment_offset = 0;  ///< into the text
  std::uint32_t comment_length = 0;
};

/// Cutting moves between two stops, which the converter may rewrite.
struct Region {
  std::uint32_t first_line = 0;  ///< from 1, first line with a cutting move
  std::uint32_t last_line = 0;   ///< last line with a cutting move
  std::size_t text_begin = 0;    ///< byte range of these lines, line ends included
  std::size_t text_end = 0;
  std::shared_ptr<const Path> path;  ///< without zero-length moves
  std::vector<RegionNote> notes;
  ModalState entry;                ///< before the first line
  ModalState exit;                 ///< after the last line
  bool incremental = false;        ///< moves an axis of unknown position: arbitrary origin, G91
  bool exact_stop_at_end = false;  ///< the last block has G09 or is in G61
  bool look_ahead_mode = false;    ///< the program has switched a look-ahead mode on before (G05.1 Q1, G08 P1)
  bool shaped = false;             ///< marked as shaped blocks in the program: (SHAPED) after its header
  bool was_rapid = false;          ///< likewise, instead of a rapid: (SHAPED RAPID)
  std::uint32_t blocks = 0;        ///< source blocks with a cutting move
};

/// A move or a wait outside of the regions, for the cycle time only.
struct OtherMove {
  Segment segment;       ///< axes of unknown position stay where they are
  double dwell_s = 0.0;  ///< a wait instead of a move when > 0
};

/// M, S and T words of one block, which may take cycle time or change the tool.
struct MachineFunction {
  std::array<int, 6> m_codes = {};
  int m_count = 0;
  std::int64_t tool = -1;             ///< T, -1 if the block has none
  double spindle_rev_per_min = -1.0;  ///< S, -1 if the block has none
  /// Axes that the block moves in rapid from or to an unknown position (after M06, G28, G30, G53).
  std::array<bool, axis_count> unknown_move = {false, false, false};
};

/// End of a rapid, or of a cutting move whose path is not known.
struct MoveEnd {
  std::uint32_t line = 0;
  Vector3 position_mm = Vector3::Zero();
  std::array<bool, axis_count> known = {false, false, false};
};

/// An executed call; the expanded program has the called blocks instead.
struct ProgramCall {
  std::uint32_t line = 0;  ///< of the expanded program, before the called blocks
  LineOrigin origin;
  std::int64_t number = -1;  ///< O number that was called
};

enum class StepKind : std::uint8_t { region, move, function };

/// One step of the program in order: a region, another move or dwell, or machine functions.
struct ProgramStep {
  StepKind kind = StepKind::move;
  std::uint32_t index = 0;  ///< into Program::regions, other_moves or functions
  std::uint32_t line = 0;
};

/// A program after reading: its exact text, its regions, and everything between them.
struct Program {
  std::string text;  ///< the original, or expanded
  /// The original contains calls, macro statements or coordinate modes: `text` is the expanded program, and line
  /// numbers of regions and steps count its lines; `origins` gives the original lines.
  bool expanded = false;
  std::string unexpanded;                     ///< the original text, if expanded
  std::vector<LineOrigin> origins;            ///< one per line of `text`; empty if not expanded
  std::vector<std::string> files;             ///< names; the first is empty: the program's own file
  std::vector<std::int64_t> program_numbers;  ///< all O numbers in the file
  std::vector<std::size_t> called;            ///< programs of the file called by others, as indices in `list_programs`
  std::vector<Finding> alarms;                ///< with ReaderOptions::collect_alarms
  std::map<int, double> expanded_radii_mm;    ///< D number -> radius, if cutter compensation was expanded
  std::uint32_t compensated_moves = 0;        ///< cutting moves under G41/G42 that were expanded
  std::uint32_t kept_compensated_moves = 0;   ///< and those left unchanged
  std::string line_end = "\n";
  std::uint32_t line_count = 0;
  std::uint32_t block_count = 0;     ///< lines with at least one word
  std::uint64_t move_count = 0;      ///< as WorkLimits::moves counts
  double least_time_s = 0.0;         ///< as WorkLimits::seconds counts
  std::size_t header_offset = 0;     ///< where a header comment may be inserted: after the O line
  std::int64_t program_number = -1;  ///< O number, -1 if none
  std::vector<std::shared_ptr<Region>> regions;
  std::vector<OtherMove> other_moves;
  std::vector<MachineFunction> functions;
  std::vector<ProgramStep> steps;  ///< all of the three in order of execution
  std::vector<MoveEnd> move_ends;  ///< in order
  std::vector<ProgramCall> calls;  ///< in order; repetitions of one call in succession once
  std::vector<Finding> warnings;
  ModalState final_state;
  std::vector<ModalState> probed;  ///< state after each of ReaderOptions::probe_lines
};

/// A program of a file, which may contain several.
struct ProgramEntry {
  std::int64_t number = -1;  ///< O number; -1: it has none
  std::string name;          ///< of a line "<NAME>" or "O<NAME>", with its brackets; empty: none
  std::string folder;        ///< of the "&F=" line before it, as written; empty: none
  std::uint32_t first_line = 1;
  std::size_t text_begin = 0;  ///< bytes: its lines, including those of its folder and before its O line
  std::size_t text_end = 0;
};

/// The programs of a text in order. Throws Error(program) if its '%' lines or its O numbers cannot be read.
[[nodiscard]] std::vector<ProgramEntry> list_programs(const std::string& text);

/// Reads a program text into regions of canonical moves (FANUC milling dialect; docs/reference/dialect.md lists the
/// words read, passed through and refused). Pure function of its arguments. Throws Error(program) with line and column.
[[nodiscard]] Program read_program(std::string text, const ReaderOptions& options = {});

/// Relates a program to `source`, a text in another control's dialect from which it was translated. `lines` has for
/// each line of the program's original text the line of the source, and its file: 0 the source itself, n the n-th of
/// `files`. Findings and origins then name lines of the source; `notes` about lines of the source are added to the
/// warnings. Throws Error(argument) if lines or files are missing.
void lead_back(Program& program, std::string source, const std::vector<LineOrigin>& lines,
               const std::vector<std::string>& files, std::vector<Finding> notes);

}  // namespace shapegcode
