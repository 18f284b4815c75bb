#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>
#include <variant>
#include <vector>

#include "shapegcode/filter.hpp"
#include "shapegcode/limits.hpp"
#include "shapegcode/path.hpp"

// For authors of a control: blocks arrive while the machine moves, the operator changes the override and presses feed
// hold, and each period returns one set-point. Only this header need be included.
//
//     using namespace shapegcode;
//     ControllerSettings settings;
//     settings.limits.law = AccelerationLaw::jerk_limited;
//     settings.limits.max_acceleration_mm_per_s2.setConstant(1000.0);
//     settings.limits.max_jerk_mm_per_s3.setConstant(50000.0);
//     settings.shaper = Fir({0, 11}, {0.516, 0.484});           // ZV of 46 Hz on a grid of 1 ms
//     MotionController control(settings);
//     control.push(make_line({0, 0, 0}, {40, 0, 0}, 100.0));     // pushing thread
//     control.push(make_line({40, 0, 0}, {40, 40, 0}, 100.0));
//     std::array<double, 3> set_point;
//     while (control.step(set_point) != Activity::idle) drive(set_point);   // every millisecond

namespace shapegcode {

inline constexpr std::size_t max_following_axes = 6;
inline constexpr std::size_t max_controller_axes = axis_count + max_following_axes;

/// Limits of an axis that follows the path, in its own unit (mm or degrees) and seconds.
struct FollowingLimits {
  double max_feed = MotionLimits::none;
  double max_acceleration = MotionLimits::none;
  double max_jerk = MotionLimits::none;
  /// Permitted deviation of the axis where its speed along the path changes abruptly; 0: the motion stops there.
  double tolerance = MotionLimits::none;
};

/// Travel range of an axis, in its unit.
struct AxisTravel {
  double low = -MotionLimits::none;
  double high = MotionLimits::none;
};

/// Limits of an offset that is added to an axis during motion, in its unit and seconds; 0: none.
struct OffsetLimits {
  double max_feed = 0.0;
  double max_acceleration = 0.0;
  double max_jerk = 0.0;
  /// Backlash of the drive: subtracted from the axis' position in negative motion; the control starts as after a
  /// positive motion.
  double backlash = 0.0;
};

/// Shapers of a control: one for all axes, one for each, or a set that depends on the position of an axis (X, Y or Z).
using ControllerShaper = std::variant<Fir, std::vector<Fir>, FollowingFir>;
/// Shapers that can replace the present one in motion.
using AxisShapers = std::variant<Fir, std::vector<Fir>>;

/// Settings of a control. Its set-points keep every finite limit of speed, acceleration and jerk.
struct ControllerSettings {
  double period_s = 0.001;
  /// Of X, Y and Z, with the rules for corners. A finite jerk requires a finite acceleration. Its `feed_override`, at
  /// most 2, is the initial one; plans are valid for any later one. Under the constant-time law ramps are as steep as
  /// the time constant allows, but short ramps are not lengthened to it.
  MotionLimits limits;
  /// One for each following axis after X, Y and Z, at most six.
  std::vector<FollowingLimits> following;
  /// Permitted deviation from the path by corner rounding, smoothing and shaper. 0 (only without smoothing and shaper):
  /// corners are exact stops; none: corners are rounded up to the middle between neighbours, and smoothing and shaper
  /// may deviate without limit.
  double contour_tolerance_mm = 0.05;
  /// Duration of each of two moving averages for every axis; 0 = none, as rounded corners need none.
  double smoothing_time_s = 0.0;
  /// A shaper that depends on an axis uses its position before the smoothing. Its changes use up to a quarter of
  /// acceleration and jerk, and limit the feed where that is not enough.
  ControllerShaper shaper = Fir({0}, {1.0});
  /// Shapers that can replace `shaper` (number 0, one for all axes or one for each) in motion, numbers 1 and up, and
  /// the time of the cross-fade. Limits and tolerance are kept meanwhile; the path's limits are reduced by what the
  /// fade may need, which is less the longer it takes. Not with a contour correction or a shaper that depends on an
  /// axis.
  std::vector<AxisShapers> other_shapers;
  double fade_time_s = 0.5;
  /// Compensate, to the second order, the radius error of arcs caused by smoothing and shaper. Costs a delay of
  /// `correction_delay()` periods, and reduces every limit by what the correction may need. At a start and an exact
  /// stop it overshoots along the path, by 1 to 15 um at 1 000 to 5 000 mm/s2 with a ZV shaper of 46 Hz; the contour
  /// tolerance does not limit that.
  bool contour_correction = false;
  /// Segments in the look-ahead window (8 at least), and in the whole queue; the queue is rounded up to a power of two
  /// and includes the window.
  std::size_t window = 128;
  std::size_t queue = 1024;
  /// True: step() also plans, when the planned motion runs out; for simulations and tests, not in real time. False:
  /// another thread calls plan(), `lead_periods` ahead of the motion; for a real-time control.
  bool plans_in_step = true;
  int lead_periods = 60;
  /// Of each axis, or empty. A segment that leads beyond it is not accepted.
  std::vector<AxisTravel> travel;
  /// Of each axis, or empty. The limits of the path are reduced by them. Not with a shaper that depends on an axis.
  std::vector<OffsetLimits> offset;
  /// Acceleration of each axis for emergency_stop(), at least its maximum; empty: it decelerates as abort() does.
  std::vector<double> emergency_acceleration;
  /// Periods of motion stored for retrace(), some 150 bytes each.
  std::size_t retrace_periods = 0;
  /// Bandwidth for following a spindle; see spindle(). A higher one follows faster ripple, but also more noise.
  double spindle_bandwidth_hz = 20.0;
};

/// To which motion a feed refers if X, Y and Z move together with following axes.
enum class FeedOf : std::uint8_t {
  path,      ///< X, Y and Z along their path; if these do not move (1e-9 mm), the axis with the longest travel
  all_axes,  ///< the root of the sum of squares of all axes, degrees counted as mm
  dominant,  ///< X, Y and Z along their path, or the following axis with a longer travel
  time,      ///< inverse time: the segment lasts one over the feed, s or revolutions
};

/// Rules for running a segment, besides its geometry and its feed.
struct SegmentRules {
  FeedRate feed_rate = FeedRate::per_time;
  FeedOf feed_of = FeedOf::path;
  /// Along its path, besides the limits of the axes.
  double max_acceleration = MotionLimits::none;
  double max_jerk = MotionLimits::none;
};

/// Result of pushing a segment.
enum class PushResult : std::uint8_t {
  accepted,
  queue_full,     ///< not accepted: push it again later
  not_connected,  ///< it does not start where the one before ended, or the sweep of an arc misses its end (1e-6 mm)
  no_length,      ///< no axis moves by more than 1e-9 mm or degrees
  no_feed,        ///< a feed that is not above zero, or not finite
  not_finite,
  wrong_axes,     ///< not as many following axes as the settings have
  aborted,        ///< after abort() nothing is accepted until restart()
  flushing,       ///< between flush() and flushed() nothing is accepted
  no_time,        ///< a dwell below zero, above 1e6 s, or not a number
  beyond_travel,  ///< it leads out of the travel of an axis
  bad_limit,      ///< a limit of the segment that is not above zero
  not_straight,   ///< synchronous with the spindle, but not a line
};
[[nodiscard]] const char* text_of(PushResult result) noexcept;

/// What a control does in a period.
enum class Activity : std::uint32_t {
  idle,      ///< at rest, nothing left to do
  moving,    ///< along the path, or the shaper's output is not yet at rest
  stopping,  ///< decelerating for hold(), flush() or abort()
  held,      ///< at rest after hold(), or at a programmed stop
  starved,   ///< decelerating: the queue ran empty, its last segment has no `stop_at_end`. Idle once at rest
  aborted,   ///< at rest after abort() or emergency_stop(); the path is discarded
  jogging,   ///< an axis moves away from the position where the path rests, or back to it
};
[[nodiscard]] const char* text_of(Activity activity) noexcept;

/// Result of a jog.
enum class JogResult : std::uint8_t {
  accepted,
  path_moves,  ///< the control is neither held nor flushed nor aborted, or not yet at rest
  no_axis,
  not_finite,     ///< or a distance of retrace() below zero
  no_speed,       ///< of a distance: not above zero
  beyond_travel,  ///< the distance leads out of the travel, or the axis is at its end already
  no_record,      ///< the settings store no periods for retrace()
};
[[nodiscard]] const char* text_of(JogResult result) noexcept;

/// Input of a drive with feed-forward: position, velocity and acceleration of each axis at the end of a period, in mm
/// or the unit of a following axis, and s. All three pass through the same filters and are consistent.
struct MotionSetPoint {
  std::array<double, max_controller_axes> position{}, velocity{}, acceleration{};
};

/// An event at a position of the path: spindle, coolant, an output. The control only reports when it is reached.
struct ControllerEvent {
  std::uint32_t id = 0;
  std::uint64_t word = 0;  ///< for the caller's use
};

/// A snapshot for a user interface.
struct ControllerState {
  Activity activity = Activity::idle;
  std::uint32_t line = 0;                               ///< of the present segment, before smoothing and shaper
  std::array<double, max_controller_axes> set_point{};  ///< the last one; mm, or the unit of a following axis
  double speed_mm_per_s = 0.0;                          ///< along the path, before smoothing and shaper
  double distance_mm = 0.0;                             ///< since the last rest
  double feed_override = 1.0;
  double rapid_override = 1.0;
  std::uint64_t segments_done = 0;  ///< run to their ends
  std::uint64_t segments_waiting = 0;
  std::uint64_t steps = 0;
  std::uint64_t starvations = 0;       ///< how often the queue ran empty
  std::uint64_t late_plans = 0;        ///< how often the motion slowed down because no section was planned in time
  double set_point_distance_mm = 0.0;  ///< `distance_mm` at the last set-point, which lags by `delay_periods()`
  std::uint64_t set_point_line = 0;    ///< `line` at the last set-point, likewise
  std::uint64_t travel_stops = 0;      ///< how often the control was held because the path would have left the travel
  double spindle_speed = 0.0;          ///< revolutions per s
  double spindle_error_mm = 0.0;       ///< of a synchronous segment: the motion less that required by the spindle angle
  std::array<double, max_controller_axes> offset{};  ///< of the axes, before smoothing and shaper
  std::uint64_t shaper = 0;                          ///< number of the active one, or of the one being faded to
};

/// Runs a path that grows during motion: look-ahead over a window of segments, motion nearly as fast as the limits of
/// the axes allow, one set-point per period through contour correction, smoothing and shaper. One thread may push, one
/// may step, one may plan, any may call the rest unless stated otherwise. Override, hold and abort act before smoothing
/// and shaper, which therefore always keep their effect.
class MotionController {
 public:
  /// Throws Error(argument) on invalid settings, with value and limit.
  explicit MotionController(const ControllerSettings& settings);
  ~MotionController();
  MotionController(MotionController&&) noexcept;
  MotionController& operator=(MotionController&&) noexcept;
  MotionController(const MotionController&) = delete;
  MotionController& operator=(const MotionController&) = delete;

