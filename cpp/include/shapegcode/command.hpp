#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <vector>

#include "shapegcode/filter.hpp"
#include "shapegcode/mode.hpp"
#include "shapegcode/motion.hpp"
#include "shapegcode/path.hpp"
#include "shapegcode/plant/modal.hpp"

namespace shapegcode {

/// Which motion is to follow the programmed path.
enum class ContourTarget {
  none,      ///< none: shaping without contour compensation
  command,   ///< the shaped command
  response,  ///< the plant's response to it, which cuts the part
};

/// What plans the command of a motion from rest to rest before it is shaped.
enum class CommandPlanner : std::uint8_t {
  look_ahead,    ///< `plan_speed`: ramps along the path, corners passed slowly
  time_optimal,  ///< `time_optimal_motion`: corners rounded within the contour tolerance, jerk of every axis limited
};

/// Axes of a kernel: the axis that moves, with its modes, and the axis whose command is shaped.
struct KernelAxes {
  std::size_t moved = 0;
  std::size_t commanded = 0;
};
/// The kernel from a command before shaping to the motion that is to follow the path, at delays 0, 1, ... samples of
/// `period_s`: the shaper's taps alone, or followed by an axis' modes under a command that is linear between samples.
/// If the shaper cancels the modes, the kernel is hardly longer than the shaper. Otherwise its tail is cut off where
/// less than 1e-4 of it remains, or at four times the shaper's duration, and the outer taps are adjusted to keep the
/// shaper's sum and mean delay. If the two axes differ, the kernel is the response of the modes that the commanded axis
/// excites, and empty without any. Throws Error(argument) as ModalPlant does. Source: this project.
[[nodiscard]] std::vector<double> contour_kernel(const Fir& shaper, std::span<const Mode> modes, double period_s,
                                                 ContourTarget target, KernelAxes of = {});

/// Finds, for one axis, the correction c of a command before shaping that brings the shaped command (or the plant's
/// response to it) back to the programmed path: it minimises |e + f*c|^2 + sum_k w_k (c_k - 2 c_{k-1} + c_{k-2})^2,
/// where f is the kernel (see contour_kernel) and e the deviation without correction.
///
/// The error is summed as far as the correction acts, so the normal matrix is a banded Toeplitz matrix whatever the
/// length of the window. Its Cholesky factor is computed once, until its rows no longer change; every window then costs
/// two substitutions. Unequal weights need a separate factorisation. Windows are solved one after the other:
/// corrections already applied stay fixed, and the next window starts from them.
class ContourSolver {
 public:
  /// `kernel`: taps at delays 0, 1, ... samples, sum other than 0; `smoothness` > 0: the weight w. Throws
  /// Error(argument) on an empty or not finite kernel or another smoothness.
  ContourSolver(std::vector<double> kernel, double smoothness);

  /// Delay of the kernel's last tap: samples by which a correction acts beyond its own sample.
  [[nodiscard]] std::size_t reach() const noexcept { return kernel_.size() - 1; }
  [[nodiscard]] const std::vector<double>& kernel() const noexcept { return kernel_; }

  /// Corrections of one window. `correction` holds reach()+2 fixed values (corrections before the window, or zero) and
  /// then the m unknowns. `error` is e without any correction, at the m unknowns and at the reach() samples after them.
  /// `stiffness`: empty, or m+2 factors of the smoothness, one per second difference. Throws Error(argument) on sizes
  /// that do not fit. O(m*reach), with stiffness O(m*reach^2).
  void solve(std::span<const double> error, std::span<double> correction, std::span<const double> stiffness = {});

 private:
  void extend_factor(std::size_t rows);
  void factor_and_solve(std::span<const double> stiffness, std::span<double> x);

