// The C interface: nothing but translation. No exception crosses it, and what a call hands over is checked here.
#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <exception>
#include <memory>
#include <new>
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
// What the first version of the struct holds.
constexpr std::size_t first_state_size = offsetof(shapegcode_state, line) + sizeof(std::uint32_t);

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
  }
  return SHAPEGCODE_IDLE;
}

shapegcode_status push(shapegcode_controller& controller, const double* end, Segment segment,
                       int stop_at_end) noexcept {
  segment.stop_at_end = stop_at_end != 0;
  const auto axes = static_cast<std::size_t>(controller.control.axes());
  const shapegcode_status status =
      status_of(controller.control.push(segment, {end + shapegcode::axis_count, axes - shapegcode::axis_count}));
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
  if (!shapegcode::c::has_known_size(*settings)) return refused(SHAPEGCODE_ERROR_STRUCT_SIZE);
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
                                                  double feed_mm_per_s, uint32_t line, int stop_at_end) {
  if (controller == nullptr || end == nullptr) return SHAPEGCODE_ERROR_NULL;
  const Segment segment = shapegcode::make_line(vector_of(controller->end.data()), vector_of(end), feed_mm_per_s, line);
  return push(*controller, end, segment, stop_at_end);
}

shapegcode_status shapegcode_controller_push_arc(shapegcode_controller* controller, const double* end,
                                                 const shapegcode_arc* arc, double feed_mm_per_s, uint32_t line,
                                                 int stop_at_end) {
  if (controller == nullptr || end == nullptr || arc == nullptr) return SHAPEGCODE_ERROR_NULL;
  return guarded(nullptr, 0, [&] {
    Segment segment;
    const shapegcode_status status =
        arc_of(vector_of(controller->end.data()), vector_of(end), *arc, feed_mm_per_s, line, segment);
    return status == SHAPEGCODE_OK ? push(*controller, end, segment, stop_at_end) : status;
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
  std::memcpy(state, &all, struct_size);
  return SHAPEGCODE_OK;
}

shapegcode_status shapegcode_controller_delay(const shapegcode_controller* controller, double* periods) {
  if (controller == nullptr || periods == nullptr) return SHAPEGCODE_ERROR_NULL;
  *periods = controller->control.delay_periods();
  return SHAPEGCODE_OK;
}
