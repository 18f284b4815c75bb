#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "program/dialect/expanded_lines.hpp"
#include "program/dialect/path_element.hpp"
#include "program/siemens/block.hpp"
#include "program/siemens/frame.hpp"
#include "program/siemens/quick_move.hpp"
#include "shapegcode/siemens_program.hpp"

namespace shapegcode::siemens {

using Axes = std::array<bool, 3>;

enum class Motion : std::uint8_t { none, g0, g1, g2, g3, cip, ct };
[[nodiscard]] std::string_view name_of(Motion motion);
[[nodiscard]] constexpr bool is_arc_by_centre(Motion motion) { return motion == Motion::g2 || motion == Motion::g3; }

/// What is in force. Inch: 592300 p. 139.
struct Modes {
  Motion motion = Motion::none;
  int plane = 17;
  bool incremental = false;
  double unit = 1.0;  // mm of a length
  double feed_unit = 1.0;
  int feed_mode = 94;
  std::optional<double> feed;  // mm/min, mm/rev or 1/min
  bool is_linear = false;      // FLIN
  std::string offset;          // G54 ...
  Frame frame;
  double rounding_mm = 0.0;  // RNDM
};

/// A length in mm.
struct Coordinate {
  double value = 0.0;
  bool from_start = false;
  std::uint32_t column = 1;
};

/// Coordinates of some of three axes, in the order of their words.
class AxisWords {
 public:
  void set(int axis, const Coordinate& coordinate);
  void clear() { count_ = 0; }
  [[nodiscard]] bool empty() const { return count_ == 0; }
  [[nodiscard]] std::size_t size() const { return count_; }
  [[nodiscard]] int axis(std::size_t k) const { return words_[k].first; }
  [[nodiscard]] const Coordinate& coordinate(std::size_t k) const { return words_[k].second; }
  /// None: it has no word.
  [[nodiscard]] const Coordinate* find(std::size_t axis) const;

 private:
  std::array<std::pair<int, Coordinate>, 3> words_;
  std::size_t count_ = 0;
};

/// AP= or RP=.
struct PolarWord {
  bool is_angle = false;
  double value = 0.0;
  Mode mode = Mode::none;
  std::uint32_t column = 1;
};

enum class CornerKind : std::uint8_t { rounding, chamfer_width, chamfer_length };  // RND, CHR, CHF

/// Words of one block that say where to go; lengths in mm.
struct Given {
  AxisWords axes;
  AxisWords centre;
  AxisWords middle;
  std::optional<double> radius;
  std::optional<double> angle;
  std::int64_t turns = 0;
  std::vector<PolarWord> polar;
  std::optional<std::pair<CornerKind, double>> corner;
  std::optional<double> start_feed;  // that was in force before the block
  bool has_feed = false;
  bool exact = false;  // G9
  std::uint32_t column = 1;

  [[nodiscard]] Error error(const std::string& message) const { return error_at(column, message); }
};

/// Follows the moves of a program and writes them for FANUC.
class SiemensPath {
 public:
  explicit SiemensPath(const SiemensOptions& options);

  Modes modes;
  std::uint32_t line = 1;  // of the source, and its file
  std::uint32_t file = 0;
  dialect::ExpandedLines out;

  /// Write a line.
  void put(std::string_view text);
  /// Tell something once; nothing of an empty text.
  void note(std::string_view text, std::string_view key = {});
  /// A word is written that stands for another one.
  void name(const std::string& written, std::string_view original);

  void set_frame(const Frame& frame);
  void set_plane(int plane);
  void set_offset(const std::string& name);
  /// The position of axes ("XZ") is not known from here on.
  void forget(std::string_view axes, bool is_shifted = false);
  /// G110 from the position, G111 from zero, G112 from the last pole.
  void define_pole(int code, const Given& given);