  /// Appends a segment, from the pushing thread: never blocks, does not allocate. `following_end`: positions of the
  /// following axes at its end; they move in proportion to the path length. If only following axes move, the length of
  /// the segment is the largest of their distances, and the feed is that axis'.
  PushResult push(const Segment& segment, std::span<const double> following_end = {},
                  const SegmentRules& rules = {}) noexcept;

  /// Appends an event after the segment pushed last, from the pushing thread. As many events may wait as segments.
  PushResult push_event(const ControllerEvent& event) noexcept;
  /// Likewise a dwell: the set-points rest there for this time. A hold during the dwell restarts it.
  PushResult push_dwell(double time_s) noexcept;
  /// Likewise a programmed stop (M00): the control comes to rest there and is held until resume().
  PushResult push_stop() noexcept;

  /// Writes the next set-point into `out` (axes() values), from the real-time thread: no allocation, no lock, no
  /// exception. It reads the planned motion in bounded time; with `plans_in_step` it also plans, every 8 to 32 periods.
  Activity step(std::span<double> out) noexcept;
  /// The same with velocity and acceleration. They do not include the effect of changing taps of a shaper that depends
  /// on an axis.
  Activity step(MotionSetPoint& out) noexcept;
  /// Returns the events reached with the last step, one by one, from the same thread; false: no more. A junction passed
  /// in motion is reached when its position has come through the filters (`delay_periods()`, rounded); a junction at
  /// which the motion stops, when the set-points come to rest.
  bool next_event(ControllerEvent& event) noexcept;

