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

// What the author of a control needs: blocks come while the machine moves, the operator turns the override and presses
// feed hold, and one set-point leaves per period. The one header to include.
//
//     using namespace shapegcode;
//     ControllerSettings settings;
//     settings.limits.law = AccelerationLaw::jerk_limited;
//     settings.limits.max_acceleration_mm_per_s2.setConstant(1000.0);
//     settings.limits.max_jerk_mm_per_s3.setConstant(50000.0);
//     settings.shaper = Fir({0, 11}, {0.516, 0.484});           // ZV of 46 Hz on a grid of 1 ms
//     MotionController control(settings);
//     control.push(make_line({0, 0, 0}, {40, 0, 0}, 100.0));     // planning thread
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
  /// By how much the axis may deviate where its speed along the path changes at once; 0: the motion comes to rest
  /// there.
  double tolerance = MotionLimits::none;
};

/// Where an axis may be, in its unit.
struct AxisTravel {
  double low = -MotionLimits::none;
  double high = MotionLimits::none;
};

/// An offset that is added to an axis while the path is run, with limits of its own, in its unit and seconds; 0: none.
struct OffsetLimits {
  double max_feed = 0.0;
  double max_acceleration = 0.0;
  double max_jerk = 0.0;
  /// Of the drive: taken up by the offset where the axis goes down; the control begins as after a motion upwards.
  double backlash = 0.0;
};

/// Shapers of a control: one for all axes, one for each, or a set followed along an axis (of X, Y, Z).
using ControllerShaper = std::variant<Fir, std::vector<Fir>, FollowingFir>;
/// Those of them that another one may be exchanged for.
using AxisShapers = std::variant<Fir, std::vector<Fir>>;

/// What a control is made of. Speeds, accelerations and jerks that are finite are kept by the set-points that leave it.
struct ControllerSettings {
  double period_s = 0.001;
  /// Of X, Y and Z, with the rules for corners. A finite jerk wants a finite acceleration. Its feed override, at most
  /// 2, is the one that the control begins with: what is planned holds for any later one. Under the constant-time law
  /// ramps are as steep as its time constant lets them be, but short ones are not stretched to it.
  MotionLimits limits;
  /// One for each axis behind X, Y and Z, at most six.
  std::vector<FollowingLimits> following;
  /// By how much rounded corners, smoothing and shaper may deviate from the path. 0: corners are exact stops; none:
  /// neighbouring corners are rounded up to the middle between them, smoothing and shaper cut off what they do.
  double contour_tolerance_mm = 0.05;
  /// Length of each of two moving averages over every axis; 0 = none, as rounded corners need none.
  double smoothing_time_s = 0.0;
  /// One that follows an axis is read in front of the smoothing. Its changes take up to a quarter of acceleration and
  /// jerk, and limit the feed where that would not be enough.
  ControllerShaper shaper = Fir({0}, {1.0});
  /// What `shaper` (number 0, one for all axes or one for each) may be exchanged for in motion, numbers 1 and up, and
  /// how long that takes: it is faded from one to the other. Limits and tolerance hold meanwhile; what the fade may
  /// need of the limits, less the longer it takes, is not the path's. Not beside a contour correction.
  std::vector<AxisShapers> other_shapers;
  double fade_time_s = 0.5;
  /// Take back, to the second order, what smoothing and shaper cut off arcs. Costs `correction_delay()` periods, and of
  /// every limit what the correction may need for itself. At a start and an exact stop it overshoots along the path, by
  /// 1 to 15 um at 1 000 to 5 000 mm/s2 with a ZV shaper of 46 Hz; the contour tolerance does not limit that.
  bool contour_correction = false;
  /// Segments that the look-ahead sees (8 at least), and those that may wait in all; the second is rounded up to a
  /// power of two, and holds the window.
  std::size_t window = 128;
  std::size_t queue = 1024;
  /// step() plans for itself when what is planned runs out: for simulations and tests, which know no clock. Otherwise
  /// another thread calls plan(), `lead_periods` ahead of the motion: a real-time control.
  bool plans_in_step = true;
  int lead_periods = 60;
  /// Of each axis, or of none. A segment that leads beyond it is not taken.
  std::vector<AxisTravel> travel;
  /// Of each axis, or of none. What it takes of the limits is not the path's any more.
  std::vector<OffsetLimits> offset;
  /// What each axis can do at the most, for emergency_stop(); none: it brakes as abort() does.
  std::vector<double> emergency_acceleration;
  /// Periods of motion that are kept for retrace(), some 150 bytes each.
  std::size_t retrace_periods = 0;
  /// With which a spindle is followed; see spindle(). Higher: a faster ripple is followed, and more noise.
  double spindle_bandwidth_hz = 20.0;
};

