#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <map>
#include <memory>
#include <span>
#include <vector>

#include "shapegcode/filter.hpp"
#include "shapegcode/motion.hpp"
#include "shapegcode/path.hpp"
#include "shapegcode/planner_models.hpp"
#include "shapegcode/samples.hpp"

namespace shapegcode {

/// When a block's successor starts.
enum class BlockEnd : std::uint8_t {
  ceil,   ///< at the next interpolation period (paper 004)
  carry,  ///< at once: the remainder of a period is carried over
};

/// Time after which a block's successor starts, in periods: l / (F T_I), a whole number under `ceil` (paper 004, eq.
/// 2 and 5, and its overlap). 0 for a block without length.
[[nodiscard]] double block_periods(double length_mm, double feed_mm_per_s, double period_s,
                                   BlockEnd block_end) noexcept;

/// Number of periods rounded up, ignoring round-off.
[[nodiscard]] double whole_periods(double periods) noexcept;

/// Interpolator of a controller without look-ahead: every block runs at its feed for its whole length, the next one
/// follows at once. The acceleration filter comes after it (a moving average: block overlap). Real-time form: the work
/// of a step grows with the logarithm of the number of blocks that end within a period.
class BlockInterpolator {
 public:
  /// `override_ratio` scales every feed. Throws Error(argument) on period or ratio <= 0, or a segment without feed.
  BlockInterpolator(Segments blocks, double period_s, BlockEnd block_end, double override_ratio = 1.0);

  /// Pauses after a block, as in a buffer underrun: the set-points stay at its end, then the next block follows. One
  /// pause per interpolator; a later call replaces an earlier one. Under `ceil` whole periods, rounded up. Throws
  /// Error(argument) on a time that is negative or not finite, or a block that has ended or does not exist.
  void pause_after(std::size_t block, double seconds);
  /// Next set-point, X, Y and Z, the start first; false after the end.
  bool step(std::span<double> out) noexcept { return step_into(out, *this); }
  bool step(Vector3& position) noexcept {
    const double elapsed_s = elapsed_s_ + period_s_;
    if (!(elapsed_s < on_line_until_s_)) return step_on(position);
    elapsed_s_ = elapsed_s;
    const double along_mm = speed_mm_per_s_ * elapsed_s;
    position = along_mm >= open_.length_mm ? open_.end_mm : open_.start_mm + along_mm / open_.length_mm * travel_mm_;
    return true;
  }
  /// Skips the following set-points on the same block before `until_mm` from its start. Returns their number, and the
  /// last one in `position`.
  std::size_t pass_block(Vector3& position, double until_mm = whole_block) noexcept;
  static constexpr double whole_block = std::numeric_limits<double>::infinity();
  /// Continues from the set-point at `elapsed_s` after the start of a block, and returns it.
  Vector3 begin_on(std::size_t block, double elapsed_s) noexcept;
  /// Block of the last set-point.
  [[nodiscard]] std::size_t block() const noexcept { return block_; }
  [[nodiscard]] const Segment& on() const noexcept { return open_; }
  /// Distance of the last set-point from the start of that block.
  [[nodiscard]] double along_mm() const noexcept {
    return finished_ ? open_.length_mm : std::min(open_.length_mm, speed_mm_per_s_ * elapsed_s_);
  }
  /// Time of the last set-point since its block began.
  [[nodiscard]] double elapsed_s() const noexcept { return elapsed_s_; }
  /// Whether the last set-point belongs to a pause.
  [[nodiscard]] bool pausing() const noexcept;
  /// Duration of one block: a whole number of periods under `ceil`.
  [[nodiscard]] double block_duration_s(const Segment& segment) const noexcept;

 private:
  void open_block() noexcept;
  bool step_on(Vector3& position) noexcept;
  [[nodiscard]] Vector3 stand_on_block() noexcept;
  /// Computes sums of durations where many blocks may end within a period.
  void find_crowds();
  /// Skips a group of blocks that ends within the elapsed time; false if no such group begins here.
  bool leap(double slack) noexcept;

