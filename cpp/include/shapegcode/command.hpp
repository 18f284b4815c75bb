#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <deque>
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

/// Kernel, at delays 0, 1, ... samples of `period_s`, from a command before shaping to what shall follow the path: the
/// shaper's own taps, or its taps followed by an axis' modes under a command that is linear between samples. A shaper
/// that cancels the modes leaves a kernel hardly longer than itself; the tail of one that does not is cut where less
/// than 1e-4 of it is left, or at four times the shaper, and the outer taps mended so that sum and mean delay
/// are the shaper's.
/// Throws Error(argument) as ModalPlant does. Source: spec 5.
[[nodiscard]] std::vector<double> contour_kernel(const Fir& shaper, std::span<const Mode> modes, double period_s,
                                                 ContourTarget target);

/// Finds, for one axis, the correction c of a command before shaping that brings the shaped command (or the plant's
/// response to it) back to the programmed path: it minimises |e + f*c|^2 + sum_k w_k (c_k - 2 c_{k-1} + c_{k-2})^2,
/// where f is the kernel from the command before shaping to what shall follow the path and e the deviation without
/// correction (spec 5).
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

  /// Delay of the kernel's last tap: samples by which a correction acts beyond its own place.
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
  bool settled_ = false;  // the last row stands for all that follow
  std::vector<double> work_;
  std::vector<double> own_factor_;  // with stiffness
};

/// Change of direction as segment `i` >= 1 of a path is entered: the length of the difference of the unit tangents.
[[nodiscard]] double junction_change(const Path& path, std::size_t i) noexcept;

/// From this `junction_change` on a junction is a corner: 5 degrees. Smoother junctions of polylines are curves.
inline constexpr double corner_change = 0.0872;

/// What follows the look-ahead of a run, on half the block grid, and how the contour is kept.
struct RunFilter {
  /// `shapers`: taps in whole block periods, one common to all axes or one for each, of one mean delay. `followed`: a
  /// set of shapers along an axis, which is used instead of it; the contour is then kept with the modes at each of its
  /// positions, by `tables`. Throws as `contour_kernel` and ContourSolver do.
  RunFilter(std::span<const Fir> shapers, ContourTarget target, const AxisModes& modes, double block_period_s,
            double smoothness, const std::optional<FollowingFir>& followed = {}, const AxisModeTables& tables = {});

  /// Half block periods by which the shaped command moves longer.
  [[nodiscard]] int shaper_rows() const noexcept { return following ? following->fir().duration_samples() : longest_; }

  std::vector<Fir> half_shapers;          ///< one per axis, taps in half block periods
  std::optional<FollowingFir> following;  ///< likewise, instead of it
  ContourTarget target;
  AxisModes modes;
  double half_period_s;
  double mean_delay_s;                                               ///< of the shaper
  std::vector<std::array<std::vector<double>, axis_count>> kernels;  ///< one per shaper that is followed
  double smoothness;

 private:
  int longest_ = 0;
};

/// What the axes may do while the contour is corrected. A stretch whose plain shaping asks for more keeps what it asks.
struct RunLimits {
  Vector3 max_speed_mm_per_s = Vector3::Constant(1e300);
  Vector3 max_acceleration_mm_per_s2 = Vector3::Constant(1e300);
};

/// Largest deviation of what follows the path, near each junction and segment of a run, in mm.
struct RunDeviation {
  std::vector<float> at_junction;  ///< [i]: while segment i is entered, within half the shaper
  std::vector<float> on_segment;   ///< further than that from every corner; negative: nowhere
  std::vector<float> near_corner;  ///< [i]: on segment i, within half the shaper of a corner
};

/// One run from rest to rest as a shaped command on half the block grid: row 2k is the border k of block periods, row
/// 2k+1 the middle of period k. With a target, the command before shaping is corrected so that the shaped command or
/// the response keeps to the path (spec 5): windows around the places where it would leave it, solved per axis, carried
/// on where they are long; memory does not grow with the run. The correction is zero at both ends of the run: nothing
/// moves before the start and nothing is added behind the stop.
///
/// The deviation that is corrected is the one across the path; along it only near corners, where time cannot be given
/// away. Where the corrected command would ask more of an axis than `limits`, the correction is made smoother there,
/// down to none.
class RunShaper {
 public:
  /// `step_s`: sampling step of the path, half a block period over a whole number. `measured`: filled while the run is
  /// read if not null.
  RunShaper(std::shared_ptr<const Path> path, std::shared_ptr<const SpeedProfile> profile, const RunFilter& filter,
            const RunLimits& limits, std::size_t steps_per_half, RunDeviation* measured = nullptr);

  /// Whole block periods of the shaped run.
  [[nodiscard]] std::uint32_t periods() const noexcept { return periods_; }
  /// Next row of the shaped command; call 2*periods()+1 times.
  void next(Vector3& position);
  /// Axis across the plane of an arc that the command follows in the period that begins at the row last given, or -1.
  [[nodiscard]] std::int8_t arc_normal();

