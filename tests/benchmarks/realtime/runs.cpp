#include "runs.hpp"

#include <algorithm>
#include <atomic>
#include <cstdio>
#include <limits>
#include <memory>
#include <thread>
#include <vector>

#include "program.hpp"
#include "system.hpp"

namespace realtime {
namespace {

using shapegcode::axis_count;
using SetPoint = std::array<double, axis_count>;

constexpr std::size_t burst = 500;
// More than a burst; and what a loop of 1 ms has.
constexpr int free_lead = 800;
constexpr int periodic_lead = 200;
constexpr std::int64_t nap_ns = 100'000;

// Keeps the compiler from leaving out or moving what made `values`.
void consume(const SetPoint& values) noexcept { asm volatile("" : : "r"(values.data()) : "memory"); }

// Pushes a program into a control; one segment is made ahead, so that making it is no part of what is timed.
class Feeder {
 public:
  explicit Feeder(MotionController& control) : control_(&control), segment_(program_.next()) {}

  // One segment, false if the queue is full.
  bool push() { return taken(control_->push(segment_)); }
  bool push(Durations& durations) {
    const std::int64_t begin = now_ns();
    const PushResult result = control_->push(segment_);
    const std::int64_t end = now_ns();
    if (result == PushResult::accepted) durations.add(end - begin);
    return taken(result);
  }
  void fill() {
    while (push()) {
    }
  }
  // One that the program stops behind.
  bool push_last() {
    segment_.stop_at_end = true;
    end_ = segment_.end_mm;
    return push();
  }
  // Where the last of push_last() ends.
  [[nodiscard]] const Vector3& end() const noexcept { return end_; }

 private:
  bool taken(PushResult result) {
    if (result == PushResult::queue_full) return false;
    if (result != PushResult::accepted) {
      std::fprintf(stderr, "a segment was refused: %s\n", text_of(result));
      std::abort();
    }
    segment_ = program_.next();
    return true;
  }

  MotionController* control_;
  Program program_;
  Segment segment_;
  Vector3 end_ = Vector3::Zero();
};

// A thread that pushes whenever there is room, and plans.
class Planner {
 public:
  Planner(MotionController& control, Feeder& feeder, Durations& durations)
      : thread_([&] { run(control, feeder, durations); }) {}
  ~Planner() { stop(); }
  Planner(const Planner&) = delete;
  Planner& operator=(const Planner&) = delete;

  interposer::Calls stop() {
    ended_ = true;
    if (thread_.joinable()) thread_.join();
    return calls_;
  }
  // How often there was nothing left to plan.
  [[nodiscard]] std::uint64_t finished() const noexcept { return finished_.load(std::memory_order_acquire); }

 private:
  void run(MotionController& control, Feeder& feeder, Durations& durations) {
    const interposer::Calls before = interposer::calls();
    while (!ended_.load(std::memory_order_relaxed)) {
      while (feeder.push(durations)) {
      }
      if (control.plan()) continue;
      finished_.fetch_add(1, std::memory_order_release);
      sleep_for(nap_ns);
    }
    calls_ = interposer::calls() - before;
  }