  /// Plans until enough motion lies ahead, from one thread, the pushing or another one; not with `plans_in_step`. Does
  /// not allocate. False: there was nothing to do, call it again after some periods.
  bool plan() noexcept;

  /// Sets the feed override, a ratio of 0 to 2; a value outside is limited to this range, NaN changes nothing. It acts
  /// on motion not yet planned: after 8 to 32 periods and the lead; 0 is a hold.
  void feed_override(double ratio) noexcept;
  /// The same for rapids, on which the feed override has no effect. 0 stops a rapid.
  void rapid_override(double ratio) noexcept;
  /// Spindle position in this period, in continuously counted revolutions (encoder counts over counts per revolution);
  /// from the stepping thread, before every step. Feeds per revolution follow its speed in steps of 0.5 % and stop when
  /// it stops; a synchronous segment begins at a whole revolution.
  void spindle(double revolutions) noexcept;
  /// Decelerates to rest along the path, beginning after 32 periods or an eighth of the lead at the latest; resume()
  /// continues.
  void hold() noexcept;
  void resume() noexcept;  ///< also from a programmed stop
  /// Decelerates to rest along the path and discards the rest of it; at rest, flushed() lets new segments start there.
  void flush() noexcept;
  /// Completes a flush(), from the pushing thread: writes the position of rest (axes() values), from which segments are
  /// accepted again. False, and nothing is changed: it is not yet at rest, or plan() is running, or there was no
  /// flush().
  bool flushed(std::span<double> position) noexcept;
  /// Reports a probe contact in the period of the last step: writes its set-point (axes() values), and flushes. From
  /// the stepping thread.
  void probe(std::span<double> latched) noexcept;
  /// Decelerates to rest along the path and discards the rest of it; nothing is accepted until restart().
  void abort() noexcept;
  /// Decelerates to rest along the path with `emergency_acceleration`, without a jerk limit; then as abort().
  void emergency_stop() noexcept;

