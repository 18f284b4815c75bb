// Private: the reading of plain blocks. Its functions are spread over four files: lines and regions
// (interpreter.cpp), codes that change the modal state (interpreter_codes.cpp), offsets (interpreter_offsets.cpp), and
// moves (interpreter_moves.cpp).
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <map>
#include <memory>
#include <optional>
#include <set>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "program/interpret/canned_cycle.hpp"
#include "program/interpret/input_rules.hpp"
#include "program/interpret/offsets.hpp"
#include "program/interpret/work_count.hpp"
#include "program/text/parsed_block.hpp"
#include "shapegcode/program.hpp"

namespace shapegcode::detail {

inline constexpr std::uint32_t axis_letters = letter_mask("XYZ");
inline constexpr std::uint32_t centre_letters = letter_mask("IJK");
// What makes a block of a drilling cycle drill; one without these stores neither Q nor P and moves nothing.
inline constexpr std::uint32_t hole_letters = letter_mask("XYZR");
inline constexpr std::uint32_t other_axis_letters = letter_mask("ABCUVW");
// What a block of a region may carry beside G codes; any other word makes it a stop.
inline constexpr std::uint32_t region_letters = letter_mask("XYZIJKRFN");

inline constexpr std::uint32_t feed_bit = 1U;
inline std::uint32_t bit(Group group) noexcept { return 1U << static_cast<unsigned>(group); }

inline int plane_normal(int plane) noexcept { return plane == 17 ? 2 : plane == 18 ? 1 : 0; }

/// Reads a plain program line by line into regions, moves and functions. Plain: no calls, macro statements or
/// coordinate modes; those are expanded by the Reader before.
class Interpreter {
 public:
  Interpreter(Program& program, const ReaderOptions& options)
      : options_(options), program_(program), state_(options.power_on), offsets_(options), work_(options.limits) {}

  /// Throws where words could only be arguments of a macro call.
  void require_plain_words(const BlockWords& words, std::uint32_t line) const;
  /// Executes a block, whose text stands at [begin, end) of the program's text.
  void execute(const ParsedBlock& block, std::uint32_t line, const LineOrigin& origin, std::size_t begin,
               std::size_t end);
  /// Ends an open region: the next line is not part of it.
  void close_region();
  void warn(const std::string& message) { warn_at(origin_, message); }
  /// Each line once, however often it is executed; of one message only the first ones, and how many more there are.
  void warn_at(const LineOrigin& origin, const std::string& message);
  /// After something whose effect is not known.
  void forget_all() noexcept { state_.known = {false, false, false}; }
  /// How the program ended.
  void finish();

  /// A work offset set by the program: one that is in force shifts the position.
  void set_work_offset(int coordinate_system, int number, int axis, double value_mm, bool incremental = false);

  /// Lines of a text that is read, see WorkCount.
  void add_lines(std::uint64_t lines) noexcept { work_.add_lines(lines); }

  [[nodiscard]] const ModalState& state() const noexcept { return state_; }
  [[nodiscard]] bool ended() const noexcept { return ended_; }
  void end() noexcept { ended_ = true; }
  [[nodiscard]] Offsets& offsets() noexcept { return offsets_; }
  [[nodiscard]] double length_mm(const Word& word) const noexcept;

 private:
  struct LineFlow {
    bool stop = false;    ///< ends a region, text kept
    bool motion = false;  ///< the block moves axes
  };