  Segments blocks_;
  Segment open_;  // of the blocks, the current one
  double period_s_;
  double ratio_;
  BlockEnd block_end_;
  std::size_t block_ = 0;
  // Set-points on a line are computed without checking the block's kind.
  Vector3 travel_mm_ = Vector3::Zero();
  double speed_mm_per_s_ = 0.0;
  double on_line_until_s_ = 0.0;
  double elapsed_s_ = 0.0;   // since the open block began
  double duration_s_ = 0.0;  // of the open block and a pause after it
  std::size_t paused_block_ = 0;
  double pause_s_ = 0.0;
  bool started_ = false;
  bool finished_ = false;
  // Durations of groups of 16 blocks, of 16 such groups, and so on; null if no 16 blocks end within a period. Immutable
  // and shared by copies.
  std::shared_ptr<const std::vector<std::vector<double>>> crowds_;
};

/// Sum of block durations in s.
[[nodiscard]] double blocks_duration_s(const Segments& blocks, double period_s, BlockEnd block_end,
                                       double override_ratio = 1.0);

/// Where the controller accelerates a cutting move.
enum class MotionKind : std::uint8_t {
  look_ahead,           ///< before interpolation: the speed is planned along the path
  after_interpolation,  ///< after it: each axis is filtered, and cutting blocks overlap (paper 004)
};

/// Shape of the acceleration after interpolation.
enum class FilterShape : std::uint8_t {
  linear,       ///< moving average of the time constant; with a bell time a second one after it
  exponential,  ///< geometric weights of the time constant
};

/// Path of a rapid (1401#1).
enum class RapidPath : std::uint8_t {
  linear,      ///< straight: the slowest axis determines the tangential rate
  non_linear,  ///< every axis at its own rate
};

/// How the wait for in-position is determined.
enum class InPosition : std::uint8_t {
  measured,   ///< a constant per axis; the largest of the axes that moved (paper 004, section 2.3)
  servo_lag,  ///< until the position error of a first-order servo loop is within the width (1825, 1826)
};

/// Which cuts of a program run as shaped blocks.
enum class ShapedRegions : std::uint8_t {
  marked,  ///< regions marked in the program
  all,     ///< every cut
  none,
};

/// Time in which the spindle reaches a speed, or stops from it.
struct SpindleTime {
  double rev_per_min = 0.0;
  double seconds = 0.0;
};

/// Parameters of a control that determine the cycle time, and the path deviation by acceleration/deceleration: FANUC's,
/// or another control whose planner is modelled. The numbers in the comments are FANUC parameters.
struct FanucModel {
  PlannerRules planner;  ///< kinds other than `fanuc`: look-ahead by their rules, also for shaped blocks
  /// Arcs of shaped programs are emitted as chords within this tolerance, and planned so; 0: as arcs.
  double chord_tolerance_mm = 0.0;
  double period_s = 0.001;  ///< interpolation period T_I
  BlockEnd block_end = BlockEnd::ceil;

  MotionKind motion = MotionKind::look_ahead;
  FilterShape filter_shape = FilterShape::linear;  ///< after_interpolation only (1610)
  double time_constant_s = 0.05;                   ///< after_interpolation: A (1622); linear: rounded to whole periods
  double bell_time_s = 0.0;                        ///< after_interpolation, linear: second moving average; 0: none
  /// Exponential: the weights end when less than this ratio of their sum remains (the controller stops when less than
  /// an increment remains); the length of the filter is time_constant_s * ln(1 / ratio).
  double exponential_rest = 1e-4;
  /// Look-ahead before interpolation (1783, 1735, 1737, 1660, 1772). `max_feed_mm_per_s` holds in both kinds of motion.
  MotionLimits limits;
  double look_ahead_filter_time_constant_s = 0.0;  ///< moving average after look-ahead (1769); 0: none

  Vector3 rapid_rate_mm_per_s = Vector3::Constant(400.0);   ///< 1420
  Vector3 rapid_time_constant_s = Vector3::Constant(0.15);  ///< 1620: from rest to the rate at override 1
  double rapid_bell_time_s = 0.0;                           ///< 1621; 0: none
  RapidPath rapid_path = RapidPath::linear;
  InPosition in_position = InPosition::measured;
  Vector3 in_position_s = Vector3::Zero();                 ///< measured
  Vector3 position_gain_per_s = Vector3::Constant(30.0);   ///< servo_lag (1825)
  Vector3 feed_forward_ratio = Vector3::Zero();            ///< servo_lag, 0 ... 1 (2092)
  Vector3 in_position_width_mm = Vector3::Constant(0.02);  ///< servo_lag (1826)

  ShapedRegions shaped_regions = ShapedRegions::marked;
  FilterShape shaped_filter_shape = FilterShape::linear;  ///< after shaped blocks
  double shaped_time_constant_s = 0.0;                    ///< likewise; 0: none
  double shaped_bell_time_s = 0.0;                        ///< likewise, linear: second moving average; 0: none
  BlockEnd shaped_block_end = BlockEnd::ceil;             ///< between shaped blocks

