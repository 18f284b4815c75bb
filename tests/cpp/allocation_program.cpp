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

  long planned = 0, stops = 0, events = 0, flushes = 0;

 private:
  static ControllerSettings settings() {
    ControllerSettings settings;
    settings.limits.law = AccelerationLaw::jerk_limited;
    settings.limits.max_acceleration_mm_per_s2.setConstant(2000.0);
    settings.limits.max_jerk_mm_per_s3.setConstant(50000.0);
    settings.shaper = Fir({0, 11}, {0.516, 0.484});
    settings.contour_correction = true;
    settings.plans_in_step = false;
    settings.window = 16;
    settings.queue = 32;
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
}
