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

/// What shall follow the programmed path.
enum class ContourTarget {
  none,      ///< nothing: the path is shaped as it is
  command,   ///< the shaped command
  response,  ///< the plant's response to it: the part
};

/// What plans the command of a run before it is shaped.
enum class CommandPlanner : std::uint8_t {
  look_ahead,    ///< `plan_speed`: ramps along the path, corners passed slowly
  time_optimal,  ///< `time_optimal_motion`: corners rounded within the contour tolerance, jerk of every axis kept
};

/// Kernel, at delays 0, 1, ... samples of `period_s`, from a command before shaping to what shall follow the path: the
/// shaper's own taps, or its taps followed by an axis' modes under a command that is linear between samples. A shaper
/// that cancels the modes leaves a kernel hardly longer than itself; the tail of one that does not is cut where less
/// than 1e-4 of it is left, or at four times the shaper, and the outer taps mended so that sum and mean delay
/// are the shaper's.
/// `of`: the axis that follows, with its modes, and the axis whose command is shaped: where that is another one, the
/// kernel is what modes do that it excites, and empty without any. Throws Error(argument) as ModalPlant does. Source:
/// this project.
struct KernelAxes {
  std::size_t moved = 0;
  std::size_t commanded = 0;
};
[[nodiscard]] std::vector<double> contour_kernel(const Fir& shaper, std::span<const Mode> modes, double period_s,
                                                 ContourTarget target, KernelAxes of = {});

/// Finds, for one axis, the correction c of a command before shaping that brings the shaped command (or the plant's
/// response to it) back to the programmed path: it minimises |e + f*c|^2 + sum_k w_k (c_k - 2 c_{k-1} + c_{k-2})^2,
/// where f is the kernel from the command before shaping to what shall follow the path and e the deviation without
/// correction.
///
/// The error is counted as far as the correction reaches, so the normal matrix is a banded Toeplitz matrix whatever the
/// length of the window: its Cholesky factor is worked out once, until its rows no longer change, and every window then
/// costs two substitutions. Unequal weights cost a factorisation of their own. What is solved window by window is
/// carried on: corrections already given out stay as they are, and the next window starts from them.
class ContourSolver {
 public:
  /// `kernel`: taps at delays 0, 1, ... samples, sum other than 0; `smoothness` > 0: the weight w. Throws
  /// Error(argument) on an empty or not finite kernel or another smoothness.
  ContourSolver(std::vector<double> kernel, double smoothness);

  /// Delay of the kernel's last tap: samples by which a correction acts beyond its own sample.
  [[nodiscard]] std::size_t reach() const noexcept { return kernel_.size() - 1; }
  [[nodiscard]] const std::vector<double>& kernel() const noexcept { return kernel_; }

  /// Corrections of one window. `correction` holds reach()+2 values that stay (what was given out before the window,
  /// zero where nothing was) and then the m unknowns; `error` e at the m unknowns and at the reach() samples behind
  /// them, without any correction. `stiffness`: empty, or m+2 factors of the smoothness, one per second difference.
  /// Throws Error(argument) on sizes that do not fit. O(m*reach), with stiffness O(m*reach^2).
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
  bool is_settled_ = false;  // the last row stands for all that follow
  std::vector<double> work_;
  std::vector<double> own_factor_;  // with stiffness
};

/// How a region is turned into a shaped command on the block grid.
struct ShapingOptions {
  MotionLimits limits;
  /// The time-optimal one asks for feed, acceleration and jerk of every axis in `limits`; their rules for corners do
  /// not count for it.
  CommandPlanner planner = CommandPlanner::look_ahead;
  FilterTolerance tolerance;  ///< of the shaper with what follows it
  double block_period_s = 0.005;
  double interpolation_period_s = 0.001;
  double plunge_axis_angle_rad = 0.26;  ///< see forced_stops
  double plunge_corner_angle_rad = 0.78;
  /// Ascending indices of segments, above 0, before which the command comes to rest too, as at a forced stop.
  std::vector<std::uint32_t> further_stops;
  double rest_at_stop_s = 0.0;  ///< pause at a forced stop, so that a filter behind the program runs out
  /// What is brought back to the path behind the shaper. With a target, `tolerance.contour_tolerance_mm` is kept by the
  /// highest feed that does; without one, `tolerance` bounds the speed at corners and on arcs.
  ContourTarget target = ContourTarget::none;
  AxisModes modes;  ///< of the response; nothing else is done with them
  /// One shaper for each of X, Y and Z (taps in whole block periods, of one mean delay) in place of the common one;
  /// empty: none. Without a target they distort the path.
  std::vector<Fir> axis_shapers;
  /// Shapers along an axis (taps in whole block periods, positions as in the path) in place of the one shaper, for
  /// modes that vary with position by `mode_tables`.
  std::optional<FollowingFir> following;
  AxisModeTables mode_tables;
  double least_feed_mm_per_s = 0.0;  ///< what the controller can run: no run is slowed below it for the tolerance
  /// Share by which the shaped command may run faster along the path than programmed, > 0. The correction of the
  /// contour keeps to it; what a slower programmed feed asks is asked so early that the shaper has passed it on in
  /// time.
  double feed_excess_ratio = MotionLimits::none;
  /// Weight of the correction's second differences on half the block grid. Less of it follows the path more closely and
  /// asks for more beside the modes' frequencies, which shows where these are off: docs/concepts/contour.md.
  double contour_smoothness = 0.4;
};