 private:
  using Column = std::vector<double>;
  struct ArcRow {
    std::size_t row = 0;
    std::int8_t normal = -1;
  };

  void read_to(std::size_t row);
  void read_row();
  void decide_to(std::size_t row);
  void correct(std::size_t begin, std::size_t end, std::size_t accepted);
  [[nodiscard]] bool asks_too_much(std::size_t begin, std::size_t end, std::size_t axis);
  [[nodiscard]] bool active(std::size_t row) const noexcept;
  [[nodiscard]] Vector3 deviation(std::size_t row);
  [[nodiscard]] Vector3 as_block(std::size_t row) const noexcept;
  void measure(std::size_t row);
  void forget();
  [[nodiscard]] double shaped(std::size_t axis, std::ptrdiff_t row, bool corrected) const noexcept;
  /// What a column comes to behind the kernel that is valid at its entry `i`.
  [[nodiscard]] double behind_kernel(std::size_t axis, const Column& column, std::size_t i) const noexcept;
  [[nodiscard]] std::size_t index(std::size_t row) const noexcept {
    return static_cast<std::size_t>(static_cast<std::ptrdiff_t>(row) - base_);
  }

  std::shared_ptr<const Path> path_;
  const RunFilter& filter_;
  RunLimits limits_;
  RunDeviation* measured_;
  std::size_t steps_per_half_;
  Interpolator ahead_;                    // the command before shaping
  std::unique_ptr<Interpolator> target_;  // where the path should be: later by the shaper's mean delay
  std::vector<std::array<ContourSolver, axis_count>> solvers_;  // one per shaper that is followed
  std::size_t reach_ = 0;                                       // samples by which any kernel acts ahead
  std::size_t margin_ = 0;  // samples by which a window is longer than what it corrects

  std::size_t rows_in_ = 0;     // of the command before shaping, until it rests
  std::size_t rows_error_ = 0;  // until the error rests too
  std::uint32_t periods_ = 0;
  std::ptrdiff_t history_ = 0;              // rows kept behind what is given out
  std::ptrdiff_t base_ = 0;                 // row of the first entry of the columns
  std::size_t read_ = 0;                    // rows read
  std::size_t scan_ = 0;                    // rows looked at for something to correct
  std::size_t decided_ = 0;                 // rows whose correction is final
  std::size_t out_ = 0;                     // rows given out
  std::array<Column, axis_count> command_;  // before shaping
  Column place_;                            // in the set of shapers that are followed, else empty
  std::array<Column, axis_count> error_;    // to be corrected
  std::array<Column, axis_count> correction_;
  std::vector<Vector3> tangent_;        // of the target, only where deviations are measured
  std::vector<Vector3> wanted_;         // likewise, its position
  std::vector<std::uint32_t> segment_;  // likewise
  std::vector<Vector3> left_;           // likewise, the deviation
  std::unique_ptr<ModalPlant> plant_;   // likewise, of the response; null where modes move
  std::deque<ArcRow> arcs_;             // rows on arcs that are still ahead
  ArcRow seen_;
  double since_corner_ = 1e300;  // rows
  double along_ = 0.0;           // how much the place along the path counts
  std::size_t segment_before_ = 0;
  Column window_, stiffness_;
  std::vector<std::size_t> raised_;
};

/// A run with the speed at which it keeps the contour tolerance.
struct PlannedRun {
  std::shared_ptr<const Path> path;
  std::shared_ptr<const SpeedProfile> profile;
  double largest_deviation_mm = 0.0;  ///< of what follows the path, as far as the plan tells
  /// Segments before which the run must come to rest, because no speed into them keeps the tolerance. The profile is
  /// then of no use: plan the pieces between.
  std::vector<std::size_t> stops;
};

/// The highest feed at which a run keeps the contour tolerance: planned at full speed, shaped, measured, and slowed
/// only on the arcs and at the corners that leave the tolerance, until all keep it; what was slowed too far is raised
/// again. `tolerance_mm` of what the filter's target says shall
/// follow the path. A corner that would have to be crept through is a stop; nothing else is slowed below
/// `least_feed_mm_per_s`, which a controller may not run.
[[nodiscard]] PlannedRun plan_within_tolerance(std::shared_ptr<const Path> path, const MotionLimits& limits,
                                               const RunFilter& filter, std::size_t steps_per_half, double tolerance_mm,
                                               double least_feed_mm_per_s = 0.0);

/// What the axes may do while the contour is corrected.
[[nodiscard]] RunLimits run_limits(const MotionLimits& limits);

/// How a region is turned into a shaped command on the block grid.
struct ShapingOptions {
  MotionLimits limits;
  FilterTolerance tolerance;  ///< of the shaper with what follows it
  double block_period_s = 0.005;
  double interpolation_period_s = 0.001;
  double plunge_axis_angle_rad = 0.26;  ///< see forced_stops
  double plunge_corner_angle_rad = 0.78;
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
