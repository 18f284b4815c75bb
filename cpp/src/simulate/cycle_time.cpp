#include "shapegcode/timing.hpp"

#include <algorithm>
#include <cmath>
#include <span>
#include <string>

#include "shapegcode/error.hpp"
#include "shapegcode/fanuc_model.hpp"
#include "shapegcode/motion.hpp"
#include "simulate/function_times.hpp"
#include "simulate/program_runs.hpp"

namespace shapegcode {
namespace {

// Closed forms for the motions of one program.
class Clock {
 public:
  Clock(const Program& program, const FanucModel& model, bool per_block)
      : program_(program),
        model_(model),
        per_block_(per_block),
        limits_(detail::overridden_limits(model)),
        rules_(detail::planner_rules(program, model)),
        function_times_(program, model),
        ordinary_(model),
        shaped_(for_shaped_blocks(model)),
        changes_by_t_(!detail::has_tool_change(program)) {}

  CycleTime run() {
    select_tool(-1, program_.steps.empty() ? 1 : program_.steps.front().line);
    for (std::size_t at = 0; at < program_.steps.size();) {
      const ProgramStep& step = program_.steps[at];
      switch (step.kind) {
        case StepKind::region:
          region(*program_.regions[step.index]);
          ++at;
          break;
        case StepKind::function:
          functions(program_.functions[step.index], step.line);
          ++at;
          break;
        case StepKind::move:
          at = other_move(at);
          break;
      }
    }
    std::erase_if(time_.tools, [](const ToolTime& tool) { return tool.parts.total_s() <= 0.0; });
    return std::move(time_);
  }

 private:
  // The controller model as it runs a cut.
  struct RunModel {
    explicit RunModel(FanucModel controller)
        : model(std::move(controller)), filters(acceleration_filters(model)), periods(filter_periods(filters)) {}
    FanucModel model;
    std::vector<Fir> filters;
    int periods;  // that the filters add to a run
  };

  void region(const Region& region) {
    wait_for_spindle(region.first_line);
    RegionTime row;
    row.first_line = region.first_line;
    row.last_line = region.last_line;
    row.tool = time_.tools[tool_].tool;
    row.start_s = now_s();
    row.length_mm = region.path->length_mm();
    const TimeParts parts = cutting_run(*region.path, region.exact_stop_at_end, detail::runs_shaped(region, model_));
    row.cutting_s = parts.cutting_s;
    row.acceleration_s = parts.acceleration_s;
    row.in_position_s = parts.in_position_s;
    row.duration_s = parts.total_s();
    time_.outside_regions_s -= parts.cutting_s + parts.acceleration_s;
    time_.regions.push_back(row);
    add(parts);
  }

  std::size_t other_move(std::size_t at) {
    const OtherMove& move = program_.other_moves[program_.steps[at].index];
    if (detail::is_cutting(move)) {
      wait_for_spindle(move.segment.line);
      std::vector<Segment> run;
      at = detail::gather_run(program_, at, run);
      const bool stop = run.back().stop_at_end;
      add(cutting_run(Path(run), stop, detail::runs_shaped_outside(model_)));
      return at;
    }
    const Segment& segment = move.segment;
    TimeParts parts;
    if (move.dwell_s > 0.0) {
      parts.dwell_s = move.dwell_s;
      note(segment.line, BlockKind::dwell, parts, 0.0);
    } else {
      const Vector3 travel = segment.end_mm - segment.start_mm;
      const RapidShape shape = rapid_shape(travel, model_);
      const double whole_s = rapid_time_s(travel, model_);
      parts.rapid_s = std::min(whole_s, whole_periods(shape.even_s / model_.period_s) * model_.period_s);
      parts.acceleration_s = whole_s - parts.rapid_s;
      parts.in_position_s = in_position_wait_s(travel, model_);
      time_.rapid_length_mm += segment.length_mm;
      note(segment.line, BlockKind::rapid, parts, shape.rate_mm_per_s);
    }
    add(parts);
    return at + 1;
  }

  void functions(const MachineFunction& function, std::uint32_t line) {
    if (function.tool >= 0) {
      selected_ = function.tool;
    }
    const bool changes = detail::changes_tool(function);
    if ((changes && selected_ >= 0) || (changes_by_t_ && function.tool >= 0)) {
      select_tool(selected_, line);
    }
    const detail::FunctionWait wait = function_times_.functions(function, now_s());
    if (function.m_count > 0 || wait.function_s > 0.0) {
      TimeParts parts;
      parts.tool_change_s = wait.tool_change_s;
      parts.function_s = wait.function_s;
      note(line, changes ? BlockKind::tool_change : BlockKind::function, parts, 0.0);
      add(parts);
    }
  }

  void wait_for_spindle(std::uint32_t line) {
    TimeParts parts;
    parts.function_s = function_times_.before_cut(now_s());
    if (parts.function_s > 0.0) {
      note(line, BlockKind::function, parts, 0.0);
      add(parts);
    }
  }

