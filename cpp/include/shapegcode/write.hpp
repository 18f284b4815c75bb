#pragma once

#include <array>
#include <cstdint>
#include <limits>
#include <span>
#include <string>
#include <vector>

#include "shapegcode/milling/feed.hpp"
#include "shapegcode/mode.hpp"
#include "shapegcode/program.hpp"
#include "shapegcode/samples.hpp"

namespace shapegcode {

enum class FittedKind : std::uint8_t { line, clockwise, counter_clockwise };

/// One block to be written, in whole least increments, so that nothing is rounded twice.
struct FittedBlock {
  std::array<std::int64_t, axis_count> end{};  ///< absolute position in increments
  std::int64_t radius = 0;                     ///< arcs: R in increments
  std::int64_t feed = 0;                       ///< F in units of 10^-feed_decimals per minute
  std::uint32_t first_period = 0;              ///< index of the block period in which it begins
  std::uint32_t periods = 0;                   ///< duration in whole block periods
  FittedKind kind = FittedKind::line;
  std::uint8_t normal = 2;  ///< arcs: axis perpendicular to the plane
};

/// Grid on which blocks are fitted.
struct FitOptions {
  double increment_mm = 0.001;  ///< least increment of the words (0.0001 inch = 0.00254 mm)
  double block_period_s = 0.005;
  double interpolation_period_s = 0.001;
  double feed_unit_mm_per_s = 0.1 / 60.0;  ///< one step of the last F digit
  std::int64_t minimum_feed = 10;          ///< in feed units
  /// Permitted deviation of merged blocks from the shaped command, per axis; where the command is straight only the
  /// rounding of their ends, half an increment, counts.
  double merge_tolerance_increments = 0.5;
  /// Longest block. 1: all blocks have the same duration, so that any time a control adds to a block at another feed
  /// override is the same for all, and lengthens the motion evenly.
  std::uint32_t most_periods = std::numeric_limits<std::uint32_t>::max();
  /// Blocks may be longer if the command moves no further than this per interpolation period: the time that a control
  /// adds has no significant effect there.
  double equal_above_increments = 1.0;
  /// Likewise blocks this far from both ends of a section at constant velocity: their vibration decays before the end.
  /// 0: none.
  std::uint32_t equal_periods = 0;
  double arc_min_chord_mm = 0.02;  ///< shorter arcs are lines
  /// Distance by which the middle of an arc may be moved to reduce the angle to its neighbours, for a control that
  /// slows where the direction jumps; 0: none.
  double smooth_arcs_mm = 0.0;
  /// Required kind of the last block, so that the modal motion code after it is the original's: a control refuses G02
  /// or G03 alone. An arc instead of a line there has `last_radius_mm` in the plane perpendicular to `last_normal`.
  FittedKind last_kind = FittedKind::line;
  std::uint8_t last_normal = 2;
  double last_radius_mm = 0.0;
  double max_sweep_rad = 1.3962634;  ///< 80 degrees: no arc can be taken for the complementary one
  /// Vibration modes of X, Y, Z, excited by the command of that axis. For an axis with modes, block ends are rounded to
  /// one of the two neighbouring increments such that the modes stay at rest (see ModalRounder); otherwise to the
  /// nearest.
  std::array<std::vector<Mode>, axis_count> modes;
  std::uint32_t lent_periods = 0;  ///< time owed by the blocks before (see fit_blocks)
};

/// Positions within a shaped command, as ascending period indices.
struct FitBorders {
  std::span<const std::uint32_t> breaks = {};  ///< positions where a block must end (program marks)
  std::span<const std::uint32_t> rests = {};   ///< positions where the command is at rest, besides its end
};

/// Converts a shaped command to blocks that each last a whole number of block periods.
///
/// `grid_mm`: positions at k*T_B, (n+1, 3). `middle_mm`: positions half a period later, (n, 3), which give the
/// curvature within a block. `arc_normal`: per period the axis perpendicular to the plane of an arc that the command
/// follows there, or -1: (n). Every word is rounded once, to the nearest increment or, with modes, to one of the two
/// neighbours. So errors do not accumulate: the blocks stay within an increment of the command, and at rest on the
/// nearest increment. F is rounded up, so that a controller that starts blocks at interpolation periods needs exactly
/// the intended number of periods. The time of a block that rounds to zero length is added to its successor; at the end
/// it is omitted. A long command may be fitted in pieces: `left_periods` receives the `lent_periods` of the next piece.
/// Throws Error(argument) on mismatched sizes or a position outside +-99999.999 mm.
[[nodiscard]] std::vector<FittedBlock> fit_blocks(const Eigen::Ref<const Eigen::MatrixXd>& grid_mm,
                                                  const Eigen::Ref<const Eigen::MatrixXd>& middle_mm,
                                                  std::span<const std::int8_t> arc_normal, const FitBorders& borders,
                                                  const FitOptions& options, std::uint32_t* left_periods = nullptr);

/// N word and comment at a position of the original, written before the first block that begins there or later.
struct BlockMark {
  std::uint32_t period = 0;    ///< block period of its position
  std::int32_t n_number = -1;  ///< -1: none
  std::string comment;         ///< with its parentheses; empty: none
  std::uint32_t n_digits = 0;  ///< minimum digits of the N word: leading zeros are kept
};

struct WriterOptions {
  int position_decimals = 3;
  int feed_decimals = 1;
  bool incremental = false;        ///< G91 words: differences of the rounded absolute positions
  int motion = 1;                  ///< modal motion code before the first block
  int plane = 17;                  ///< plane active before the first block; G01 is active too
  bool exact_stop_at_end = false;  ///< G09 on the last block
  std::string line_end = "\n";
};

struct WrittenBlocks {
  std::string text;
  int motion = 1;  ///< modal motion code after the last block: 1, 2 or 3
  int plane = 17;  ///< modal plane after the last block
};

/// Text of fitted blocks: modal G codes, X Y Z, R, F only where they change. N words go to different blocks in their
/// order, at or after their position; the rest get lines of their own. `start` is in increments.
[[nodiscard]] WrittenBlocks write_blocks(std::span<const FittedBlock> blocks,
                                         std::array<std::int64_t, axis_count> start, std::span<const BlockMark> marks,
                                         const WriterOptions& options);

/// Largest amount per second in any time window of `stretch_s`; each block's amount is spread evenly over its duration.
/// `amounts`: of each block, such as its characters; empty: one each. Durations >= 0; if all blocks together are
/// shorter, they are the window. 0 if all durations are 0.
[[nodiscard]] double busiest_per_s(std::span<const double> durations_s, std::span<const double> amounts,
                                   double stretch_s) noexcept;

/// Options for writing new feeds into the blocks of a region.
struct FeedWriterOptions {
  double increment_mm = 0.001;    ///< least increment of positions
  double unit_mm = 1.0;           ///< of a position word and of the length in F: 1 or 25.4
  int position_decimals = 3;      ///< of a position word
  bool absolute_centres = false;  ///< I J K are positions
  double modal_feed = 0.0;        ///< F in effect before the region; 0: as in the original
  bool restore_feed = true;       ///< restore the modal feed of the original at the end
};

/// A region's text with other feeds.
struct RefedRegion {
  std::string text;                  ///< whole lines
  std::uint32_t blocks = 0;          ///< blocks with a cutting move
  double modal_feed = 0.0;           ///< F in effect after it
  std::vector<std::uint32_t> lines;  ///< per block, ascending: its line, counted from 0 for the first of the text
};

/// Whether F is a feed per minute in every block of a region, in one unit of length, so that other feeds can be
/// written.
[[nodiscard]] bool feeds_per_minute(const Program& program, const Region& region);

/// Which segments of a region's path may be divided into several blocks: lines, and arcs in the XY plane, with a
/// separate source line without one-shot codes, whose words are the positions of the path.
[[nodiscard]] std::vector<bool> divisible_segments(const Program& program, const Region& region,
                                                   const FeedWriterOptions& options);

/// The region's lines with the feeds of `sections`; comments, numbers, spaces and everything else do not change. F is
/// written where the feed changes and where the original has it; if requested, a last line with F alone restores the
/// modal feed of the original. Where a section ends within a divisible block, the block is divided: the first part
/// keeps the words of the original, ends are rounded to the least increment (off the path by at most half of it).
/// Throws Error(argument) if the sections do not cover the path, or one ends within a block that cannot be divided.
[[nodiscard]] RefedRegion write_feeds(const Program& program, const Region& region,
                                      std::span<const FeedStretch> sections, const FeedWriterOptions& options);

}  // namespace shapegcode
