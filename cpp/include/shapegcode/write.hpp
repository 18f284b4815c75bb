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

/// One block to be written, in whole least increments: what is rounded once is never rounded again.
struct FittedBlock {
  std::array<std::int64_t, axis_count> end{};  ///< absolute position in increments
  std::int64_t radius = 0;                     ///< arcs: R in increments
  std::int64_t feed = 0;                       ///< F in units of 10^-feed_decimals per minute
  std::uint32_t first_period = 0;              ///< index of the block period in which it begins
  std::uint32_t periods = 0;                   ///< whole block periods that it lasts
  FittedKind kind = FittedKind::line;
  std::uint8_t normal = 2;  ///< arcs: axis across the plane
};

/// Grid on which blocks are fitted.
struct FitOptions {
  double increment_mm = 0.001;  ///< least increment of the words (0.0001 inch = 0.00254 mm)
  double block_period_s = 0.005;
  double interpolation_period_s = 0.001;
  double feed_unit_mm_per_s = 0.1 / 60.0;  ///< one step of the last F digit
  std::int64_t minimum_feed = 10;          ///< in feed units
  /// Deviation of merged blocks from the shaped command, per axis; where the command is straight the rounding of their
  /// ends, half an increment, is all that counts.
  double merge_tolerance_increments = 0.5;
  /// Longest block. 1: all blocks last the same time, so that whatever a control adds to each of them at another feed
  /// override is the same for all, and sections the motion evenly.
  std::uint32_t most_periods = std::numeric_limits<std::uint32_t>::max();
  /// Distance per interpolation period up to which blocks may be longer than that: what a control adds there is no
  /// more.
  double equal_above_increments = 1.0;
  /// Likewise blocks so far from both ends of a steady section: what they excite dies away before it. 0: none.
  std::uint32_t equal_periods = 0;
  double arc_min_chord_mm = 0.02;  ///< shorter pieces are lines
  /// How far the middle of an arc may be moved so that it meets its neighbours at a smaller angle, for a control that
  /// slows where the direction jumps; 0: not at all.
  double smooth_arcs_mm = 0.0;
  /// What the last block must be, so that the modal motion code behind it is the original's: a control refuses G02 or
  /// G03 alone. An arc that takes the place of a line there has `last_radius_mm` in the plane across `last_normal`.
  FittedKind last_kind = FittedKind::line;
  std::uint8_t last_normal = 2;
  double last_radius_mm = 0.0;
  double max_sweep_rad = 1.3962634;  ///< 80 degrees: no piece can be mistaken for the long way round
  /// Vibration modes of X, Y, Z, excited by the command of that axis. Where an axis has some, the ends of blocks are
  /// rounded to that of the two neighbouring increments that leaves them at rest (see ModalRounder); else to the
  /// nearest.
  std::array<std::vector<Mode>, axis_count> modes;
  std::uint32_t lent_periods = 0;  ///< time that the blocks before did not last (see fit_blocks)
};

/// Positions within a shaped command, as ascending period indices.
struct FitBorders {
  std::span<const std::uint32_t> breaks = {};  ///< a block must end there (program marks)
  std::span<const std::uint32_t> rests = {};   ///< the command is at rest there, besides its end
};

/// Turns a shaped command into blocks that each last a whole number of block periods.
///
/// `grid_mm`: positions at k*T_B, (n+1, 3). `middle_mm`: positions half a period later, (n, 3), from which the
/// curvature within a block is read. `arc_normal`: per period the axis across the plane of an arc that the command
/// follows there, or -1: (n). Every word is rounded once, to the nearest increment or, with modes, to one of its two
/// neighbours, so nothing drifts: the blocks stay within an increment of the command, and where it rests they are on
/// the nearest increment. F is rounded up, so that a controller that starts blocks on its interpolation ticks takes
/// exactly the intended number of ticks. A block that rounds to nothing lends its time to its successor; at the very
/// end it is rest and left out. A long command may be fitted in pieces: `left_periods` receives what the next one must
/// be lent. Throws Error(argument) on mismatched sizes or a position outside +-99999.999 mm.
[[nodiscard]] std::vector<FittedBlock> fit_blocks(const Eigen::Ref<const Eigen::MatrixXd>& grid_mm,
                                                  const Eigen::Ref<const Eigen::MatrixXd>& middle_mm,
                                                  std::span<const std::int8_t> arc_normal, const FitBorders& borders,
                                                  const FitOptions& options, std::uint32_t* left_periods = nullptr);