  std::vector<double> kernel_;
  std::vector<std::size_t> taps_;  // delays at which the kernel is not zero
  double smoothness_;
  std::size_t band_;            // half bandwidth of the normal matrix
  std::vector<double> column_;  // its first column
  /// Rows of the factor, band_+1 values each: l(i, i-band_) ... l(i, i-1), 1/l(i, i).
  std::vector<double> factor_;
  std::size_t factor_rows_ = 0;
  bool is_settled_ = false;  // the last row is valid for all later ones
  std::vector<double> work_;
  std::vector<double> own_factor_;  // with stiffness
};

/// How a region is turned into a shaped command on the block grid.
struct ShapingOptions {
  MotionLimits limits;
  /// The time-optimal planner needs feed, acceleration and jerk of every axis in `limits` and ignores its corner rules.
  CommandPlanner planner = CommandPlanner::look_ahead;
  FilterTolerance tolerance;  ///< for the shaper and the filters after it
  double block_period_s = 0.005;
  double interpolation_period_s = 0.001;
  double plunge_axis_angle_rad = 0.26;  ///< see forced_stops
  double plunge_corner_angle_rad = 0.78;
  /// Ascending indices of segments, above 0, before which the command also stops, as at a forced stop.
  std::vector<std::uint32_t> further_stops;
  double rest_at_stop_s = 0.0;  ///< pause at a forced stop, until the filters after interpolation are at rest
  /// Which motion contour compensation brings back to the path. With a target, the feed is the highest that keeps
  /// `tolerance.contour_tolerance_mm`; without one, `tolerance` bounds the speed at corners and on arcs.
  ContourTarget target = ContourTarget::none;
  AxisModes modes;  ///< used for the response only
  /// One shaper for each of X, Y and Z (taps in whole block periods, of one mean delay) instead of the common one;
  /// empty: none. Without a target they distort the path.
  std::vector<Fir> axis_shapers;
  /// Shapers along an axis (taps in whole block periods, positions as in the path) instead of the one shaper, for modes
  /// that vary with position by `mode_tables`.
  std::optional<FollowingFir> following;
  AxisModeTables mode_tables;
  double least_feed_mm_per_s = 0.0;  ///< lowest feed of the controller: no motion is slowed below it for the tolerance
  /// Ratio by which the shaped command may exceed the programmed feed along the path, > 0. The contour correction keeps
  /// it. The speed is lowered for a slower programmed feed early enough that the shaper's output reaches it in time.
  double feed_excess_ratio = MotionLimits::none;
  /// Weight of the correction's second differences on a grid of half the block period. A smaller weight follows the
  /// path more closely and excites more at frequencies beside the modes: docs/concepts/contour.md.
  double contour_smoothness = 0.4;
};

/// A region's command, shaped and on the block grid, ready for fit_blocks.
struct ShapedCommand {
  std::uint32_t first_period = 0;       ///< periods of the region before this part
  Eigen::MatrixXd grid_mm;              ///< (n+1, 3) at multiples of the block period
  Eigen::MatrixXd middle_mm;            ///< (n, 3) half a period later
  std::vector<std::int8_t> arc_normal;  ///< (n) see fit_blocks
  std::vector<std::uint32_t> run_ends;  ///< periods, of this part, at which the command is at rest
  std::vector<std::uint32_t>
      segment_periods;  ///< per marked segment: period of the region in which its start is reached
};

/// Duration of a region at a contour tolerance.
struct PlannedTolerance {
  double duration_s = 0.0;    ///< of the shaped command, before any filter after it
  double deviation_mm = 0.0;  ///< largest, of the target; 0 without a target
};

/// Splits the path at forced stops and plans each motion from rest to rest. Samples each at half the block period,
/// shapes it with `shaper` (taps in whole block periods, common to all axes) and joins them. The output comes in parts
/// of a bounded number of periods, so that memory does not grow with the region.
class RegionShaper {
 public:
  /// `marked_segments`: ascending indices (up to path->size()) whose start time is wanted. Throws Error(argument) if
  /// the block period is not a whole multiple of the interpolation period, and as the planner and the filter do.
  RegionShaper(std::shared_ptr<const Path> path, const Fir& shaper, std::span<const std::uint32_t> marked_segments,
               ShapingOptions options);
  RegionShaper(RegionShaper&&) noexcept;
  RegionShaper& operator=(RegionShaper&&) noexcept;
  ~RegionShaper();

  /// Next part of at most `periods` periods; false after the last one or if withdrawn, and `part` is then unchanged.
  /// `part.segment_periods` contains all marks of the motions begun so far.
  [[nodiscard]] bool next(ShapedCommand& part, std::uint32_t periods);
  /// Call before the first part. If the region is one motion from rest to rest, with a target, next() then returns
  /// parts while the search for the feed still measures them, as if its first plan kept the tolerance. If it does not,
  /// next() returns false and is_withdrawn() is true: all parts returned so far are invalid.
  void begin_early() noexcept;
  [[nodiscard]] bool is_withdrawn() const noexcept;
  /// Restarts the region from its beginning, with the feed that the search then finds; false, and nothing done, if
  /// begin_early() was not called or had no effect.
  bool restart();
  /// Largest deviation of the target from the path in mm, over the motions returned so far.
  [[nodiscard]] double largest_deviation_mm() const noexcept;
  /// Whether any motion returned so far is slower than without a tolerance; always true without a target.
  [[nodiscard]] bool is_slowed() const noexcept;
  /// Progress in the region, 0 to 1: by segments, within a motion by its periods.
  [[nodiscard]] double share() const noexcept;
  /// Number of stops besides the forced ones: junctions that exceed the tolerance at every speed.
  [[nodiscard]] std::uint32_t stops() const noexcept;

 private:
  friend std::vector<PlannedTolerance> plan_tolerances(const std::shared_ptr<const Path>& path, const Fir& shaper,
                                                       const ShapingOptions& options,
                                                       std::span<const double> tolerances_mm);

  struct State;

  std::unique_ptr<State> state_;
};

/// The time of a region at several contour tolerances, without its command. Each search for the feed starts from the
/// speeds of the previous tolerance, so descending tolerances need few rounds each; infinity: nothing is slowed. The
/// tolerances replace `options.tolerance.contour_tolerance_mm`. Throws as RegionShaper does.
[[nodiscard]] std::vector<PlannedTolerance> plan_tolerances(const std::shared_ptr<const Path>& path, const Fir& shaper,
                                                            const ShapingOptions& options,
                                                            std::span<const double> tolerances_mm);

/// The whole region in one part; see RegionShaper.
[[nodiscard]] ShapedCommand shape_path(const std::shared_ptr<const Path>& path, const Fir& shaper,
                                       std::span<const std::uint32_t> marked_segments, const ShapingOptions& options);

}  // namespace shapegcode