/// What a feed is of, where X, Y and Z move together with axes that follow.
enum class FeedOf : std::uint8_t {
  path,      ///< X, Y and Z along their path; where these do not move (1e-9 mm), the axis that moves the furthest
  all_axes,  ///< the root of the squares of all, degrees counted as mm
  dominant,  ///< that of X, Y and Z along their path and the others which moves the furthest
  time,      ///< inverse time: the segment lasts one over the feed, s or revolutions
};

/// How a segment is run, beside its geometry and its feed.
struct SegmentRules {
  FeedRate feed_rate = FeedRate::per_time;
  FeedOf feed_of = FeedOf::path;
  /// Along its path, beside the limits of the axes.
  double max_acceleration = MotionLimits::none;
  double max_jerk = MotionLimits::none;
};

/// Answer to a segment that was pushed.
enum class PushResult : std::uint8_t {
  accepted,
  queue_full,     ///< nothing was taken: push it again later
  not_connected,  ///< it does not start where the one before ended, or the sweep of an arc misses its end (1e-6 mm)
  no_length,      ///< no axis moves by more than 1e-9 mm or degrees
  no_feed,        ///< a feed that is not above zero, or not finite
  not_finite,
  wrong_axes,     ///< not as many following axes as the settings have
  aborted,        ///< after abort() nothing is taken until restart()
  flushing,       ///< between flush() and flushed() nothing is taken
  no_time,        ///< a dwell below zero, above 1e6 s, or no number
  beyond_travel,  ///< it leads out of the travel of an axis
  bad_limit,      ///< a limit of the segment that is not above zero
  not_straight,   ///< bound to the spindle, and no line
};
[[nodiscard]] const char* text_of(PushResult result) noexcept;

/// What a control does in a period.
enum class Activity : std::uint32_t {
  idle,      ///< at rest, nothing left to do
  moving,    ///< along the path, or the shaper is still giving out what it holds
  stopping,  ///< decelerating for hold(), flush() or abort()
  held,      ///< at rest after hold(), or at a stop that was pushed
  starved,   ///< coming to rest: the segments ran out before one with `stop_at_end`. At rest it is idle
  aborted,   ///< at rest after abort() or emergency_stop(); the path is gone
  jogging,   ///< away from where the path rests, or back onto it
};
[[nodiscard]] const char* text_of(Activity activity) noexcept;

/// Answer to a jog.
enum class JogResult : std::uint8_t {
  accepted,
  path_moves,  ///< the control is neither held nor flushed nor aborted, or does not rest yet
  no_axis,
  not_finite,
  no_speed,       ///< of a distance: not above zero
  beyond_travel,  ///< the distance leads out of the travel, or the axis is at its end already
  no_record,      ///< the settings keep none for retrace()
};
[[nodiscard]] const char* text_of(JogResult result) noexcept;

/// What a drive with feed-forward wants in a period: where each axis is at its end, how fast, and how it accelerates,
/// in mm or the unit of a following axis, and s. All three leave the same filters, so they belong together.
struct MotionSetPoint {
  std::array<double, max_controller_axes> position{}, velocity{}, acceleration{};
};

/// Something that belongs to a place of the path: spindle, coolant, an output. The control only says when.
struct ControllerEvent {
  std::uint32_t id = 0;
  std::uint64_t word = 0;  ///< the caller's own
};