  /// A line in G90 of nothing but numbers, which most blocks are; false: it needs another look. It does what `move`
  /// does.
  [[nodiscard]] bool quick_move(const QuickMove& quick);
  /// One block with axes.
  void move(Given& given);
  /// Write what was held for a corner.
  void release();

  [[nodiscard]] std::int64_t moves() const { return moves_; }
  [[nodiscard]] const SiemensOptions& options() const { return options_; }
  [[nodiscard]] std::vector<std::pair<std::string, std::string>> take_names() { return std::move(names_); }

 private:
  /// A corner whose second block is not yet known.
  struct HeldCorner {
    dialect::PathElement element;
    CornerKind kind;
    double size;
    bool is_modal;
  };
  struct HeldLine {
    std::string text;
    std::uint32_t line;
    std::uint32_t file;
  };
  /// Of a block with linear feed.
  struct LinearFeed {
    double start = 0.0;
    double slope = 0.0;  // 1/min
    double time_min = 0.0;
    std::size_t count = 1;  // of blocks of constant feed
  };
  enum class WrittenMotion : std::uint8_t { rapid, cut };

  void write_plane(int plane);
  [[nodiscard]] std::optional<Vector3> direction() const;

  void polar_end(Given& given);
  void straight(const Given& given, const Vector3& target);
  void by_distance(const Given& given, const Vector3& end, const Axes& moved);
  [[nodiscard]] double distance_of(const Given& given, const Vector3& end, std::size_t axis);
  void round(const Given& given, Vector3 here, Vector3 target);
  [[nodiscard]] dialect::PathElement arc(const Given& given, const Vector3& here, const Vector3& target) const;
  [[nodiscard]] dialect::PathElement arc_in_plane(const Given& given, const Vector3& here, const Vector3& target) const;
  [[nodiscard]] dialect::PathElement in_offset(const dialect::PathElement& element, std::uint32_t column) const;

  void write_element(const dialect::PathElement& element, const Given& given, const Axes& moved);
  void write_cut(const dialect::PathElement& element, const Given& given, const Axes& moved, bool known);
  void write_linear(const dialect::PathElement& element, const LinearFeed& feed, const Axes& moved, bool exact);
  /// One block of constant feed; with a time its feed is that which takes it between the rounded ends.
  void write_part(const dialect::PathElement& part, const Axes& moved, bool exact, double feed, double time_min);
  void write_piece(const dialect::PathElement& piece, const Axes& moved, bool exact, double feed);
  /// None: the feed is constant.
  [[nodiscard]] std::optional<LinearFeed> linear_feed(const dialect::PathElement& element, const Given& given,
                                                      double feed, bool known);
  [[nodiscard]] double constant_feed(const Given& given, double length_mm) const;
  [[nodiscard]] std::string feed_word(double feed);
  [[nodiscard]] Vector3 on_grid(const Vector3& value) const;
  void append_length(std::string& text, double value) const;
  void append_axes(std::string& text, const Vector3& end, const Axes& moved) const;
  void end_corner(const dialect::PathElement& element, const Vector3& ahead, bool is_rapid, const Axes& moved);

  const SiemensOptions& options_;
  Vector3 at_;         // in the coordinates of the work offset; NaN: not known
  Axes shifted_ = {};  // an offset of the axis changed since it was programmed absolutely
  Vector3 pole_ = Vector3::Zero();
  std::optional<double> polar_angle_, polar_radius_;
  std::optional<Vector3> step_;  // along the end of the last move
  std::int64_t moves_ = 0;
  std::vector<std::pair<std::string, std::string>> names_;
  int plane_ = 17;  // as written, like the next two
  int mode_ = 94;
  std::string feed_;
  std::optional<HeldCorner> corner_;
  std::vector<HeldLine> held_;  // lines of the block before a corner, and behind it
  double increment_;
  int decimals_;
};

/// A settable frame as FANUC's work offset: G505 is G54.1P5, G500 (no offset of its own) G54.1P300.
[[nodiscard]] std::string offset_word(const std::string& name);

}  // namespace shapegcode::siemens
