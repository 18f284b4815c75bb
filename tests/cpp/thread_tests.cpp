// Sessions of the controller with a thread for each of its parts, for ThreadSanitizer: one steps, one plans, one pushes
// and turns the override, one reads the state and moves axes by hand. What the sanitizer finds ends the process with
// its own exit code; what is checked here is that no reader sees half a state.
#include <array>
#include <atomic>
#include <chrono>
#include <cmath>
#include <cstdint>
#include <cstdio>
#include <random>
#include <span>
#include <thread>
#include <vector>

#include "random_motion.hpp"
#include "shapegcode/controller.hpp"

using namespace shapegcode;

namespace {

constexpr std::uint32_t sessions = 8;
constexpr std::size_t max_steps = 20'000'000;

std::atomic<int> failures{0};

void check(bool holds, const char* what, std::uint32_t session) {
  if (holds) return;
  failures.fetch_add(1, std::memory_order_relaxed);
  std::fprintf(stderr, "session %u: %s\n", session, what);
}

ControllerSettings settings_of(std::uint32_t session) {
  ControllerSettings settings;
  settings.limits.law = session % 2 == 0 ? AccelerationLaw::jerk_limited : AccelerationLaw::constant_time;
  settings.limits.max_feed_mm_per_s.setConstant(200.0);
  settings.limits.max_acceleration_mm_per_s2.setConstant(2000.0);
  settings.limits.max_jerk_mm_per_s3.setConstant(100'000.0);
  settings.limits.feed_override = session % 3 == 0 ? 0.25 : 1.0;
  settings.following.resize(session % 4 == 1 ? 2 : 0, {90.0, 1'000.0, 50'000.0});
  settings.shaper = Fir({0, 11}, {0.516, 0.484});
  settings.window = session % 2 == 0 ? 8 : 64;
  settings.plans_in_step = session % 4 == 0;
  settings.lead_periods = session % 8 < 4 ? 20 : 200;
  if (session % 2 == 0) settings.offset.resize(3 + settings.following.size(), {10.0, 100.0, 5'000.0, 0.01});
  settings.retrace_periods = 200;
  if (session % 2 == 1) settings.other_shapers = {Fir({0, 30}, {0.5, 0.5})};
  settings.queue = 66;  // small: pushing waits for stepping, and places are used again and again
  return settings;
}

// What an operator does at any time.
void operate(MotionController& control, std::mt19937& draw) {
  const int axis = static_cast<int>(draw() % 3);
  const double size = 0.01 * static_cast<double>(draw() % 1001) - 5.0;
  switch (draw() % 10) {
    case 7:
      control.exchange_shaper(draw() % 3);
      break;
    case 0:
      control.hold();
      break;
    case 1:
      control.jog(axis, 10.0 * size);
      break;
    case 2:
      control.jog_by(axis, 0.1 * size, 20.0);
      break;
    case 3:
      control.retrace(std::abs(size));
      break;
    case 4:
      control.offset(axis, 0.1 * size);
      break;
    case 5:
      control.travel(axis, {-1000.0 - size, 1000.0});
      break;
    case 6:
      control.rapid_override(0.5 + 0.1 * size);
      break;
    default:
      control.resume();
  }
}

void session_of(std::uint32_t session) {
  const ControllerSettings settings = settings_of(session);
  MotionController control(settings);
  std::mt19937 random(session);
  const std::vector<Segment> segments = tests::random_segments(random, 24, 150.0, true);
  const std::array<double, 2> following{};
  const std::span<const double> followed(following.data(), settings.following.size());
  std::atomic<bool> ended{false};
  std::atomic<bool> is_pushed{false};
  std::thread pusher([&] {
    std::mt19937 draw(session + 1000);
    std::uint32_t events = 0;
    for (Segment segment : segments) {
      std::array<double, max_controller_axes> rest{};
      if (session % 3 == 0 && draw() % 5 == 0) {
        control.flush();
        control.feed_override(1.0);
        while (!control.flushed(std::span(rest).first(static_cast<std::size_t>(control.axes()))) &&
               !ended.load(std::memory_order_relaxed)) {
          control.resume();
          std::this_thread::yield();
        }
        segment = make_line({rest[0], rest[1], rest[2]}, segment.end_mm, 100.0);
      }
      PushResult result = control.push(segment, followed);
      while (result == PushResult::queue_full && !ended.load(std::memory_order_relaxed)) {
        std::this_thread::yield();
        result = control.push(segment, followed);
      }
      const auto what = draw() % 100;
      if (what < 20) control.feed_override(0.02 * static_cast<double>(draw() % 101));
      if (what == 20) control.hold();
      if (what > 70) control.push_event({events++, 0});
      if (what == 70) control.push_dwell(0.01);
      if (what == 69) control.push_stop();
      control.resume();
    }
    control.feed_override(2.0);
    is_pushed.store(true, std::memory_order_release);
  });
  std::thread planner([&] {
    while (!settings.plans_in_step && !ended.load(std::memory_order_relaxed)) {
      if (!control.plan()) std::this_thread::yield();
    }
  });
  std::thread reader([&] {
    std::uint64_t last = 0;
    std::mt19937 draw(session + 2000);
    while (!ended.load(std::memory_order_relaxed)) {
      const ControllerState state = control.state();
      check(state.steps >= last, "the state went back", session);
      // All of one step: the path is run from segment 0 on, and nothing is done that was not pushed.
      check(state.segments_done + state.segments_waiting <= segments.size(), "a state of two steps", session);
      check(std::isfinite(state.set_point[0]) && state.feed_override <= 2.0, "no number", session);
      if (state.steps / 64 != last / 64) operate(control, draw);
      last = state.steps;
    }
  });
  std::array<double, max_controller_axes> point{};
  std::size_t steps = 0;
  std::int64_t last_event = -1;
  for (bool runs = true; steps < max_steps && runs; ++steps) {
    const bool all = is_pushed.load(std::memory_order_acquire);
    if (all) control.resume();
    const Activity activity = control.step({point.data(), static_cast<std::size_t>(control.axes())});
    runs = !all || activity != Activity::idle || control.state().segments_waiting > 0;
    ControllerEvent event;
    while (control.next_event(event)) {
      check(event.id > last_event, "an event came twice, or late", session);
      last_event = event.id;
    }
    // Not so fast that every plan comes too late.
    if (!settings.plans_in_step) std::this_thread::sleep_for(std::chrono::microseconds(50));
  }
  check(steps < max_steps, "the path did not end", session);
  ended.store(true, std::memory_order_relaxed);
  pusher.join();
  planner.join();
  reader.join();
}

}  // namespace

int main() {
  for (std::uint32_t session = 0; session < sessions; ++session) session_of(session);
  std::printf("thread_tests: %u sessions, %d failures\n", sessions, failures.load());
  return failures.load() == 0 ? 0 : 1;
}