/// A snapshot for a user interface.
struct ControllerState {
  Activity activity = Activity::idle;
  std::uint32_t line = 0;  ///< of the segment that is being run, before smoothing and shaper
  std::array<double, max_controller_axes> set_point{};  ///< last one given; mm, or the unit of a following axis
  double speed_mm_per_s = 0.0;                          ///< along the path, before smoothing and shaper
  double distance_mm = 0.0;                             ///< since the last rest
  double feed_override = 1.0;
  double rapid_override = 1.0;
  std::uint64_t segments_done = 0;  ///< run to their ends
  std::uint64_t segments_waiting = 0;
  std::uint64_t steps = 0;
  std::uint64_t starvations = 0;       ///< how often the segments ran out
  std::uint64_t late_plans = 0;        ///< how often the motion slowed down because nothing further was planned in time
  double set_point_distance_mm = 0.0;  ///< `distance_mm` and `line` of the set-point that was given, which has come
  std::uint64_t set_point_line = 0;    ///< through smoothing and shaper: `delay_periods()` later, rounded
  std::uint64_t travel_stops = 0;      ///< how often it was held because the path would have left the travel
  double spindle_speed = 0.0;          ///< revolutions per s
  double spindle_error_mm = 0.0;       ///< of a synchronous segment: the motion less what the angle asks for
  std::array<double, max_controller_axes> offset{};  ///< of the axes, before smoothing and shaper
  std::uint64_t shaper = 0;                          ///< number of the one that acts, or that is being faded to
};

/// A path that grows while it is run: look-ahead over a window of segments, motion nearly as fast as the limits of the
/// axes let it be, one set-point per period through contour correction, smoothing and shaper. One thread may push, one
/// may step, one may plan, any may call the rest. Override, hold and abort act before smoothing and shaper: what these
/// keep they keep at any instant.
class MotionController {
 public:
  /// Throws Error(argument) on settings that are none, with value and limit.
  explicit MotionController(const ControllerSettings& settings);
  ~MotionController();
  MotionController(MotionController&&) noexcept;
  MotionController& operator=(MotionController&&) noexcept;
  MotionController(const MotionController&) = delete;
  MotionController& operator=(const MotionController&) = delete;

  /// The next segment, from the planning thread: never blocks, does not allocate. `following_end`: where the following
  /// axes are at its end; they follow in proportion to the path length. A segment of no length in X, Y and Z is one of
  /// the following axes alone if they move: its length is then the largest of their distances, its feed that axis'.
  PushResult push(const Segment& segment, std::span<const double> following_end = {},
                  const SegmentRules& rules = {}) noexcept;

  /// An event behind the segment that was pushed last, from the planning thread, as a push. As many may wait as
  /// segments.
  PushResult push_event(const ControllerEvent& event) noexcept;
  /// Likewise a dwell: what leaves the control rests there for so long. A hold in it restarts it.
  PushResult push_dwell(double time_s) noexcept;
  /// Likewise a programmed stop (M00): at rest there the control is held until resume().
  PushResult push_stop() noexcept;

  /// The next set-point into `out` (axes() values), from the real-time thread: no allocation, no lock, no exception. It
  /// takes what is planned, in bounded time; with `plans_in_step` it also plans, every 8 to 32 periods.
  Activity step(std::span<double> out) noexcept;
  /// The same with velocity and acceleration. A shaper that follows an axis adds to them what its taps' changes do,
  /// which is not in there.
  Activity step(MotionSetPoint& out) noexcept;
  /// The events that the motion reached with the last step, one by one, from the same thread; false: no more. A
  /// junction that is passed is reached when its place has come through the filters (`delay_periods()`, rounded), one
  /// at which the motion rests with the period in which the set-points come to rest.
  bool next_event(ControllerEvent& event) noexcept;

  /// Plans on until enough lies ahead, from one thread, the pushing or another one; not with `plans_in_step`. Does not
  /// allocate. False: there was nothing to do, call it again after some periods.
  bool plan() noexcept;

