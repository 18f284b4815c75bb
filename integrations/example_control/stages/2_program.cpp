// The moves of a program, pushed as there is room for them.
//   2_program PROGRAM

#include <array>
#include <cstdio>
#include <fstream>
#include <iterator>

#include "job.hpp"
#include "shapegcode/error.hpp"

using namespace shapegcode;

int main(int count, char** words) try {
  std::ifstream file(count == 2 ? words[1] : "", std::ios::binary);
  if (!file) return std::fprintf(stderr, "usage: %s PROGRAM, a file that can be read\n", words[0]), 2;
  Machine machine;
  const Vector3 start(0.0, 0.0, 100.0);
  const Job job = read_job({std::istreambuf_iterator<char>(file), {}}, start, machine);

  ControllerSettings settings = settings_of(machine);
  settings.plans_in_step = true;  // no thread yet that plans
  MotionController control(settings);
  control.restart(values_of(start));
  std::array<double, 3> set_point{};
  std::size_t next = 0;
  int periods = 0;
  for (Activity activity = Activity::moving; next < job.items.size() || activity != Activity::idle; ++periods) {
    // Moves alone: no spindle, no coolant, no stops.
    while (next < job.items.size()) {
      const auto* segment = std::get_if<Segment>(&job.items[next]);
      if (segment != nullptr && control.push(*segment) != PushResult::accepted) break;  // full: later
      ++next;
    }
    activity = control.step(set_point);
  }
  std::printf("%.3f s, at X %.3f Y %.3f Z %.3f\n", periods * settings.period_s, set_point[0], set_point[1],
              set_point[2]);
  return job.end_mm == Vector3(set_point[0], set_point[1], set_point[2]) ? 0 : 1;
} catch (const Error& error) {
  std::fprintf(stderr, "%s: line %u: %s\n", words[1], error.line(), error.what());
  return 2;
}
