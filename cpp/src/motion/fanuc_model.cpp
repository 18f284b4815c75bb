#include "shapegcode/fanuc_model.hpp"

#include <algorithm>
#include <cmath>

#include "base/checks.hpp"
#include "base/refuse.hpp"
#include "shapegcode/motion.hpp"

namespace shapegcode {
namespace {

constexpr double longest_ramp_s = 100.0;
constexpr double longest_wait_s = 3600.0;

void require_ramp(const char* name, double value) {
  require(value >= 0.0 && value <= longest_ramp_s, name, value, "s", "0 to 100 s");
}

void require_wait(const char* name, double value) {
  require(value >= 0.0 && value <= longest_wait_s, name, value, "s", "0 to 3600 s");
}

void add_average(std::vector<Fir>& filters, double time_s, double period_s) {
  const auto length = require_count(std::round(time_s / period_s), max_filter_samples, "a filter", "periods");
  if (length > 1) {
    filters.push_back(Fir::moving_average(static_cast<int>(length)));
  }
}

void require_ascending(const char* name, const std::vector<SpindleTime>& table) {
  double below = 0.0;
  for (const SpindleTime& row : table) {
    require(row.rev_per_min > below, name, row.rev_per_min, "1/min", "above the row before");
    require_wait(name, row.seconds);
    below = row.rev_per_min;
  }
}

}  // namespace

FanucModel for_shaped_blocks(const FanucModel& model) {
  FanucModel shaped = model;
  shaped.planner.chord_tolerance_mm = model.chord_tolerance_mm;
  if (model.planner.kind != ControllerKind::fanuc) return shaped;
  shaped.motion = MotionKind::after_interpolation;
  shaped.filter_shape = model.shaped_filter_shape;
  shaped.time_constant_s = model.shaped_time_constant_s;
  shaped.bell_time_s = model.shaped_bell_time_s;
  shaped.block_end = model.shaped_block_end;
  return shaped;
}

void check(const FanucModel& model) {
  check(model.planner);
  require(model.chord_tolerance_mm >= 0.0 && model.chord_tolerance_mm <= 10.0, "tolerance of emitted chords",
          model.chord_tolerance_mm, "mm", "0 to 10 mm");
  require(model.period_s >= 1e-5 && model.period_s <= 1.0, "interpolation period", model.period_s, "s", "1e-5 to 1 s");
  require_ramp("acceleration time constant", model.time_constant_s);
  require_ramp("bell time", model.bell_time_s);
  require_ramp("time constant behind shaped blocks", model.shaped_time_constant_s);
  require_ramp("bell time behind shaped blocks", model.shaped_bell_time_s);
  require_ramp("look-ahead filter time constant", model.look_ahead_filter_time_constant_s);
  require_ramp("rapid bell time", model.rapid_bell_time_s);
  require_wait("start of the program", model.program_start_s);
  require_wait("tool change", model.tool_change_s);
  require_wait("M function", model.m_function_s);
  for (const auto& [code, seconds] : model.m_code_s) {
    require_wait("M code", seconds);
  }
  require_ascending("start of the spindle", model.spindle_start_s);
  require_ascending("stop of the spindle", model.spindle_stop_s);
  require(model.exponential_rest > 0.0 && model.exponential_rest < 1.0, "share left of the exponential",
          model.exponential_rest, "", "between 0 and 1");
  require_above_zero(model.feed_override, "feed override", "");
  require_above_zero(model.rapid_override, "rapid override", "");
  for (int i = 0; i < axis_count; ++i) {
    require(model.limits.max_feed_mm_per_s[i] > 0.0, "axis feed limit", model.limits.max_feed_mm_per_s[i], "mm/s",
            "> 0");
    require_above_zero(model.rapid_rate_mm_per_s[i], "rapid rate", "mm/s");
    require_ramp("rapid time constant", model.rapid_time_constant_s[i]);
    require_wait("in-position wait", model.in_position_s[i]);
    require_wait("rapid from an unknown position", model.unknown_move_s[i]);
    require_above_zero(model.position_gain_per_s[i], "position gain", "1/s");
    require_above_zero(model.in_position_width_mm[i], "in-position width", "mm");
    require(model.feed_forward_ratio[i] >= 0.0 && model.feed_forward_ratio[i] <= 1.0, "feed-forward ratio",
            model.feed_forward_ratio[i], "", "0 to 1");
  }
}

std::vector<Fir> acceleration_filters(const FanucModel& model) {
  std::vector<Fir> filters;
  if (model.planner.kind == ControllerKind::linuxcnc) {
    // Joints are interpolated by cubics that pass near the set-points of the planner, not through them.
    filters.push_back(Fir({0, 1, 2}, {1.0 / 6.0, 4.0 / 6.0, 1.0 / 6.0}));
  }
  if (model.planner.kind != ControllerKind::fanuc) return filters;
  if (model.motion == MotionKind::look_ahead) {
    add_average(filters, model.look_ahead_filter_time_constant_s, model.period_s);
  } else if (model.filter_shape == FilterShape::linear) {
    add_average(filters, model.time_constant_s, model.period_s);
    add_average(filters, model.bell_time_s, model.period_s);
  } else if (model.time_constant_s > 0.0) {
    filters.push_back(Fir::exponential(model.time_constant_s / model.period_s, model.exponential_rest));
  }
  return filters;
}

int filter_periods(const std::vector<Fir>& filters) noexcept {
  int periods = filters.empty() ? 0 : 1;
  for (const Fir& filter : filters) {
    periods += filter.duration_samples();
  }
  return periods;
}

double controlled_feed_mm_per_s(const Segment& segment, const FanucModel& model) noexcept {
  return std::min(segment.feed_mm_per_s * model.feed_override, axis_feed_limit(segment, model.limits));
}

double block_overlap_time_s(std::span<const double> lengths_mm, std::span<const double> feeds_mm_per_s,
                            const FanucModel& model) {
  check(model);
  if (lengths_mm.size() != feeds_mm_per_s.size()) {
    detail::refuse("{} lengths but {} feeds", lengths_mm.size(), feeds_mm_per_s.size());
  }
  double periods = 0.0;
  for (std::size_t i = 0; i < lengths_mm.size(); ++i) {
    if (!(lengths_mm[i] >= 0.0) || !(feeds_mm_per_s[i] > 0.0)) {
      detail::refuse("block {} has length {} mm and feed {} mm/s, must be >= 0 and > 0", i, lengths_mm[i],
                     feeds_mm_per_s[i]);
    }
    periods += block_periods(lengths_mm[i], feeds_mm_per_s[i], model.period_s, model.block_end);
  }
  if (periods <= 0.0) {
    return 0.0;
  }
  return (whole_periods(periods) + filter_periods(acceleration_filters(model))) * model.period_s;
}

}  // namespace shapegcode
