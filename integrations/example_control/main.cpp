// A small control: a program is read, planned in a thread of its own, and moves three simulated drives once in a
// millisecond, while an operator types commands. docs/tutorials/build_a_control.md leads up to it.

#include <pthread.h>
#include <sys/mman.h>
#include <time.h>

#include <algorithm>
#include <atomic>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <fstream>
#include <iterator>
#include <thread>

#include "control.hpp"
#include "operator.hpp"
#include "recorder.hpp"
#include "shapegcode/error.hpp"

using namespace shapegcode;

namespace {

struct Options {
  std::string program, csv;
  bool is_fast = false;
  Vector3 start_mm = Vector3(0.0, 0.0, 100.0);
  Machine machine;
};

constexpr const char* usage =
    "usage: example_control PROGRAM [--fast] [--csv FILE] [--start X Y Z] [--feed-forward RATIO] [--friction]\n"
    "  --fast          without a clock, as fast as it goes; commands are read to their end first\n"
    "  --csv FILE      one row per period\n"
    "  --start X Y Z   where the machine stands, in mm of the program (0 0 100)\n"
    "  --feed-forward  share of the lag of the drives that is fed forward, 0 to 1 (1)\n"
    "  --friction      in the guideways\n"
    "commands, one in a line: hold (!), resume (~), override PERCENT, probe, flush, abort, status (?), quit;\n"
    "  at rest also mdi BLOCK, jog x+ 20. With `at SECONDS` in front a command waits for that time of the run,\n"
    "  `wait` waits for rest. The run is over with quit, or where program and commands are at their end.\n"
    "Exit code 0: the whole program was run; 1: not all of it; 2: bad input\n";

bool read_number(const char* text, double low, double high, double& value) {
  char* end = nullptr;
  value = text == nullptr ? 0.0 : std::strtod(text, &end);
  return text != nullptr && end != text && *end == '\0' && value >= low && value <= high;
}

/// False, and why on stderr.
bool read_options(int count, char** words, Options& options) {
  for (int k = 1; k < count; ++k) {
    const std::string word = words[k];
    const auto next = [&] { return k + 1 < count ? words[++k] : nullptr; };
    bool is_good = true;
    if (word == "--fast") {
      options.is_fast = true;
    } else if (word == "--friction") {
      options.machine.has_friction = true;
    } else if (word == "--feed-forward") {
      is_good = read_number(next(), 0.0, 1.0, options.machine.feed_forward_ratio);
    } else if (word == "--start") {
      for (double& value : values_of(options.start_mm)) is_good = is_good && read_number(next(), -1e4, 1e4, value);
    } else if (word == "--csv") {
      const char* name = next();
      is_good = name != nullptr;
      if (is_good) options.csv = name;
    } else {
      is_good = options.program.empty() && word[0] != '-';
      options.program = word;
    }
    if (!is_good) return std::fprintf(stderr, "%s: not understood\n%s", word.c_str(), usage), false;
  }
  if (options.program.empty()) std::fputs(usage, stderr);
  return !options.program.empty();
}

// --- The real-time thread: a deadline per period ---------------------------------------------------------------------

struct Punctuality {
  long periods = 0, missed = 0;
  double worst_s = 0.0;
  bool is_real_time = false;
};

void run_periods(Control& control, double period_s, const std::atomic<bool>& ends, Punctuality& found) {
  const sched_param priority{80};
  found.is_real_time =
      pthread_setschedparam(pthread_self(), SCHED_FIFO, &priority) == 0 && mlockall(MCL_CURRENT | MCL_FUTURE) == 0;
  constexpr long second_ns = 1'000'000'000;
  const auto period_ns = static_cast<long>(std::lround(1e9 * period_s));
  timespec deadline{};
  clock_gettime(CLOCK_MONOTONIC, &deadline);
  while (!ends) {
    deadline.tv_nsec += period_ns;
    deadline.tv_sec += deadline.tv_nsec / second_ns;
    deadline.tv_nsec %= second_ns;
    clock_nanosleep(CLOCK_MONOTONIC, TIMER_ABSTIME, &deadline, nullptr);
    timespec now{};
    clock_gettime(CLOCK_MONOTONIC, &now);
    const double late_s =
        static_cast<double>(now.tv_sec - deadline.tv_sec) + 1e-9 * static_cast<double>(now.tv_nsec - deadline.tv_nsec);
    found.worst_s = std::max(found.worst_s, late_s);
    if (late_s > period_s) {  // the drives have waited: no set-points in a hurry, the next deadline counts from now
      found.missed += static_cast<long>(late_s / period_s);
      deadline = now;
    }
    control.period();
    ++found.periods;
  }
}

// --- The operator ----------------------------------------------------------------------------------------------------

void print_status(const Control& control) {
  const ControllerState s = control.state();
  std::printf("<%s|line %llu|X%.3f Y%.3f Z%.3f|%.1f mm/s|override %.0f %%|waiting %llu|starved %llu|late plans %llu>\n",
              text_of(s.activity), static_cast<unsigned long long>(s.set_point_line), s.set_point[0], s.set_point[1],
              s.set_point[2], s.speed_mm_per_s, 100.0 * s.feed_override,
              static_cast<unsigned long long>(s.segments_waiting), static_cast<unsigned long long>(s.starvations),
              static_cast<unsigned long long>(s.late_plans));
}

/// False: quit.
bool carry_out(const Command& command, Control& control) {
  std::string block = command.block;
  switch (command.key) {
    case Key::hold:
      control.hold();
      break;
    case Key::resume:
      control.resume();
      break;
    case Key::feed_override:
      control.feed_override(command.value / 100.0);
      break;
    case Key::probe:
      control.probe();
      break;
    case Key::flush:
      control.flush();
      break;
    case Key::quit:
      if (control.is_done()) return false;
      [[fallthrough]];  // not from full speed
    case Key::abort:
      control.abort();
      break;
    case Key::jog:  // from hold beside the path, back with resume; at the end an increment is a block
      if (!control.is_done()) {
        const JogResult result = control.jog_by(command.axis, command.value);
        if (result != JogResult::accepted) std::puts(text_of(result));
        break;
      }
      block = std::string("G91 G01 ") + "XYZ"[command.axis] + std::to_string(command.value) + " F3000.";
      [[fallthrough]];
    case Key::mdi:
      if (!control.run_block(block)) std::puts("only at rest, with nothing left to do");
      break;
    case Key::status:
      print_status(control);
      break;
    case Key::wait:
      break;
    case Key::unknown:
      std::puts("not understood");
      break;
  }
  return true;
}

/// Commands whose time it is, rows to the recorder. False: the run is over.
bool attend(Control& control, Terminal& terminal, Recorder& recorder, double time_s) {
  bool goes_on = true;
  while (const auto command = terminal.take(time_s, control.is_at_rest())) {
    std::printf("%.3f s: %s\n", time_s, command->line.c_str());
    goes_on = carry_out(*command, control) && goes_on;
  }
  if (const auto message = control.take_message()) std::puts(message->c_str());
  for (Row row; control.rows().take(row);) recorder.write(row);
  std::fflush(stdout);
  if (control.state().activity == Activity::aborted) return false;
  if (terminal.is_over() && control.is_held()) {
    std::puts("held, and no command will come any more");
    control.abort();
  }
  return goes_on && !(terminal.is_over() && control.is_done());
}

// --- Both ways to run ------------------------------------------------------------------------------------------------

/// One thread stands for all of them, and a second is as long as it takes.
void run_fast(Control& control, Terminal& terminal, Recorder& recorder, double period_s) {
  terminal.read_to_the_end();
  for (double time_s = 0.0; attend(control, terminal, recorder, time_s); time_s += period_s) {
    while (control.plan()) {
    }
    control.period();
  }
}

Punctuality run_by_the_clock(Control& control, Terminal& terminal, Recorder& recorder, double period_s) {
  Punctuality found;
  std::atomic<bool> ends = false;
  std::thread planner([&] {
    while (!ends) {
      if (!control.plan()) std::this_thread::sleep_for(std::chrono::milliseconds(5));
    }
  });
  std::thread real_time([&] { run_periods(control, period_s, ends, found); });
  while (attend(control, terminal, recorder, static_cast<double>(control.state().steps) * period_s)) {
    terminal.look();
    std::this_thread::sleep_for(std::chrono::milliseconds(5));
  }
  ends = true;
  real_time.join();
  planner.join();
  return found;
}

int run(const Options& options) {
  std::ifstream file(options.program, std::ios::binary);
  if (!file) return std::fprintf(stderr, "%s: cannot be read\n", options.program.c_str()), 2;
  const Job job = read_job({std::istreambuf_iterator<char>(file), {}}, options.start_mm, options.machine);
  for (const std::string& warning : job.warnings) std::fprintf(stderr, "%s\n", warning.c_str());
  std::FILE* csv = options.csv.empty() ? nullptr : std::fopen(options.csv.c_str(), "w");
  if (csv == nullptr && !options.csv.empty()) {
    return std::fprintf(stderr, "%s: cannot be written\n", options.csv.c_str()), 2;
  }
  Recorder recorder(path_of(job), csv);
  Control control(options.machine, job, options.start_mm);
  Terminal terminal;
  Punctuality found;
  if (options.is_fast) {
    run_fast(control, terminal, recorder, options.machine.period_s);
  } else {
    found = run_by_the_clock(control, terminal, recorder, options.machine.period_s);
  }
  for (Row row; control.rows().take(row);) recorder.write(row);
  print_status(control);
  std::printf("set-points off the path by at most %.2f um, the table by %.2f um\n", recorder.max_set_point_off_um(),
              recorder.max_table_off_um());
  if (!options.is_fast) {
    std::printf("%ld periods, %ld missed, late by at most %.0f us (%s)\n", found.periods, found.missed,
                1e6 * found.worst_s, found.is_real_time ? "SCHED_FIFO, memory locked" : "no real-time priority");
  }
  const bool is_written = csv == nullptr || std::fclose(csv) == 0;
  if (!is_written || control.rows().lost() > 0) std::fputs("the record is not whole\n", stderr);
  return control.is_cut_short() || !is_written || control.rows().lost() > 0 ? 1 : 0;
}

}  // namespace

int main(int count, char** words) {
  Options options;
  if (!read_options(count, words, options)) return 2;
  try {
    return run(options);
  } catch (const Error& error) {
    std::fprintf(stderr, "%s: line %u: %s\n", options.program.c_str(), error.line(), error.what());
    return 2;
  }
}
