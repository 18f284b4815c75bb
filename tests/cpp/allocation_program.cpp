// What else a control calls, in allocation_tests: plan() by another caller, events, dwells, stops, probe, flush and the
// set-point with its derivatives allocate nothing and lock nothing.
#include <array>
#include <cstddef>
#include <cstdint>

#include "allocation_tests.hpp"
#include "shapegcode/controller.hpp"

namespace {

using namespace shapegcode;

/// A control whose caller plans, and how often each of its calls was answered.
class ProgramRun {
 public:
  ProgramRun() : control_(settings()) {}

  long push(long rounds) noexcept {
    for (long round = 0; round < rounds; ++round) {
      const Vector3 next = at_ + Vector3(round % 2 == 0 ? 3.0 : -3.0, 1.0, 0.0);
      Segment segment = make_line(at_, next, 60.0);
      segment.stop_at_end = true;
      if (control_.push(segment) != PushResult::accepted) return round;
      at_ = next;
      control_.push_event({static_cast<std::uint32_t>(round), 0});
      if (round % 3 == 1) control_.push_dwell(0.02);
      if (round % 3 == 2) control_.push_stop();
    }
    return rounds;
  }
  long plan() noexcept {
    long plans = 0;
    while (control_.plan()) ++plans;
    planned += plans;
    return plans + 1;
  }
  long step(long periods) noexcept {
    for (long k = 0; k < periods; ++k) {
      stops += control_.step(out_) == Activity::held ? 1 : 0;
      ControllerEvent event;
      while (control_.next_event(event)) ++events;
    }
    return periods;
  }
  /// All of it, as a control's threads do it one after the other.
  long live() noexcept {
    long steps = 0;
    for (int round = 0; round < 12; ++round) {
      push(9);
      for (int part = 0; part < 60; ++part) {
        plan();
        steps += step(20);
        control_.resume();
      }
      std::array<double, axis_count> position{};
      if (round % 3 == 1) control_.probe(position);
      if (round % 3 == 2) control_.flush();
      if (round % 3 == 0) continue;
      for (int part = 0; part < 60 && !control_.flushed(position); ++part) {
        plan();
        steps += step(20);
      }
      at_ = Vector3(position[0], position[1], position[2]);
      ++flushes;
    }
    return steps;
  }

  /// What an operator does while the path rests, a thread, and an end.
  long by_hand() noexcept {
    long steps = 0;
    control_.restart(std::array<double, axis_count>{});
    at_ = Vector3::Zero();
    push(6);
    for (int part = 0; part < 30; ++part) {
      plan();
      control_.offset(part % 3, 0.01 * part);
      control_.rapid_override(0.5 + 0.01 * part);
      control_.exchange_shaper(part % 2);
      control_.travel(part % 3, {-500.0 - part, 500.0});
      steps += step(10);
    }
    control_.hold();
    steps += step(400);
    for (int axis = 0; axis < 3; ++axis) jogs += control_.jog(axis, 20.0 - 15.0 * axis) == JogResult::accepted ? 1 : 0;
    steps += step(200);
    for (int axis = 0; axis < 3; ++axis) control_.jog(axis, 0.0);
    steps += step(200);
    for (int axis = 0; axis < 3; ++axis) jogs += control_.jog_by(axis, 1.5, 30.0) == JogResult::accepted ? 1 : 0;
    steps += step(400);
    jogs += control_.retrace(2.0) == JogResult::accepted ? 1 : 0;
    steps += step(600);
    control_.flush();
    steps += step(50);
    std::array<double, axis_count> position{};
    if (control_.flushed(position)) ++flushes;
    control_.resume();
    const Vector3 here(position[0], position[1], position[2]);
    SegmentRules rules;
    rules.feed_rate = FeedRate::synchronous;
    control_.push(make_line(here, here + Vector3(0, 0, 20), 1.0), {}, rules);
    for (int k = 0; k < 600; ++k) {
      control_.spindle(0.01 * k);
      plan();
      steps += step(1);
    }
    control_.emergency_stop();
    return steps + step(300);
  }

  long jogs = 0;
  long planned = 0, stops = 0, events = 0, flushes = 0;

 private:
  static ControllerSettings settings() {
    ControllerSettings settings;
    settings.limits.law = AccelerationLaw::jerk_limited;
    settings.limits.max_acceleration_mm_per_s2.setConstant(2000.0);
    settings.limits.max_jerk_mm_per_s3.setConstant(50000.0);
    settings.shaper = Fir({0, 11}, {0.516, 0.484});
    settings.other_shapers = {Fir({0, 16}, {0.5, 0.5})};
    settings.limits.max_feed_mm_per_s.setConstant(300.0);
    settings.plans_in_step = false;
    settings.window = 16;
    settings.queue = 32;
    settings.travel.assign(axis_count, {-500.0, 500.0});
    settings.offset.assign(axis_count, {10.0, 200.0, 5000.0, 0.01});
    settings.emergency_acceleration.assign(axis_count, 5000.0);
    settings.retrace_periods = 500;
    return settings;
  }

  MotionController control_;
  MotionSetPoint out_;
  Vector3 at_ = Vector3::Zero();
};

}  // namespace

void check_program_items() {
  ProgramRun run;
  expect_none("MotionController: plan, events, dwells, stops, probe, flush", [&] { return run.live(); });
  expect(run.planned > 100 && run.stops > 0 && run.events > 20 && run.flushes == 8,
         "a program was run with its events, dwells, stops, touches and flushes");
  expect_none("MotionController: axes by hand, offset, spindle, emergency stop", [&] { return run.by_hand(); });
  expect(run.jogs == 7 && run.flushes == 9, "axes were jogged, the path retraced and flushed");
}
