#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <vector>

#include "shapegcode/emission/feed_search.hpp"
#include "shapegcode/emission/run_shaper.hpp"
#include "shapegcode/filter/fir.hpp"
#include "shapegcode/filter/varying_fir.hpp"
#include "shapegcode/motion/limits.hpp"
#include "shapegcode/path/path.hpp"
#include "shapegcode/plant/modal.hpp"

namespace shapegcode {

/// How a region is turned into a shaped command on the block grid.
struct ShapingOptions {
  MotionLimits limits;
  double block_period_s = 0.005;
  double interpolation_period_s = 0.001;
  double plunge_axis_angle_rad = 0.26;  ///< see forced_stops
  double plunge_corner_angle_rad = 0.78;
  double rest_at_stop_s = 0.0;  ///< pause at a forced stop, so that a filter behind the program runs out
  /// What is brought back to the path behind the shaper (spec 5). With a target, `limits.contour_tolerance_mm` is its
  /// tolerance, kept by the highest feed that does; without one, `limits` holds the bounds that plain shaping needs.
  ContourTarget target = ContourTarget::none;
  AxisModes modes;  ///< of the response; nothing else is done with them
  /// One shaper for each of X, Y and Z (taps in whole block periods, of one mean delay) in place of the common one;
  /// empty: none. Without a target they distort the path.
  std::vector<Fir> axis_shapers;
  /// Shapers along an axis (taps in whole block periods, positions as in the path) in place of the one shaper, for
  /// modes that vary with position by `mode_tables`.
  std::optional<FollowingFir> following;
  AxisModeTables mode_tables;
  /// Weight of the correction's second differences on half the block grid. Less of it follows the path more closely and
  /// asks for more beside the modes' frequencies, which shows where these are off: docs/contour.md.
  double least_feed_mm_per_s = 0.0;  ///< what the controller can run: no run is slowed below it for the tolerance
  double contour_smoothness = 0.4;
};

/// A region's command, shaped and on the block grid, ready for fit_blocks.
struct ShapedCommand {
  std::uint32_t first_period = 0;       ///< periods of the region before this piece
  Eigen::MatrixXd grid_mm;              ///< (n+1, 3) at k*T_B
  Eigen::MatrixXd middle_mm;            ///< (n, 3) half a period later
  std::vector<std::int8_t> arc_normal;  ///< (n) see fit_blocks
  std::vector<std::uint32_t> run_ends;  ///< periods, of this piece, at which the command is at rest
  std::vector<std::uint32_t>
      segment_periods;  ///< per marked segment: period of the region in which its begin is reached
};

/// Splits the path at forced stops, plans each run from rest to rest, samples it at half the block period, shapes it
/// with `shaper` (taps in whole block periods, common to all axes) and puts the runs behind one another. Pieces of a
/// bounded number of periods, so that memory does not grow with the region.
class RegionShaper {
 public:
  /// `marked_segments`: ascending indices (up to path->size()) whose begin in time is wanted. Throws Error(argument) if
  /// the block period is not a whole multiple of the interpolation period, and as the planner and the filter do.
  RegionShaper(std::shared_ptr<const Path> path, const Fir& shaper, std::span<const std::uint32_t> marked_segments,
               ShapingOptions options);

  /// Next piece of at most `periods` periods; false once the region was given out, and `piece` is then left alone.
  /// `piece.segment_periods` then holds all marks of the runs that were begun.
  [[nodiscard]] bool next(ShapedCommand& piece, std::uint32_t periods);
  /// Largest deviation in mm of what the target says shall follow the path, as far as the runs given out tell.
  [[nodiscard]] double largest_deviation_mm() const noexcept { return largest_deviation_mm_; }
  /// Junctions that no speed passes within the tolerance: stops beside the forced ones.
  [[nodiscard]] std::uint32_t stops() const noexcept { return stops_; }

 private:
  struct Piece {
    std::size_t first, last;  // segments
  };

  [[nodiscard]] bool begin_run();
  void note_marks(const PlannedRun& run);

  std::shared_ptr<const Path> path_;
  ShapingOptions options_;
  RunFilter filter_;
  std::vector<std::uint32_t> marks_;
  std::vector<Piece> pieces_;  // still to be run, the next one last
  std::size_t steps_per_half_ = 1;
  std::uint32_t rest_periods_ = 0;

  Piece now_{0, 0};
  std::unique_ptr<RunShaper> run_;
  std::uint32_t given_ = 0;       // periods of the run given out
  std::uint32_t resting_ = 0;     // periods of rest still to come
  std::uint32_t period_ = 0;      // of the region
  Vector3 at_ = Vector3::Zero();  // last grid row
  std::vector<std::uint32_t> segment_periods_;
  double largest_deviation_mm_ = 0.0;
  std::uint32_t stops_ = 0;
};

/// The whole region in one piece; see RegionShaper.
[[nodiscard]] ShapedCommand shape_path(const std::shared_ptr<const Path>& path, const Fir& shaper,
                                       std::span<const std::uint32_t> marked_segments, const ShapingOptions& options);

}  // namespace shapegcode
