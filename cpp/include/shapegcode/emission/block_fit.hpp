#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "shapegcode/mode.hpp"
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
  double feed_unit_mm_per_s = 0.1 / 60.0;   ///< one step of the last F digit
  std::int64_t minimum_feed = 10;           ///< in feed units
  double merge_tolerance_increments = 0.5;  ///< deviation of merged blocks from the shaped command, per axis
  double arc_min_chord_mm = 0.02;           ///< shorter pieces are lines
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

/// Turns a shaped command into blocks that each last a whole number of block periods.
///
/// `grid_mm`: positions at k*T_B, (n+1, 3). `middle_mm`: positions half a period later, (n, 3), from which the
/// curvature within a block is read. `arc_normal`: per period the axis across the plane of an arc that the command
/// follows there, or -1: (n). `breaks`: ascending period indices at which a block must end (program marks). Every word
/// is rounded once, to the nearest increment or, with modes, to one of its two neighbours, so nothing drifts: the
/// blocks stay within an increment of the command, and where it rests they are on the nearest increment. `rests`:
/// ascending periods at which the command is at rest, besides its end. F is rounded up, so that a controller that
/// starts blocks on its interpolation ticks takes exactly the intended number of ticks. A block that rounds to nothing
/// lends its time to its successor; at the very end it is rest and left out. A long command may be fitted in pieces:
/// `left_periods` receives what the next one must be lent. Throws Error(argument) on mismatched sizes
/// or a position outside +-99999.999 mm.
[[nodiscard]] std::vector<FittedBlock> fit_blocks(const Eigen::Ref<const Eigen::MatrixXd>& grid_mm,
                                                  const Eigen::Ref<const Eigen::MatrixXd>& middle_mm,
                                                  std::span<const std::int8_t> arc_normal,
                                                  std::span<const std::uint32_t> breaks, const FitOptions& options,
                                                  std::span<const std::uint32_t> rests = {},
                                                  std::uint32_t* left_periods = nullptr);

}  // namespace shapegcode
