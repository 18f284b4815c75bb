#include "controller/axis_tracker.hpp"

#include <algorithm>
#include <cmath>

namespace shapegcode {
namespace {

// Bisections of the jerk that reaches a speed.
constexpr int jerk_halvings = 44;
// As near as that, relative to what a period changes, is there.
constexpr double reached = 1e-9;
// Landings that are tried, each a little longer; and where the first of them begins, of the shortest time.
constexpr int tried_landings = 96;
constexpr std::array<double, 4> middle_shares{0.0, 0.1, 0.2, 0.34};  // of a landing: its second jerk
constexpr double first_landing = 0.95;
constexpr double limit_rounding = 1e-9;
// Before the end so much of what a period travels is kept, for the landing to be rounded to periods.
constexpr double periods_kept = 2.5;

// What ends an acceleration adds to the speed: its end takes whole periods.
double speed_added(double acceleration, double jerk, double period_s) noexcept {
  const double periods = std::ceil(std::abs(acceleration) / (jerk * period_s) * (1.0 - limit_rounding));
  return 0.5 * acceleration * periods * period_s;
}

struct Stop {
  double distance = 0.0, time_s = 0.0;
};
// Of the shortest stop from a speed above zero.
Stop stop_from(AlongPath state, const TrackerLimits& limits) noexcept {
  const double a = state.acceleration;
  const double j = limits.jerk;
  const double t = std::abs(a) / j;
  // With the acceleration ended, or as it was when the braking began.
  const double v = state.speed + 0.5 * a * a / j;
  const double ramps = 0.5 * v;
  const double time_s = v * j >= limits.acceleration * limits.acceleration
                            ? v / limits.acceleration + limits.acceleration / j
                            : 2.0 * std::sqrt(v / j);
  const double travel = ramps * time_s;
  if (a >= 0.0) return {travel + t * (state.speed + a * t / 3.0), time_s + t};
  return {std::max(0.0, travel - t * (v - a * a / (6.0 * j))), std::max(0.0, time_s - t)};
}

}  // namespace

void AxisTracker::restart(double position, double velocity, double acceleration) noexcept {
  position_ = goal_ = position;
  state_ = {velocity, acceleration};
  landing_ = {};
}

void AxisTracker::move(double jerk) noexcept {
  position_ += state_.travel(jerk, period_s_);
  state_ = state_.after(jerk, period_s_);
}

// The largest jerk towards a speed after which the acceleration can still end at it.
double AxisTracker::jerk_to_speed(double speed, const TrackerLimits& limits) const noexcept {
  const double t = period_s_;
  const double sign = speed - state_.speed >= speed_added(state_.acceleration, limits.jerk, t) ? 1.0 : -1.0;
  const AlongPath now{sign * state_.speed, sign * state_.acceleration};
  const auto passes = [&](double jerk) {
    const AlongPath then = now.after(jerk, t);
    return then.speed + speed_added(then.acceleration, limits.jerk, t) > sign * speed;
  };
  double high = std::max(-limits.jerk, std::min(limits.jerk, (limits.acceleration - now.acceleration) / t));
  if (!passes(high)) return sign * high;
  const double periods = std::ceil(std::abs(now.acceleration) / (limits.jerk * t) * (1.0 - limit_rounding));
  double low = periods > 0.0 ? -now.acceleration / (periods * t) : 0.0;
  if (low >= high) return sign * high;
  for (int n = 0; n < jerk_halvings; ++n) {
    const double middle = 0.5 * (low + high);
    (passes(middle) ? high : low) = middle;
  }
  return sign * low;
}

void AxisTracker::step_to_speed(double speed, const TrackerLimits& limits) noexcept {
  landing_ = {};
  if (state_.speed == speed && state_.acceleration == 0.0) return move(0.0);
  const double small = reached * limits.jerk * period_s_ * period_s_;
  move(jerk_to_speed(speed, limits));
  if (std::abs(state_.speed - speed) <= small && std::abs(state_.acceleration) * period_s_ <= small) {
    state_ = {speed, 0.0};
  }
}

bool AxisTracker::land(double goal, const TrackerLimits& limits) noexcept {
  const double sign = goal >= position_ ? 1.0 : -1.0;
  const AlongPath now{sign * state_.speed, sign * state_.acceleration};
  const double travel = sign * (goal - position_);
  const double ended = now.speed + 0.5 * now.acceleration * now.acceleration / limits.jerk;
  const double highest = std::max(limits.speed, ended) * (1.0 + limit_rounding);
  const auto keeps = [&](const Landing& landing) {
    AlongPath state = now;
    for (std::size_t i = 0; i < landing.jerk.size(); ++i) {
      const double jerk = landing.jerk[i];
      if (std::abs(jerk) > limits.jerk * (1.0 + limit_rounding)) return false;
      const double before = state.acceleration;
      const double peak = before > 0.0 && jerk < 0.0 ? state.speed - 0.5 * before * before / jerk : 0.0;
      state = state.after(jerk, landing.periods[i] * period_s_);
      if (std::max(state.acceleration < 0.0 ? peak : 0.0, state.speed) > highest) return false;
      if (state.speed < -limit_rounding * limits.acceleration * period_s_) return false;
      if (std::abs(state.acceleration) > limits.acceleration * (1.0 + limit_rounding)) return false;
    }
    return true;
  };
  // From rest there and back, otherwise the braking.
  const double shortest_s = std::max(now.speed > 0.0 ? stop_from(now, limits).time_s : 0.0,
                                     std::cbrt((now.speed > 0.0 ? 6.0 : 32.0) * travel / limits.jerk));
  const double braking = std::min(limits.acceleration, std::sqrt(ended * limits.jerk));
  const double ends = std::max(1.0, std::ceil(braking / (limits.jerk * period_s_)));
  const double begins = std::max(1.0, std::ceil((braking + now.acceleration) / (limits.jerk * period_s_)));
  int periods = std::max(3, static_cast<int>(first_landing * shortest_s / period_s_));
  for (int n = 0; n < tried_landings; ++n, periods += 1 + periods / 32) {
    for (const double between : middle_shares) {
      const double share = std::min(1.0, (periods - std::max(1.0, between * periods)) / (begins + ends));
      const int first = std::clamp(static_cast<int>(std::lround(share * begins)), 1, periods - 2);
      const int last = std::clamp(static_cast<int>(std::lround(share * ends)), 1, periods - 1 - first);
      Landing found = landing_after(travel, now, {first, periods - first - last, last}, period_s_);
      if (!keeps(found)) continue;
      for (double& jerk : found.jerk) jerk *= sign;
      landing_ = found;
      return true;
    }
  }
  return false;
}

bool AxisTracker::leaves_room(double goal, double sign, const TrackerLimits& limits) const noexcept {
  const AlongPath now{sign * state_.speed, sign * state_.acceleration};
  const double ends_at = now.speed + 0.5 * std::max(0.0, now.acceleration) * now.acceleration / limits.jerk;
  const double left = sign * (goal - position_);
  return ends_at <= 0.0 || stop_from(now, limits).distance + periods_kept * now.speed * period_s_ < left;
}

void AxisTracker::step(double goal, const TrackerLimits& limits) noexcept {
  if (!(goal == goal_)) landing_ = {};
  goal_ = goal;
  if (!landing_.runs()) {
    const double sign = goal >= position_ ? 1.0 : -1.0;
    if (!std::isfinite(goal)) return step_to_speed(sign * limits.speed, limits);
    if (at_rest() && goal == position_) return;
    // On, as long as a stop before the goal stays possible.
    AxisTracker on = *this;
    on.step_to_speed(sign * limits.speed, limits);
    if (on.leaves_room(goal, sign, limits)) {
      *this = on;
      return;
    }
    if (!land(goal, limits)) return step_to_speed(0.0, limits);
  }
  move(landing_.next());
  if (landing_.runs()) return;
  position_ = goal;  // to the last bit
  state_ = {};
}

}  // namespace shapegcode