  std::atomic<bool> ended_ = false;
  std::atomic<std::uint64_t> finished_ = 0;
  interposer::Calls calls_;
  std::thread thread_;
};

void free_steps(FreeRun& run, MotionController& control, const Planner& planner, std::size_t steps) {
  run.thread = become_real_time();
  SetPoint set_point{};
  Operator panel;
  Activity activity = Activity::idle;
  const interposer::Calls before = interposer::calls();
  for (std::size_t done = 0; done < steps; done += burst) {
    const std::uint64_t finished = planner.finished();
    while (planner.finished() < finished + 2) sleep_for(nap_ns);
    std::int64_t left = 0;  // of the time that the clock is read for
    for (std::size_t i = 0; i < burst; ++i) {
      const bool changes = panel.act(control, activity);
      const std::int64_t begin = now_ns();
      activity = control.step(set_point);
      consume(set_point);
      const std::int64_t spent = now_ns() - begin;
      left += spent;
      run.step.add(spent);
      (changes ? run.with_change : run.usual).add(spent);
      ++run.activities[static_cast<std::size_t>(activity)];
    }
    for (std::size_t i = 0; i < burst || left > 0; ++i) {
      const std::int64_t begin = now_ns();
      consume(set_point);
      const std::int64_t spent = now_ns() - begin;
      left -= spent;
      run.interruptions += spent >= step_target_ns ? 1U : 0U;
      if (i < burst) run.clock.add(spent);
    }
  }
  run.stepping = interposer::calls() - before;
}

// Steps a fresh control, fed every 64 steps; `each(i, changes, ns)` has the time of step i.
template <class Each>
void steps_of_one_thread(std::size_t steps, Each&& each) {
  MotionController control(settings_with(128, free_lead));
  Feeder feeder(control);
  Operator panel;
  SetPoint set_point{};
  Activity activity = Activity::idle;
  for (std::size_t i = 0; i < steps; ++i) {
    if (i % 64 == 0) {
      feeder.fill();
      while (control.plan()) {
      }
    }
    const bool changes = panel.act(control, activity);
    const std::int64_t begin = now_ns();
    activity = control.step(set_point);
    consume(set_point);
    each(i, changes, now_ns() - begin);
  }
}

}  // namespace

FreeRun free_running(std::size_t steps, std::size_t window) {
  steps = (steps + burst - 1) / burst * burst;
  FreeRun run(steps, steps);
  MotionController control(settings_with(window, free_lead));
  Feeder feeder(control);
  Planner planner(control, feeder, run.push);
  std::atomic<bool> ended = false;
  std::thread stepping([&] {
    free_steps(run, control, planner, steps);
    ended = true;
  });
  // Somebody looks at the state, as a user interface does.
  while (!ended) {
    sleep_for(ns_per_s / 20);
    static_cast<void>(control.state());
  }
  stepping.join();
  run.pushing = planner.stop();
  run.segments = control.state().segments_done;
  run.starvations = control.state().starvations;
  for (Durations* durations : {&run.step, &run.usual, &run.with_change, &run.clock, &run.push}) durations->sort();
  return run;
}

Repeated repeated(std::size_t steps, std::size_t passes) {
  Repeated found(steps);
  found.passes = passes;
  std::vector<std::int64_t> least(steps, std::numeric_limits<std::int64_t>::max());
  std::vector<bool> changed(steps);
  std::thread thread([&] {
    static_cast<void>(become_real_time());
    for (std::size_t pass = 0; pass < passes; ++pass) {
      steps_of_one_thread(steps, [&](std::size_t i, bool changes, std::int64_t ns) {
        least[i] = std::min(least[i], ns);
        changed[i] = changes;
        if (i % 1000 == 0) sleep_for(nap_ns);  // a real-time thread may not take a whole second
      });
    }
  });
  thread.join();
  for (std::size_t i = 0; i < steps; ++i) {
    found.step.add(least[i]);
    (changed[i] ? found.with_change : found.usual).add(least[i]);
  }
  for (Durations* durations : {&found.step, &found.usual, &found.with_change}) durations->sort();
  return found;
}

Periodic periodic(double minutes) {
  constexpr auto period_ns = static_cast<std::int64_t>(period_s * 1e9);
  const auto periods = static_cast<std::size_t>(minutes * 60e9 / static_cast<double>(period_ns));
  Periodic found(periods);
  MotionController control(settings_with(128, periodic_lead));
  Feeder feeder(control);
  Durations pushes(1);
  const OthersLoad load;
  auto busy = std::make_unique<BusyProcess>();
  Planner planner(control, feeder, pushes);
  sleep_for(ns_per_s / 2);
  const std::int64_t start = now_ns() + ns_per_s / 10;

  // `work()` once a period; the lateness of each into `late`, periods that were over too soon into `missed`.
  const auto loop = [&](std::int64_t first, Durations& late, std::size_t& missed, auto&& work) {
    std::int64_t next = first;
    for (std::size_t i = 0; i < periods; ++i, next += period_ns) {
      sleep_until(next);
      late.add(now_ns() - next);
      work();
      for (; now_ns() > next + period_ns && i + 1 < periods; ++i, next += period_ns) ++missed;
    }
  };
  std::thread stepping([&] {
    found.thread = become_real_time();
    SetPoint set_point{};
    Operator panel;
    Activity activity = Activity::idle;
    loop(start, found.late, found.missed, [&] {
      panel.act(control, activity);
      const std::int64_t begin = now_ns();
      activity = control.step(set_point);
      consume(set_point);
      found.step.add(now_ns() - begin);
    });
  });
  std::thread alone([&] {
    static_cast<void>(become_real_time());
    loop(start + period_ns / 2, found.late_alone, found.missed_alone, [] {});
  });
  stepping.join();
  alone.join();
  planner.stop();
  busy.reset();  // counted among our own from here on
  found.starvations = control.state().starvations;
  found.others_cores = load.cores();
  found.stolen_cores = load.stolen_cores();
  for (Durations* durations : {&found.late, &found.late_alone, &found.step}) durations->sort();
  return found;
}

Simulated simulated(std::uint64_t steps) {
  constexpr std::uint64_t between_stops = 1'000'000;
  constexpr std::uint64_t max_to_rest = 1'000'000;
  Simulated found;
  MotionController control(settings_with(128));
  Feeder feeder(control);
  Operator panel;
  SetPoint set_point{};
  Activity activity = Activity::idle;
  const interposer::Calls before = interposer::calls();
  const std::int64_t begin = now_ns();
  const auto step = [&] {
    panel.act(control, activity);
    activity = control.step(set_point);
    ++found.steps;
  };
  while (found.steps < steps) {
    for (std::uint64_t i = 0; i < between_stops && found.steps < steps; ++i) {
      if (i % 64 == 0) feeder.fill();
      step();
    }
    while (!feeder.push_last()) step();
    std::uint64_t left = max_to_rest;
    do {
      step();
    } while (activity != Activity::idle && activity != Activity::starved && --left > 0);
    if (left == 0) {
      found.never_rests = true;
      break;
    }
    const Vector3 at(set_point.data());
    found.drift_mm = std::max(found.drift_mm, (at - feeder.end()).cwiseAbs().maxCoeff());
    ++found.stops;
  }
  found.wall_s = static_cast<double>(now_ns() - begin) / static_cast<double>(ns_per_s);
  found.calls = interposer::calls() - before;
  const auto state = control.state();
  found.segments = state.segments_done;
  found.starvations = state.starvations;
  return found;
}

}  // namespace realtime