  [[nodiscard]] const BlockWords& words() const noexcept { return block_->sorted(); }
  void optional_skip_block(const ModalState& before);
  void read_codes(LineFlow& flow);
  void read_code(int g_tenths, Group group, std::uint32_t column, LineFlow& flow);
  [[nodiscard]] int* modal_field(Group group) noexcept;
  void compensation_code(int whole) noexcept;
  void cycle_code(int whole);
  void coordinate_code(int g_tenths, LineFlow& flow);
  void reference_code(int g_tenths);
  void refuse_in_cycle(int g_tenths) const;
  void one_shot(int g_tenths, LineFlow& flow);
  void dwell();
  void data_setting();
  void data_work_offset(int coordinate_system, int number);
  void set_tool_offset(int kind);
  void m_codes(LineFlow& flow);
  void length_offset(int whole);
  void rapid();
  [[nodiscard]] std::string unit_example();
  void move(LineFlow& flow, const ModalState& before, std::size_t begin, std::size_t end);
  void cut(const char* why_kept, const ModalState& before, std::size_t begin, std::size_t end);
  void keep_cut(const char* why, const Vector3& end, const std::array<bool, 3>& known_after);
  void forget_uncertain_end() noexcept;
  void check_range() const;
  void cycle_block();
  void read_cycle_words(int axis);
  [[nodiscard]] int cycle_repeats() const;
  void require_cycle_data() const;
  void require_room_for_holes(int holes);
  void drill_hole(int axis, double feed_mm_per_s);
  void foreign_switch(int g_tenths);
  void look_ahead_switch(int g_tenths);
  void change_coordinates(int number, int extra);
  void add_move(const OtherMove& move);
  /// Ends the reading where a limit is passed.
  void require_room(const std::optional<std::string>& passed);
  void add_step(StepKind kind, std::size_t index);
  void note(std::size_t segment);
  void tell_further_warnings();
  void read_header_comments();
  void warn_once(std::uint32_t& seen, const std::string& message);
  [[noreturn]] void fail(const std::string& message, std::uint32_t column = 0) const;
  [[noreturn]] void alarm(int number, const std::string& message, std::uint32_t column = 0) const;

  [[nodiscard]] double feed_mm_per_s(double move_length_mm) const;
  [[nodiscard]] bool target(Vector3& end, std::array<bool, 3>& known_after, bool& relative) const noexcept;
  [[nodiscard]] Segment cutting_segment(const Vector3& end) const;
  void forget_axes(std::uint32_t letters) noexcept;
  /// Notes a rapid of the axes that are named whose start or end is not known, for the cycle time;
  /// `from_unknown`: only of those whose position is not known now.
  void unknown_move(std::uint32_t letters, bool from_unknown);

  const ReaderOptions& options_;
  Program& program_;
  std::size_t steps_before_block_ = 0;
  ModalState state_;
  Offsets offsets_;
  const ParsedBlock* block_ = nullptr;  ///< the one that is executed
  std::size_t begin_ = 0;               ///< where it stands in the program's text
  std::uint32_t line_number_ = 0;
  LineOrigin origin_;
  std::shared_ptr<Region> region_;
  PathBuilder segments_;  ///< of the open region
  std::size_t notes_kept_ = 0;
  std::uint32_t foreign_ = 0;  ///< modes passed through untouched that are on
  bool explicit_exact_stop_ = false;
  bool one_shot_axes_ = false;  ///< axis words belong to a one-shot code
  bool distance_given_ = false;
  bool units_given_ = false;
  bool ended_ = false;
  bool emitted_ = false;      ///< the header comment of a shaped program was seen
  bool shaped_next_ = false;  ///< what is cut next is shaped blocks
  bool rapid_next_ = false;   ///< likewise, in place of a rapid
  bool look_ahead_ = false;   ///< a look-ahead mode was switched on by the program
  Vector3 local_offset_ = Vector3::Zero();
  std::array<bool, axis_count> local_offset_uncertain_ = {false, false, false};  ///< set in a '/' block
  CannedCycle cycle_;
  struct Warned {
    std::set<std::pair<std::uint32_t, std::uint32_t>> lines;  ///< file and number
    std::uint64_t further = 0;
    LineOrigin last;
  };
  std::map<std::string, Warned> warned_;
  WorkCount work_;  ///< of the program so far
  std::uint32_t seen_no_point_ = 0;
  std::uint32_t seen_distance_ = 0;
  std::uint32_t seen_units_ = 0;
  std::uint32_t seen_cycle_point_ = 0;
  std::uint32_t seen_cycle_level_ = 0;
  std::uint32_t seen_cycle_depth_ = 0;
  std::uint32_t kept_run_line_ = 0;
};

}  // namespace shapegcode::detail
