// What the benchmark asks of the operating system, and what it was given.
#pragma once

#include <time.h>

#include <sys/types.h>
#include <cstdint>
#include <string>
#include <vector>

namespace realtime {

inline constexpr std::int64_t ns_per_s = 1'000'000'000;

inline std::int64_t now_ns() noexcept {
  timespec now{};
  clock_gettime(CLOCK_MONOTONIC, &now);
  return std::int64_t{now.tv_sec} * ns_per_s + now.tv_nsec;
}

/// Until an instant of that clock.
inline void sleep_until(std::int64_t ns) noexcept {
  const timespec until{static_cast<time_t>(ns / ns_per_s), static_cast<long>(ns % ns_per_s)};
  while (clock_nanosleep(CLOCK_MONOTONIC, TIMER_ABSTIME, &until, nullptr) != 0) {
  }
}
inline void sleep_for(std::int64_t ns) noexcept { sleep_until(now_ns() + ns); }

/// Last processor: the threads that are measured run on it.
[[nodiscard]] int measured_processor() noexcept;

/// The calling thread on `measured_processor()`, with SCHED_FIFO where that is allowed; what it got.
std::string become_real_time();
/// All memory, of now and to come; what was given.
std::string lock_memory();
/// Keeps the processor from sleeping deeply as long as the process lives, where there is such a device.
std::string forbid_deep_sleep();

/// Machine, kernel and how many others run, a line each.
[[nodiscard]] std::vector<std::string> describe_machine();

/// A child process that keeps the measured processor and its memory busy. Ended with this object.
class BusyProcess {
 public:
  BusyProcess();
  ~BusyProcess();
  BusyProcess(const BusyProcess&) = delete;
  BusyProcess& operator=(const BusyProcess&) = delete;

 private:
  pid_t id_ = -1;
};

/// Time that all processors together spent on something, in cores, since this object was made (/proc/stat).
class OthersLoad {
 public:
  OthersLoad();
  /// Of other processes than this one and its children that have ended.
  [[nodiscard]] double cores() const;
  /// What the host of a virtual machine took of its processors, in cores.
  [[nodiscard]] double stolen_cores() const;

 private:
  [[nodiscard]] double wall_s() const;

  double busy_s_, own_s_, stolen_s_;
  std::int64_t begin_ns_;
};

}  // namespace realtime
