// The runs of the benchmark: each makes a control of its own.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

#include "durations.hpp"
#include "interposer.hpp"
#include "shapegcode/controller.hpp"

namespace realtime {

constexpr std::uint32_t step_target_ns = 2000;

/// One thread steps without a pause between the steps, in bursts; another one, of ordinary priority, pushes.
struct FreeRun {
  FreeRun(std::size_t steps, std::size_t pushes)
      : step(steps), usual(steps), with_change(steps / 100), clock(steps), push(pushes) {}

  std::string thread;     ///< what the operating system gave the stepping thread
  Durations step;         ///< every step
  Durations usual;        ///< those without a new override, hold or resume
  Durations with_change;  ///< those with one
  Durations clock;        ///< the same loop, the clock alone, in bursts between those of the steps
  /// How often the clock alone took `step_target_ns` or more, in as much measured time as the steps took: what
  /// interrupted it then interrupts a step as often.
  std::size_t interruptions = 0;
  Durations push;  ///< segments that were taken
  std::array<std::size_t, 7> activities{};
  interposer::Calls stepping, pushing;
  std::uint64_t segments = 0, starvations = 0;
};
[[nodiscard]] FreeRun free_running(std::size_t steps, std::size_t window);

/// Every call that is none of these, one after another in one thread, while another form of motion is run.
struct NamedDurations {
  std::string name;
  Durations durations;
};
struct OtherCalls {
  std::string thread;
  std::vector<NamedDurations> rows;
  interposer::Calls calls;
};
[[nodiscard]] OtherCalls other_calls(int rounds);

/// The same steps several times, fed between them by the same thread: the least time of each is the code's own.
struct Repeated {
  explicit Repeated(std::size_t steps) : step(steps), usual(steps), with_change(steps) {}
  std::size_t passes = 0;
  Durations step;         ///< least of the passes
  Durations usual;        ///< of those without a new override, hold or resume
  Durations with_change;  ///< of those with one
};
[[nodiscard]] Repeated repeated(std::size_t steps, std::size_t passes);

/// A loop of 1 ms with a control and one without, half a period apart on one processor, beside a busy process.
struct Periodic {
  explicit Periodic(std::size_t periods) : late(periods), late_alone(periods), step(periods) {}
  std::string thread;
  Durations late, late_alone;  ///< from the instant that was asked for to waking up
  Durations step;
  std::size_t missed = 0, missed_alone = 0;  ///< periods that were over before their step was done
  std::uint64_t starvations = 0;
  double others_cores = 0.0;
  double stolen_cores = 0.0;  ///< by the host of a virtual machine
};
[[nodiscard]] Periodic periodic(double minutes);

/// As fast as it goes, with a stop about every thousand seconds where the position is held against the program's.
struct Simulated {
  std::uint64_t steps = 0, segments = 0, starvations = 0;
  double wall_s = 0.0;
  double drift_mm = 0.0;  ///< largest distance of a set-point at rest from the end of its segment
  int stops = 0;
  bool never_rests = false;  ///< behind a segment with stop_at_end: it was given up
  interposer::Calls calls;
};
[[nodiscard]] Simulated simulated(std::uint64_t steps);

}  // namespace realtime
