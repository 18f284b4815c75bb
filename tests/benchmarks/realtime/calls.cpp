// What every call of a control takes that is not step() along a path or push(), and step() in whatever else it does.
#include <array>
#include <cmath>
#include <string>
#include <utility>
#include <vector>

#include "program.hpp"
#include "runs.hpp"
#include "system.hpp"

namespace realtime {
namespace {

using shapegcode::make_line;
using shapegcode::SegmentRules;
using SetPoint = std::array<double, shapegcode::axis_count>;

constexpr std::size_t most_calls = 1'000'000;
constexpr double turns_per_period = 0.02;

class Session {
 public:
  explicit Session(std::vector<NamedDurations>& rows) : rows_(&rows), control_(settings()) {}

  void run(int round) {
    program(round);
    by_hand(round);
    thread();
    flush();
    emergency_stop();
  }

 private:
  static shapegcode::ControllerSettings settings() {
    shapegcode::ControllerSettings settings = settings_with(64, 100);
    settings.offset.assign(shapegcode::axis_count, {20.0, 300.0, 20'000.0, 0.01});
    settings.travel.assign(shapegcode::axis_count, {-1000.0, 1000.0});
    settings.emergency_acceleration.assign(shapegcode::axis_count, 10'000.0);
    settings.retrace_periods = 4000;
    settings.contour_correction = false;  // which shapers that change have none beside
    settings.other_shapers = {shapegcode::Fir({0, 30}, {0.5, 0.5})};
    return settings;
  }

  template <typename Call>
  void timed(const char* name, Call&& call) {
    auto row = std::ranges::find(*rows_, name, &NamedDurations::name);
    if (row == rows_->end()) row = rows_->insert(row, {name, Durations(most_calls)});
    const std::int64_t begin = now_ns();
    std::forward<Call>(call)();
    row->durations.add(now_ns() - begin);
  }

  Activity step(const char* name) {
    while (control_.plan()) {
    }
    angle_ += turns_per_period;
    timed("spindle()", [&] { control_.spindle(angle_); });
    Activity activity{};
    timed(name, [&] { activity = control_.step(at_); });
    shapegcode::ControllerEvent event;
    timed("next_event()", [&] { control_.next_event(event); });
    timed("state()", [&] { steps_ = control_.state().steps; });
    return activity;
  }
  void rest(const char* name) {
    for (int n = 0; n < 4000; ++n) {
      const Activity now = step(name);
      if (now == Activity::held || now == Activity::idle || now == Activity::aborted) return;
    }
  }
  shapegcode::Vector3 here() const { return {at_[0], at_[1], at_[2]}; }

  void program(int round) {
    control_.restart(SetPoint{});
    at_ = {};
    shapegcode::Vector3 end = shapegcode::Vector3::Zero();
    for (int i = 0; i < 12; ++i) {
      const shapegcode::Vector3 next(10.0 * ((i + round) % 4), 3.0 * i, i % 2);
      if (next == end) continue;
      control_.push(make_line(std::exchange(end, next), next, 120.0));
      timed("push_event()", [&] { control_.push_event({1, 2}); });
      if (i == 5) timed("push_dwell()", [&] { control_.push_dwell(0.01); });
      if (i == 8) timed("push_stop()", [&] { control_.push_stop(); });
    }
    for (int n = 0; n < 900; ++n) {
      step("step(): path, offset, record for retrace");
      if (n % 50 == 0) timed("offset()", [&] { control_.offset(n % 3, 0.001 * (n % 70)); });
      if (n % 50 == 1) timed("feed_override()", [&] { control_.feed_override(0.8 + 0.1 * (n % 5)); });
      if (n % 50 == 2) timed("rapid_override()", [&] { control_.rapid_override(0.5); });
      if (n % 50 == 4) timed("exchange_shaper()", [&] { control_.exchange_shaper(n % 100 < 50 ? 1 : 0); });
      if (n % 50 == 3) timed("travel()", [&] { control_.travel(n % 3, {-900.0, 900.0}); });
    }
    timed("hold()", [&] { control_.hold(); });
    rest("step(): stopping");
  }

  void by_hand(int round) {
    timed("retrace()", [&] { control_.retrace(3.0 + round % 7); });
    rest("step(): retracing");
    for (int axis = 0; axis < 3; ++axis) {
      timed("jog()", [&] { control_.jog(axis, axis == round % 3 ? 40.0 : -25.0); });
    }
    for (int n = 0; n < 100; ++n) step("step(): three axes jogged");
    for (int axis = 0; axis < 3; ++axis) control_.jog(axis, 0.0);
    rest("step(): three axes jogged");
    for (int axis = 0; axis < 3; ++axis) {
      timed("jog_by()", [&] { control_.jog_by(axis, 0.37 * (1 + (round + axis) % 9), 60.0); });
    }
    rest("step(): three axes jogged");
    timed("resume()", [&] { control_.resume(); });
    for (int n = 0; n < 300; ++n) step("step(): back onto the path, and on");
  }

  void flush() {
    SetPoint position{};
    timed("probe()", [&] { control_.probe(position); });
    timed("flush()", [&] { control_.flush(); });
    rest("step(): stopping");
    bool done = false;
    for (int n = 0; n < 100 && !done; ++n) {
      timed("flushed()", [&] { done = control_.flushed(position); });
      step("step(): at rest");
    }
    at_ = position;
    control_.resume();
  }

  void thread() {
    flush();
    SegmentRules rules;
    rules.feed_rate = shapegcode::FeedRate::synchronous;
    control_.push(make_line(here(), here() - shapegcode::Vector3(0, 0, 8), 1.5), {}, rules);
    for (int n = 0; n < 500; ++n) step("step(): bound to the spindle");
  }

  void emergency_stop() {
    control_.push(make_line(here(), here() + shapegcode::Vector3(40, 0, 0), 200.0));
    for (int n = 0; n < 150; ++n) step("step(): path, offset, record for retrace");
    timed("emergency_stop()", [&] { control_.emergency_stop(); });
    rest("step(): emergency braking");
    timed("abort()", [&] { control_.abort(); });
  }

  std::vector<NamedDurations>* rows_;
  MotionController control_;
  SetPoint at_{};
  double angle_ = 0.0;
  std::uint64_t steps_ = 0;
};

}  // namespace

OtherCalls other_calls(int rounds) {
  OtherCalls found;
  found.rows.reserve(64);
  found.thread = become_real_time();
  // The first round makes the rows; what it takes is not counted.
  Session session(found.rows);
  session.run(0);
  for (NamedDurations& row : found.rows) row.durations.clear();
  const interposer::Calls before = interposer::calls();
  for (int round = 1; round <= rounds; ++round) session.run(round);
  found.calls = interposer::calls() - before;
  for (NamedDurations& row : found.rows) row.durations.sort();
  return found;
}

}  // namespace realtime
