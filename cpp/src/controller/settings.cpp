#include "controller/settings.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <vector>

#include "base/checks.hpp"
#include "base/refuse.hpp"
#include "limits/speed_limits.hpp"

namespace shapegcode {
namespace {

constexpr std::size_t min_window = 8;
constexpr int max_lead = 10'000;
constexpr std::size_t max_segments = std::size_t{1} << 24;

// Fraction of acceleration and jerk for the changes of a shaper that depends on a position.
constexpr double change_share = 0.25;

// Of acceleration and jerk that a fade has to leave.
constexpr double least_beside_fade = 0.5;

// Stands for no limit of the acceleration, mm/s^2.
constexpr double no_acceleration = 1e8;

bool changes(const SetPointFilters& filters) noexcept { return filters.change().acceleration_per_mm > 0.0; }

double own_share(const SetPointFilters& filters) noexcept { return changes(filters) ? 1.0 - change_share : 1.0; }

struct AxisSettings {
  double max_feed, max_acceleration, max_jerk;
};
AxisSettings axis_settings(const ControllerSettings& settings, std::size_t i) noexcept {
  if (i >= axis_count) {
    const FollowingLimits& axis = settings.following[i - axis_count];
    return {axis.max_feed, axis.max_acceleration, axis.max_jerk};
  }
  const auto axis = static_cast<Eigen::Index>(i);
  return {settings.limits.max_feed_mm_per_s[axis], settings.limits.max_acceleration_mm_per_s2[axis],
          settings.limits.max_jerk_mm_per_s3[axis]};
}

// Highest speed of an axis while the followed one moves at `speed`.
double feed_beside_changes(const AxisSettings& axis, double speed, const ChangeCost& cost) noexcept {
  return change_share * std::min(axis.max_acceleration / (speed * cost.acceleration_per_mm),
                                 0.5 * axis.max_jerk / (speed * cost.jerk_per_mm_s));
}

// Highest speed of X, Y and Z at which the changes of the shaper take no more than their share; half of that of the
// jerk is for what they make of the acceleration.
double changing_speed(const ControllerSettings& settings, const SetPointFilters& filters) noexcept {
  if (!changes(filters)) return MotionLimits::none;
  const ChangeCost& cost = filters.change();
  double speed = MotionLimits::none;
  const auto look_at = [&](double acceleration, double jerk) {
    if (std::isfinite(jerk)) {
      speed = std::min(speed, 0.5 * change_share * jerk / (acceleration * cost.acceleration_per_mm));
    }
  };
  for (int i = 0; i < axis_count; ++i) {
    const double acceleration = settings.limits.max_acceleration_mm_per_s2[i];
    const double jerk = settings.limits.max_jerk_mm_per_s3[i];
    look_at(acceleration, jerk);
    speed = std::min({speed, std::sqrt(change_share * acceleration / cost.acceleration_per_mm),
                      std::sqrt(0.5 * change_share * jerk / cost.jerk_per_mm_s)});
  }
  for (const FollowingLimits& axis : settings.following) look_at(axis.max_acceleration, axis.max_jerk);
  return speed;
}

// What there may be for each axis.
void check_axes(const ControllerSettings& settings) {
  const std::size_t n = axis_count + settings.following.size();
  const auto is_for_each = [n](std::size_t count, const char* name) {
    if (count != 0 && count != n) detail::refuse("{} of {} axes, the control has {}", name, count, n);
  };
  is_for_each(settings.travel.size(), "travel");
  is_for_each(settings.offset.size(), "offset");
  is_for_each(settings.emergency_acceleration.size(), "emergency acceleration");
  for (std::size_t i = 0; i < settings.travel.size(); ++i) {
    const AxisTravel& travel = settings.travel[i];
    if (!(travel.low <= travel.high)) detail::refuse("axis {}: travel from {} to {}", i, travel.low, travel.high);
  }
  for (std::size_t i = 0; i < settings.emergency_acceleration.size(); ++i) {
    const double most = settings.emergency_acceleration[i];
    const double planned = axis_settings(settings, i).max_acceleration;
    if (!(most >= planned)) {
      detail::refuse("axis {}: emergency acceleration {}, must be at least that of the axis, {}", i, most, planned);
    }
  }
  for (std::size_t i = 0; i < settings.offset.size(); ++i) {
    const OffsetLimits& offset = settings.offset[i];
    const AxisSettings axis = axis_settings(settings, i);
    const auto takes_part = [i](double part, double of, const char* name) {
      if (!(part >= 0.0 && std::isfinite(part) && (part == 0.0 || part < of))) {
        detail::refuse("axis {}: {} of the offset is {}, must be 0 ... {} of the axis", i, name, part, of);
      }
    };
    takes_part(offset.max_feed, axis.max_feed, "feed");
    takes_part(offset.max_acceleration, axis.max_acceleration, "acceleration");
    takes_part(offset.max_jerk, axis.max_jerk, "jerk");
    const bool moves = offset.max_feed > 0.0;
    if (moves != (offset.max_acceleration > 0.0) || moves != (offset.max_jerk > 0.0)) {
      detail::refuse("axis {}: an offset wants feed, acceleration and jerk above 0, or none of them", i);
    }
    if (!std::isfinite(offset.backlash) || (offset.backlash != 0.0 && !moves)) {
      detail::refuse("axis {}: a backlash of {} wants limits of the offset", i, offset.backlash);
    }
  }
}

}  // namespace

void check_settings(const ControllerSettings& settings) {
  require_period(settings.period_s);
  check_limits(settings.limits, {});
  require(settings.contour_tolerance_mm >= 0.0, "contour tolerance", settings.contour_tolerance_mm, "mm", ">= 0");
  require(settings.limits.feed_override <= max_override, "feed override", settings.limits.feed_override, "", "<= 2");
  if (settings.following.size() > max_following_axes) {
    detail::refuse("{} following axes, at most {} are possible", settings.following.size(), max_following_axes);
  }
  const auto jerk_has_acceleration = [](double jerk, double acceleration, std::size_t axis) {
    if (std::isfinite(jerk) && !std::isfinite(acceleration)) {
      detail::refuse("axis {}: a jerk limit of {} needs an acceleration limit", axis, jerk);
    }
  };
  for (int i = 0; i < axis_count; ++i) {
    jerk_has_acceleration(settings.limits.max_jerk_mm_per_s3[i], settings.limits.max_acceleration_mm_per_s2[i],
                          static_cast<std::size_t>(i));
  }
  for (std::size_t i = 0; i < settings.following.size(); ++i) {
    const FollowingLimits& axis = settings.following[i];
    require(axis.max_feed > 0.0, "feed limit of a following axis", axis.max_feed, "", "> 0");
    require(axis.max_acceleration > 0.0, "acceleration limit of a following axis", axis.max_acceleration, "", "> 0");
    require(axis.max_jerk > 0.0, "jerk limit of a following axis", axis.max_jerk, "", "> 0");
    require(axis.tolerance >= 0.0, "tolerance of a following axis", axis.tolerance, "", ">= 0");
    jerk_has_acceleration(axis.max_jerk, axis.max_acceleration, axis_count + i);
  }
  check_axes(settings);
  require_above_zero(settings.spindle_bandwidth_hz, "spindle bandwidth", "Hz");
  require(settings.lead_periods >= 0 && settings.lead_periods <= max_lead, "lead",
          static_cast<double>(settings.lead_periods), "periods", "0 ... 10000");
  require(settings.window >= min_window && settings.window <= max_segments, "window",
          static_cast<double>(settings.window), "segments", "8 ... 16777216");
  require(settings.retrace_periods <= max_segments, "retrace", static_cast<double>(settings.retrace_periods), "periods",
          "0 ... 16777216");
  require(settings.queue <= max_segments, "queue", static_cast<double>(settings.queue), "segments", "0 ... 16777216");
}

// A motion of v, a and j that is multiplied with w: w v + w' s, w a + 2 w' v + w'' s and so on, each at its most.
InputShare input_share(const ControllerSettings& settings, const SetPointFilters& filters, std::size_t axis) noexcept {
  const double own = own_share(filters) / filters.gain();
  const FadeCost& fade = filters.fade();
  if (fade.apart_s <= 0.0) return {1.0 / filters.gain(), own, own};
  const double gain = filters.gain();
  const AxisSettings most = axis_settings(settings, axis);
  const double first = fade.first * fade.apart_s;
  const double v = most.max_feed / (gain + first);
  const double a =
      (std::min(most.max_acceleration, no_acceleration) - fade.second * fade.apart_s * v) / (gain + 2.0 * first);
  InputShare share{1.0 / (gain + first), a / std::min(most.max_acceleration, no_acceleration), 1.0 / gain};
  if (std::isfinite(most.max_jerk)) {
    const double others = fade.apart_s * (3.0 * fade.second * a + fade.third * v);
    share.jerk = (most.max_jerk - others) / (gain + 3.0 * first) / most.max_jerk;
  }
  return share;
}

namespace {

void check_fade(const ControllerSettings& settings, const SetPointFilters& filters) {
  if (filters.fade().apart_s <= 0.0) return;
  for (std::size_t i = 0; i < axis_count + settings.following.size(); ++i) {
    if (!std::isfinite(axis_settings(settings, i).max_feed)) {
      detail::refuse("axis {}: a fade between shapers wants a limit of the feed", i);
    }
    const InputShare share = input_share(settings, filters, i);
    const double least = std::min(share.acceleration, share.jerk) * filters.gain();
    if (least < least_beside_fade) {
      detail::refuse("axis {}: a fade of {} s leaves the share {} of acceleration or jerk, must be at least {}: longer",
                     i, settings.fade_time_s, least, least_beside_fade);
    }
  }
}

AxisLimits axis_limits_of(const ControllerSettings& settings, const SetPointFilters& filters) {
  check_fade(settings, filters);
  const double speed = changing_speed(settings, filters);
  AxisLimits limits;
  limits.axes = axis_count + settings.following.size();
  for (std::size_t i = 0; i < limits.axes; ++i) {
    AxisSettings axis = axis_settings(settings, i);
    axis.max_acceleration = std::min(axis.max_acceleration, no_acceleration);
    if (i < settings.offset.size()) {
      axis.max_feed -= settings.offset[i].max_feed;
      axis.max_acceleration -= settings.offset[i].max_acceleration;
      axis.max_jerk -= settings.offset[i].max_jerk;
    }
    const InputShare share = input_share(settings, filters, i);
    limits.speed[i] = axis.max_feed * share.speed;
    if (i < axis_count) {
      limits.speed[i] = std::min(limits.speed[i], speed);
    } else if (changes(filters)) {
      limits.speed[i] = std::min(limits.speed[i], feed_beside_changes(axis, speed, filters.change()));
    }
    limits.acceleration[i] = axis.max_acceleration * share.acceleration;
    limits.jerk[i] = axis.max_jerk * share.jerk;
  }
  return limits;
}

}  // namespace

namespace {

// The largest difference between the variances of what X, Y and Z pass, in samples^2.
double variances_apart(const std::vector<FilterStages>& chains) {
  double apart = 0.0;
  for (const FilterStages& stages : chains) {
    std::array<double, axis_count> variances{};
    for (const std::vector<Fir>& stage : stages) {
      for (std::size_t i = 0; i < variances.size(); ++i) {
        variances[i] += stage[stage.size() == 1 ? 0 : i].variance_samples2();
      }
    }
    const auto [low, high] = std::ranges::minmax(variances);
    apart = std::max(apart, high - low);
  }
  return apart;
}

}  // namespace

PlanningRules planning_rules_of(const ControllerSettings& settings, const SetPointFilters& filters) {
  if (filters.duration_samples() > 0) {
    require(settings.contour_tolerance_mm > 0.0, "contour tolerance with smoothing or shaper",
            settings.contour_tolerance_mm, "mm", "> 0");
  }
  if (changes(filters) && !settings.offset.empty()) {
    detail::refuse("an offset of {} axes beside a shaper that follows an axis", settings.offset.size());
  }
  PlanningRules rules;
  rules.period_s = settings.period_s;
  rules.limits = axis_limits_of(settings, filters);
  // What filters behind cut off a path that bends at an acceleration a across it is half their variance times a.
  const double variance_s2 = filters.tolerance().variance_s2;
  if (variance_s2 > 0.0) rules.max_across = settings.contour_tolerance_mm / variance_s2;
  rules.window = settings.window;
  rules.lead_periods = settings.plans_in_step ? 0 : settings.lead_periods;
  rules.settling_periods = filters.duration_samples();
  if (filters.duration_samples() > 0 && std::isfinite(settings.contour_tolerance_mm)) {
    rules.chains = filters.chains();
    rules.filtered_mm = settings.contour_tolerance_mm - path_tolerance_of(settings, filters);
    // Filters of two axes whose variances differ by d take a straight path at 45 degrees aside by a d / sqrt(8).
    const double apart_s2 = variances_apart(rules.chains) * settings.period_s * settings.period_s;
    const double most = std::sqrt(8.0) * rules.filtered_mm / apart_s2;
    for (std::size_t i = 0; apart_s2 > 0.0 && i < axis_count; ++i) {
      rules.limits.acceleration[i] = std::min(rules.limits.acceleration[i], most);
    }
  }
  return rules;
}

AxisValues emergency_of(const ControllerSettings& settings, const SetPointFilters& filters) noexcept {
  const FadeCost& fade = filters.fade();
  AxisValues most{};
  for (std::size_t i = 0; i < settings.emergency_acceleration.size(); ++i) {
    const double offset = i < settings.offset.size() ? settings.offset[i].max_acceleration : 0.0;
    // As fast as it is at the most.
    const double beside = fade.apart_s > 0.0 ? fade.second * fade.apart_s * axis_settings(settings, i).max_feed *
                                                   input_share(settings, filters, i).speed
                                             : 0.0;
    most[i] =
        (settings.emergency_acceleration[i] - offset - beside) / (filters.gain() + 2.0 * fade.first * fade.apart_s);
  }
  return most;
}

double path_tolerance_of(const ControllerSettings& settings, const SetPointFilters& filters) {
  return filters.duration_samples() > 0 ? 0.5 * settings.contour_tolerance_mm : settings.contour_tolerance_mm;
}

double corner_time_of(const SetPointFilters& filters) {
  return filters.correction_samples() > 0 ? 0.5 * filters.tolerance().mean_deviation_s : 0.0;
}

}  // namespace shapegcode
