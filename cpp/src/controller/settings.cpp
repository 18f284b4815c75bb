#include "controller/settings.hpp"

#include <algorithm>
#include <cmath>

#include "base/checks.hpp"
#include "base/refuse.hpp"
#include "motion/speed_limits.hpp"

namespace shapegcode {
namespace {

constexpr std::size_t min_window = 8;
constexpr std::size_t max_segments = std::size_t{1} << 24;

// Share of acceleration and jerk that the changes of a shaper may take which follows a position.
constexpr double change_share = 0.25;

bool changes(const SetPointFilters& filters) noexcept { return filters.change().acceleration_per_mm > 0.0; }

double own_share(const SetPointFilters& filters) noexcept { return changes(filters) ? 1.0 - change_share : 1.0; }

// Highest speed of an axis while the followed one moves at `speed`.
double feed_beside_changes(const FollowingLimits& axis, double speed, const ChangeCost& cost) noexcept {
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

}  // namespace

int jerk_periods(const ControllerSettings& settings) {
  double longest_s = jerk_time(settings.limits, MotionLimits::none);
  for (const FollowingLimits& axis : settings.following) {
    if (std::isfinite(axis.max_jerk)) longest_s = std::max(longest_s, 2.0 * axis.max_acceleration / axis.max_jerk);
  }
  const double periods = std::ceil(longest_s / settings.period_s - 1e-9);
  return std::max(1, static_cast<int>(require_count(periods, max_filter_samples, "the jerk time", "periods")));
}

void check_settings(const ControllerSettings& settings) {
  require_period(settings.period_s);
  check_limits(settings.limits, {settings.contour_tolerance_mm, 1.0, 0.0, 0.0});
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
    jerk_has_acceleration(axis.max_jerk, axis.max_acceleration, axis_count + i);
  }
  require(settings.window >= min_window && settings.window <= max_segments, "window",
          static_cast<double>(settings.window), "segments", "8 ... 16777216");
  require(settings.queue <= max_segments, "queue", static_cast<double>(settings.queue), "segments", "0 ... 16777216");
}

MotionLimits planning_limits_of(const ControllerSettings& settings, const SetPointFilters& filters) {
  const double share = own_share(filters) / filters.gain();
  MotionLimits limits = settings.limits;
  limits.feed_override = 1.0;  // the one at the begin may be raised later; zones reach as far as any can be
  const int periods = jerk_periods(settings);
  limits.jerk_time_s = periods > 1 ? periods * settings.period_s : 0.0;
  limits.max_feed_mm_per_s = (limits.max_feed_mm_per_s / filters.gain()).cwiseMin(changing_speed(settings, filters));
  limits.max_acceleration_mm_per_s2 *= share;
  limits.max_jerk_mm_per_s3 *= share;
  const bool limited = limits.max_acceleration_mm_per_s2.minCoeff() < MotionLimits::none ||
                       std::ranges::any_of(settings.following, [](const FollowingLimits& axis) {
                         return axis.max_acceleration < MotionLimits::none;
                       });
  if (limited) limits.jumps = filters.jumps();
  return limits;
}

std::vector<FollowingLimits> following_limits_of(const ControllerSettings& settings, const SetPointFilters& filters) {
  const double share = own_share(filters) / filters.gain();
  const double speed = changing_speed(settings, filters);
  std::vector<FollowingLimits> limits = settings.following;
  for (FollowingLimits& axis : limits) {
    axis.max_feed /= filters.gain();
    if (changes(filters)) axis.max_feed = std::min(axis.max_feed, feed_beside_changes(axis, speed, filters.change()));
    axis.max_acceleration *= share;
    axis.max_jerk *= share;
  }
  return limits;
}

}  // namespace shapegcode