/// What stood at a position of the original: written before the block that begins there.
struct BlockMark {
  std::uint32_t period = 0;    ///< block period at which it stood
  std::int32_t n_number = -1;  ///< -1: none
  std::string comment;         ///< with its parentheses; empty: none
  std::uint32_t n_digits = 0;  ///< least digits of the N word: leading zeros are kept
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
  int motion = 1;  ///< modal motion code behind the last block: 1, 2 or 3
  int plane = 17;  ///< modal plane behind the last block
};

/// Text of fitted blocks: modal G codes, X Y Z, R, F only where they change. N words go to distinct blocks in their
/// order, at or behind their place; those that find no block of their own stand alone. `start` is in increments.
[[nodiscard]] WrittenBlocks write_blocks(std::span<const FittedBlock> blocks,
                                         std::array<std::int64_t, axis_count> start, std::span<const BlockMark> marks,
                                         const WriterOptions& options);

/// Largest amount per second in any time window of a duration; each block's amount is spread evenly over it. `amounts`:
/// of each block, such as its characters; empty: one of each. Durations >= 0; all blocks together are the window if
/// they last less. 0 where nothing lasts.
[[nodiscard]] double busiest_per_s(std::span<const double> durations_s, std::span<const double> amounts,
                                   double stretch_s) noexcept;

/// How new feeds are written into the blocks of a region.
struct FeedWriterOptions {
  double increment_mm = 0.001;    ///< least increment of positions
  double unit_mm = 1.0;           ///< of a position word and of the length in F: 1 or 25.4
  int position_decimals = 3;      ///< of a position word
  bool absolute_centres = false;  ///< I J K are positions
  double modal_feed = 0.0;        ///< F that holds before the region; 0: as in the original
  bool restore_feed = true;       ///< leave the modal feed of the original behind
};

/// A region's text with other feeds.
struct RefedRegion {
  std::string text;                  ///< whole lines
  std::uint32_t blocks = 0;          ///< blocks with a cutting move
  double modal_feed = 0.0;           ///< F that holds behind it
  std::vector<std::uint32_t> lines;  ///< per block, ascending: its line, counted from the text's first one = 0
};

/// Whether F is a feed per minute in every block of a region, in one unit of length: what other feeds can be written
/// for.
[[nodiscard]] bool feeds_per_minute(const Program& program, const Region& region);

/// Which segments of a region's path may be divided into several blocks: lines, and arcs in the XY plane, that have a
/// source line of their own without one-shot codes, whose words are the positions of the path.
[[nodiscard]] std::vector<bool> divisible_segments(const Program& program, const Region& region,
                                                   const FeedWriterOptions& options);

/// The region's lines with the feeds of `sections`; comments, numbers, spaces and everything else stay as they are.
/// F stands where the feed changes and where it stood; where asked for, a last line with F alone gives the modal feed
/// back that the original leaves behind. Where a section ends within a divisible block, the block is divided: the first
/// part keeps the words of the original, ends lie on the least increment (so they are off the path by half of it at
/// most). Throws Error(argument) if the sections do not cover the path.
[[nodiscard]] RefedRegion write_feeds(const Program& program, const Region& region,
                                      std::span<const FeedStretch> sections, const FeedWriterOptions& options);

}  // namespace shapegcode
