// The C interface: translation only. No exception crosses it, and the arguments of a call are checked here.
#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <exception>
#include <memory>
#include <new>
#include <optional>
#include <span>
#include <string_view>
#include <utility>

#include "c/settings.hpp"
#include "path/arc_end.hpp"
#include "path/arc_frame.hpp"
#include "shapegcode/controller.hpp"
#include "shapegcode/error.hpp"
#include "shapegcode/path.hpp"
#include "shapegcode/shapegcode.h"

using shapegcode::Activity;
using shapegcode::JogResult;
using shapegcode::MotionController;
using shapegcode::PushResult;
using shapegcode::Segment;
using shapegcode::Vector3;
using shapegcode::c::vector_of;

// The handle: a segment in C begins where the one before ended, which is remembered here by the thread that pushes.
struct shapegcode_controller {
  explicit shapegcode_controller(const shapegcode::ControllerSettings& settings) : control(settings) {}

  MotionController control;
  std::array<double, shapegcode::max_controller_axes> end{};
};

namespace {

// By how much a sweep may miss the end of its arc.
constexpr double max_sweep_error_mm = 0.01;
// What version 1.0 of the structs holds.
constexpr std::size_t first_state_size = offsetof(shapegcode_state, offset) + sizeof(shapegcode_state::offset);
constexpr std::size_t first_rules_size = offsetof(shapegcode_rules, max_jerk) + sizeof(double);

shapegcode_rules default_rules() noexcept {
  const shapegcode::SegmentRules rules;
  return {sizeof(shapegcode_rules),
          0,
          0,
          SHAPEGCODE_PER_TIME,
          SHAPEGCODE_FEED_OF_PATH,
          rules.max_acceleration,
          rules.max_jerk};
}

void write_message(std::string_view text, char* message, std::size_t size) noexcept {
  if (message == nullptr || size == 0) return;
  const std::size_t length = std::min(text.size(), size - 1);
  std::copy_n(text.data(), length, message);
  message[length] = '\0';
}

/// What `call` gives; an exception becomes its status and its message.
template <class Call>
shapegcode_status guarded(char* message, std::size_t size, Call&& call) noexcept {
  try {
    return std::forward<Call>(call)();
  } catch (const shapegcode::Error& error) {
    write_message(error.what(), message, size);
    const bool is_argument = error.kind() == shapegcode::ErrorKind::argument;
    return is_argument ? SHAPEGCODE_ERROR_ARGUMENT : SHAPEGCODE_ERROR_INTERNAL;
  } catch (const std::bad_alloc&) {
    write_message("out of memory", message, size);
    return SHAPEGCODE_ERROR_OUT_OF_MEMORY;
  } catch (const std::exception& error) {
    write_message(error.what(), message, size);
  } catch (...) {
    write_message("an unknown error", message, size);
  }
  return SHAPEGCODE_ERROR_INTERNAL;
}

shapegcode_status status_of(PushResult result) noexcept {
  switch (result) {
    case PushResult::accepted:
      return SHAPEGCODE_OK;
    case PushResult::queue_full:
      return SHAPEGCODE_QUEUE_FULL;
    case PushResult::not_connected:
      return SHAPEGCODE_NOT_CONNECTED;
    case PushResult::no_length:
      return SHAPEGCODE_NO_LENGTH;
    case PushResult::no_feed:
      return SHAPEGCODE_NO_FEED;
    case PushResult::not_finite:
      return SHAPEGCODE_NOT_FINITE;
    case PushResult::wrong_axes:
      return SHAPEGCODE_WRONG_AXES;
    case PushResult::aborted:
      return SHAPEGCODE_AFTER_ABORT;
    case PushResult::flushing:
      return SHAPEGCODE_FLUSHING;
    case PushResult::no_time:
      return SHAPEGCODE_NO_TIME;
    case PushResult::beyond_travel:
      return SHAPEGCODE_BEYOND_TRAVEL;
    case PushResult::bad_limit:
      return SHAPEGCODE_BAD_LIMIT;
    case PushResult::not_straight:
      return SHAPEGCODE_NOT_STRAIGHT;
  }
  return SHAPEGCODE_ERROR_INTERNAL;
}

shapegcode_status status_of(JogResult result) noexcept {
  switch (result) {
    case JogResult::accepted:
      return SHAPEGCODE_OK;
    case JogResult::path_moves:
      return SHAPEGCODE_PATH_MOVES;
    case JogResult::no_axis:
      return SHAPEGCODE_NO_AXIS;
    case JogResult::not_finite:
      return SHAPEGCODE_NOT_FINITE;
    case JogResult::no_speed:
      return SHAPEGCODE_NO_SPEED;
    case JogResult::no_record:
      return SHAPEGCODE_NO_RECORD;
    case JogResult::beyond_travel:
      return SHAPEGCODE_BEYOND_TRAVEL;
  }
  return SHAPEGCODE_ERROR_INTERNAL;
}

shapegcode_activity activity_of(Activity activity) noexcept {
  switch (activity) {
    case Activity::idle:
      return SHAPEGCODE_IDLE;
    case Activity::moving:
      return SHAPEGCODE_MOVING;
    case Activity::stopping:
      return SHAPEGCODE_STOPPING;
    case Activity::held:
      return SHAPEGCODE_HELD;
    case Activity::starved:
      return SHAPEGCODE_STARVED;
    case Activity::aborted:
      return SHAPEGCODE_ABORTED;
    case Activity::jogging:
      return SHAPEGCODE_JOGGING;
  }
  return SHAPEGCODE_IDLE;
}

// Rules as they are meant; nothing: a struct or a code that is none.
std::optional<shapegcode_rules> whole_rules(const shapegcode_rules* given) noexcept {
  shapegcode_rules rules = default_rules();
  if (given == nullptr) return rules;
  if (given->struct_size < first_rules_size || given->struct_size > sizeof rules) return std::nullopt;
  std::memcpy(&rules, given, given->struct_size);
  const bool is_known = rules.feed_rate >= SHAPEGCODE_PER_TIME && rules.feed_rate <= SHAPEGCODE_SYNCHRONOUS &&
                        rules.feed_of >= SHAPEGCODE_FEED_OF_PATH && rules.feed_of <= SHAPEGCODE_FEED_OF_TIME;
  return is_known ? std::optional(rules) : std::nullopt;
}

shapegcode_status push(shapegcode_controller& controller, const double* end, Segment segment,
                       const shapegcode_rules& rules) noexcept {
  segment.stop_at_end = rules.stop_at_end != 0;
  const auto axes = static_cast<std::size_t>(controller.control.axes());
  const shapegcode::SegmentRules run{static_cast<shapegcode::FeedRate>(rules.feed_rate),
                                     static_cast<shapegcode::FeedOf>(rules.feed_of), rules.max_acceleration,
                                     rules.max_jerk};
  const std::span following(end + shapegcode::axis_count, axes - shapegcode::axis_count);
  const shapegcode_status status = status_of(controller.control.push(segment, following, run));
  if (status == SHAPEGCODE_OK) std::copy_n(end, axes, controller.end.begin());
  return status;
}

/// As make_arc, which throws where this says so.
shapegcode_status arc_of(const Vector3& start, const Vector3& end, const shapegcode_arc& arc, double feed_mm_per_s,
                         std::uint32_t line, Segment& segment) {
  if (arc.normal < 0 || arc.normal > 2) return SHAPEGCODE_NO_ARC;
  const shapegcode::ArcFrame frame(arc.normal);
  const Vector3 centre = vector_of(arc.centre_mm);
  if (!end.allFinite() || !frame.project(centre).allFinite() || !std::isfinite(arc.sweep_rad)) {
    return SHAPEGCODE_NOT_FINITE;
  }
  if (!std::isfinite(feed_mm_per_s)) return SHAPEGCODE_NO_FEED;
  if (arc.sweep_rad == 0.0 || !(frame.radius(start, centre) > 0.0) || !(frame.radius(end, centre) > 0.0)) {
    return SHAPEGCODE_NO_ARC;
  }
  segment = shapegcode::make_arc(start, end, centre, arc.sweep_rad, arc.normal, feed_mm_per_s, line);
  const double missing_rad = shapegcode::missing_sweep_rad(segment);
  const double sweep_rad = arc.sweep_rad + missing_rad;
  if (std::abs(missing_rad) * segment.end_radius_mm > max_sweep_error_mm || sweep_rad * arc.sweep_rad <= 0.0) {
    return SHAPEGCODE_NO_ARC;
  }
  segment = shapegcode::make_arc(start, end, centre, sweep_rad, arc.normal, feed_mm_per_s, line);
  return SHAPEGCODE_OK;
}

}  // namespace

