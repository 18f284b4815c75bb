// MotionController in allocation_tests: step() and push() allocate nothing and lock nothing in whatever they do, and
// make no system call at all.
#include <sys/prctl.h>
#include <sys/syscall.h>
#include <sys/wait.h>
#include <unistd.h>

#include <linux/seccomp.h>
#include <array>
#include <atomic>
#include <cstddef>
#include <cstdlib>
#include <limits>
#include <numbers>
#include <set>
#include <span>
#include <string>
#include <thread>
#include <vector>

#include "allocation_tests.hpp"
#include "shapegcode/controller.hpp"

namespace {

using namespace shapegcode;

constexpr std::size_t n_following = 2;
constexpr std::size_t n_axes = axis_count + n_following;
using Ends = std::array<double, n_following>;

ControllerSettings settings_with(ControllerShaper shaper, bool correction) {
  ControllerSettings settings;
  settings.limits.law = AccelerationLaw::jerk_limited;
  settings.limits.max_acceleration_mm_per_s2.setConstant(2000.0);
  settings.limits.max_jerk_mm_per_s3.setConstant(50000.0);
  settings.contour_tolerance_mm = 0.02;
  settings.following.resize(n_following, {90.0, 1000.0, 50000.0});
  settings.shaper = std::move(shaper);
  settings.contour_correction = correction;
  settings.window = 16;
  settings.queue = 128;
  return settings;
}

/// Lines and quarter arcs without an end: one after the other from where the last one ended.
class Way {
 public:
  [[nodiscard]] Segment next(bool stop_at_end = false) const noexcept {
    const int number = made_ + 1;
    const double out = number % 40 < 20 ? 1.0 : -1.0;
    Segment segment;
    if (number % 4 == 0) {
      const Vector3 end = at_ + Vector3(2.0, 2.0, 0.3) * out;
      segment = make_arc(at_, end, at_ + Vector3(0.0, 2.0, 0.0) * out, std::numbers::pi / 2, 2, 60.0);
    } else {
      segment = make_line(at_, at_ + Vector3(number % 3 == 0 ? 0.02 : 1.5, 0.4, 0.1) * out, 60.0);
    }
    segment.stop_at_end = stop_at_end;
    return segment;
  }
  void passed(const Segment& segment) noexcept {
    at_ = segment.end_mm;
    ++made_;
  }
  void restart() noexcept {
    at_.setZero();
    made_ = 0;
  }
  [[nodiscard]] Ends following() const noexcept { return {0.5 * (made_ + 1), at_[0]}; }

 private:
  Vector3 at_ = Vector3::Zero();
  int made_ = 0;
};

/// A control with what is pushed into it.
struct Control {
  explicit Control(const ControllerSettings& settings) : controller(settings) {}

  /// As many segments as go in, at most `most`.
  long push(long most, bool stop_at_end = false) noexcept {
    for (long pushed = 0; pushed < most; ++pushed) {
      const Segment segment = way.next(stop_at_end && pushed + 1 == most);
      const Ends ends = way.following();
      if (controller.push(segment, ends) != PushResult::accepted) return pushed;
      way.passed(segment);
    }
    return most;
  }
  Activity step() noexcept {
    const Activity activity = controller.step(set_point);
    seen[static_cast<std::size_t>(activity)] = true;
    return activity;
  }
  /// Until it does `wanted`; how many steps that took, at most a million.
  long step_until(Activity wanted) noexcept {
    long steps = 1;
    while (step() != wanted && steps < 1'000'000) ++steps;
    return steps;
  }

