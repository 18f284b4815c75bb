#include "motion/controller.hpp"

#include <fmt/format.h>
#include <pybind11/eigen.h>
#include <pybind11/stl.h>

#include <cstddef>
#include <optional>
#include <string>
#include <utility>
#include <variant>
#include <vector>

#include "arrays.hpp"
#include "register.hpp"
#include "shapegcode/controller.hpp"
#include "shapegcode/filter.hpp"
#include "shapegcode/motion.hpp"
#include "shapegcode/path.hpp"
#include "shapegcode/shaper.hpp"

namespace py = pybind11;

namespace shapegcode::bindings {
namespace {

using AxisLimit = std::optional<PerAxis>;
using AxisShaper = std::variant<Shaper, Fir, Mode>;
using AnyAxisShaper = std::variant<Shaper, Fir, Mode, std::vector<AxisShaper>>;
using AnyShaper = std::optional<std::variant<Shaper, Fir, Mode, std::vector<AxisShaper>, FollowingFir>>;

void limit_axes(Vector3& limits, const AxisLimit& given) {
  if (given) limits = each_axis(*given);
}

Fir filter_of(const Shaper& design, double period_s) { return to_fir(design, period_s); }

Fir filter_of(const Mode& mode, double period_s) { return to_fir(zv_on_grid(mode, period_s), period_s); }

Fir filter_of(const Fir& fir, double /*period_s*/) { return fir; }

ControllerShaper filter_of(const FollowingFir& following, double /*period_s*/) { return following; }

std::vector<Fir> filter_of(const std::vector<AxisShaper>& given, double period_s) {
  std::vector<Fir> each;
  for (const AxisShaper& one : given) {
    each.push_back(std::visit([period_s](const auto& shaper) { return filter_of(shaper, period_s); }, one));
  }
  return each;
}

ControllerShaper shaper_of(const AnyShaper& given, double period_s) {
  if (!given) return ControllerSettings{}.shaper;
  return std::visit([period_s](const auto& shaper) -> ControllerShaper { return filter_of(shaper, period_s); }, *given);
}

AxisShapers shaper_of(const AnyAxisShaper& given, double period_s) {
  return std::visit([period_s](const auto& shaper) -> AxisShapers { return filter_of(shaper, period_s); }, given);
}

/// No switch goes beyond 254 %: a larger number is meant in percent.
double checked_override(double ratio) {
  if (ratio > 2.54) {
    throw Error(ErrorKind::argument, fmt::format("override {:.6g}: a ratio of at most 2.54 (0.5 is 50 %)", ratio));
  }
  return ratio;
}

// What Python names one by one.
PyController make_controller(double period_s, const std::optional<MotionLimits>& limits, const AxisLimit& max_feed,
                             const AxisLimit& max_acceleration, const AxisLimit& max_jerk,
                             std::vector<FollowingLimits> following, double contour_tolerance_mm,
                             double smoothing_time_s, const AnyShaper& shaper, bool contour_correction,
                             py::ssize_t window, py::ssize_t queue, std::optional<int> lead_periods,
                             const std::vector<std::pair<double, double>>& travel, std::vector<OffsetLimits> offset,
                             std::vector<double> emergency_acceleration, double spindle_bandwidth_hz,
                             py::ssize_t retrace_periods, const std::vector<AnyAxisShaper>& other_shapers,
                             double fade_time_s) {
  ControllerSettings settings;
  settings.period_s = period_s;
  if (limits) {
    settings.limits = *limits;
  } else if (max_acceleration) {
    settings.limits.law = AccelerationLaw::jerk_limited;
  }
  limit_axes(settings.limits.max_feed_mm_per_s, max_feed);
  limit_axes(settings.limits.max_acceleration_mm_per_s2, max_acceleration);
  limit_axes(settings.limits.max_jerk_mm_per_s3, max_jerk);
  settings.following = std::move(following);
  settings.contour_tolerance_mm = contour_tolerance_mm;
  settings.smoothing_time_s = smoothing_time_s;
  settings.shaper = shaper_of(shaper, period_s);
  settings.contour_correction = contour_correction;
  settings.window = count_of(window, "window");
  settings.queue = count_of(queue, "queue");
  settings.plans_in_step = !lead_periods.has_value();
  settings.lead_periods = lead_periods.value_or(settings.lead_periods);
  for (const auto& [low, high] : travel) settings.travel.push_back({low, high});
  settings.offset = std::move(offset);
  settings.emergency_acceleration = std::move(emergency_acceleration);
  settings.spindle_bandwidth_hz = spindle_bandwidth_hz;
  for (const AnyAxisShaper& other : other_shapers) settings.other_shapers.push_back(shaper_of(other, period_s));
  settings.fade_time_s = fade_time_s;
  settings.retrace_periods = count_of(retrace_periods, "retrace_periods");
  return PyController(settings);
}

std::string shown(const py::handle& value) { return py::repr(value).cast<std::string>(); }

std::string shown(double value) { return shown(py::float_(value)); }

py::array_t<double> axis_values(const PyState& self, const std::array<double, max_controller_axes>& values) {
  return py::array_t<double>(static_cast<py::ssize_t>(self.axes), values.data());
}

py::array_t<double> set_point_of(const PyState& self) { return axis_values(self, self.state.set_point); }

void register_answers(py::module_& module) {
  py::enum_<PushResult>(module, "PushResult", "Result of pushing a segment to a MotionController.")
      .value("accepted", PushResult::accepted, "It is in the queue.")
      .value("queue_full", PushResult::queue_full, "It was not accepted: push it again later.")
      .value("not_connected", PushResult::not_connected,
             "It does not start where the one before ended, or an arc misses its end (1e-6 mm).")
      .value("no_length", PushResult::no_length, "It moves no axis by more than 1e-9 mm or degrees.")
      .value("no_feed", PushResult::no_feed, "A feed that is not above zero, or not finite.")
      .value("not_finite", PushResult::not_finite, "A position that is not finite.")
      .value("wrong_axes", PushResult::wrong_axes, "Not as many following axes as the control has.")
      .value("aborted", PushResult::aborted, "Nothing is accepted between abort() and restart().")
      .value("flushing", PushResult::flushing, "Nothing is accepted between flush() and flushed().")
      .value("no_time", PushResult::no_time, "A dwell below zero, above 1e6 s, or not a number.")
      .value("beyond_travel", PushResult::beyond_travel, "It leads out of the travel of an axis.")
      .value("bad_limit", PushResult::bad_limit, "A limit of the segment that is not above zero.")
      .value("not_straight", PushResult::not_straight, "Synchronous with the spindle, but not a line.");

  py::enum_<JogResult>(module, "JogResult", "Result of a jog of a MotionController.")
      .value("accepted", JogResult::accepted, "The axis moves.")
      .value("path_moves", JogResult::path_moves,
             "The control is neither held nor flushed nor aborted, or not yet at rest.")
      .value("no_axis", JogResult::no_axis, "There is no such axis.")
      .value("not_finite", JogResult::not_finite, "A number that is not finite, or a distance of retrace() below zero.")
      .value("no_speed", JogResult::no_speed, "The speed of a jog by a distance is not above zero.")
      .value("beyond_travel", JogResult::beyond_travel,
             "The distance leads out of the travel, or the axis is at its end already.")
      .value("no_record", JogResult::no_record, "No periods are stored for retrace().");

  py::enum_<FeedRate>(module, "FeedRate", "Unit of a programmed feed, and the override that applies.")
      .value("per_time", FeedRate::per_time, "Per s; the feed override.")
      .value("rapid", FeedRate::rapid, "Per s; the rapid override.")
      .value("per_revolution", FeedRate::per_revolution, "Per revolution of the spindle; the feed override.")
      .value("synchronous", FeedRate::synchronous,
             "Likewise, synchronous with the spindle angle from rest to rest; no override.");

  py::enum_<FeedOf>(module, "FeedOf", "To which motion a feed refers if X, Y and Z move together with following axes.")
      .value("path", FeedOf::path,
             "X, Y and Z along their path; if these do not move (1e-9 mm), the axis with the longest travel.")
      .value("all_axes", FeedOf::all_axes, "The root of the sum of squares of all axes, degrees counted as mm.")
      .value("dominant", FeedOf::dominant, "X, Y and Z along their path, or the following axis with a longer travel.")
      .value("time", FeedOf::time, "Inverse time: the segment lasts one over the feed, s or revolutions.");

  py::class_<SegmentRules>(module, "SegmentRules",
                           R"(Rules for running a segment, besides its geometry and its feed. Immutable.

Args:
    feed_rate: Unit of its feed, and the override that applies.
    feed_of: Motion to which its feed refers.
    max_acceleration: Along its path, besides the limits of the axes, mm/s^2.
    max_jerk: Likewise, mm/s^3.)")
      .def(py::init([](FeedRate feed_rate, FeedOf feed_of, double max_acceleration, double max_jerk) {
             return SegmentRules{feed_rate, feed_of, max_acceleration, max_jerk};
           }),
           py::kw_only(), py::arg("feed_rate") = FeedRate::per_time, py::arg("feed_of") = FeedOf::path,
           py::arg("max_acceleration") = MotionLimits::none, py::arg("max_jerk") = MotionLimits::none,
           "Values are checked by the control that uses them.")
      .def_readonly("feed_rate", &SegmentRules::feed_rate, "Unit of its feed, and the override that applies.")
      .def_readonly("feed_of", &SegmentRules::feed_of, "Motion to which its feed refers.")
      .def_readonly("max_acceleration", &SegmentRules::max_acceleration, "mm/s^2.")
      .def_readonly("max_jerk", &SegmentRules::max_jerk, "mm/s^3.")
      .def("__repr__", [](const SegmentRules& self) {
        return "SegmentRules(feed_rate=" + shown(py::cast(self.feed_rate)) +
               ", feed_of=" + shown(py::cast(self.feed_of)) + ", max_acceleration=" + shown(self.max_acceleration) +
               ", max_jerk=" + shown(self.max_jerk) + ")";
      });

  py::class_<OffsetLimits>(module, "OffsetLimits",
                           R"(Limits of an offset that is added to an axis during motion. Immutable.

Args:
    max_feed: Highest speed in the axis' unit (mm or degrees) per s; 0: no offset.
    max_acceleration: Likewise per s^2.
    max_jerk: Likewise per s^3.
    backlash: Backlash of the drive in the axis' unit, subtracted from its position in negative motion; the control
        starts as after positive motion.)")
      .def(py::init([](double max_feed, double max_acceleration, double max_jerk, double backlash) {
             return OffsetLimits{max_feed, max_acceleration, max_jerk, backlash};
           }),
           py::kw_only(), py::arg("max_feed") = 0.0, py::arg("max_acceleration") = 0.0, py::arg("max_jerk") = 0.0,
           py::arg("backlash") = 0.0, "Values are checked by the control that uses them.")
      .def_readonly("max_feed", &OffsetLimits::max_feed, "Unit per s.")
      .def_readonly("max_acceleration", &OffsetLimits::max_acceleration, "Unit per s^2.")
      .def_readonly("max_jerk", &OffsetLimits::max_jerk, "Unit per s^3.")
      .def_readonly("backlash", &OffsetLimits::backlash, "Unit.")
      .def("__repr__", [](const OffsetLimits& self) {
        return "OffsetLimits(max_feed=" + shown(self.max_feed) + ", max_acceleration=" + shown(self.max_acceleration) +
               ", max_jerk=" + shown(self.max_jerk) + ", backlash=" + shown(self.backlash) + ")";
      });

  py::enum_<Activity>(module, "Activity", "What a MotionController does in a period.")
      .value("idle", Activity::idle, "At rest, nothing left to do.")
      .value("moving", Activity::moving, "Along the path, or the shaper's output is not yet at rest.")
      .value("stopping", Activity::stopping, "Decelerating for hold(), flush() or abort().")
      .value("held", Activity::held, "At rest after hold(), or at a programmed stop.")
      .value("starved", Activity::starved,
             "Decelerating: the queue ran empty, and its last segment has no `stop_at_end`. Idle once at rest.")
      .value("aborted", Activity::aborted, "At rest after abort() or emergency_stop(); the path is discarded.")
      .value("jogging", Activity::jogging, "An axis moves away from the position where the path rests, or back to it.");

  py::class_<FollowingLimits>(module, "FollowingLimits", R"(Limits of an axis that follows the path. Immutable.

Args:
    max_feed: Highest speed in its own unit (mm or degrees) per s.
    max_acceleration: Likewise per s^2.
    max_jerk: Likewise per s^3.
    tolerance: Permitted deviation where its speed along the path changes abruptly, in its unit; 0: the motion stops
        there.)")
      .def(py::init([](double max_feed, double max_acceleration, double max_jerk, double tolerance) {
             return FollowingLimits{max_feed, max_acceleration, max_jerk, tolerance};
           }),
           py::kw_only(), py::arg("max_feed") = MotionLimits::none, py::arg("max_acceleration") = MotionLimits::none,
           py::arg("max_jerk") = MotionLimits::none, py::arg("tolerance") = MotionLimits::none,
           "Values are checked by the control that uses them.")
      .def_readonly("max_feed", &FollowingLimits::max_feed, "Unit per s.")
      .def_readonly("max_acceleration", &FollowingLimits::max_acceleration, "Unit per s^2.")
      .def_readonly("max_jerk", &FollowingLimits::max_jerk, "Unit per s^3.")
      .def_readonly("tolerance", &FollowingLimits::tolerance, "Unit.")
      .def("__repr__", [](const FollowingLimits& self) {
        return "FollowingLimits(max_feed=" + shown(self.max_feed) +
               ", max_acceleration=" + shown(self.max_acceleration) + ", max_jerk=" + shown(self.max_jerk) +
               ", tolerance=" + shown(self.tolerance) + ")";
      });
}

void register_state(py::module_& module) {
  py::class_<PyEvent>(module, "ControllerEvent", "An event at a position of the path. Immutable.")
      .def_property_readonly(
          "id", [](const PyEvent& self) { return self.event.id; }, "Identifier of the caller, as it was pushed.")
      .def_property_readonly(
          "word", [](const PyEvent& self) { return self.event.word; }, "Data of the caller, as they were pushed.")
      .def_property_readonly(
          "step", [](const PyEvent& self) { return self.step; }, "The step with which it was reached, from 1.")
      .def("__repr__", [](const PyEvent& self) {
        return "ControllerEvent(id=" + std::to_string(self.event.id) + ", word=" + std::to_string(self.event.word) +
               ", step=" + std::to_string(self.step) + ")";
      });
  py::class_<PyState>(module, "ControllerState", "A snapshot of a MotionController. Immutable.")
      .def_property_readonly(
          "activity", [](const PyState& self) { return self.state.activity; }, "What the control does.")
      .def_property_readonly("set_point", &set_point_of, "Last set-point, (n_axes,), mm or the axis' unit.")
      .def_property_readonly(
          "speed_mm_per_s", [](const PyState& self) { return self.state.speed_mm_per_s; },
          "Speed along the path, before smoothing and shaper.")
      .def_property_readonly(
          "distance_mm", [](const PyState& self) { return self.state.distance_mm; }, "Distance since the last rest.")
      .def_property_readonly(
          "feed_override", [](const PyState& self) { return self.state.feed_override; },
          "Ratio of the programmed feeds.")
      .def_property_readonly(
          "line", [](const PyState& self) { return self.state.line; }, "Line of the present segment.")
      .def_property_readonly(
          "segments_done", [](const PyState& self) { return self.state.segments_done; }, "Segments run to their ends.")
      .def_property_readonly(
          "segments_waiting", [](const PyState& self) { return self.state.segments_waiting; },
          "Number of segments pushed and not yet run to their ends.")
      .def_property_readonly(
          "steps", [](const PyState& self) { return self.state.steps; }, "Number of set-points so far.")
      .def_property_readonly(
          "starvations", [](const PyState& self) { return self.state.starvations; }, "How often the queue ran empty.")
      .def_property_readonly(
          "late_plans", [](const PyState& self) { return self.state.late_plans; },
          "How often the motion slowed down because no section was planned in time.")
      .def_property_readonly(
          "set_point_distance_mm", [](const PyState& self) { return self.state.set_point_distance_mm; },
          "`distance_mm` at the last set-point, which correction, smoothing and shaper delay by `delay_periods`, "
          "rounded.")
      .def_property_readonly(
          "set_point_line", [](const PyState& self) { return self.state.set_point_line; }, "`line` at that set-point.")
      .def_property_readonly(
          "travel_stops", [](const PyState& self) { return self.state.travel_stops; },
          "How often the control was held because the path would have left the travel.")
      .def_property_readonly(
          "spindle_speed", [](const PyState& self) { return self.state.spindle_speed; }, "Revolutions per s.")
      .def_property_readonly(
          "spindle_error_mm", [](const PyState& self) { return self.state.spindle_error_mm; },
          "Of a synchronous segment: the motion less that required by the spindle angle.")
      .def_property_readonly(
          "offset", [](const PyState& self) { return axis_values(self, self.state.offset); },
          "Offset of each axis before smoothing and shaper, (n_axes,), mm or the axis' unit.")
      .def_property_readonly(
          "rapid_override", [](const PyState& self) { return self.state.rapid_override; }, "Ratio of the rapid rates.")
      .def_property_readonly(
          "shaper", [](const PyState& self) { return self.state.shaper; },
          "Number of the active shaper, or of the one being faded to.")
      .def("__repr__", [](const PyState& self) {
        const ControllerState& state = self.state;
        return "ControllerState(activity=" + std::string(text_of(state.activity)) +
               ", set_point=" + shown(set_point_of(self).attr("tolist")()) +
               ", speed_mm_per_s=" + shown(state.speed_mm_per_s) + ", distance_mm=" + shown(state.distance_mm) +
               ", feed_override=" + shown(state.feed_override) + ", line=" + std::to_string(state.line) +
               ", segments_done=" + std::to_string(state.segments_done) +
               ", segments_waiting=" + std::to_string(state.segments_waiting) +
               ", steps=" + std::to_string(state.steps) + ", starvations=" + std::to_string(state.starvations) +
               ", late_plans=" + std::to_string(state.late_plans) +
               ", set_point_distance_mm=" + shown(state.set_point_distance_mm) +
               ", set_point_line=" + std::to_string(state.set_point_line) +
               ", travel_stops=" + std::to_string(state.travel_stops) +
               ", spindle_speed=" + shown(state.spindle_speed) + ", spindle_error_mm=" + shown(state.spindle_error_mm) +
               ", offset=" + shown(axis_values(self, state.offset).attr("tolist")()) +
               ", rapid_override=" + shown(state.rapid_override) + ", shaper=" + std::to_string(state.shaper) + ")";
      });
}

constexpr const char* controller_doc =
    R"(Runs a path that grows during motion: what a control does between blocks and drives.

Look-ahead over a window of segments, junctions rounded within the tolerance, motion nearly as fast as the limits of the
axes allow, one set-point per period through contour correction, smoothing and shaper. The set-points keep every finite
limit. One thread may push and call flushed(), one may step, one may plan, any may call the rest except restart();
step(), run() and plan() release the global interpreter lock. The real-time form is the C++ class of the same name.

Args:
    period_s: Time between set-points in s.
    limits: Limits, with the rules for corners. None: only the next three, under the jerk-limited law if there is an
        acceleration.
    max_feed_mm_per_s: Of X, Y and Z, shape (3,), or one number for all; instead of that in `limits`.
    max_acceleration_mm_per_s2: Likewise.
    max_jerk_mm_per_s3: Likewise; requires an acceleration.
    following: Limits of the axes that follow the path, at most six.
    contour_tolerance_mm: Permitted deviation from the path by rounded corners, smoothing and shaper. 0 (only without
        smoothing and shaper): corners are exact stops; inf: corners are rounded up to the middle between neighbours.
    smoothing_time_s: Duration of each of two moving averages of every axis in s; 0: none.
    shaper: A Shaper on the grid of the period, a Fir, or a Mode (for its ZV on the grid) for all axes; a list with one
        of these for each axis; or a FollowingFir. None: no shaper.
    contour_correction: Compensate, to the second order, the radius error of arcs caused by smoothing and shaper.
    window: Segments that the look-ahead sees, 8 at least.
    queue: Segments in the whole queue, including the window; rounded up to a power of two.
    lead_periods: Periods by which plan(), called by another thread, is ahead of the motion. None: step() plans when the
        planned motion runs out.
    travel: Travel range of each axis, (low, high); empty: no limits.
    offset: Limits of the offset of each axis, by which the limits of the path are reduced; empty: no offset. Not with
        a FollowingFir.
    emergency_acceleration: Acceleration of each axis for emergency_stop(), at least its maximum; empty: it decelerates
        as abort() does.
    spindle_bandwidth_hz: Bandwidth for following a spindle in Hz.
    retrace_periods: Periods of motion stored for retrace().
    other_shapers: Shapers that can replace `shaper` (number 0) in motion, numbers 1 and up: each one for all axes, or a
        list with one for each. Not with a FollowingFir or a contour correction.
    fade_time_s: Duration of an exchange in s. Exchanges reduce the limits of the path, less if they take longer.

Raises:
    ArgumentError: A value outside its range.
    DesignError: A Shaper whose times are not on the grid of the period.

Source: this project, as time_optimal_trajectory.)";

void register_pushes(py::class_<PyController>& controller) {
  controller
      .def("push", &PyController::push, py::arg("segment"), py::arg("following") = py::none(),
           py::arg("rules") = py::none(),
           R"(Appends the next segment; never waits.

Args:
    segment: Starts where the previous one ended, the first one at the position of rest.
    following: Positions of the following axes at its end, (n_axes - 3,); they move in proportion to the path length.
        None: they do not move.
    rules: Rules for running it. None: the feed is per s along the path.

Returns:
    PushResult; unless it is `accepted`, nothing has changed.)")
      .def("push_path", &PyController::push_path, py::arg("path"), py::arg("first") = 0,
           R"(Appends the segments of a path, as many as are accepted; the following axes do not move.

Args:
    path: Its segment `first` starts where the previous segment ended.
    first: Index of the segment to begin with.

Returns:
    (index of the segment to continue with, PushResult of the last one that was tried): (len(path), accepted) if all
    were accepted.

Raises:
    ArgumentError: `first` below 0.)")
      .def("push_line", &PyController::push_line, py::arg("end_mm"), py::arg("feed_mm_per_s"),
           py::arg("following") = py::none(), py::kw_only(), py::arg("rules") = py::none(), py::arg("line") = 0,
           py::arg("stop_at_end") = false,
           R"(Appends a straight move from the end of the previous segment, at first from the position of rest.

Args:
    end_mm: Shape (3,), mm.
    feed_mm_per_s: Along the path, unless `rules` state otherwise.
    following: As in push().
    rules: Rules for running it. None: the feed is per s along the path.
    line: Shown by the state while the segment runs.
    stop_at_end: Exact stop; marks the last segment of a program, after which none is missing.

Returns:
    PushResult; unless it is `accepted`, nothing has changed.)")
      .def("push_arc", &PyController::push_arc, py::arg("end_mm"), py::arg("centre_mm"), py::arg("sweep_rad"),
           py::arg("feed_mm_per_s"), py::arg("normal") = 2, py::arg("following") = py::none(), py::kw_only(),
           py::arg("rules") = py::none(), py::arg("line") = 0, py::arg("stop_at_end") = false,
           R"(Appends an arc or helix from the end of the previous segment, as Segment.arc makes it.

Args:
    end_mm: Shape (3,), mm.
    centre_mm: Shape (3,), mm; its value along `normal` has no effect.
    sweep_rad: Above zero: X towards Y about Z, Y towards Z about X, Z towards X about Y.
    feed_mm_per_s: Along the path.
    normal: Axis perpendicular to its plane: 0 X, 1 Y, 2 Z.
    following: As in push().
    rules: Rules for running it. None: the feed is per s along the path.
    line: Shown by the state while the segment runs.
    stop_at_end: Exact stop.

Returns:
    PushResult; unless it is `accepted`, nothing has changed.

Raises:
    ArgumentError: No radius, no sweep, no such `normal`, or a number that is not finite.)");
}

}  // namespace