shapegcode_status shapegcode_controller_create(const shapegcode_settings* settings, shapegcode_controller** controller,
                                               char* message, size_t message_size) {
  write_message("", message, message_size);
  if (controller != nullptr) *controller = nullptr;
  const auto refused = [&](shapegcode_status status) {
    write_message(shapegcode_status_text(status), message, message_size);
    return status;
  };
  if (controller == nullptr || settings == nullptr) return refused(SHAPEGCODE_ERROR_NULL);
  return guarded(message, message_size, [&] {
    *controller = std::make_unique<shapegcode_controller>(shapegcode::c::settings_of(*settings)).release();
    return SHAPEGCODE_OK;
  });
}

shapegcode_status shapegcode_controller_destroy(shapegcode_controller* controller) {
  const std::unique_ptr<shapegcode_controller> owned(controller);
  return SHAPEGCODE_OK;
}

shapegcode_status shapegcode_controller_axes(const shapegcode_controller* controller, int32_t* axes) {
  if (controller == nullptr || axes == nullptr) return SHAPEGCODE_ERROR_NULL;
  *axes = controller->control.axes();
  return SHAPEGCODE_OK;
}

shapegcode_status shapegcode_controller_push_line(shapegcode_controller* controller, const double* end,
                                                  double feed_mm_per_s, const shapegcode_rules* rules) {
  if (controller == nullptr || end == nullptr) return SHAPEGCODE_ERROR_NULL;
  const std::optional<shapegcode_rules> whole = whole_rules(rules);
  if (!whole) return SHAPEGCODE_ERROR_STRUCT_SIZE;
  const Segment segment =
      shapegcode::make_line(vector_of(controller->end.data()), vector_of(end), feed_mm_per_s, whole->line);
  return push(*controller, end, segment, *whole);
}

