#include "system.hpp"

#include <fcntl.h>
#include <pthread.h>
#include <sched.h>
#include <signal.h>
#include <sys/mman.h>
#include <sys/prctl.h>
#include <sys/resource.h>
#include <sys/utsname.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <fstream>
#include <sstream>
#include <stdexcept>

namespace realtime {
namespace {

constexpr int priority = 80;

cpu_set_t set_of(int processor) noexcept {
  cpu_set_t set;
  CPU_ZERO(&set);
  CPU_SET(static_cast<std::size_t>(processor), &set);
  return set;
}

std::string first_line(const char* file, const std::string& key = "") {
  std::ifstream in(file);
  for (std::string line; std::getline(in, line);) {
    if (line.rfind(key, 0) != 0) continue;
    const std::size_t colon = key.empty() ? std::string::npos : line.find(": ");
    return colon == std::string::npos ? line : line.substr(colon + 2);
  }
  return "";
}

// Of all processors: what the fields from `first` to `last` of /proc/stat count, without idle and iowait.
double processors_s(int first, int last) {
  std::istringstream line(first_line("/proc/stat").substr(3));
  double sum = 0.0;
  double value = 0.0;
  // user nice system idle iowait irq softirq steal
  for (int i = 0; i <= last && line >> value; ++i) sum += i < first || i == 3 || i == 4 ? 0.0 : value;
  return sum / static_cast<double>(sysconf(_SC_CLK_TCK));
}
double busy_s() { return processors_s(0, 6); }
double stolen_s() { return processors_s(7, 7); }

double own_s() {
  double sum = 0.0;
  for (const auto who : {RUSAGE_SELF, RUSAGE_CHILDREN}) {
    rusage usage{};
    getrusage(who, &usage);
    for (const timeval& part : {usage.ru_utime, usage.ru_stime}) {
      sum += static_cast<double>(part.tv_sec) + 1e-6 * static_cast<double>(part.tv_usec);
    }
  }
  return sum;
}

[[noreturn]] void be_busy() {
  std::vector<double> memory(4 << 20, 1.0);  // 32 MB: more than most caches
  double sink = 0.0;
  for (std::size_t round = 0;; ++round) {
    for (double& value : memory) value = value * 0.999 + 1e-3 * static_cast<double>(round % 7);
    sink += memory[round % memory.size()];
    if (sink < 0.0) _exit(0);
    sched_yield();  // and a system call now and then
  }
}

}  // namespace

int measured_processor() noexcept {
  static const int last = static_cast<int>(sysconf(_SC_NPROCESSORS_ONLN)) - 1;
  return last;
}

std::string become_real_time() {
  const cpu_set_t set = set_of(measured_processor());
  std::string got = "processor " + std::to_string(measured_processor());
  if (const int error = pthread_setaffinity_np(pthread_self(), sizeof set, &set); error != 0) {
    got = std::string("any processor (") + std::strerror(error) + ")";
  }
  sched_param parameter{};
  parameter.sched_priority = priority;
  const int error = pthread_setschedparam(pthread_self(), SCHED_FIFO, &parameter);
  if (error == 0) return "SCHED_FIFO " + std::to_string(priority) + ", " + got;
  prctl(PR_SET_TIMERSLACK, 1UL);
  return std::string("no SCHED_FIFO (") + std::strerror(error) + "): ordinary priority, " + got;
}

std::string lock_memory() {
  if (mlockall(MCL_CURRENT | MCL_FUTURE) == 0) return "locked (mlockall)";
  return std::string("not locked (") + std::strerror(errno) + ")";
}

std::string forbid_deep_sleep() {
  const int file = open("/dev/cpu_dma_latency", O_RDWR | O_CLOEXEC);  // held open to the end of the process
  const std::int32_t latency_us = 0;
  if (file >= 0 && write(file, &latency_us, sizeof latency_us) == sizeof latency_us) return "forbidden";
  return "not in our hands (no /dev/cpu_dma_latency)";
}

std::vector<std::string> describe_machine() {
  utsname name{};
  uname(&name);
  const bool patched = first_line("/sys/kernel/realtime") == "1" || std::strstr(name.version, "PREEMPT_RT") != nullptr;
  std::string model = first_line("/proc/cpuinfo", "model name");
  if (model.empty()) model = name.machine;
  const bool guest = !first_line("/proc/cpuinfo", "flags").empty() &&
                     (" " + first_line("/proc/cpuinfo", "flags") + " ").find(" hypervisor ") != std::string::npos;
  return {
      model + ", " + std::to_string(measured_processor() + 1) + " processors" + (guest ? ", a virtual machine" : ""),
      std::string("Linux ") + name.release + (patched ? ", real-time (PREEMPT_RT)" : ", no real-time kernel"),
      "load before " + first_line("/proc/loadavg").substr(0, 4)};
}

BusyProcess::BusyProcess() {
  const pid_t parent = getpid();
  id_ = fork();
  if (id_ < 0) throw std::runtime_error(std::string("no second process: ") + std::strerror(errno));
  if (id_ != 0) return;
  prctl(PR_SET_PDEATHSIG, SIGKILL);
  if (getppid() != parent) _exit(0);
  const cpu_set_t set = set_of(measured_processor());
  sched_setaffinity(0, sizeof set, &set);
  be_busy();
}

BusyProcess::~BusyProcess() {
  kill(id_, SIGKILL);
  waitpid(id_, nullptr, 0);
}

OthersLoad::OthersLoad() : busy_s_(busy_s()), own_s_(own_s()), stolen_s_(stolen_s()), begin_ns_(now_ns()) {}

double OthersLoad::wall_s() const {
  return std::max(static_cast<double>(now_ns() - begin_ns_) / static_cast<double>(ns_per_s), 1e-3);
}

double OthersLoad::cores() const { return std::max(0.0, (busy_s() - busy_s_) - (own_s() - own_s_)) / wall_s(); }

double OthersLoad::stolen_cores() const { return (stolen_s() - stolen_s_) / wall_s(); }

}  // namespace realtime
