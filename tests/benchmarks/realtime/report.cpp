#include "report.hpp"

#include <cstdarg>
#include <cstdio>
#include <fstream>
#include <stdexcept>

namespace realtime {
namespace {

constexpr std::uint32_t push_target_ns = 20'000;
constexpr double drift_target_mm = 1e-9;

[[gnu::format(printf, 1, 2)]] std::string format(const char* pattern, ...) {
  char text[512];
  std::va_list arguments;
  va_start(arguments, pattern);
  std::vsnprintf(text, sizeof text, pattern, arguments);
  va_end(arguments);
  return text;
}

std::string quoted(const std::string& text) {
  std::string result = "\"";
  for (const char c : text) {
    if (c == '"' || c == '\\') result += '\\';
    result += c;
  }
  return result + '"';
}

const std::string header =
    format("  %-42s %11s %9s %9s %9s %11s\n", "us", "number", "median", "99 %", "99.99 %", "worst");

std::string row(const std::string& name, const Durations& durations) {
  return format("  %-42s %11zu %9.3f %9.3f %9.3f %11.3f\n", name.c_str(), durations.count(), 1e-3 * durations.at(0.5),
                1e-3 * durations.at(0.99), 1e-3 * durations.at(0.9999), 1e-3 * durations.worst());
}

std::string json_of(const Durations& durations) {
  return format("{\"number\": %zu, \"median_ns\": %u, \"p99_ns\": %u, \"p9999_ns\": %u, \"worst_ns\": %u}",
                durations.count(), durations.at(0.5), durations.at(0.99), durations.at(0.9999), durations.worst());
}

void print_verdict(const char* what, double value_us, double target_us) {
  std::printf("  %s: %.3f us, asked below %g us: %s\n", what, value_us, target_us,
              value_us < target_us ? "met" : "MISSED");
}

}  // namespace

void Report::add(const std::string& key, const std::string& value) {
  json_ += (json_.empty() ? "{" : ",\n ") + quoted(key) + ": " + value;
}

void Report::expect(bool holds, const char* what) {
  if (holds) return;
  std::printf("  NOT SO: %s\n", what);
  sound_ = false;
}

void Report::calls(const char* who, const interposer::Calls& calls) {
  std::printf("  %s: %zu allocations, %zu releases, %zu locks\n", who, calls.allocations, calls.releases, calls.locks);
  expect(interposer::all(calls) == 0, "a thread allocates and locks nothing");
}

void Report::machine(const std::vector<std::string>& lines, const std::string& memory, const std::string& sleep) {
  std::string list;
  for (const std::string& line : lines) {
    std::printf("%s\n", line.c_str());
    list += (list.empty() ? "" : ", ") + quoted(line);
  }
  std::printf("memory %s; deep sleep of the processor %s\n", memory.c_str(), sleep.c_str());
  add("machine", "[" + list + "]");
  add("memory", quoted(memory));
  const char* blind = interposer::blind_spot();
  expect(blind == nullptr, "allocations and locks are counted");
}

void Report::free_run(const FreeRun& run, std::size_t window, double others_cores) {
  std::printf("\nfree-running, window %zu, %s; other processes took %.2f cores\n", window, run.thread.c_str(),
              others_cores);
  std::fputs(
      (header + row("step()", run.step) + row("  nothing new from the operator", run.usual) +
       row("  new override, hold or resume", run.with_change) + row("the clock alone, in the same run", run.clock))
          .c_str(),
      stdout);
  const double jitter_us = 1e-3 * run.clock.worst();
  std::printf("  worst step less worst of the clock: %.3f us; below %g us: %.5f %% of the steps\n",
              1e-3 * run.step.worst() - jitter_us, 1e-3 * step_target_ns,
              100.0 * static_cast<double>(run.step.below(step_target_ns)) / static_cast<double>(run.step.count()));
  print_verdict("99.99 % of step()", 1e-3 * run.step.at(0.9999), 1e-3 * step_target_ns);
  const auto steps = static_cast<double>(run.step.count());
  const std::size_t above = run.step.count() - run.step.below(step_target_ns);
  const double own = above > run.interruptions ? static_cast<double>(above - run.interruptions) : 0.0;
  std::printf(
      "  above it: %zu steps; the clock alone, in as much measured time: %zu; without these below it: %.5f %%, "
      "asked 99.99 %%: %s\n",
      above, run.interruptions, 100.0 * (1.0 - own / steps), own <= 1e-4 * steps ? "met" : "MISSED");
  std::string activities;
  for (std::size_t i = 0; i < run.activities.size(); ++i) {
    const char* name = text_of(static_cast<shapegcode::Activity>(i));
    activities += format("%s%s %zu", i == 0 ? "" : ", ", name, run.activities[i]);
  }
  std::printf("  steps: %s; %llu segments\n", activities.c_str(), static_cast<unsigned long long>(run.segments));
  calls("stepping thread", run.stepping);
  calls("planning thread", run.pushing);
  expect(run.starvations == 0, "the planning thread keeps up");
  if (push_rows_.empty()) print_histogram("step()", run.step, "clock alone", run.clock);
  push_rows_ += row("push(), window " + std::to_string(window), run.push);
  add("free_running_" + std::to_string(window),
      "{\"thread\": " + quoted(run.thread) + ", \"step\": " + json_of(run.step) + ", \"usual\": " + json_of(run.usual) +
          ", \"with_change\": " + json_of(run.with_change) + ", \"clock\": " + json_of(run.clock) +
          ", \"push\": " + json_of(run.push) +
          format(", \"below_2_us\": %.7f, \"interruptions\": %zu, \"segments\": %llu, \"others_cores\": %.3f}",
                 static_cast<double>(run.step.below(step_target_ns)) / steps, run.interruptions,
                 static_cast<unsigned long long>(run.segments), others_cores));
  std::fflush(stdout);
}

void Report::pushes() {
  std::printf("\nplanning thread of ordinary priority, in the same runs; asked: median below %g us\n%s%s",
              1e-3 * push_target_ns, header.c_str(), push_rows_.c_str());
}

void Report::repeated(const Repeated& found) {
  std::printf("\nfed by its own thread, %zu times the same steps, least time of each: the code's own\n%s%s%s%s",
              found.passes, header.c_str(), row("step()", found.step).c_str(),
              row("  nothing new from the operator", found.usual).c_str(),
              row("  new override, hold or resume", found.with_change).c_str());
  print_verdict("99.99 % of step()", 1e-3 * found.step.at(0.9999), 1e-3 * step_target_ns);
  add("repeated", format("{\"passes\": %zu, \"step\": ", found.passes) + json_of(found.step) + ", \"usual\": " +
                      json_of(found.usual) + ", \"with_change\": " + json_of(found.with_change) + "}");
  std::fflush(stdout);
}

void Report::periodic(const Periodic& found, double minutes) {
  std::printf("\nloop of 1 ms for %g min beside a busy process, %s; others took %.2f cores, the host %.3f\n%s%s%s%s",
              minutes, found.thread.c_str(), found.others_cores, found.stolen_cores, header.c_str(),
              row("late, with the control", found.late).c_str(),
              row("late, a loop without one", found.late_alone).c_str(), row("step()", found.step).c_str());
  std::printf("  missed periods: %zu with the control, %zu without\n", found.missed, found.missed_alone);
  expect(found.starvations == 0, "the planning thread keeps up");
  print_histogram("late, with", found.late, "late, without", found.late_alone);
  add("periodic", "{\"thread\": " + quoted(found.thread) + ", \"late\": " + json_of(found.late) +
                      ", \"late_alone\": " + json_of(found.late_alone) + ", \"step\": " + json_of(found.step) +
                      format(", \"missed\": %zu, \"missed_alone\": %zu, \"minutes\": %g, \"others_cores\": %.3f, "
                             "\"stolen_cores\": %.3f}",
                             found.missed, found.missed_alone, minutes, found.others_cores, found.stolen_cores));
  std::fflush(stdout);
}

void Report::other_calls(const OtherCalls& found) {
  std::printf("\nevery other call, and step() in whatever else it does; one thread, %s\n", found.thread.c_str());
  std::string text = header;
  std::string json;
  for (const NamedDurations& named : found.rows) {
    text += row(named.name, named.durations);
    json += (json.empty() ? "{" : ", ") + quoted(named.name) + ": " + json_of(named.durations);
  }
  std::fputs(text.c_str(), stdout);
  calls("all of them", found.calls);
  add("other_calls", json + "}");
  std::fflush(stdout);
}

void Report::simulated(const Simulated& found) {
  const auto steps = static_cast<double>(found.steps);
  std::printf(
      "\n%.0f steps (%.1f h) as fast as they go: %.1f s, %llu segments, %.0f ns for each step with what is pushed\n",
      steps, steps / 3.6e6, found.wall_s, static_cast<unsigned long long>(found.segments), 1e9 * found.wall_s / steps);
  std::printf("  at rest off the end of the path, at most, %d stops: %.2g mm, asked within %g mm: %s\n", found.stops,
              found.drift_mm, drift_target_mm, found.drift_mm <= drift_target_mm ? "met" : "MISSED");
  calls("step() and push()", found.calls);
  expect(found.starvations == 0, "it never ran out of segments");
  expect(!found.never_rests, "a stop is reached");
  expect(found.drift_mm <= drift_target_mm, "nothing drifts");
  add("simulated", format("{\"steps\": %llu, \"segments\": %llu, \"wall_s\": %.3f, \"stops\": %d, \"drift_mm\": %.3g, "
                          "\"allocations_and_locks\": %zu}",
                          static_cast<unsigned long long>(found.steps), static_cast<unsigned long long>(found.segments),
                          found.wall_s, found.stops, found.drift_mm, interposer::all(found.calls)));
}

void Report::write_json(const std::string& file) const {
  std::ofstream out(file);
  out << json_ << "}\n";
  if (!out.flush()) throw std::runtime_error(file + " cannot be written");
}

}  // namespace realtime
