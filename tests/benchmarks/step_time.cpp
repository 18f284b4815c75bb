// How long one step() of the real-time forms takes: step_time PAPER.nc LONG.nc prints one JSON object.
//
// Every step is timed on its own, between two readings of the monotonic clock. The same steps are repeated in several
// passes: what is slow in one pass only is the operating system's doing, what is slow in every pass is the code's.
#include <time.h>

#include <algorithm>
#include <cstdint>
#include <cstdio>
#include <exception>
#include <fstream>
#include <iterator>
#include <limits>
#include <memory>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

#include "shapegcode/fanuc_model.hpp"
#include "shapegcode/filter.hpp"
#include "shapegcode/motion.hpp"
#include "shapegcode/plant/modal.hpp"
#include "shapegcode/program.hpp"

namespace {

using namespace shapegcode;

constexpr double period_s = 1e-3;
constexpr std::size_t steps_wanted = 1'000'000;  // per case, over all passes at least; per pass at most
constexpr std::size_t min_passes = 5;

std::int64_t now_ns() noexcept {
  timespec now{};
  clock_gettime(CLOCK_MONOTONIC, &now);
  return std::int64_t{now.tv_sec} * 1'000'000'000 + now.tv_nsec;
}

// Keeps the compiler from leaving out or moving what made `value`.
void consume(const Vector3& value) noexcept { asm volatile("" : : "r"(value.data()) : "memory"); }

class Report {
 public:
  // `make_step()` returns a fresh stepper at its start; a stepper makes its i-th step.
  template <class MakeStep>
  void measure(const char* name, std::size_t steps, MakeStep&& make_step) {
    steps = std::min(steps, steps_wanted);
    const std::size_t passes = std::max(min_passes, (steps_wanted + steps - 1) / steps);
    constexpr auto none = std::numeric_limits<std::uint32_t>::max();
    std::vector<std::uint32_t> least(steps, none);
    std::vector<std::uint32_t> all;
    all.reserve(passes * steps);
    for (std::size_t pass = 0; pass < passes; ++pass) {
      auto step = make_step();
      for (std::size_t i = 0; i < steps; ++i) {
        const std::int64_t begin = now_ns();
        step(i);
        const auto spent = static_cast<std::uint32_t>(std::min<std::int64_t>(now_ns() - begin, none));
        all.push_back(spent);
        least[i] = std::min(least[i], spent);
      }
    }
    std::sort(all.begin(), all.end());
    const auto at = [&](double share) {
      return all[static_cast<std::size_t>(share * static_cast<double>(all.size() - 1))];
    };
    std::printf(
        "%s\"%s\": {\"steps\": %zu, \"passes\": %zu, \"median_ns\": %u, \"p9999_ns\": %u, \"longest_ns\": %u, "
        "\"longest_repeatable_ns\": %u}",
        first_ ? "{" : ",\n ", name, steps, passes, at(0.5), at(0.9999), all.back(),
        *std::max_element(least.begin(), least.end()));
    first_ = false;
  }
  void finish() const { std::printf("}\n"); }

 private:
  bool first_ = true;
};

// The longest cutting path of a program.
std::shared_ptr<const Path> cutting_path(const char* file) {
  std::ifstream in(file, std::ios::binary);
  if (!in) throw std::runtime_error(std::string(file) + " cannot be read");
  ReaderOptions options;
  const Program program = read_program(std::string(std::istreambuf_iterator<char>(in), {}), options);
  std::shared_ptr<const Path> longest;
  for (const auto& region : program.regions) {
    if (!longest || region->path->length_mm() > longest->length_mm()) longest = region->path;
  }
  if (!longest) throw std::runtime_error(std::string(file) + " has no cutting moves");
  return longest;
}

// The built-in VX500's look-ahead.
std::shared_ptr<const SpeedProfile> look_ahead(const Path& path) {
  MotionLimits limits;
  limits.time_constant_s = 0.05;
  limits.max_feed_mm_per_s = Vector3::Constant(250.0);
  limits.max_acceleration_mm_per_s2 = Vector3::Constant(5000.0);
  limits.corner_speed_difference_mm_per_s = Vector3::Constant(500.0 / 60.0);
  limits.centripetal_acceleration_mm_per_s2 = 2500.0;
  return std::make_shared<const SpeedProfile>(plan_speed(path, limits));
}

void interpolator(Report& report, const char* name, const std::shared_ptr<const Path>& path) {
  const auto profile = look_ahead(*path);
  const Interpolator start(path, profile, period_s);
  report.measure(name, start.sample_count(), [&] {
    return [stepper = start](std::size_t /*i*/) mutable {
      Vector3 position;
      stepper.step(position);
      consume(position);
    };
  });
}

void block_player(Report& report, const char* name, const Path& path) {
  std::size_t samples = 0;
  Vector3 position;
  for (BlockInterpolator player(path.segments(), period_s, BlockEnd::ceil); player.step(position);) ++samples;
  report.measure(name, samples, [&] {
    return [player = BlockInterpolator(path.segments(), period_s, BlockEnd::ceil)](std::size_t /*i*/) mutable {
      Vector3 at;
      player.step(at);
      consume(at);
    };
  });
}

void run(const char* paper_file, const char* long_file) {
  const auto paper_path = cutting_path(paper_file);
  const auto long_path = cutting_path(long_file);
  Report report;
  report.measure("clock", steps_wanted, [] { return [](std::size_t /*i*/) {}; });
  interpolator(report, "interpolator_paper", paper_path);
  interpolator(report, "interpolator_long", long_path);
  block_player(report, "block_player_paper", *paper_path);
  block_player(report, "block_player_long", *long_path);

  // Filter and plant get the long path's set-points.
  Interpolator source(long_path, look_ahead(*long_path), period_s);
  std::vector<Vector3> setpoints(std::min(steps_wanted, source.sample_count()));
  for (Vector3& setpoint : setpoints) source.step(setpoint);

  FirStream fir_start(Fir({0, 7, 11}, {0.4, 0.3, 0.3}), axis_count);
  fir_start.reset(values_of(setpoints.front()));
  report.measure("fir_stream", setpoints.size(), [&] {
    return [&setpoints, stream = fir_start](std::size_t i) mutable {
      Vector3 position = setpoints[i];
      stream.step(values_of(position), values_of(position));
      consume(position);
    };
  });

  ModalPlant plant_start({std::vector<Mode>{{46.0, 0.02, 1.0}}, std::vector<Mode>{{131.0, 0.02, 1.0}}, {}}, period_s);
  plant_start.reset(setpoints.front());
  report.measure("modal_plant", setpoints.size(), [&] {
    return [&setpoints, plant = plant_start](std::size_t i) mutable { consume(plant.step(setpoints[i])); };
  });
  report.finish();
}

}  // namespace

int main(int argc, char** argv) {
  if (argc != 3) {
    std::fprintf(stderr, "usage: %s PAPER.nc LONG.nc\n", argv[0]);
    return 2;
  }
  try {
    run(argv[1], argv[2]);
  } catch (const std::exception& error) {
    std::fprintf(stderr, "%s: %s\n", argv[0], error.what());
    return 2;
  }
  return 0;
}