shapegcode_status shapegcode_controller_push_arc(shapegcode_controller* controller, const double* end,
                                                 const shapegcode_arc* arc, double feed_mm_per_s,
                                                 const shapegcode_rules* rules) {
  if (controller == nullptr || end == nullptr || arc == nullptr) return SHAPEGCODE_ERROR_NULL;
  const std::optional<shapegcode_rules> whole = whole_rules(rules);
  if (!whole) return SHAPEGCODE_ERROR_STRUCT_SIZE;
  return guarded(nullptr, 0, [&] {
    Segment segment;
    const shapegcode_status status =
        arc_of(vector_of(controller->end.data()), vector_of(end), *arc, feed_mm_per_s, whole->line, segment);
    return status == SHAPEGCODE_OK ? push(*controller, end, segment, *whole) : status;
  });
}

shapegcode_status shapegcode_controller_push_event(shapegcode_controller* controller, uint32_t id, uint64_t word) {
  if (controller == nullptr) return SHAPEGCODE_ERROR_NULL;
  return status_of(controller->control.push_event({id, word}));
}

shapegcode_status shapegcode_controller_push_dwell(shapegcode_controller* controller, double time_s) {
  if (controller == nullptr) return SHAPEGCODE_ERROR_NULL;
  return status_of(controller->control.push_dwell(time_s));
}

shapegcode_status shapegcode_controller_push_stop(shapegcode_controller* controller) {
  if (controller == nullptr) return SHAPEGCODE_ERROR_NULL;
  return status_of(controller->control.push_stop());
}

shapegcode_status shapegcode_controller_next_event(shapegcode_controller* controller, uint32_t* id, uint64_t* word,
                                                   int* has_event) {
  if (controller == nullptr || id == nullptr || word == nullptr || has_event == nullptr) return SHAPEGCODE_ERROR_NULL;
  shapegcode::ControllerEvent event;
  *has_event = controller->control.next_event(event) ? 1 : 0;
  *id = event.id;
  *word = event.word;
  return SHAPEGCODE_OK;
}

shapegcode_status shapegcode_controller_step(shapegcode_controller* controller, double* set_point,
                                             shapegcode_activity* activity) {
  if (controller == nullptr || set_point == nullptr) return SHAPEGCODE_ERROR_NULL;
  const Activity now = controller->control.step({set_point, static_cast<std::size_t>(controller->control.axes())});
  if (activity != nullptr) *activity = activity_of(now);
  return SHAPEGCODE_OK;
}

