// Private: blocks under coordinate modes (G16, G51, G51.1, G68), corner words and cutter compensation, written as
// simple blocks.
#pragma once

#include <functional>
#include <string>
#include <string_view>
#include <vector>

#include "program/interpret/interpreter_impl.hpp"
#include "program/rewrite/coordinate_modes.hpp"
#include "program/rewrite/corner_words.hpp"

namespace shapegcode::detail {

class MoveRewriter {
 public:
  /// `put` takes a plain line and the line it comes from, and lets the interpreter read it.
  using Put = std::function<void(std::string_view, const LineOrigin&)>;

  MoveRewriter(const ReaderOptions& options, Program& program, Interpreter& interpreter, Put put)
      : options_(options), program_(program), interpreter_(interpreter), put_(std::move(put)) {}

  /// Whether a block has to go through here: a mode is on, or the block switches one on.
  [[nodiscard]] bool wants(const BlockWords& words) const noexcept;
  /// Writes the block, now or as soon as the blocks behind it allow.
  void block(const ParsedBlock& block, const LineOrigin& origin);
  /// Takes note of a block that did not have to go through here: it may name the offset of a G41 to come.
  void pass(const BlockWords& words) noexcept {
    d_number_ = words.has('D') ? static_cast<int>(words['D'].value) : d_number_;
  }
  /// Writes a comment at its position among the blocks that wait.
  void comment(std::string_view text, const LineOrigin& origin);
  /// Writes all that waits: before anything that is more than a block.
  void flush();

  /// The modal state and position as programmed: ahead of the interpreter's while blocks wait.
  [[nodiscard]] const ModalState& programmed() const noexcept { return idle() ? interpreter_.state() : programmed_; }
  /// 40, 41 or 42, expanded or left to the control.
  [[nodiscard]] int compensation() const noexcept {
    return compensation_ != 40 ? compensation_ : programmed().compensation;
  }
  [[nodiscard]] int radius_number() const noexcept { return d_number_; }
  [[nodiscard]] const CoordinateModes& modes() const noexcept { return modes_; }
  [[nodiscard]] bool polar() const noexcept { return polar_; }

 private:
  struct Item {
    std::string head;  ///< N and G words that stay
    std::string tail;  ///< all other words that stay, and comments
    LineOrigin origin;
    Segment segment;  ///< of a move, in work coordinates
    bool move = false;
    bool cycle = false;  ///< a drilling cycle: `level` words beside the hole's position
    std::string levels;  ///< its Z and R words
    std::array<bool, axis_count> axes = {false, false, false};  ///< that are written even if they do not change
    Vector3 increment_mm = Vector3::Zero();                     ///< of a cycle in G91
    int distance = 90;
    int units = 21;
    int compensation = 40;
    double radius_mm = 0.0;
  };

  [[nodiscard]] bool idle() const noexcept { return waiting_.empty(); }
  void synchronise();
  void read_codes(const BlockWords& words);
  void set_plane(int plane, std::uint32_t column);
  void set_rotation(int g_tenths);
  void set_scaling(int g_tenths);
  void set_mirror(int g_tenths);
  void set_compensation(int code);
  [[nodiscard]] bool drops(const Word& word, int g_tenths) const noexcept;
  void keep_words(Item& item) const;
  void read_move(Item& item);
  void read_cycle(Item& item, bool data_only);
  void drill_holes(Item item);
  void read_target(Item& item, Vector3& end);
  void check_known(bool from_polar) const;
  [[nodiscard]] Segment programmed_segment(const Vector3& end) const;
  void refuse_machine_coordinates() const;
  void enqueue(Item item);
  void meet_corner(Item& item);
  void write(const Item& item, const Segment* segment, bool with_words);
  void append_axis(std::string& text, const Item& item, int axis, double target_mm, bool always) const;
  void append_centre(std::string& text, const Item& item, const Segment& arc) const;
  [[nodiscard]] double increment_mm(int units) const noexcept;
  void append_length(std::string& text, char letter, double value_mm, int units) const;
  [[noreturn]] void fail(const std::string& message, std::uint32_t column = 1) const;
  [[noreturn]] void refuse_corner(std::uint32_t line);
  [[nodiscard]] double angle_rad(const Word& word) const noexcept;

  const ReaderOptions& options_;
  Program& program_;
  Interpreter& interpreter_;
  Put put_;

  ModalState programmed_;                       // position in work coordinates, exact
  Vector3 hole_ = Vector3::Zero();              ///< position of the last hole, as programmed
  Vector3 programmed_point_ = Vector3::Zero();  // the same before the coordinate modes
  CoordinateModes modes_;
  bool polar_ = false;
  double polar_radius_ = 0.0;
  Vector3 polar_pole_ = Vector3::Zero();
  double polar_angle_rad_ = 0.0;
  int compensation_ = 40;
  int d_number_ = -1;
  double radius_mm_ = 0.0;
  bool keeps_compensation_ = false;  // the block at hand belongs to a G41/G42 of a radius that is not known
  std::vector<Item> waiting_;
  bool span_open_ = false;     // blocks under compensation wait for their end
  bool corner_waits_ = false;  // the last move that waits carries ,R or ,C
  CornerWord corner_;
  LineOrigin corner_origin_;

  // Of the block at hand.
  const ParsedBlock* block_ = nullptr;
  const BlockWords* words_ = nullptr;
  LineOrigin origin_;
};

}  // namespace shapegcode::detail
