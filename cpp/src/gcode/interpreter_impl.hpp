// Private to gcode: the state of one reading of a program text. Its functions are spread over three files: the frame of
// the text and its lines (interpreter.cpp), codes that change the modal state (interpreter_codes.cpp), and moves
// (interpreter_moves.cpp).
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "block_words.hpp"
#include "shapegcode/gcode/canned_cycle.hpp"
#include "shapegcode/gcode/lexer.hpp"
#include "shapegcode/gcode/program.hpp"

namespace shapegcode::detail {

inline constexpr double mm_per_inch = 25.4;
inline constexpr std::uint32_t axis_letters = letter_mask("XYZ");
inline constexpr std::uint32_t centre_letters = letter_mask("IJK");
inline constexpr std::uint32_t other_axis_letters = letter_mask("ABCUVW");
// What a block of a region may carry beside G codes; any other word makes it a stop.
inline constexpr std::uint32_t region_letters = letter_mask("XYZIJKRFN");

inline constexpr std::uint32_t feed_bit = 1U;
inline std::uint32_t bit(Group group) noexcept { return 1U << static_cast<unsigned>(group); }

inline int plane_normal(int plane) noexcept { return plane == 17 ? 2 : plane == 18 ? 1 : 0; }

class Interpreter {
 public:
  Interpreter(std::string text, const ReaderOptions& options) : options_(options) {
    program_.text = std::move(text);
    state_ = options.power_on;
  }

  Program run();

 private:
  struct LineFlow {
    bool stop = false;    ///< ends a region, text kept
    bool motion = false;  ///< the block moves axes
  };

  void frame();
  void line(std::string_view text, std::size_t begin, std::size_t end);
  void optional_skip_block(const ModalState& before);
  void read_codes(LineFlow& flow);
  void one_shot(int g_tenths, LineFlow& flow);
  void m_codes(LineFlow& flow);
  void move(LineFlow& flow, const ModalState& before, std::size_t begin, std::size_t end);
  void cut(const char* why_kept, const ModalState& before, std::size_t begin, std::size_t end);
  void forget_uncertain_end() noexcept;
  void check_range() const;
  void cycle_block();
  void foreign_switch(int g_tenths);
  void look_ahead_switch(int g_tenths);
  void change_coordinates(int number);
  void close_region();
  void add_move(const OtherMove& move);
  void add_step(StepKind kind, std::size_t index);
  void note(std::size_t segment);
  void warn(const std::string& message);
  void warn_once(std::uint32_t& seen, const std::string& message);
  [[noreturn]] void fail(const std::string& message, std::uint32_t column = 0) const;

  [[nodiscard]] double length_mm(const Word& word) const noexcept;
  [[nodiscard]] double feed_mm_per_s(double move_length_mm) const;
  [[nodiscard]] bool target(Vector3& end, std::array<bool, 3>& known_after, bool& relative) const noexcept;
  [[nodiscard]] Segment cutting_segment(const Vector3& end) const;
  void forget_axes(std::uint32_t letters) noexcept;
  void forget_all() noexcept { state_.known = {false, false, false}; }

  const ReaderOptions& options_;
  Program program_;
  ModalState state_;
  Block block_;
  BlockWords words_;
  std::uint32_t line_number_ = 0;
  std::size_t body_begin_ = 0;
  std::size_t body_end_ = 0;
  std::uint32_t first_body_line_ = 1;
  std::shared_ptr<Region> region_;
  std::vector<Segment> segments_;  ///< of the open region
  std::size_t notes_kept_ = 0;
  std::uint32_t foreign_ = 0;    ///< modes passed through untouched that are on
  bool corner_pending_ = false;  ///< the block before carried ,R or ,C
  bool explicit_exact_stop_ = false;
  bool one_shot_axes_ = false;  ///< axis words belong to a one-shot code
  bool distance_given_ = false;
  bool ended_ = false;
  bool look_ahead_ = false;  ///< a look-ahead mode was switched on by the program
  bool framed_ = false;      ///< has its '%' lines
  Vector3 local_offset_ = Vector3::Zero();
  std::array<bool, axis_count> local_offset_uncertain_ = {false, false, false};  ///< set in a '/' block
  CannedCycle cycle_;
  double cycle_r_ = 0.0;
  double cycle_z_ = 0.0;
  std::uint32_t seen_no_point_ = 0;
  std::uint32_t seen_distance_ = 0;
  std::uint32_t kept_run_line_ = 0;
};

}  // namespace shapegcode::detail