shapegcode_status shapegcode_controller_step_motion(shapegcode_controller* controller, double* set_point,
                                                    double* velocity, double* acceleration,
                                                    shapegcode_activity* activity) {
  if (controller == nullptr || set_point == nullptr) return SHAPEGCODE_ERROR_NULL;
  shapegcode::MotionSetPoint motion;
  const Activity now = controller->control.step(motion);
  const auto axes = static_cast<std::size_t>(controller->control.axes());
  std::copy_n(motion.position.begin(), axes, set_point);
  if (velocity != nullptr) std::copy_n(motion.velocity.begin(), axes, velocity);
  if (acceleration != nullptr) std::copy_n(motion.acceleration.begin(), axes, acceleration);
  if (activity != nullptr) *activity = activity_of(now);
  return SHAPEGCODE_OK;
}

shapegcode_status shapegcode_controller_plan(shapegcode_controller* controller, int* has_worked) {
  if (controller == nullptr) return SHAPEGCODE_ERROR_NULL;
  const bool worked = controller->control.plan();
  if (has_worked != nullptr) *has_worked = worked ? 1 : 0;
  return SHAPEGCODE_OK;
}

shapegcode_status shapegcode_controller_feed_override(shapegcode_controller* controller, double ratio) {
  if (controller == nullptr) return SHAPEGCODE_ERROR_NULL;
  controller->control.feed_override(ratio);
  return SHAPEGCODE_OK;
}

shapegcode_status shapegcode_controller_rapid_override(shapegcode_controller* controller, double ratio) {
  if (controller == nullptr) return SHAPEGCODE_ERROR_NULL;
  controller->control.rapid_override(ratio);
  return SHAPEGCODE_OK;
}

shapegcode_status shapegcode_controller_exchange_shaper(shapegcode_controller* controller, int number) {
  if (controller == nullptr) return SHAPEGCODE_ERROR_NULL;
  const bool is_one = number >= 0 && controller->control.exchange_shaper(static_cast<std::size_t>(number));
  return is_one ? SHAPEGCODE_OK : SHAPEGCODE_ERROR_ARGUMENT;
}

shapegcode_status shapegcode_controller_spindle(shapegcode_controller* controller, double revolutions) {
  if (controller == nullptr) return SHAPEGCODE_ERROR_NULL;
  controller->control.spindle(revolutions);
  return SHAPEGCODE_OK;
}

shapegcode_status shapegcode_controller_emergency_stop(shapegcode_controller* controller) {
  if (controller == nullptr) return SHAPEGCODE_ERROR_NULL;
  controller->control.emergency_stop();
  return SHAPEGCODE_OK;
}

shapegcode_status shapegcode_controller_jog(shapegcode_controller* controller, int axis, double speed) {
  if (controller == nullptr) return SHAPEGCODE_ERROR_NULL;
  return status_of(controller->control.jog(axis, speed));
}

shapegcode_status shapegcode_controller_jog_by(shapegcode_controller* controller, int axis, double distance,
                                               double speed) {
  if (controller == nullptr) return SHAPEGCODE_ERROR_NULL;
  return status_of(controller->control.jog_by(axis, distance, speed));
}

shapegcode_status shapegcode_controller_retrace(shapegcode_controller* controller, double distance_mm) {
  if (controller == nullptr) return SHAPEGCODE_ERROR_NULL;
  return status_of(controller->control.retrace(distance_mm));
}

shapegcode_status shapegcode_controller_offset(shapegcode_controller* controller, int axis, double value) {
  if (controller == nullptr) return SHAPEGCODE_ERROR_NULL;
  if (!std::isfinite(value)) return SHAPEGCODE_NOT_FINITE;
  return controller->control.offset(axis, value) ? SHAPEGCODE_OK : SHAPEGCODE_NO_AXIS;
}

shapegcode_status shapegcode_controller_travel(shapegcode_controller* controller, int axis, double low, double high) {
  if (controller == nullptr) return SHAPEGCODE_ERROR_NULL;
  if (!(low <= high)) return SHAPEGCODE_ERROR_ARGUMENT;
  return controller->control.travel(axis, {low, high}) ? SHAPEGCODE_OK : SHAPEGCODE_NO_AXIS;
}