/// A region's command, shaped and on the block grid, ready for fit_blocks.
struct ShapedCommand {
  std::uint32_t first_period = 0;       ///< periods of the region before this part
  Eigen::MatrixXd grid_mm;              ///< (n+1, 3) at k*T_B
  Eigen::MatrixXd middle_mm;            ///< (n, 3) half a period later
  std::vector<std::int8_t> arc_normal;  ///< (n) see fit_blocks
  std::vector<std::uint32_t> run_ends;  ///< periods, of this part, at which the command is at rest
  std::vector<std::uint32_t>
      segment_periods;  ///< per marked segment: period of the region in which its begin is reached
};

/// What a region takes at a contour tolerance.
struct PlannedTolerance {
  double duration_s = 0.0;    ///< of the shaped command, before any filter behind it
  double deviation_mm = 0.0;  ///< largest, of what shall follow the path; 0 without a target
};

/// Splits the path at forced stops, plans each run from rest to rest, samples it at half the block period, shapes it
/// with `shaper` (taps in whole block periods, common to all axes) and puts the runs behind one another. Parts of a
/// bounded number of periods, so that memory does not grow with the region.
class RegionShaper {
 public:
  /// `marked_segments`: ascending indices (up to path->size()) whose begin in time is wanted. Throws Error(argument) if
  /// the block period is not a whole multiple of the interpolation period, and as the planner and the filter do.
  RegionShaper(std::shared_ptr<const Path> path, const Fir& shaper, std::span<const std::uint32_t> marked_segments,
               ShapingOptions options);
  RegionShaper(RegionShaper&&) noexcept;
  RegionShaper& operator=(RegionShaper&&) noexcept;
  ~RegionShaper();

  /// Next part of at most `periods` periods; false once the region was given out, and `part` is then left alone.
  /// `part.segment_periods` then holds all marks of the runs that were begun.
  [[nodiscard]] bool next(ShapedCommand& part, std::uint32_t periods);
  /// To be called before the first part: parts are then given out while the search for the feed still measures them,
  /// where the region is one run, as if its first plan kept the tolerance. Where that turns out to be wrong, next()
  /// gives false and is_withdrawn() holds: all that was given out is void.
  void begin_early() noexcept;
  [[nodiscard]] bool is_withdrawn() const noexcept;
  /// Gives the region out from its begin again, with the feed that the search then finds; false, and nothing done, if
  /// no part was given out early.
  bool restart();
  /// Largest deviation in mm of what the target says shall follow the path, as far as the runs given out tell.
  [[nodiscard]] double largest_deviation_mm() const noexcept;
  /// Whether any run given out is slower than without a tolerance; without a target always.
  [[nodiscard]] bool is_slowed() const noexcept;
  /// How much of the region was given out, 0 to 1: by segments, within a run by its periods.
  [[nodiscard]] double share() const noexcept;
  /// Junctions that no speed passes within the tolerance: stops beside the forced ones.
  [[nodiscard]] std::uint32_t stops() const noexcept;

 private:
  friend std::vector<PlannedTolerance> plan_tolerances(const std::shared_ptr<const Path>& path, const Fir& shaper,
                                                       const ShapingOptions& options,
                                                       std::span<const double> tolerances_mm);

  struct State;

  std::unique_ptr<State> state_;
};

/// The time of a region at several contour tolerances, without giving it out. Each search for the feed starts from the
/// speeds of the tolerance before, so descending tolerances cost few rounds each; infinity: nothing is slowed. They
/// replace `options.tolerance.contour_tolerance_mm`. Throws as RegionShaper does.
[[nodiscard]] std::vector<PlannedTolerance> plan_tolerances(const std::shared_ptr<const Path>& path, const Fir& shaper,
                                                            const ShapingOptions& options,
                                                            std::span<const double> tolerances_mm);

/// The whole region in one part; see RegionShaper.
[[nodiscard]] ShapedCommand shape_path(const std::shared_ptr<const Path>& path, const Fir& shaper,
                                       std::span<const std::uint32_t> marked_segments, const ShapingOptions& options);

}  // namespace shapegcode