  /// Ratio of the programmed feeds, 0 to 2; what is outside of that, or no number, is taken as the nearer end (no
  /// number: as it was). It acts on what is not planned yet: after 8 to 32 periods and the lead; 0 is a hold.
  void feed_override(double ratio) noexcept;
  /// The same of rapids, which the feed override leaves alone. One that is 0 stops a motion that it acts on.
  void rapid_override(double ratio) noexcept;
  /// Where the spindle is in this period, in revolutions that go on counting (an encoder's counts over those of a
  /// revolution); from the thread that steps, in front of every step. Feeds per revolution follow its speed in steps of
  /// .5 %, and rest where it stands; a synchronous segment begins at a whole revolution.
  void spindle(double revolutions) noexcept;
  /// Come to rest along the path, beginning after 32 periods or an eighth of the lead at the latest; resume() goes on.
  void hold() noexcept;
  void resume() noexcept;  ///< from a stop that was pushed as well
  /// Come to rest along the path and forget the rest of it; when it rests, flushed() makes it go on from there.
  void flush() noexcept;
  /// From the pushing thread, after flush(): where the motion rests (axes() values), from where on segments are taken
  /// again. False: it does not rest yet, or plan() is at work, or there was no flush(): nothing has happened.
  bool flushed(std::span<double> position) noexcept;
  /// A probe has touched, in the period of the last step: gives its set-point (axes() values), and flushes. From the
  /// thread that steps.
  void probe(std::span<double> latched) noexcept;
  /// Come to rest along the path and forget the rest of it, until restart().
  void abort() noexcept;
  /// Come to rest along the path with all that `emergency_acceleration` allows, whatever the jerk; then as abort().
  void emergency_stop() noexcept;

  /// Moves an axis by hand while the path rests: after hold(), at a stop that was pushed, after flush() until
  /// flushed(), after abort(). Any thread, but one for each axis. The limits hold; it comes to rest at the end of the
  /// travel. A speed that is given again counts from the next period; 0: to rest. resume() leads back onto the path,
  /// each axis as fast as it was jogged last, then the path goes on; flushed() and restart() begin at the new place.
  JogResult jog(int axis, double speed) noexcept;
  /// Likewise by a distance; those that are given before it ends add up.
  JogResult jog_by(int axis, double distance, double speed) noexcept;

  /// Back along the path by so many mm from where it rests, as far as it is kept, at half the speed with which it was
  /// run; less than before: forward. When a jog may; resume() leads to where the path rests, then it goes on. Any
  /// thread.
  JogResult retrace(double distance_mm) noexcept;

  /// An offset to which the axis goes within the limits of the settings' `offset`, at rest and while the path is run;
  /// shaped as the path is. From any thread. False: the axis has no such limits, or the value is not finite.
  bool offset(int axis, double value) noexcept;
  /// Where an axis may be from now on. Where the path that is planned would leave it, the control is held, with the
  /// stop that is planned. From any thread. False: there is no such axis, or `low` is above `high`.
  bool travel(int axis, const AxisTravel& travel) noexcept;

  /// Fades to one of the settings' shapers, from the next period on, or when an earlier fade or a synchronous segment
  /// ends; a synchronous segment waits for it. From any thread. False: there is no such number.
  bool exchange_shaper(std::size_t number) noexcept;

  /// At rest at a position (axes() values), the queue empty. Not while another thread pushes or steps. False, and
  /// nothing is changed: a value is not finite.
  bool restart(std::span<const double> position) noexcept;

  [[nodiscard]] ControllerState state() const noexcept;
  [[nodiscard]] int axes() const noexcept;
  /// Periods by which set-points lag behind the profile: mean delay of correction, smoothing and the shaper that was
  /// asked for last.
  [[nodiscard]] double delay_periods() const noexcept;
  /// Periods of that which are the correction's.
  [[nodiscard]] int correction_delay() const noexcept;

 private:
  class Implementation;
  std::unique_ptr<Implementation> implementation_;
};

}  // namespace shapegcode
