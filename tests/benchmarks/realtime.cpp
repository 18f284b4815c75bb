// MotionController in real time: how long step() and push() take, how late a loop of 1 ms wakes up, whether an hour
// drifts. `realtime --help` has the options.
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <exception>
#include <memory>
#include <optional>
#include <stdexcept>
#include <string>
#include <vector>

#include "realtime/report.hpp"
#include "realtime/runs.hpp"
#include "realtime/system.hpp"

namespace {

using namespace realtime;

constexpr const char* usage =
    "usage: realtime [--steps N] [--minutes M] [--drift] [--json FILE]\n"
    "  --steps N     free-running steps (10000000); 0: leave them out\n"
    "  --minutes M   of the loop of 1 ms beside a busy process (10); 0: leave it out\n"
    "  --drift       a hundred million simulated steps in place of an hour of them\n"
    "  --json FILE   every figure, and the histograms\n";

struct Options {
  std::size_t steps = 10'000'000;
  double minutes = 10.0;
  std::uint64_t simulated_steps = 3'600'000;
  std::string json;
};

double number_of(const char* text, const char* option) {
  char* end = nullptr;
  const double value = std::strtod(text, &end);
  if (end == text || *end != '\0' || !(value >= 0.0) || value > 1e9) {
    throw std::runtime_error(std::string(option) + " wants a number from 0 to 1e9, not " + text);
  }
  return value;
}

std::optional<Options> read_options(int argc, char** argv) {
  Options options;
  for (int i = 1; i < argc; ++i) {
    const std::string name = argv[i];
    if (name == "--help") return std::nullopt;
    if (name == "--drift") {
      options.simulated_steps = 100'000'000;
      continue;
    }
    if (++i == argc) throw std::runtime_error(name + " is no option, or wants a value\n" + usage);
    if (name == "--steps") {
      options.steps = static_cast<std::size_t>(number_of(argv[i], "--steps"));
    } else if (name == "--minutes") {
      options.minutes = number_of(argv[i], "--minutes");
    } else if (name == "--json") {
      options.json = argv[i];
    } else {
      throw std::runtime_error(name + " is no option\n" + usage);
    }
  }
  return options;
}

bool run(const Options& options) {
  Report report;
  const std::string memory = lock_memory();
  report.machine(describe_machine(), memory, forbid_deep_sleep());
  if (options.steps > 0) {
    for (const std::size_t window : {std::size_t{128}, std::size_t{32}, std::size_t{512}}) {
      const OthersLoad load;
      const FreeRun free_run = free_running(window == 128 ? options.steps : options.steps / 10, window);
      report.free_run(free_run, window, load.cores());
    }
    report.pushes();
    report.other_calls(other_calls(100));
    report.repeated(repeated(std::min<std::size_t>(options.steps, 200'000), 10));
  }
  if (options.minutes > 0.0) report.periodic(periodic(options.minutes), options.minutes);
  report.simulated(simulated(options.simulated_steps));
  if (!options.json.empty()) report.write_json(options.json);
  return report.sound();
}

}  // namespace

int main(int argc, char** argv) {
  try {
    const std::optional<Options> options = read_options(argc, argv);
    if (!options) {
      std::fputs(usage, stdout);
      return 0;
    }
    return run(*options) ? 0 : 1;
  } catch (const std::exception& error) {
    std::fprintf(stderr, "%s: %s\n", argv[0], error.what());
    return 2;
  }
}
