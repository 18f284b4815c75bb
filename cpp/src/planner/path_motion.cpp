#include "planner/path_motion.hpp"

#include <algorithm>
#include <cmath>

namespace shapegcode {
namespace {

// Relative round-off by which a state may exceed a limit.
constexpr double rounding = 1e-9;
// Candidates of the jerk that are tried, and halvings between the best of them and the next.
constexpr int candidates = 12;
constexpr int halvings = 9;
// A slow feed asks for far less than the limit of the jerk.
constexpr int halvings_from_rest = 48;
// Of the jerk that ends at a speed.
constexpr int halvings_to_speed = 28;
// So many landings are tried, each a little longer, and within so many stopping lengths.
constexpr int landings = 96;
constexpr double landing_lengths = 40.0;
constexpr double longest_landing = 1e6;
// A landing before the last interval is tried within so many times what a stop takes from there.
constexpr double landing_stops = 2.0;
// A landing wherever it ends is tried when so much braking is ahead, as a multiple of what ends with the jerk limit.
constexpr double most_ahead = 4.0;
constexpr double shortest_share = 1.2;
constexpr int landings_anywhere = 24;
// Of the jerk, with which a speed is approached: what is left is for the landing.
constexpr double approach_share = 0.8;
// What a landing may be beyond the limits.
constexpr double landing_rounding = 5e-4;
// What is tried where no landing keeps them.
constexpr double first_excess = 1.1;
constexpr double next_excess = 1.5;
constexpr double last_excess = 16.0;
// Where in a period the jerk is looked at, by its length.
constexpr std::array<double, 4> jerk_looked_at{0.0, 1.0 / 3.0, 2.0 / 3.0, 1.0};
// How far ahead of a motion that begins a stop is near, in periods at full speed.
constexpr double periods_to_stop = 4.0;
// A speed, and what a period makes of it, that is none, mm/s.
constexpr double no_speed = 1e-10;

// Where nothing is left by a little, what is too slow is taken: it is the upper bound that leads beyond the limits.
double nearest(const Range& range, double value) noexcept { return std::min(range.high, std::max(range.low, value)); }

// Whether a speed is above that of an interval, beyond rounding.
bool is_above(double speed, const Station& station) noexcept { return speed > station.speed_limit * (1.0 + rounding); }

// Distance and speed after a time on s'' = a + c s.
void go(PathState state, double c, double t, double& travel, double& speed) noexcept {
  const double v = std::sqrt(state.speed_squared);
  const double a = state.acceleration;
  const double root = std::sqrt(std::abs(c));
  const double angle = root * t;
  if (angle < 1e-4) {
    travel = t * (v + t * (0.5 * a + t * c * v / 6.0));
    speed = v + t * (a + 0.5 * t * c * v);
  } else if (c > 0.0) {
    travel = a / c * (std::cosh(angle) - 1.0) + v / root * std::sinh(angle);
    speed = a / root * std::sinh(angle) + v * std::cosh(angle);
  } else {
    travel = a / c * (std::cos(angle) - 1.0) + v / root * std::sin(angle);
    speed = a / root * std::sin(angle) + v * std::cos(angle);
  }
}

}  // namespace

AxisValues PathMotion::position() const noexcept {
  const std::size_t at = at_end() ? station_ - 1 : station_;
  const Station& station = plan_->station(at);
  return position_at(station, plan_->segment_of(station), at_end() ? station.length : offset_, plan_->axes());
}

void PathMotion::rates(AxisValues& velocity, AxisValues& acceleration) const noexcept {
  velocity = acceleration = {};
  if (at_end()) return;
  const Derivatives path = path_here();
  const double v = state_.speed;
  for (std::size_t i = 0; i < plan_->axes(); ++i) {
    velocity[i] = path.first[i] * v;
    acceleration[i] = path.first[i] * state_.acceleration + path.second[i] * v * v;
  }
}

PathPoint PathMotion::point() const noexcept {
  if (at_end()) {
    const Station& last = plan_->station(station_ - 1);
    return {last.segment, last.offset + last.length, state_};
  }
  const Station& here = plan_->station(station_);
  return {here.segment, here.offset + offset_, state_};
}

// Where the motion is so many mm on; not planned: at a stop or beyond it.
PathMotion::Place PathMotion::place_at(double travel) const noexcept {
  Place place{station_, offset_ + travel, true};
  while (place.offset >= plan_->station(place.station).length) {
    if (plan_->ends_in_stop(place.station)) return {place.station, plan_->station(place.station).length, false};
    place.offset -= plan_->station(place.station++).length;
  }
  return place;
}

// Distance to the next stop, infinite beyond `most`.
double PathMotion::to_stop(double most) const noexcept {
  double travel = -offset_;
  for (std::size_t k = station_; travel <= most; ++k) {
    travel += plan_->station(k).length;
    if (plan_->ends_in_stop(k)) return travel;
  }
  return no_limit;
}

bool PathMotion::is_near_end(double length_mm) const noexcept {
  double travel = -offset_;
  for (std::size_t k = station_; k < plan_->end() && travel <= length_mm; ++k) travel += plan_->station(k).length;
  return travel <= length_mm;
}

// The path where the motion is after so much time, as far as its jerk does not matter.
Derivatives PathMotion::derivatives_after(double time_s) const noexcept {
  const Place place = place_at(std::max(0.0, time_s * (state_.speed + 0.5 * state_.acceleration * time_s)));
  const Station& there = plan_->station(place.station);
  return plan_->derivatives(there, place.offset);
}

// The jerks with which all limits are kept until the end of the period.
PathMotion::Jerks PathMotion::allowed() const noexcept {
  const Station& here = plan_->station(station_);
  const AxisLimits limits = plan_->limits_at(here).share(share_);
  const double t = period_s_;
  Jerks jerks{-no_limit, no_limit};
  const auto keep = [&](double on_jerk, double rest, double most) {
    if (std::abs(on_jerk) < rounding * t) return;
    const double first = (most - rest) / on_jerk;
    const double second = (-most - rest) / on_jerk;
    jerks.high = std::min(jerks.high, std::max(first, second));
    jerks.low = std::max(jerks.low, std::min(first, second));
  };
  keep(1.0, 0.0, share_ * here.max_jerk);
  keep(t, state_.acceleration, share_ * here.max_acceleration);
  for (const double share : jerk_looked_at) {
    const double x = share * t;
    const Derivatives path = share < 1.0 ? derivatives_after(x) : after_period_;
    const double v = std::max(0.0, state_.speed + state_.acceleration * x);
    for (std::size_t i = 0; i < limits.axes; ++i) {
      keep(path.first[i] + 3.0 * path.second[i] * v * x,
           v * (3.0 * path.second[i] * state_.acceleration + path.third[i] * v * v), limits.jerk[i]);
      if (share < 1.0) continue;
      keep(path.first[i] * t, path.first[i] * state_.acceleration + path.second[i] * v * v, limits.acceleration[i]);
    }
  }
  return jerks;
}

// Whether a stop is certain after so much time with a constant jerk.
bool PathMotion::controllable(double jerk, double time_s, const Derivatives& path) const noexcept {
  const double travel = state_.travel(jerk, time_s);
  const auto [v, a] = state_.after(jerk, time_s);
  if (v < 0.0 || travel < 0.0) return false;
  const Place place = place_at(travel);
  if (!place.planned || plan_->ends_in_stop(place.station)) return false;
  const Station& station = plan_->station(place.station);
  const double left = station.length - place.offset;
  const PathState state{v * v, a};
  const double cap = station.squared_limit();
  const double rise = station.coarse ? std::max(a, 0.0) * left : 0.0;
  if (state.speed_squared + rise > cap * (1.0 + rounding)) return false;
  const AxisLimits limits = plan_->limits_at(station);
  // Braking must be over before the motion is.
  if (a < 0.0 && 2.0 * plan_->highest_jerk(station, path) * v < a * a) return false;
  if (std::abs(a) > station.max_acceleration * (1.0 + rounding)) return false;
  for (std::size_t i = 0; i < limits.axes; ++i) {
    const double acceleration = path.first[i] * a + path.second[i] * state.speed_squared;
    if (std::abs(acceleration) > limits.acceleration[i] * (1.0 + rounding)) return false;
  }
  // It may come to rest within the interval: after no more than v^2 / -a, wherever the braking begins to end.
  if (stops_ && state.speed_squared < -a * left) return true;
  const Range range = ControllableSets::leading_to(set(place.station + 1), state, left);
  if (range.empty()) return false;
  Rows rows;
  plan_->rules().rows_of(station, plan_->segment_of(station),
                         {place.offset, left, state.speed_squared, state.squared_after(left), cap}, rows);
  return !ControllableSets::within(rows, state, range).empty();
}

// Now and, so that jerks do not alternate, one period later still.
bool PathMotion::controllable(double jerk) const noexcept {
  return controllable(jerk, period_s_, after_period_) && controllable(jerk, 2.0 * period_s_, after_two_);
}

// The jerk nearest to the one wished for, looked for towards `end` first.
bool PathMotion::choose(double wish, double end, double& jerk) const noexcept {
  jerk = wish;
  if (controllable(wish)) return true;
  double wrong = wish;
  double right = wish;
  bool found = false;
  const auto look = [&](double candidate) {
    if (found || candidate < jerks_.low || candidate > jerks_.high) return;
    right = candidate;
    found = controllable(candidate);
  };
  const auto look_towards = [&](double far) {
    for (int n = 1; n <= candidates && !found; ++n) {
      look(wish + (far - wish) * n / candidates);
      if (!found) wrong = right;
    }
    if (!found) wrong = wish;
  };
  look_towards(end);
  // Where the limit of the jerk is far beyond what so slow a motion can do.
  for (const double candidate : {jerk_, -state_.acceleration / period_s_, 0.0}) look(candidate);
  if (!found) look_towards(end == jerks_.low ? jerks_.high : jerks_.low);
  if (!found) return false;
  for (int n = 0; n < halvings || (n < halvings_from_rest && right == 0.0 && at_rest()); ++n) {
    const double middle = 0.5 * (wrong + right);
    (controllable(middle) ? right : wrong) = middle;
  }
  jerk = right;
  return true;
}

// The jerk after which the acceleration can end at a speed, and not below it.
double PathMotion::wished(double max_speed) const noexcept {
  const Station& here = plan_->station(station_);
  const double most_jerk = approach_share * plan_->highest_jerk(here, path_here());
  const auto ends_above = [&](double jerk) {
    const AlongPath then = state_.after(jerk, period_s_);
    return then.speed + then.acceleration * std::abs(then.acceleration) / (2.0 * most_jerk) >= max_speed;
  };
  double low = jerks_.low;
  double high = jerks_.high;
  if (ends_above(low)) return low;
  if (!ends_above(high)) return high;
  for (int n = 0; n < halvings_to_speed; ++n) {
    const double middle = 0.5 * (low + high);
    (ends_above(middle) ? high : low) = middle;
  }
  return high;
}

// Whether a landing keeps the limits where the path turns.
bool PathMotion::keeps_limits(const Landing& landing, double excess) const noexcept {
  AlongPath state = state_;
  double travel = 0.0;
  // A motion that is too fast already, or has to end whatever it costs, at least gets no faster.
  const bool is_too_fast = excess > 1.0 || is_above(state_.speed, plan_->station(station_));
  for (std::size_t part = 0; part < landing.jerk.size(); ++part) {
    const double jerk = landing.jerk[part];
    for (int n = 0; n < landing.periods[part]; ++n) {
      travel += state.travel(jerk, period_s_);
      state = state.after(jerk, period_s_);
      const Place place = place_at(travel);
      if (!place.planned) return true;  // the last of it is slow
      const Station& station = plan_->station(place.station);
      if ((!is_too_fast || state.speed > state_.speed) && is_above(state.speed, station)) return false;
      const AxisLimits limits = plan_->limits_at(station).share(excess * (1.0 + landing_rounding));
      const Derivatives path = plan_->derivatives(station, place.offset);
      if (!keeps(limits, path, state, jerk)) return false;
    }
  }
  return true;
}

// Whether its three parts do not go back and keep these limits along the path, and those of the axes.
bool PathMotion::holds(const Landing& landing, double most_jerk, double steepest, double excess) const noexcept {
  AlongPath state = state_;
  for (std::size_t i = 0; i < landing.jerk.size(); ++i) {
    if (std::abs(landing.jerk[i]) > most_jerk) return false;
    state = state.after(landing.jerk[i], landing.periods[i] * period_s_);
    if (state.speed < -rounding || std::abs(state.acceleration) > steepest) return false;
  }
  return keeps_limits(landing, excess);
}

// Distance to a stop as if the acceleration had to be built up: what brakes for a corner far from a stop does not land.
double PathMotion::stop_from_here() const noexcept {
  const Station& here = plan_->station(station_);
  const Derivatives path = path_here();
  const double stop_s = stopping_time(state_.speed, plan_->steepest(here, path), plan_->highest_jerk(here, path));
  return 0.5 * state_.speed * stop_s;
}

// The shortest landing after `travel` mm within the limits times `excess`.
bool PathMotion::land(double travel, double excess) noexcept {
  const Station& here = plan_->station(station_);
  const Derivatives path = path_here();
  const double most_jerk = excess * (1.0 + landing_rounding) * plan_->highest_jerk(here, path);
  const double steepest =
      excess * (1.0 + rounding) * std::max(plan_->steepest(here, path), std::abs(state_.acceleration));
  // No shorter than with a jerk that is constant.
  const double shortest_s =
      0.5 * std::max(std::abs(state_.acceleration) / most_jerk, std::cbrt(6.0 * travel / most_jerk));
  int periods = std::max(3, static_cast<int>(std::min(shortest_s / period_s_, longest_landing)));
  for (int n = 0; n < landings; ++n, periods += 1 + periods / (n < landings / 3 ? 32 : 8)) {
    const Landing found =
        landing_after(travel, state_, {periods / 3, periods - 2 * (periods / 3), periods / 3}, period_s_);
    if (!holds(found, most_jerk, steepest, excess)) continue;
    landing_ = found;
    return true;
  }
  return false;
}

// A landing of two jerks wherever it ends, before the next stop. Near the end of the braking.
bool PathMotion::land_anywhere() noexcept {
  const Station& here = plan_->station(station_);
  const Derivatives path = path_here();
  const double most_jerk = share_ * (1.0 + landing_rounding) * plan_->highest_jerk(here, path);
  const double a = state_.acceleration;
  const double v = state_.speed;
  if (!(a < 0.0) || 2.0 * most_jerk * v > most_ahead * a * a) return false;
  const double steepest = (1.0 + rounding) * std::max(plan_->steepest(here, path), -a);
  const int shortest = std::max(2, static_cast<int>(std::min(-shortest_share * v / (a * period_s_), longest_landing)));
  for (int n = 0, periods = shortest; n < landings_anywhere; ++n, periods += 1 + periods / 16) {
    Landing found;
    found.periods = {periods / 2, periods - periods / 2, 0};
    const double t = found.periods[0] * period_s_;
    const double u = found.periods[1] * period_s_;
    // a + j t + k u = 0 and v + a (t + u) + j t (t / 2 + u) + k u^2 / 2 = 0.
    found.jerk[0] = -(v + a * (t + 0.5 * u)) / (0.5 * t * (t + u));
    found.jerk[1] = -(a + found.jerk[0] * t) / u;
    const AlongPath middle = state_.after(found.jerk[0], t);
    if (!place_at(state_.travel(found.jerk[0], t) + middle.travel(found.jerk[1], u)).planned) continue;
    if (!holds(found, most_jerk, steepest, share_)) continue;
    landing_ = found;
    return true;
  }
  return false;
}

void PathMotion::fly_on() noexcept {
  move(landing_.next(), period_s_);
  if (!landing_.runs()) come_to_rest();
}

void PathMotion::pass(double travel) noexcept {
  offset_ += std::max(travel, 0.0);
  while (offset_ >= plan_->station(station_).length) {
    // A stop is not passed but reached: see come_to_rest.
    if (plan_->ends_in_stop(station_)) {
      offset_ = plan_->station(station_).length;
      return;
    }
    offset_ -= plan_->station(station_++).length;
  }
}

void PathMotion::move(double jerk, double time_s) noexcept {
  double t = time_s;
  // Not beyond rest.
  if (state_.acceleration < 0.0 && jerk > 0.0 &&
      state_.speed * 2.0 * jerk <= state_.acceleration * state_.acceleration * (1.0 + rounding)) {
    t = std::min(t, -state_.acceleration / jerk);
  }
  const double travel = state_.travel(jerk, t);
  state_ = state_.after(jerk, t);
  state_.speed = std::max(0.0, state_.speed);
  jerk_ = jerk;
  pass(travel);
  const bool is_slow = state_.speed < no_speed && std::abs(state_.acceleration) * period_s_ < no_speed;
  if (t < time_s || is_slow || (state_.speed <= 0.0 && state_.acceleration < 0.0)) come_to_rest();
}

void PathMotion::come_to_rest() noexcept {
  state_ = {};
  jerk_ = 0.0;
  if (plan_->ends_in_stop(station_) && offset_ >= plan_->station(station_).length - no_travel_mm) {
    ++station_;
    offset_ = 0.0;
    landing_ = {};  // what is left of it is rounding
  }
}

// The choice of c for the rest of an interval.
double PathMotion::course(double left, PathState state) noexcept {
  const Station& here = plan_->station(station_);
  const Range leading = ControllableSets::leading_to(set(station_ + 1), state, left);
  Rows rows;
  plan_->rules().rows_of(here, plan_->segment_of(here),
                         {offset_, left, state.speed_squared, state.squared_after(left),
                          std::max(state.speed_squared, here.squared_limit())},
                         rows);
  const Range range = ControllableSets::within(rows, state, leading);
  double c = leading.high;
  if (range.low <= range.high) {
    // What the limits allow at once, if the rest lets it.
    c = nearest(range, state_.speed > 0.0 ? wish_ / state_.speed : range.high);
  } else if (leading.low <= leading.high) {
    // Between the places that were looked at: as it was begun, which misses the least.
    c = nearest(leading, course_station_ == station_ ? course_ : 0.5 * (range.low + range.high));
  }
  course_ = std::isfinite(c) ? c : 0.0;
  course_station_ = station_;
  return course_;
}

// Where no constant jerk will do: a choice of c that leads to the next set, from station to station.
void PathMotion::follow() noexcept {
  double rest = period_s_;
  while (rest > rounding * period_s_) {
    const double left = plan_->station(station_).length - offset_;
    if (plan_->ends_in_stop(station_)) {
      // A landing begins with a period; none was found where the end is reached.
      return left <= no_travel_mm ? come_to_rest() : move(0.0, rest);
    }
    const PathState state{state_.speed * state_.speed, state_.acceleration};
    const double c = course(left, state);
    if (state_.acceleration < 0.0 && -state_.acceleration < c * left &&
        state_.acceleration * state_.acceleration > c * state.speed_squared) {
      // That would be rest within the interval: with the jerk that ends both.
      return move(state_.speed > 0.0 ? state_.acceleration * state_.acceleration / (2.0 * state_.speed) : 0.0, rest);
    }
    double travel = 0.0;
    double speed = 0.0;
    double t = rest;
    go(state, c, t, travel, speed);
    if (travel > left) {
      double low = 0.0;
      double high = rest;
      for (int halving = 0; halving < 40; ++halving) {
        t = 0.5 * (low + high);
        go(state, c, t, travel, speed);
        (travel > left ? high : low) = t;
      }
      t = high;
      travel = left;
    }
    travel = std::max(travel, 0.0);
    state_.acceleration += c * travel;
    state_.speed = std::max(speed, 0.0);
    jerk_ = c * state_.speed;
    pass(travel);
    rest -= t;
    // The motion does not go back.
    if (state_.speed <= 0.0 && state_.acceleration < 0.0) state_.acceleration = 0.0;
  }
}

// Within the sets.
void PathMotion::keep_to(double jerk) noexcept {
  is_beside_ = false;
  move(jerk, period_s_);
}

// A state to which another plan has led may be a little beside the sets of this one: towards them within the limits.
bool PathMotion::returns() noexcept {
  if (jerks_.low > jerks_.high || state_.speed <= no_speed) return false;
  const double left = plan_->station(station_).length - offset_;
  const double jerk = course(left, {state_.speed * state_.speed, state_.acceleration}) * state_.speed;
  if (jerk >= jerks_.low && jerk <= jerks_.high) return false;
  const double nearest = std::clamp(jerk, jerks_.low, jerks_.high);
  const Place place = place_at(state_.travel(nearest, period_s_));
  const double speed = state_.after(nearest, period_s_).speed;
  if (!place.planned || speed < 0.0 || speed > plan_->station(place.station).speed_limit) return false;
  move(nearest, period_s_);
  return true;
}

void PathMotion::advance(double max_speed) noexcept {
  if (landing_.runs()) return fly_on();
  if (at_end()) return;
  const double near = landing_lengths * plan_->stopping_length();
  const double travel = to_stop(near);
  const bool last = plan_->ends_in_stop(station_);
  if (last || (travel <= near && state_.acceleration < 0.0 && travel <= landing_stops * stop_from_here())) {
    if (land(travel, share_)) return fly_on();
  }
  stops_ = max_speed <= 0.0;
  if (stops_ && land_anywhere()) return fly_on();
  after_period_ = derivatives_after(period_s_);
  after_two_ = derivatives_after(2.0 * period_s_);
  jerks_ = allowed();
  if (at_rest()) {
    // Not past a near stop, where the limits are far beyond what so short a motion can do.
    const double period_mm = periods_to_stop * plan_->station(station_).speed_limit * period_s_;
    jerks_.high = std::min(jerks_.high, 6.0 * to_stop(std::max(near, period_mm)) / std::pow(period_s_, 3));
  }
  wish_ = jerks_.high;
  if (jerks_.low <= jerks_.high) {
    double jerk = 0.0;
    const bool slower = max_speed < no_limit;
    if (slower) wish_ = wished(max_speed);
    const bool was_slow = is_slow_ || is_beside_;
    is_slow_ = slower;
    if (choose(wish_, slower ? jerks_.high : jerks_.low, jerk)) return keep_to(jerk);
    // After a slow motion, which may brake harder than a valley is approached.
    is_slow_ = was_slow;
    if (!slower && is_slow_ && choose(wish_, jerks_.low, jerk)) return keep_to(jerk);
  }
  if (last) {
    // Whatever the limits are, not past the stop.
    for (double excess = first_excess; excess < last_excess; excess *= next_excess) {
      if (land(travel, excess)) return fly_on();
    }
  }
  if (is_beside_ && !last && returns()) return;
  follow();
}

}  // namespace shapegcode