  MotionController controller;
  Way way;
  std::array<double, n_axes> set_point{};
  std::array<bool, 6> seen{};
};

/// All that may happen to a control while it runs.
long live(Control& control) noexcept {
  long steps = 0;
  MotionController& controller = control.controller;
  for (int round = 0; round < 8; ++round) {
    control.push(1000);
    for (int i = 0; i < 100; ++i, ++steps) {
      if (i % 37 == 0) controller.feed_override(0.1 * static_cast<double>(steps % 21));
      if (i % 16 == 0) control.push(4);  // absorbed by the steps that follow, while it moves
      control.step();
    }
    controller.feed_override(std::numeric_limits<double>::quiet_NaN());
    controller.feed_override(1.0);
    controller.hold();
    steps += control.step_until(Activity::held);
    for (int i = 0; i < 50; ++i, ++steps) control.step();
    controller.resume();
    control.step_until(Activity::moving);
    if (round % 8 == 3) steps += control.step_until(Activity::starved);
    if (round % 8 == 5) {
      while (control.push(1, true) == 0) control.step();
      steps += control.step_until(Activity::idle);
    }
    if (round % 8 == 7) {
      controller.abort();
      steps += control.step_until(Activity::aborted);
      control.push(1);  // is refused
      controller.restart(std::array<double, n_axes>{});
      control.way.restart();
    }
    steps += static_cast<long>(controller.state().steps > 0);
  }
  return steps;
}

/// What is not taken does not allocate either.
long refuse(Control& control) noexcept {
  constexpr double not_a_number = std::numeric_limits<double>::quiet_NaN();
  long refused = 0;
  const Ends ends = control.way.following();
  for (int i = 0; i < 100; ++i) {
    Segment segment = control.way.next();
    if (i % 4 == 0) segment.feed_mm_per_s = 0.0;
    if (i % 4 == 1) segment.end_mm[0] = not_a_number;
    if (i % 4 == 2) segment.start_mm[1] += 1.0;
    const std::span<const double> following = i % 4 == 3 ? std::span<const double>() : std::span<const double>(ends);
    refused += static_cast<long>(control.controller.push(segment, following) != PushResult::accepted);
  }
  return refused;
}

void check_one(const std::string& name, const ControllerSettings& settings) {
  Control control(settings);
  expect_none(("MotionController::push, " + name).c_str(), [&] { return control.push(1000); });
  expect_none(("MotionController, " + name).c_str(), [&] { return live(control); });
  expect_none(("MotionController::push refused, " + name).c_str(), [&] { return refuse(control); });
  for (const bool seen : control.seen) expect(seen, "a control did everything that it can do");
}

/// Push and step at the same time, each counted in its own thread.
void check_two_threads(const ControllerSettings& settings) {
  Control control(settings);
  std::atomic<bool> done = false;
  interposer::Calls pushing;
  long pushed = 0;
  std::thread planner([&] {
    const interposer::Calls before = interposer::calls();
    while (!done.load(std::memory_order_relaxed)) pushed += control.push(1000);
    pushing = interposer::calls() - before;
  });
  expect_none("MotionController::step beside push", [&] {
    long steps = 0;
    for (; steps < 20'000 || control.controller.state().segments_done < 100; ++steps) control.step();
    return steps;
  });
  done = true;
  planner.join();
  expect(pushed >= 100, "100 segments were pushed beside the steps");
  expect(interposer::all(pushing) == 0, "push beside step allocates and locks nothing");
}

#if !defined(__SANITIZE_ADDRESS__)
/// Status of a child process that ends at the first system call other than read, write and exit, after `deed`.
template <class Deed>
int without_system_calls(Deed&& deed) {
  std::fflush(nullptr);
  const pid_t child = fork();
  if (child == 0) {
    if (prctl(PR_SET_SECCOMP, SECCOMP_MODE_STRICT) != 0) _exit(3);
    deed();
    syscall(SYS_exit, 0);
  }
  int status = -1;
  waitpid(child, &status, 0);
  return status;
}

void check_system_calls(const ControllerSettings& settings) {
  Control control(settings);
  const int quiet = without_system_calls([&] { live(control); });
  const int loud = without_system_calls([] { sched_yield(); });
  std::printf("%-44s %s\n", "MotionController without system calls",
              quiet == 0 ? "ends by itself" : "was ended by the kernel");
  expect(quiet == 0, "step() and push() make no system call");
  expect(WIFSIGNALED(loud), "a process that may make no system call is ended when it makes one");
}
#else
// The sanitizer makes system calls of its own.
void check_system_calls(const ControllerSettings& /*settings*/) {}
#endif

}  // namespace

void check_motion_controller() {
  const Fir one({0, 11}, {0.516, 0.484});
  const Fir other({0, 4, 9}, {0.3, 0.4, 0.3});
  const FollowingFir following(VaryingFir({one, other}), 0, {0.0, 40.0});
  for (const bool correction : {false, true}) {
    const char* end = correction ? ", corrected" : "";
    check_one(std::string("one shaper") + end, settings_with(one, correction));
    check_one(std::string("one each") + end, settings_with(std::vector(n_axes, other), correction));
    check_one(std::string("following") + end, settings_with(following, correction));
  }
  check_two_threads(settings_with(one, true));
  check_system_calls(settings_with(one, true));
}
