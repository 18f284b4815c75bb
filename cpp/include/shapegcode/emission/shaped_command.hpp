#pragma once

#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include "shapegcode/filter/fir.hpp"
#include "shapegcode/motion/limits.hpp"
#include "shapegcode/path/path.hpp"

namespace shapegcode {

/// How a region is turned into a shaped command on the block grid.
struct ShapingOptions {
  MotionLimits limits;
  double block_period_s = 0.005;
  double interpolation_period_s = 0.001;
  double plunge_axis_angle_rad = 0.26;  ///< see forced_stops
  double plunge_corner_angle_rad = 0.78;
  double rest_at_stop_s = 0.0;  ///< pause at a forced stop, so that a filter behind the program runs out
};

/// A region's command, shaped and on the block grid, ready for fit_blocks.
struct ShapedCommand {
  Eigen::MatrixXd grid_mm;                     ///< (n+1, 3) at k*T_B
  Eigen::MatrixXd middle_mm;                   ///< (n, 3) half a period later
  std::vector<std::int8_t> arc_normal;         ///< (n) see fit_blocks
  std::vector<std::uint32_t> run_ends;         ///< periods at which the command is at rest
  std::vector<std::uint32_t> segment_periods;  ///< per marked segment: period in which its begin is reached
};

/// Splits the path at forced stops, plans each run from rest to rest, samples it at half the block period, shapes it
/// with `shaper` (taps in whole block periods, common to all axes) and puts the runs behind one another.
/// `marked_segments`: ascending indices (up to path->size()) whose begin in time is wanted.
/// Throws Error(argument) if the block period is not a whole multiple of the interpolation period.
[[nodiscard]] ShapedCommand shape_path(const std::shared_ptr<const Path>& path, const Fir& shaper,
                                       std::span<const std::uint32_t> marked_segments, const ShapingOptions& options);

}  // namespace shapegcode
