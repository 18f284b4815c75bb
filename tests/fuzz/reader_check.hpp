#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <optional>
#include <span>
#include <string>
#include <string_view>

#include "shapegcode/error.hpp"
#include "shapegcode/program.hpp"

/// What must hold for every text that the reader is given. Shared by the fuzzer and by the test that replays its
/// corpus.
namespace shapegcode::fuzz {

/// Ends the process with the place and the words; libFuzzer keeps the input.
inline void require(bool holds, const char* what) {
  if (!holds) {
    std::fprintf(stderr, "reader check failed: %s\n", what);
    std::abort();
  }
}

/// The reader's options from the bytes behind the last NUL of an input: a program text without one is read with the
/// defaults, so that programs can be put into the corpus as they are.
class OptionBytes {
 public:
  explicit OptionBytes(std::span<const std::uint8_t> bytes) : bytes_(bytes) {}

  std::uint8_t byte() {
    if (at_ >= bytes_.size()) {
      return 0;
    }
    return bytes_[at_++];
  }
  bool bit() { return (byte() & 1U) != 0; }

 private:
  std::span<const std::uint8_t> bytes_;
  std::size_t at_ = 0;
};

inline ReaderOptions options_from(std::span<const std::uint8_t> bytes) {
  OptionBytes in(bytes);
  ReaderOptions options;
  const std::uint8_t flags = in.byte();
  options.calculator_decimal_point = (flags & 1U) == 0;
  options.absolute_arc_centres = (flags & 2U) != 0;
  options.power_on.distance = (flags & 4U) != 0 ? 91 : 90;
  options.power_on.units = (flags & 8U) != 0 ? 20 : 21;
  options.power_on.motion = (flags & 16U) != 0 ? 1 : 0;
  options.power_on.plane = 17 + (flags >> 5U) % 3;
  options.arc_tolerance_mm = in.byte() * 0.005;
  options.least_increment_mm = in.bit() ? 0.0001 : 0.001;
  if (in.bit()) {
    for (int k = 0; k < 6; ++k) {
      options.work_offsets_mm.push_back({in.byte() * 1.0, in.byte() * -1.5, in.byte() * 0.25});
    }
  }
  const std::uint8_t probes = in.byte() % 8U;
  for (std::uint32_t line = 1; line <= probes; ++line) {
    options.probe_lines.push_back(3 * line);
  }
  // Enough to see what repeats; a fuzzer has no time for the limit that people get.
  options.limits.steps = 3000;
  options.limits.moves = 30'000;
  const std::uint8_t choices = in.byte();
  options.collect_alarms = (choices & 1U) != 0;
  options.expand_compensation = (choices & 2U) == 0;
  options.compensation_start_up = (choices & 4U) != 0 ? 'B' : 'A';
  options.offset_memory = static_cast<char>('C' - (choices >> 3U) % 3);
  options.program = (choices & 32U) != 0 ? in.byte() : -1;
  options.subprogram_nesting = (choices & 64U) != 0 ? 1 + in.byte() % 12 : 10;
  for (auto& on : options.block_skip) {
    const std::uint8_t state = in.byte() % 3U;
    if (state != 0) {
      on = state == 1;
    }
  }
  const std::uint8_t tools = in.byte() % 4U;
  for (int number = 1; number <= tools; ++number) {
    ToolOffset& tool = options.tool_offsets[number];
    tool.radius_mm = (in.byte() - 20) * 0.25;
    tool.length_mm = in.byte() * 1.0;
    if (in.bit()) {
      tool.radius_wear_mm = -0.01;
    }
  }
  if (in.bit()) {
    options.extra_work_offsets_mm[1] = {10.0, -20.0, 30.0};
    options.retained_variables[500] = in.byte() * 0.5;
    options.bindings.g_macros[1200] = in.byte();
    options.bindings.m_macros[50] = in.byte();
    options.bindings.m_subprograms[6] = in.byte();
    options.bindings.tool_program = in.bit() ? in.byte() : -1;
  }
  if (in.bit()) {
    const std::uint8_t number = in.byte();
    options.load_program = [number](std::int64_t wanted) -> std::optional<SourceText> {
      if (wanted != number) {
        return std::nullopt;
      }
      return SourceText{"loaded.nc", "O1\nG91G1X1.F100.\nM98P2\nG65P3A#1\nM99\n"};
    };
  }
  return options;
}

inline bool finite(const Vector3& v) { return std::isfinite(v[0]) && std::isfinite(v[1]) && std::isfinite(v[2]); }

inline void check_segment(const Segment& segment) {
  require(finite(segment.start_mm) && finite(segment.end_mm), "a segment's ends are numbers");
  require(std::isfinite(segment.length_mm) && segment.length_mm >= 0.0, "a segment's length is a number, not negative");
  require(std::isfinite(segment.feed_mm_per_s) && segment.feed_mm_per_s >= 0.0, "a feed is a number, not negative");
}

inline void check_program(const Program& program) {
  require(program.steps.size() == program.regions.size() + program.other_moves.size() + program.functions.size(),
          "every region, move and function is one step");
  for (const ProgramStep& step : program.steps) {
    const std::size_t count = step.kind == StepKind::region ? program.regions.size()
                              : step.kind == StepKind::move ? program.other_moves.size()
                                                            : program.functions.size();
    require(step.index < count, "a step's index lies in its list");
  }
  std::size_t behind = 0;
  for (const auto& region : program.regions) {
    require(region != nullptr && region->path != nullptr, "a region has a path");
    require(region->text_begin >= behind && region->text_begin <= region->text_end &&
                region->text_end <= program.text.size(),
            "regions lie in the text, one behind the other");
    behind = region->text_end;
    require(
        region->first_line >= 1 && region->first_line <= region->last_line && region->last_line <= program.line_count,
        "a region's lines are lines of the text");
    for (const Segment& segment : region->path->segments()) {
      check_segment(segment);
      require(segment.feed_mm_per_s > 0.0, "a cutting move has a feed");
    }
  }
  for (const OtherMove& move : program.other_moves) {
    check_segment(move.segment);
    require(std::isfinite(move.dwell_s) && move.dwell_s >= 0.0, "a dwell is a number, not negative");
  }
}

/// Reads one input and checks what came out: a program that is whole in itself, or an error with a place in the text.
inline void check_reader(std::span<const std::uint8_t> input) {
  const std::size_t limit = 1U << 16U;
  input = input.first(std::min(input.size(), limit));
  std::size_t length = input.size();
  for (std::size_t i = input.size(); i-- > 0;) {
    if (input[i] == 0) {
      length = i;
      break;
    }
  }
  const std::string text(input.begin(), input.begin() + static_cast<std::ptrdiff_t>(length));
  const auto lines =
      static_cast<std::uint32_t>(1 + std::ranges::count_if(text, [](char c) { return c == '\n' || c == '\r'; }));
  try {
    const Program program = read_program(text, options_from(input.subspan(std::min(length + 1, input.size()))));
    check_program(program);
  } catch (const Error& error) {
    require(error.kind() == ErrorKind::program, "a text can only be a program error");
    // A program that was loaded has lines of its own.
    const bool placed = error.line() >= 1 && (error.line() <= lines || !error.file().empty()) && error.column() >= 1;
    if (!placed) {
      std::fprintf(stderr, "%u:%u: %s\n", static_cast<unsigned>(error.line()), static_cast<unsigned>(error.column()),
                   error.what());
    }
    require(placed, "the error has a place in the text");
    const std::string_view message = error.what();
    require(!message.empty() && message.find('\n') == std::string_view::npos, "the message is one line");
    require(error.alarm() == 0 || message.find("(alarm ") != std::string_view::npos,
            "an alarm's message has its number");
  }
}

}  // namespace shapegcode::fuzz
