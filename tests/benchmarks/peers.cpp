// Drives the control for peers.py, which says what is compared:
//
//     peers play OUT.f64 < task          set-points (X, Y, Z as doubles) into a file, times as JSON on stdout
//     peers window WINDOW... -- PROGRAM... < task
//     peers random COUNT FIRST_SEED [TRACE]
#include "peers.hpp"
#include "shapegcode/planner.hpp"

#include <time.h>

#include <algorithm>
#include <array>
#include <cstdint>
#include <cstdio>
#include <exception>
#include <fstream>
#include <iostream>
#include <limits>
#include <numeric>
#include <sstream>
#include <stdexcept>
#include <string>
#include <string_view>

namespace shapegcode::peers {
namespace {

constexpr std::size_t max_steps = 2'000'000;

std::int64_t now_ns() noexcept {
  timespec now{};
  clock_gettime(CLOCK_MONOTONIC, &now);
  return std::int64_t{now.tv_sec} * 1'000'000'000 + now.tv_nsec;
}

Vector3 vector_of(std::istream& in) {
  Vector3 vector;
  in >> vector[0] >> vector[1] >> vector[2];
  return vector;
}

// A line of the task that adds to the path; false if it is another one.
bool read_segment(const std::string& word, std::istream& in, Task& task, Vector3& at) {
  if (word == "start") {
    at = vector_of(in);
  } else if (word == "stop" && !task.segments.empty()) {
    task.segments.back().stop_at_end = true;
  } else if (word == "line") {
    const Vector3 end = vector_of(in);
    double feed = 0.0;
    in >> feed;
    task.segments.push_back(make_line(at, end, feed, static_cast<std::uint32_t>(task.segments.size() + 1)));
    at = end;
  } else if (word == "arc") {
    const Vector3 end = vector_of(in);
    const Vector3 centre = vector_of(in);
    double sweep = 0.0;
    double feed = 0.0;
    int normal = 2;
    in >> sweep >> normal >> feed;
    task.segments.push_back(
        make_arc(at, end, centre, sweep, normal, feed, static_cast<std::uint32_t>(task.segments.size() + 1)));
    at = end;
  } else {
    return false;
  }
  return true;
}

bool read_setting(const std::string& word, std::istream& in, Task& task) {
  ControllerSettings& settings = task.settings;
  if (word == "period") {
    in >> settings.period_s;
  } else if (word == "window") {
    in >> settings.window;
  } else if (word == "smoothing") {
    in >> settings.smoothing_time_s;
  } else if (word == "tolerance") {
    in >> settings.contour_tolerance_mm;
  } else if (word == "correction") {
    in >> settings.contour_correction;
  } else if (word == "passes") {
    in >> task.passes;
  } else if (word == "program_feed") {
    in >> task.program_feed;
  } else if (word == "feed") {
    settings.limits.max_feed_mm_per_s = vector_of(in);
  } else if (word == "acceleration") {
    settings.limits.max_acceleration_mm_per_s2 = vector_of(in);
  } else if (word == "jerk") {
    settings.limits.max_jerk_mm_per_s3 = vector_of(in);
  } else if (word == "shaper") {
    std::vector<int> delays;
    std::vector<double> taps;
    int delay = 0;
    for (double tap = 0.0; in >> delay >> tap;) {
      delays.push_back(delay);
      taps.push_back(tap);
    }
    in.clear();
    settings.shaper = Fir(delays, taps);
  } else {
    return false;
  }
  return true;
}

// What the passes of a path took, the least of each step: what is slow in every pass is the code's own.
struct StepTimes {
  std::vector<std::int64_t> min_ns;
  double push_ns = std::numeric_limits<double>::infinity();  // per segment
  std::uint64_t late_plans = 0;
};

std::vector<double> run_once(const Task& task, StepTimes& times) {
  FedController fed(task.settings, task.segments);
  const std::int64_t before = now_ns();
  fed.feed();
  const bool all_at_once = fed.all_pushed();
  const auto pushed_ns = static_cast<double>(now_ns() - before);
  if (all_at_once) times.push_ns = std::min(times.push_ns, pushed_ns / static_cast<double>(task.segments.size()));
  std::vector<double> set_points;
  std::array<double, axis_count> out{};
  for (std::size_t i = 0;; ++i) {
    fed.feed();
    const std::int64_t begin = now_ns();
    const Activity activity = fed.control().step(out);
    const std::int64_t spent = now_ns() - begin;
    if (i == times.min_ns.size()) times.min_ns.push_back(spent);
    times.min_ns[i] = std::min(times.min_ns[i], spent);
    set_points.insert(set_points.end(), out.begin(), out.end());
    if (activity == Activity::idle && fed.all_pushed()) {
      times.late_plans = fed.control().state().late_plans;
      return set_points;
    }
    if (i == max_steps) {
      const ControllerState state = fed.control().state();
      throw std::runtime_error("not at rest after " + std::to_string(i) + " steps: segment " +
                               std::to_string(state.line) + ", " + text_of(state.activity) + " at " +
                               std::to_string(state.speed_mm_per_s) + " mm/s");
    }
  }
}

int play(const Task& task, const char* file) {
  if (task.segments.empty()) throw std::runtime_error("the task has no segments");
  StepTimes times;
  std::vector<double> set_points;
  for (int pass = 0; pass < std::max(task.passes, 1); ++pass) set_points = run_once(task, times);
  std::ofstream out(file, std::ios::binary);
  out.write(reinterpret_cast<const char*>(set_points.data()),
            static_cast<std::streamsize>(set_points.size() * sizeof(double)));
  if (!out) throw std::runtime_error(std::string(file) + " cannot be written");
  const double sum = static_cast<double>(std::accumulate(times.min_ns.begin(), times.min_ns.end(), std::int64_t{}));
  const std::size_t steps = times.min_ns.size();
  const double longest = static_cast<double>(*std::max_element(times.min_ns.begin(), times.min_ns.end()));
  const double delay = FedController(task.settings, {}).control().delay_periods();
  std::printf(
      "{\"steps\": %zu, \"step_us\": %.4f, \"longest_step_us\": %.4f, \"delay_periods\": %.17g, \"late_plans\": %llu",
      steps, 1e-3 * sum / static_cast<double>(steps), 1e-3 * longest, delay,
      static_cast<unsigned long long>(times.late_plans));
  if (times.push_ns < std::numeric_limits<double>::infinity()) std::printf(", \"push_us\": %.4f", 1e-3 * times.push_ns);
  std::printf("}\n");
  return 0;
}

// The same path and limits, planned as a whole.
int plan(const Task& task, const char* file) {
  if (task.segments.empty()) throw std::runtime_error("the task has no segments");
  const MotionLimits& given = task.settings.limits;
  const TrajectoryLimits limits{given.max_feed_mm_per_s, given.max_acceleration_mm_per_s2, given.max_jerk_mm_per_s3,
                                task.settings.contour_tolerance_mm};
  const Path path(task.segments);
  std::int64_t least_ns = std::numeric_limits<std::int64_t>::max();
  Samples samples;
  for (int pass = 0; pass < std::max(task.passes, 1); ++pass) {
    const std::int64_t begin = now_ns();
    samples = time_optimal_trajectory(path, limits, task.settings.period_s);
    least_ns = std::min(least_ns, now_ns() - begin);
  }
  std::ofstream out(file, std::ios::binary);
  for (Eigen::Index k = 0; k < samples.positions_mm.rows(); ++k) {
    const Vector3 point = samples.positions_mm.row(k);
    out.write(reinterpret_cast<const char*>(point.data()), axis_count * sizeof(double));
  }
  if (!out) throw std::runtime_error(std::string(file) + " cannot be written");
  std::printf("{\"steps\": %lld, \"plan_us\": %.4f}\n", static_cast<long long>(samples.positions_mm.rows()),
              1e-3 * static_cast<double>(least_ns) / static_cast<double>(task.segments.size()));
  return 0;
}

int run(std::span<const char* const> arguments) {
  const std::string_view what = arguments.empty() ? "" : arguments[0];
  if (what == "play" && arguments.size() == 2) return play(read_task(std::cin), arguments[1]);
  if (what == "plan" && arguments.size() == 2) return plan(read_task(std::cin), arguments[1]);
  if (what == "window" && arguments.size() > 1) return compare_windows(read_task(std::cin), arguments.subspan(1));
  if (what == "random" && (arguments.size() == 3 || arguments.size() == 4)) return random_motion(arguments.subspan(1));
  throw std::runtime_error(
      "usage: play OUT | plan OUT | window WINDOW... -- PROGRAM... | random COUNT FIRST_SEED [TRACE]");
}

}  // namespace

Task read_task(std::istream& in) {
  Task task;
  task.settings.limits.law = AccelerationLaw::jerk_limited;
  Vector3 at = Vector3::Zero();
  for (std::string text; std::getline(in, text);) {
    std::istringstream line(text);
    std::string word;
    if (!(line >> word)) continue;
    if ((!read_segment(word, line, task, at) && !read_setting(word, line, task)) || line.fail()) {
      throw std::runtime_error("the task has a line that says nothing: " + text);
    }
  }
  if (!task.segments.empty()) task.segments.back().stop_at_end = true;
  return task;
}

FedController::FedController(const ControllerSettings& settings, std::span<const Segment> segments)
    : control_(settings), segments_(segments) {
  if (!segments.empty()) control_.restart(std::span(segments.front().start_mm.data(), axis_count));
}

void FedController::feed() {
  while (next_ < segments_.size()) {
    const PushResult result = control_.push(segments_[next_]);
    if (result == PushResult::queue_full) return;
    if (result != PushResult::accepted) throw std::runtime_error(text_of(result));
    ++next_;
  }
}

}  // namespace shapegcode::peers

int main(int argc, char** argv) {
  try {
    return shapegcode::peers::run(std::span<const char* const>(argv + 1, static_cast<std::size_t>(argc - 1)));
  } catch (const std::exception& error) {
    std::fprintf(stderr, "%s: %s\n", argv[0], error.what());
    return 2;
  }
}