void register_controller(py::module_& module) {
  register_answers(module);
  register_state(module);
  py::class_<PyController> controller(module, "MotionController", controller_doc);
  controller.def(
      py::init(&make_controller), py::kw_only(), py::arg("period_s") = 0.001, py::arg("limits") = py::none(),
      py::arg("max_feed_mm_per_s") = py::none(), py::arg("max_acceleration_mm_per_s2") = py::none(),
      py::arg("max_jerk_mm_per_s3") = py::none(), py::arg("following") = py::tuple(),
      py::arg("contour_tolerance_mm") = ControllerSettings{}.contour_tolerance_mm,
      py::arg("smoothing_time_s") = ControllerSettings{}.smoothing_time_s, py::arg("shaper") = py::none(),
      py::arg("contour_correction") = false, py::arg("window") = ControllerSettings{}.window,
      py::arg("queue") = ControllerSettings{}.queue, py::arg("lead_periods") = py::none(),
      py::arg("travel") = py::tuple(), py::arg("offset") = py::tuple(), py::arg("emergency_acceleration") = py::tuple(),
      py::arg("spindle_bandwidth_hz") = ControllerSettings{}.spindle_bandwidth_hz, py::arg("retrace_periods") = 0,
      py::arg("other_shapers") = py::tuple(), py::arg("fade_time_s") = ControllerSettings{}.fade_time_s,
      "Raises ArgumentError or DesignError as the class states.");
  register_pushes(controller);
  controller
      .def(
          "push_event",
          [](PyController& self, std::uint32_t id, std::uint64_t word) {
            return self.control().push_event({id, word});
          },
          py::arg("id"), py::arg("word") = 0,
          R"(Appends an event after the last pushed segment: spindle, coolant, an output.

Args:
    id: Identifier of the caller, below 2^32.
    word: Further data of the caller, below 2^64.

Returns:
    `accepted`, `queue_full` (as many may wait as segments), `flushing`, `aborted`.)")
      .def(
          "push_dwell", [](PyController& self, double time_s) { return self.control().push_dwell(time_s); },
          py::arg("time_s"), R"(Appends a dwell after the last pushed segment. A hold during the dwell restarts it.

Args:
    time_s: Time for which the set-points rest in s, 0 to 1e6.

Returns:
    `accepted`, `no_time`, `flushing`, `aborted`.)")
      .def(
          "push_stop", [](PyController& self) { return self.control().push_stop(); },
          "Appends a programmed stop (M00) after the last pushed segment: the control is held there until resume().")
      .def("take_events", &PyController::take_events, R"(Returns the events reached since the last call.

A junction passed in motion is reached when its position has come through smoothing and shaper (`delay_periods`,
rounded); a junction at which the motion stops, when the set-points come to rest.

Returns:
    The events in the order in which they were pushed, each with its step.)")
      .def("step", &PyController::step, py::arg("periods") = 1, py::arg("spindle") = py::none(),
           R"(The next set-points, one for each period.

Args:
    periods: Number of set-points, >= 0.
    spindle: Spindle position in each period, in continuously counted revolutions, (periods,). None: not measured.

Returns:
    (periods, n_axes), mm or the unit of a following axis; `state.activity` is that of the last one.

Raises:
    ArgumentError: Periods below 0, or another number of spindle positions.)")
      .def("step_motion", &PyController::step_motion, py::arg("periods") = 1,
           R"(The next set-points with velocity and acceleration, for the feed-forward of a drive.

All three pass through the same smoothing and shaper. The effect of changing taps of a FollowingFir is not included.

Args:
    periods: Number of set-points, >= 0.

Returns:
    Positions, velocities (per s) and accelerations (per s^2), each (periods, n_axes), in mm or the axis' unit.

Raises:
    ArgumentError: Periods below 0.)")
      .def(
          "flush", [](PyController& self) { self.control().flush(); },
          "Decelerates to rest along the path and discards the rest of it; at rest, flushed() lets new segments start "
          "there.")
      .def("flushed", &PyController::flushed, R"(Completes a flush(): accepts segments again, from the position of rest.

Returns:
    That position, (n_axes,). None: it is not yet at rest, or plan() is running, or there was no flush().)")
      .def("probe", &PyController::probe, R"(Reports a probe contact in the period of the last step, and flushes.

Returns:
    The set-point of that period, (n_axes,).)")
      .def("run", &PyController::run, py::arg("max_periods") = 1'000'000,
           R"(Steps until the control is idle, held or aborted.

Args:
    max_periods: Maximum number of steps.

Returns:
    (n, n_axes), mm or the unit of a following axis.

Raises:
    ArgumentError: `max_periods` below 0.)")
      .def("plan", &PyController::plan,
           "Plans until enough motion lies ahead; only with `lead_periods`, from one thread. False: nothing to do.")
      .def(
          "feed_override",
          [](PyController& self, double ratio) { self.control().feed_override(checked_override(ratio)); },
          py::arg("ratio"),
          "Sets the feed override, a ratio of 0 to 2; up to 2.54 it is limited to this range, more is refused. It acts "
          "on motion not "
          "yet planned: after 8 to 32 periods and the lead; 0 is a hold.")
      .def(
          "rapid_override",
          [](PyController& self, double ratio) { self.control().rapid_override(checked_override(ratio)); },
          py::arg("ratio"), "Sets the override of rapids, likewise. The feed override has no effect on them.")
      .def(
          "exchange_shaper",
          [](PyController& self, std::size_t number) { return self.control().exchange_shaper(number); },
          py::arg("number"), R"(Fades to another shaper, in motion or at rest, within the limits.

Begins with the next period, or after an earlier fade or synchronous segment; a synchronous segment waits for the fade.

Args:
    number: 0: `shaper`; 1 and up: `other_shapers`.

Returns:
    False: there is no such number.)")
      .def(
          "hold", [](PyController& self) { self.control().hold(); }, "Decelerates to rest along the path.")
      .def(
          "resume", [](PyController& self) { self.control().resume(); }, "Continues after hold() or a programmed stop.")
      .def(
          "abort", [](PyController& self) { self.control().abort(); },
          "Decelerates to rest along the path and discards the rest of it; nothing is accepted until restart().")
      .def(
          "emergency_stop", [](PyController& self) { self.control().emergency_stop(); },
          "Decelerates to rest along the path with `emergency_acceleration`, without a jerk limit; then as abort().")
      .def(
          "jog", [](PyController& self, int axis, double speed) { return self.control().jog(axis, speed); },
          py::arg("axis"), py::arg("speed"), R"(Jogs an axis while the path rests; it stops at the end of its travel.

Allowed after hold(), at a programmed stop, after flush() until flushed(), and after abort(). resume() first leads back
to the path, each axis at its last jog speed; flushed() and restart() begin at the new position.

Args:
    axis: Its index, from 0.
    speed: With its sign, unit per s; a new speed acts from the next period; 0: stop.

Returns:
    JogResult; unless it is `accepted`, nothing has changed.)")
      .def(
          "jog_by",
          [](PyController& self, int axis, double distance, double speed) {
            return self.control().jog_by(axis, distance, speed);
          },
          py::arg("axis"), py::arg("distance"), py::arg("speed"), R"(Jogs an axis by a distance, where jog() is allowed.

Args:
    axis: Its index, from 0.
    distance: With its sign; further distances before its end are added.
    speed: Unit per s.

Returns:
    JogResult; unless it is `accepted`, nothing has changed.)")
      .def(
          "retrace", [](PyController& self, double distance_mm) { return self.control().retrace(distance_mm); },
          py::arg("distance_mm"), R"(Moves back along the path, at half the original speed.

Allowed when a jog is; resume() returns to the position where the path rests, then continues.

Args:
    distance_mm: From the position of rest, as far as periods are stored; a smaller one than before: forward.

Returns:
    JogResult; unless it is `accepted`, nothing has changed.)")
      .def(
          "offset", [](PyController& self, int axis, double value) { return self.control().offset(axis, value); },
          py::arg("axis"), py::arg("value"),
          R"(Sets an offset, which the axis approaches within the limits of its offset, at rest and in motion.

Args:
    axis: Its index, from 0.
    value: mm or the axis' unit.

Returns:
    False: the axis has no such limits, or the value is not finite.)")
      .def(
          "travel",
          [](PyController& self, int axis, double low, double high) {
            return self.control().travel(axis, {low, high});
          },
          py::arg("axis"), py::arg("low"), py::arg("high"), R"(Sets the travel range of an axis.

If the path to be run next would leave it, the control is held and stops where the motion already planned ends.

Args:
    axis: Its index, from 0.
    low: mm or the axis' unit.
    high: Likewise.

Returns:
    False: there is no such axis, or `low` is above `high`.)")
      .def("restart", &PyController::restart, py::arg("position"),
           "Sets the control at rest at a position (n_axes,), with an empty queue. Raises ArgumentError on another "
           "shape or a value that is not finite.")
      .def_property_readonly("state", &PyController::state, "A snapshot: ControllerState.")
      .def_property_readonly(
          "n_axes", [](const PyController& self) { return self.control().axes(); }, "Number of axes of a set-point.")
      .def_property_readonly("end_mm", &PyController::end, "Start of the next segment, (3,), mm.")
      .def_property_readonly("following_end", &PyController::following_end,
                             "Positions of the following axes at the end of the last segment, (n_axes - 3,).")
      .def_property_readonly(
          "delay_periods", [](const PyController& self) { return self.control().delay_periods(); },
          "Mean delay of correction, smoothing and the shaper requested last, in periods.")
      .def_property_readonly(
          "correction_delay", [](const PyController& self) { return self.control().correction_delay(); },
          "Part of `delay_periods` caused by the contour correction, in periods.");
}

}  // namespace shapegcode::bindings