  double feed_override = 1.0;         ///< scales every programmed feed
  double rapid_override = 1.0;        ///< scales the rapid rates; the acceleration of a rapid does not change
  double program_start_s = 0.0;       ///< from the start key to the first block
  bool last_tool_in_spindle = false;  ///< at the start, from the previous run: an M06 that calls it changes nothing
  double tool_change_s = 0.0;         ///< M06
  double m_function_s = 0.0;          ///< every other M code not in `m_code_s`
  std::map<int, double> m_code_s;     ///< M codes with individual times
  std::vector<SpindleTime> spindle_start_s;  ///< from rest, by speed; in parallel with axis motion; empty: none
  std::vector<SpindleTime> spindle_stop_s;   ///< likewise to rest
  Vector3 unknown_move_s = Vector3::Zero();  ///< of a rapid whose start or end the program does not give
};

/// The same controller while shaped blocks run: block by block at their feed, without look-ahead. If look-ahead cannot
/// be switched off (planners other than FANUC's), it stays on, with arcs as they are emitted.
[[nodiscard]] FanucModel for_shaped_blocks(const FanucModel& model);

/// Whether cutting moves are planned along the path before they are interpolated.
[[nodiscard]] inline bool is_planned(const FanucModel& model) noexcept {
  return model.motion == MotionKind::look_ahead || model.planner.kind != ControllerKind::fanuc;
}

/// Throws Error(argument) on an impossible value; the message names it.
void check(const FanucModel& model);

/// Filters after interpolation in order: none, one or two (acceleration after interpolation, 1769 in look-ahead, or
/// LinuxCNC's cubic interpolation of the joints).
[[nodiscard]] std::vector<Fir> acceleration_filters(const FanucModel& model);

/// Periods that filters add to a sequence of set-points: the number of taps of their cascade (A for one moving average
/// of A periods); 0 without filters.
[[nodiscard]] int filter_periods(const std::vector<Fir>& filters) noexcept;

/// Feed of a cutting block in mm/s: programmed feed times override, no axis above its maximum feed.
[[nodiscard]] double controlled_feed_mm_per_s(const Segment& segment, const FanucModel& model) noexcept;

/// Time of a sequence of overlapping cutting blocks (paper 004, section 2.2): sum of ceil(l / (F T_I)) T_I (or of l / F
/// under `carry`) plus the length of the acceleration filters. Blocks without length take no time. Lengths in mm, feeds
/// in mm/s (no override). Throws Error(argument) on unequal sizes or a feed <= 0.
[[nodiscard]] double block_overlap_time_s(std::span<const double> lengths_mm, std::span<const double> feeds_mm_per_s,
                                          const FanucModel& model);

/// Shape of one rapid in whole interpolation periods, per axis: the distance is run at a constant rate in `travel`
/// periods and smoothed by a moving average over `ramp` and one over `bell` periods, so it takes the sum of the three.
/// A short rapid has travel = ramp.
struct RapidShape {
  std::array<int, axis_count> travel = {};
  std::array<int, axis_count> ramp = {};
  int bell = 0;
  double even_s = 0.0;         ///< time of the distance at constant rate; non-linear: of the slowest axis
  double rate_mm_per_s = 0.0;  ///< reached; linear: tangential; non-linear: of the slowest axis
};

/// Paper 004, eq. 6 to 16, with rates and accelerations per axis: linear v = min_i(1420_i L/d_i) and a =
/// min_i(1420_i/1620_i L/d_i); non-linear each axis separately. Axes without travel have 0 periods. Throws
/// Error(argument) on a rapid of more than 1e8 periods.
[[nodiscard]] RapidShape rapid_shape(const Vector3& travel_mm, const FanucModel& model);

/// Time of a rapid from rest to rest without the wait for in-position; 0 without travel.
[[nodiscard]] double rapid_time_s(const Vector3& travel_mm, const FanucModel& model);

/// Wait for in-position after a rapid. `measured`: the largest constant of an axis that moves. `servo_lag`: closed form
/// of the position error e' = (1 - a) x' - K e (gain K, feed-forward a) at the end of the command, which decays to the
/// width w in ln(e / w) / K; whole periods.
[[nodiscard]] double in_position_wait_s(const Vector3& travel_mm, const FanucModel& model);

/// The same after any command: `error_mm` is the servo lag at its end, `moved` the axes that moved.
[[nodiscard]] double in_position_wait_s(const Vector3& error_mm, const std::array<bool, axis_count>& moved,
                                        const FanucModel& model);

/// Set-points of a rapid, one per period, the start first. The number of periods is found by trial, not by the closed
/// form.
class RapidInterpolator {
 public:
  /// Throws Error(argument) on a model that `check` refuses.
  RapidInterpolator(const Vector3& start_mm, const Vector3& end_mm, const FanucModel& model);
  /// Next set-point, X, Y and Z; false after the end.
  bool step(std::span<double> out) noexcept { return step_into(out, *this); }
  bool step(Vector3& position) noexcept;
  /// Periods from rest to rest.
  [[nodiscard]] int period_count() const noexcept { return count_; }

 private:
  struct Axis {
    int travel = 0;
    std::vector<FirStream> filters;
  };
  Vector3 start_mm_;
  Vector3 travel_mm_;
  Vector3 end_mm_;
  std::array<Axis, axis_count> axes_;
  int index_ = 0;
  int count_ = 0;
};

/// All set-points of a rapid, (n, 3).
[[nodiscard]] Samples rapid_samples(const Vector3& start_mm, const Vector3& end_mm, const FanucModel& model);

}  // namespace shapegcode
