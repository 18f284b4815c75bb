#include "job.hpp"

#include <algorithm>

#include "shapegcode/error.hpp"
#include "shapegcode/program.hpp"

using namespace shapegcode;

namespace {

/// Appends what the reader found, in the order in which the machine does it.
class JobWriter {
 public:
  JobWriter(Job& job, const Machine& machine) : job_(job), machine_(machine) {}

  void add_region(const Region& region) {
    if (region.incremental) {
      throw Error(ErrorKind::program, "an axis moves whose position is not known", region.first_line);
    }
    for (Segment segment : region.path->segments()) add_segment(segment);
    if (region.exact_stop_at_end) last_segment_stops();
  }

  void add_move(const OtherMove& move) {
    if (move.dwell_s > 0.0) {
      job_.items.emplace_back(Dwell{move.dwell_s});
    } else if (move.segment.length_mm > 0.0) {
      add_segment(move.segment);
    }
  }

  /// A move from where the reader does not know the position any more, behind G28: it knows where it ends.
  void add_unknown_move(const MoveEnd& end) {
    Vector3 to = job_.end_mm;
    for (int axis = 0; axis < axis_count; ++axis) {
      if (end.known[static_cast<std::size_t>(axis)]) to[axis] = end.position_mm[axis];
    }
    go_to(to, end.line);
  }

  /// M, S and T words of a block. False: the program ends here.
  bool add_function(const MachineFunction& function) {
    for (int k = 0; k < function.m_count; ++k) {
      const auto m = static_cast<std::uint32_t>(function.m_codes[static_cast<std::size_t>(k)]);
      if (m == 2 || m == 30) return false;
      const double speed = std::max(function.spindle_rev_per_min, 0.0);
      if (m != 0 && m != 1) job_.items.emplace_back(ControllerEvent{m, static_cast<std::uint64_t>(speed)});
      if (m == 0 || m == 1 || m == tool_change) job_.items.emplace_back(ProgramStop{});  // until the operator resumes
      if (m == 3 || m == 4) job_.items.emplace_back(Dwell{machine_.spindle_time_s});
    }
    return true;
  }

  /// Behind the last segment nothing comes: to come to rest there is no starvation.
  void last_segment_stops() {
    for (auto item = job_.items.rbegin(); item != job_.items.rend(); ++item) {
      if (auto* segment = std::get_if<Segment>(&*item)) {
        segment->stop_at_end = true;
        return;
      }
    }
  }

 private:
  void go_to(const Vector3& to, std::uint32_t line) {
    if ((to - job_.end_mm).norm() < 1e-6) return;
    Segment rapid = make_line(job_.end_mm, to, machine_.rapid_mm_per_s, line);
    rapid.stop_at_end = true;
    job_.items.emplace_back(rapid);
    job_.end_mm = to;
  }

  void add_segment(Segment segment) {
    go_to(segment.start_mm, segment.line);  // behind a move to a position that the reader does not know
    if (segment.kind == SegmentKind::rapid) {
      segment.kind = SegmentKind::line;
      segment.feed_mm_per_s = machine_.rapid_mm_per_s;
      segment.stop_at_end = true;  // in-position check
    }
    job_.items.emplace_back(segment);
    job_.end_mm = segment.end_mm;
  }

  Job& job_;
  const Machine& machine_;
};

}  // namespace

Job read_job(const std::string& text, const Vector3& start_mm, const Machine& machine) {
  ReaderOptions options;
  options.power_on.position_mm = start_mm;
  options.power_on.known = {true, true, true};
  options.unknown_after_tool_change = {false, false, false};  // the tool is changed where the machine stands
  const Program program = read_program(text, options);
  Job job{{}, {}, start_mm};
  JobWriter writer(job, machine);
  auto end = program.move_ends.begin();
  for (const ProgramStep& step : program.steps) {
    if (step.kind == StepKind::region) writer.add_region(*program.regions[step.index]);
    if (step.kind == StepKind::move) writer.add_move(program.other_moves[step.index]);
    if (step.kind != StepKind::function) continue;
    const MachineFunction& function = program.functions[step.index];
    end = std::find_if(end, program.move_ends.end(), [&](const MoveEnd& one) { return one.line >= step.line; });
    const bool is_unknown = std::ranges::find(function.unknown_move, true) != function.unknown_move.end();
    if (is_unknown && end != program.move_ends.end() && end->line == step.line) writer.add_unknown_move(*end);
    if (!writer.add_function(function)) break;
  }
  writer.last_segment_stops();
  for (const Finding& warning : program.warnings) {
    job.warnings.push_back("line " + std::to_string(warning.line) + ": " + warning.message);
  }
  return job;
}

Path path_of(const Job& job) {
  PathBuilder path;
  for (const Item& item : job.items) {
    if (const auto* segment = std::get_if<Segment>(&item)) path.add(*segment);
  }
  return path.path();
}