shapegcode_status shapegcode_rules_init(shapegcode_rules* rules, size_t struct_size) {
  if (rules == nullptr) return SHAPEGCODE_ERROR_NULL;
  if (struct_size < first_rules_size || struct_size > sizeof *rules) return SHAPEGCODE_ERROR_STRUCT_SIZE;
  shapegcode_rules defaults = default_rules();
  defaults.struct_size = struct_size;
  std::memcpy(rules, &defaults, struct_size);
  return SHAPEGCODE_OK;
}

shapegcode_status shapegcode_controller_hold(shapegcode_controller* controller) {
  if (controller == nullptr) return SHAPEGCODE_ERROR_NULL;
  controller->control.hold();
  return SHAPEGCODE_OK;
}

shapegcode_status shapegcode_controller_resume(shapegcode_controller* controller) {
  if (controller == nullptr) return SHAPEGCODE_ERROR_NULL;
  controller->control.resume();
  return SHAPEGCODE_OK;
}

shapegcode_status shapegcode_controller_abort(shapegcode_controller* controller) {
  if (controller == nullptr) return SHAPEGCODE_ERROR_NULL;
  controller->control.abort();
  return SHAPEGCODE_OK;
}

shapegcode_status shapegcode_controller_flush(shapegcode_controller* controller) {
  if (controller == nullptr) return SHAPEGCODE_ERROR_NULL;
  controller->control.flush();
  return SHAPEGCODE_OK;
}

shapegcode_status shapegcode_controller_flushed(shapegcode_controller* controller, double* position, int* done) {
  if (controller == nullptr || position == nullptr || done == nullptr) return SHAPEGCODE_ERROR_NULL;
  const std::span values(position, static_cast<std::size_t>(controller->control.axes()));
  *done = controller->control.flushed(values) ? 1 : 0;
  if (*done != 0) std::ranges::copy(values, controller->end.begin());
  return SHAPEGCODE_OK;
}

shapegcode_status shapegcode_controller_probe(shapegcode_controller* controller, double* latched) {
  if (controller == nullptr || latched == nullptr) return SHAPEGCODE_ERROR_NULL;
  controller->control.probe({latched, static_cast<std::size_t>(controller->control.axes())});
  return SHAPEGCODE_OK;
}

shapegcode_status shapegcode_controller_restart(shapegcode_controller* controller, const double* position) {
  if (controller == nullptr || position == nullptr) return SHAPEGCODE_ERROR_NULL;
  const std::span values(position, static_cast<std::size_t>(controller->control.axes()));
  if (!controller->control.restart(values)) return SHAPEGCODE_NOT_FINITE;
  std::ranges::copy(values, controller->end.begin());
  return SHAPEGCODE_OK;
}

shapegcode_status shapegcode_controller_state(const shapegcode_controller* controller, shapegcode_state* state,
                                              size_t struct_size) {
  if (controller == nullptr || state == nullptr) return SHAPEGCODE_ERROR_NULL;
  if (struct_size < first_state_size || struct_size > sizeof *state) return SHAPEGCODE_ERROR_STRUCT_SIZE;
  const shapegcode::ControllerState now = controller->control.state();
  shapegcode_state all{};
  all.activity = activity_of(now.activity);
  all.axes = controller->control.axes();
  std::ranges::copy(now.set_point, all.set_point);
  all.speed_mm_per_s = now.speed_mm_per_s;
  all.distance_mm = now.distance_mm;
  all.feed_override = now.feed_override;
  all.segments_done = now.segments_done;
  all.segments_waiting = now.segments_waiting;
  all.steps = now.steps;
  all.starvations = now.starvations;
  all.line = now.line;
  all.late_plans = now.late_plans;
  all.set_point_distance_mm = now.set_point_distance_mm;
  all.set_point_line = now.set_point_line;
  all.travel_stops = now.travel_stops;
  all.spindle_speed = now.spindle_speed;
  all.spindle_error_mm = now.spindle_error_mm;
  std::ranges::copy(now.offset, all.offset);
  all.shaper = now.shaper;
  all.rapid_override = now.rapid_override;
  std::memcpy(state, &all, struct_size);
  return SHAPEGCODE_OK;
}

shapegcode_status shapegcode_controller_delay(const shapegcode_controller* controller, double* periods) {
  if (controller == nullptr || periods == nullptr) return SHAPEGCODE_ERROR_NULL;
  *periods = controller->control.delay_periods();
  return SHAPEGCODE_OK;
}
