// Time under look-ahead over a window of segments against the plan of the whole path.
#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <fstream>
#include <iterator>
#include <limits>
#include <stdexcept>
#include <string>
#include <string_view>

#include "peers.hpp"
#include "shapegcode/planner.hpp"
#include "shapegcode/program.hpp"

namespace shapegcode::peers {
namespace {

constexpr std::size_t max_steps = 10'000'000;

// Cutting moves between stops; rapids are no part of it.
std::vector<std::vector<Segment>> cutting_paths(const char* file, double feed_mm_per_s) {
  std::ifstream in(file, std::ios::binary);
  if (!in) throw std::runtime_error(std::string(file) + " cannot be read");
  ReaderOptions options;
  const Program program = read_program(std::string(std::istreambuf_iterator<char>(in), {}), options);
  std::vector<std::vector<Segment>> paths;
  for (const auto& region : program.regions) {
    const Segments all = region->path->segments();
    std::vector<Segment> segments(all.begin(), all.end());
    if (segments.empty()) continue;
    for (Segment& segment : segments) {
      if (feed_mm_per_s > 0.0) segment.feed_mm_per_s = feed_mm_per_s;
    }
    segments.back().stop_at_end = true;
    paths.push_back(std::move(segments));
  }
  if (paths.empty()) throw std::runtime_error(std::string(file) + " has no cutting moves");
  return paths;
}

// Periods in which the profile moved.
std::size_t moving_periods(const ControllerSettings& settings, const std::vector<Segment>& segments) {
  FedController fed(settings, segments);
  std::array<double, axis_count> out{};
  std::size_t moving = 0;
  double before = 0.0;
  for (std::size_t steps = 0;; ++steps) {
    if (steps == max_steps) throw std::runtime_error("not at rest after " + std::to_string(steps) + " steps");
    const Activity activity = fed.step(out);
    const double distance = fed.control().state().distance_mm;
    if (distance != before) ++moving;
    before = distance;
    if (activity == Activity::idle && fed.all_pushed()) return moving;
  }
}

std::size_t planned_periods(const ControllerSettings& settings, const std::vector<Segment>& segments) {
  const MotionLimits& given = settings.limits;
  const TrajectoryLimits limits{given.max_feed_mm_per_s, given.max_acceleration_mm_per_s2, given.max_jerk_mm_per_s3,
                                settings.contour_tolerance_mm};
  return static_cast<std::size_t>(
      time_optimal_trajectory(Path(segments), limits, settings.period_s).positions_mm.rows() - 1);
}

void compare(Task task, const std::vector<std::size_t>& windows, const char* program) {
  const auto paths = cutting_paths(program, task.program_feed);
  std::size_t segments = 0;
  std::size_t longest = 0;
  std::size_t planned = 0;
  for (const auto& path : paths) {
    segments += path.size();
    longest = std::max(longest, path.size());
    planned += planned_periods(task.settings, path);
  }
  std::printf("{\"program\": \"%s\", \"paths\": %zu, \"segments\": %zu, \"longest_path\": %zu, \"planned_s\": %.6f",
              program, paths.size(), segments, longest, static_cast<double>(planned) * task.settings.period_s);
  std::printf(", \"windows\": {");
  for (const std::size_t window : windows) {
    task.settings.window = window;
    std::size_t moving = 0;
    for (const auto& path : paths) moving += moving_periods(task.settings, path);
    std::printf("%s\"%zu\": %.6f", window == windows.front() ? "" : ", ", window,
                static_cast<double>(moving) * task.settings.period_s);
  }
  std::printf("}}");
}

}  // namespace

int compare_windows(const Task& task, std::span<const char* const> arguments) {
  const auto dashes = std::ranges::find(arguments, std::string_view("--"));
  std::vector<std::size_t> windows;
  for (auto at = arguments.begin(); at != dashes; ++at) windows.push_back(std::strtoul(*at, nullptr, 10));
  if (windows.empty() || dashes == arguments.end()) throw std::runtime_error("windows, then -- and programs");
  std::printf("[");
  for (auto program = dashes + 1; program != arguments.end(); ++program) {
    if (program != dashes + 1) std::printf(",\n ");
    compare(task, windows, *program);
    std::fflush(stdout);
  }
  std::printf("]\n");
  return 0;
}

}  // namespace shapegcode::peers