  /// Jogs an axis while the path rests: after hold(), at a programmed stop, after flush() until flushed(), after
  /// abort(). From any thread, but one thread for each axis. The limits are kept; the axis stops at the end of its
  /// travel. A new speed acts from the next period; 0: stop. resume() first leads back to the path, each axis at its
  /// last jog speed, then continues it; flushed() and restart() begin at the new position.
  JogResult jog(int axis, double speed) noexcept;
  /// Likewise by a distance; further distances before its end are added.
  JogResult jog_by(int axis, double distance, double speed) noexcept;

  /// Moves back along the path by this distance from its position of rest, as far as periods are stored, at half the
  /// original speed; a smaller distance than before: forward. Allowed when a jog is; resume() returns to the position
  /// of rest, then continues. Any thread.
  JogResult retrace(double distance_mm) noexcept;

  /// Sets an offset, which the axis approaches within the limits of the settings' `offset`, at rest and in motion; it
  /// is shaped like the path. From any thread. False: the axis has no such limits, or the value is not finite.
  bool offset(int axis, double value) noexcept;
  /// Sets the travel range of an axis. If the path to be run next would leave it, the control is held and stops where
  /// the motion already planned ends. From any thread. False: there is no such axis, or `low` is above `high`.
  bool travel(int axis, const AxisTravel& travel) noexcept;

  /// Fades to one of the settings' shapers, from the next period on or after an earlier fade or a synchronous segment;
  /// a synchronous segment waits for the fade. From any thread. False: there is no such number.
  bool exchange_shaper(std::size_t number) noexcept;

  /// Sets the control at rest at a position (axes() values), with an empty queue. Not while another thread pushes,
  /// plans or steps. False, and nothing is changed: a value is not finite.
  bool restart(std::span<const double> position) noexcept;

  [[nodiscard]] ControllerState state() const noexcept;
  [[nodiscard]] int axes() const noexcept;
  /// Delay of the set-points behind the profile in periods: mean delay of correction, smoothing and the shaper
  /// requested last.
  [[nodiscard]] double delay_periods() const noexcept;
  /// The part of it caused by the correction, in periods.
  [[nodiscard]] int correction_delay() const noexcept;

 private:
  class Implementation;
  std::unique_ptr<Implementation> implementation_;
};

}  // namespace shapegcode
