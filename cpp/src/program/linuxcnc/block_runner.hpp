// Private: one block of a LinuxCNC program in FANUC's words, in the order in which LinuxCNC executes its words.
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "program/dialect/expanded_lines.hpp"
#include "program/dialect/path_element.hpp"
#include "program/linuxcnc/codes.hpp"
#include "program/linuxcnc/interpreter_state.hpp"
#include "program/linuxcnc/offset_codes.hpp"
#include "program/linuxcnc/word_values.hpp"

namespace shapegcode::linuxcnc {

/// The line that is executed.
struct Place {
  std::uint32_t line = 1;
  std::uint32_t file = 0;
  std::string number;  ///< N word that the next block takes
};

/// How long the expanded program may become.
struct Room {
  std::uint64_t program_bytes = 0;  ///< of the program that is read
  std::uint64_t max_expansion_bytes = 0;
};

/// Executes blocks and writes the lines that they become.
class BlockRunner {
 public:
  BlockRunner(State& state, dialect::ExpandedLines& lines, const Room& room);
  BlockRunner(const BlockRunner&) = delete;
  BlockRunner& operator=(const BlockRunner&) = delete;

  Place place;
  bool ended = false;

  /// Write one line; the first block of a line of the source takes its N word.
  void put(const std::string& text);
  /// Add a note, if it is not there yet.
  void note(const std::string& text, std::string_view key);
  void run(BlockWords& block, const std::vector<std::string>& comments);
  /// Lines that are taken as they are come next: G90 or G91, F and the G code of motion are in force in the expanded
  /// program too.
  void lead_in(bool begins_with_g);
  /// Behind such lines: the expanded program's modes are those of the state.
  void follow_modes() noexcept;
  /// Modes of M72: what differs is written.
  void restore(const Modes& saved);
  /// The one P and Q of all G64.
  [[nodiscard]] std::optional<LinuxcncPathTolerance> path_tolerance() const;
  void require_room() const;

 private:
  void sync();
  /// G90 or G91, where the expanded program has the other one; it has this from then on.
  std::string distance_word(int code);
  /// F of the mode in force, which the expanded program has from then on.
  std::string written_f();
  void flush(std::string& codes);

  // What comes before the move.
  void run_feed(const GroupCodes& codes, const WordValues& values);
  void run_tool(const BlockWords& block);
  void run_spindle_and_functions(const BlockWords& block);
  void run_dwell(const WordValues& values);
  void run_stops(const BlockWords& block);
  /// Codes that change a mode; those that may stand in the block of a move.
  std::string run_modal_codes(const GroupCodes& codes, const WordValues& values);
  std::string set_unit(int code, const WordValues& values);
  std::string set_path_mode(int code, const WordValues& values);
  void add_tolerance(const LinuxcncPathTolerance& tolerance);

  // The move.
  void run_axes(const GroupCodes& codes, WordValues values, std::string pending);
  void run_motion(const GroupCodes& codes, const WordValues& values, std::string& pending);
  void run_cycle(WordValues values, bool is_first);
  void run_move(const WordValues& words, std::string& codes, bool is_machine);
  std::string feed_word(const WordValues& values);
  /// Polar words @ and ^ as X and Y.
  [[nodiscard]] WordValues cartesian(const WordValues& values) const;

  struct Arc {
    dialect::PlaneAxes axes;
    Triple start;
    bool is_incremental = false;
    double turns = 1.0;
    dialect::Complex from;
    dialect::Complex to;
    dialect::Complex centre;
    int turn = 1;
    double total_rad = 0.0;
  };

  /// An arc and its F: one block, and one more for each further full turn.
  void run_arc(const std::string& head, const WordValues& values, const Triple& start, bool is_incremental);
  void find_centre(Arc& arc, const WordValues& values) const;
  void put_arc(const Arc& arc, const std::string& head, const WordValues& values);
  /// F of an arc: in G93 LinuxCNC's counts the whole block, FANUC's the radius.
  std::string arc_feed(const Arc& arc, const WordValues& values);

  State& state_;
  dialect::ExpandedLines& lines_;
  Room room_;
  OffsetCodes offsets_;
  int written_distance_ = 900;         ///< what the expanded program's reader takes for granted
  std::optional<int> written_motion_;  ///< none: what is in force there is not followed
  double written_feed_ = 0.0;
  std::optional<LinuxcncPathTolerance> tolerance_;  ///< of the first G64
  bool has_other_tolerances_ = false;
};

}  // namespace shapegcode::linuxcnc