  TimeParts cutting_run(const Path& path, bool exact_stop, bool shaped) {
    time_.cutting_length_mm += path.length_mm();
    const RunModel& run_model = shaped ? shaped_ : ordinary_;
    return is_planned(run_model.model) ? planned_run(path, exact_stop, run_model)
                                       : overlapped_run(path, exact_stop, run_model);
  }

  // Paper 004: a block's successor starts ceil(l / (F T_I)) T_I behind it, and the filters end the run.
  TimeParts overlapped_run(const Path& path, bool exact_stop, const RunModel& run_model) {
    const std::size_t first_row = time_.blocks.size();
    double periods = 0.0;
    for (const Segment& segment : path.segments()) {
      const double feed = detail::checked_feed(segment, run_model.model);
      const double block = block_periods(segment.length_mm, feed, run_model.model.period_s, run_model.model.block_end);
      if (per_block_) {
        time_.blocks.push_back({segment.line, BlockKind::cutting, now_s() + periods * run_model.model.period_s,
                                block * run_model.model.period_s, segment.length_mm > 0.0 ? feed : 0.0});
      }
      periods += block;
    }
    TimeParts parts;
    if (periods <= 0.0) {
      return parts;
    }
    const double whole = whole_periods(periods);
    parts.cutting_s = periods * run_model.model.period_s;
    parts.acceleration_s = (whole - periods + run_model.periods) * run_model.model.period_s;
    if (exact_stop) {
      parts.in_position_s = detail::wait_behind_blocks(path, whole - periods, run_model.filters, run_model.model);
    }
    if (per_block_) {
      const std::span<BlockTime> rows = std::span(time_.blocks).subspan(first_row);
      detail::lower_to_reached(rows, run_model.model);
      rows.back().duration_s += parts.acceleration_s + parts.in_position_s;
    }
    return parts;
  }

  TimeParts planned_run(const Path& path, bool exact_stop, const RunModel& run_model) {
    TimeParts parts;
    if (!(path.length_mm() > 0.0)) {
      return parts;
    }
    for (const Segment& segment : path.segments()) {
      if (segment.length_mm > 0.0) {
        parts.cutting_s += segment.length_mm / detail::checked_feed(segment, run_model.model);
      }
    }
    const ControlledMotion motion = controlled_motion(std::make_shared<const Path>(path), limits_, rules_);
    const SpeedProfile& profile = *motion.profile;
    const detail::PlannedEnd end = detail::planned_end(profile, run_model.filters, run_model.model);
    parts.cutting_s = std::min(parts.cutting_s, end.duration_s);  // rounding only
    parts.acceleration_s = end.duration_s - parts.cutting_s;
    if (exact_stop) {
      parts.in_position_s = detail::wait_behind_profile(*motion.path, profile, end, run_model.model);
    }
    if (per_block_) {
      detail::append_rows(*motion.path, profile, now_s(), time_.blocks);
      BlockTime& last = time_.blocks.back();
      last.duration_s = now_s() + parts.total_s() - last.start_s;
    }
    return parts;
  }

  [[nodiscard]] double now_s() const noexcept { return time_.parts.total_s(); }

  void note(std::uint32_t line, BlockKind kind, const TimeParts& parts, double feed_mm_per_s) {
    if (per_block_) {
      time_.blocks.push_back({line, kind, now_s(), parts.total_s(), feed_mm_per_s});
    }
  }

  void add(const TimeParts& parts) {
    time_.parts += parts;
    time_.tools[tool_].parts += parts;
    time_.outside_regions_s += parts.total_s();
  }

  void select_tool(std::int64_t tool, std::uint32_t line) {
    const auto known =
        std::find_if(time_.tools.begin(), time_.tools.end(), [tool](const ToolTime& row) { return row.tool == tool; });
    tool_ = static_cast<std::size_t>(known - time_.tools.begin());
    if (known == time_.tools.end()) {
      time_.tools.push_back({tool, line, {}});
    }
  }

  const Program& program_;
  const FanucModel& model_;
  bool per_block_;
  MotionLimits limits_;
  PlannerRules rules_;
  detail::FunctionTimes function_times_;
  RunModel ordinary_;
  RunModel shaped_;
  bool changes_by_t_;
  std::int64_t selected_ = -1;
  std::size_t tool_ = 0;  // in use, index into time_.tools
  CycleTime time_;
};

}  // namespace

TimeParts& TimeParts::operator+=(const TimeParts& other) noexcept {
  cutting_s += other.cutting_s;
  rapid_s += other.rapid_s;
  in_position_s += other.in_position_s;
  dwell_s += other.dwell_s;
  acceleration_s += other.acceleration_s;
  tool_change_s += other.tool_change_s;
  function_s += other.function_s;
  return *this;
}

CycleTime time_program(const Program& program, const FanucModel& model, bool per_block) {
  check(model);
  return Clock(program, model, per_block).run();
}

}  // namespace shapegcode
