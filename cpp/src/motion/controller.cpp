#include "shapegcode/control.hpp"

#include <algorithm>
#include <cmath>
#include <string>

#include "shapegcode/error.hpp"
#include "shapegcode/motion.hpp"

namespace shapegcode {
namespace {

constexpr double longest_ramp_s = 100.0;
constexpr double longest_wait_s = 3600.0;

void require(bool holds, const char* name, double value, const char* range) {
  if (!holds) {
    throw Error(ErrorKind::argument, std::string(name) + " is " + std::to_string(value) + ", must be " + range);
  }
}

void require_ramp(const char* name, double value) {
  require(value >= 0.0 && value <= longest_ramp_s, name, value, "0 to 100 s");
}

void require_wait(const char* name, double value) {
  require(value >= 0.0 && value <= longest_wait_s, name, value, "0 to 3600 s");
}

void require_positive(const char* name, double value) {
  require(value > 0.0 && std::isfinite(value), name, value, "> 0 and finite");
}

void add_average(std::vector<Fir>& filters, double time_s, double period_s) {
  const long length = std::lround(time_s / period_s);
  if (length > 1) {
    filters.push_back(Fir::moving_average(static_cast<int>(length)));
  }
}

}  // namespace

void check(const ControllerModel& model) {
  require(model.period_s >= 1e-5 && model.period_s <= 1.0, "interpolation period (s)", model.period_s, "1e-5 to 1");
  require_ramp("acceleration time constant (s)", model.time_constant_s);
  require_ramp("bell time (s)", model.bell_time_s);
  require_ramp("look-ahead filter time constant (s)", model.look_ahead_filter_time_constant_s);
  require_ramp("rapid bell time (s)", model.rapid_bell_time_s);
  require_wait("tool change (s)", model.tool_change_s);
  require_wait("M function (s)", model.m_function_s);
  require(model.exponential_rest > 0.0 && model.exponential_rest < 1.0, "share left of the exponential",
          model.exponential_rest, "between 0 and 1");
  require_positive("feed override", model.feed_override);
  require_positive("rapid override", model.rapid_override);
  for (int i = 0; i < axis_count; ++i) {
    require(model.limits.max_feed_mm_per_s[i] > 0.0, "axis feed limit (mm/s)", model.limits.max_feed_mm_per_s[i],
            "> 0");
    require_positive("rapid rate (mm/s)", model.rapid_rate_mm_per_s[i]);
    require_ramp("rapid time constant (s)", model.rapid_time_constant_s[i]);
    require_wait("in-position wait (s)", model.in_position_s[i]);
    require_positive("position gain (1/s)", model.position_gain_per_s[i]);
    require_positive("in-position width (mm)", model.in_position_width_mm[i]);
    require(model.feed_forward_ratio[i] >= 0.0 && model.feed_forward_ratio[i] <= 1.0, "feed-forward ratio",
            model.feed_forward_ratio[i], "0 to 1");
  }
}

std::vector<Fir> acceleration_filters(const ControllerModel& model) {
  std::vector<Fir> filters;
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

double controlled_feed_mm_per_s(const Segment& segment, const ControllerModel& model) noexcept {
  return std::min(segment.feed_mm_per_s * model.feed_override, axis_feed_limit(segment, model.limits));
}

double block_overlap_time_s(std::span<const double> lengths_mm, std::span<const double> feeds_mm_per_s,
                            const ControllerModel& model) {
  check(model);
  if (lengths_mm.size() != feeds_mm_per_s.size()) {
    throw Error(ErrorKind::argument,
                std::to_string(lengths_mm.size()) + " lengths but " + std::to_string(feeds_mm_per_s.size()) + " feeds");
  }
  double periods = 0.0;
  for (std::size_t i = 0; i < lengths_mm.size(); ++i) {
    if (!(lengths_mm[i] >= 0.0) || !(feeds_mm_per_s[i] > 0.0)) {
      throw Error(ErrorKind::argument, "block " + std::to_string(i) + " has length " + std::to_string(lengths_mm[i]) +
                                           " mm and feed " + std::to_string(feeds_mm_per_s[i]) +
                                           " mm/s, must be >= 0 and > 0");
    }
    periods += block_periods(lengths_mm[i], feeds_mm_per_s[i], model.period_s, model.block_end);
  }
  if (periods <= 0.0) {
    return 0.0;
  }
  return (whole_periods(periods) + filter_periods(acceleration_filters(model))) * model.period_s;
}

}  // namespace shapegcode
