#include "planner/path_motion.hpp"

#include <algorithm>
#include <cmath>

#include <Eigen/LU>

namespace shapegcode {
namespace {

// Relative, of a limit that a state may be beyond by rounding.
constexpr double rounding = 1e-9;
// Candidates of the jerk that are tried, and halvings between the best of them and the next.
constexpr int candidates = 12;
constexpr int halvings = 14;
// So many landings are tried, each a little longer, and within so many stopping lengths.
constexpr int landings = 96;
constexpr double landing_lengths = 40.0;
// What a landing may be beyond the limits.
constexpr double landing_rounding = 5e-4;
// What is tried where no landing keeps them.
constexpr double first_excess = 1.1;
constexpr double next_excess = 1.5;
constexpr double last_excess = 16.0;
// Where in a period the jerk is looked at, by its length.
constexpr std::array<double, 4> jerk_looked_at{0.0, 1.0 / 3.0, 2.0 / 3.0, 1.0};
// How near an end is it.
constexpr double at_end_mm = 1e-9;

// Where nothing is left by a little, what is too slow is taken: it is the upper bound that leads beyond the limits.
double nearest(const Range& range, double value) noexcept { return std::min(range.high, std::max(range.low, value)); }

// Way and speed after a time on s'' = a + c s.
void go(PathState state, double c, double t, double& way, double& speed) noexcept {
  const double v = std::sqrt(state.speed_squared);
  const double a = state.acceleration;
  const double root = std::sqrt(std::abs(c));
  const double angle = root * t;
  if (angle < 1e-4) {
    way = t * (v + t * (0.5 * a + t * c * v / 6.0));
    speed = v + t * (a + 0.5 * t * c * v);
  } else if (c > 0.0) {
    way = a / c * (std::cosh(angle) - 1.0) + v / root * std::sinh(angle);
    speed = a / root * std::sinh(angle) + v * std::cosh(angle);
  } else {
    way = a / c * (std::cos(angle) - 1.0) + v / root * std::sin(angle);
    speed = a / root * std::sin(angle) + v * std::cos(angle);
  }
}

}  // namespace

AxisValues PathMotion::position() const noexcept {
  const std::size_t at = at_end() ? station_ - 1 : station_;
  const Station& station = plan_->station(at);
  return position_at(station, plan_->segment_of(station), at_end() ? station.length : offset_);
}

// Where the motion is so many mm on; not planned: at a stop or beyond it.
PathMotion::Place PathMotion::place_at(double way) const noexcept {
  Place place{station_, offset_ + way, true};
  while (place.offset >= plan_->station(place.station).length) {
    if (plan_->ends_in_stop(place.station)) return {place.station, plan_->station(place.station).length, false};
    place.offset -= plan_->station(place.station++).length;
  }
  return place;
}

// Way to the next stop; beyond `most`, some more than that.
double PathMotion::to_stop(double most) const noexcept {
  double way = -offset_;
  for (std::size_t k = station_; way <= most; ++k) {
    way += plan_->station(k).length;
    if (plan_->ends_in_stop(k)) return way;
  }
  return std::numeric_limits<double>::infinity();
}

// The path where the motion is after so much time, as far as its jerk does not matter.
Derivatives PathMotion::derivatives_after(double time_s) const noexcept {
  const Place place = place_at(std::max(0.0, time_s * (speed_ + 0.5 * acceleration_ * time_s)));
  const Station& there = plan_->station(place.station);
  return derivatives_at(there, plan_->segment_of(there), place.offset);
}

// The jerks with which all limits are kept until the end of the period.
PathMotion::Jerks PathMotion::allowed() const noexcept {
  const AxisLimits limits = plan_->limits_at(plan_->station(station_));
  const double t = period_s_;
  Jerks jerks{-std::numeric_limits<double>::infinity(), std::numeric_limits<double>::infinity()};
  const auto keep = [&](double on_jerk, double rest, double most) {
    if (std::abs(on_jerk) < rounding * t) return;
    const double first = (most - rest) / on_jerk;
    const double second = (-most - rest) / on_jerk;
    jerks.high = std::min(jerks.high, std::max(first, second));
    jerks.low = std::max(jerks.low, std::min(first, second));
  };
  for (const double share : jerk_looked_at) {
    const double x = share * t;
    const Derivatives path = share < 1.0 ? derivatives_after(x) : after_period_;
    const double v = std::max(0.0, speed_ + acceleration_ * x);
    for (std::size_t i = 0; i < axis_count; ++i) {
      keep(path.first[i] + 3.0 * path.second[i] * v * x,
           v * (3.0 * path.second[i] * acceleration_ + path.third[i] * v * v), limits.jerk[i]);
      if (share < 1.0) continue;
      keep(path.first[i] * t, path.first[i] * acceleration_ + path.second[i] * v * v, limits.acceleration[i]);
    }
  }
  return jerks;
}

// Whether a stop is certain after so much time with a constant jerk.
bool PathMotion::controllable(double jerk, double time_s, const Derivatives& path) const noexcept {
  const double t = time_s;
  const double a = acceleration_ + jerk * t;
  const double v = speed_ + t * (acceleration_ + 0.5 * jerk * t);
  const double way = t * (speed_ + t * (0.5 * acceleration_ + jerk * t * (1.0 / 6.0)));
  if (v < 0.0 || way < 0.0) return false;
  const Place place = place_at(way);
  if (!place.planned || plan_->ends_in_stop(place.station)) return false;
  const Station& station = plan_->station(place.station);
  const double left = station.length - place.offset;
  const PathState state{v * v, a};
  const double cap = station.squared_limit();
  if (state.speed_squared > cap * (1.0 + rounding)) return false;
  const AxisLimits limits = plan_->limits_at(station);
  // Braking must be over before the motion is.
  if (a < 0.0 && 2.0 * along(path.first, limits.jerk) * v < a * a) return false;
  for (std::size_t i = 0; i < axis_count; ++i) {
    const double acceleration = path.first[i] * a + path.second[i] * state.speed_squared;
    if (std::abs(acceleration) > limits.acceleration[i] * (1.0 + rounding)) return false;
  }
  const Range range = ControllableSets::leading_to(plan_->set(place.station + 1), state, left);
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

// The highest jerk that is allowed.
bool PathMotion::choose(double& jerk) const noexcept {
  if (controllable(jerks_.high)) {
    jerk = jerks_.high;
    return true;
  }
  double wrong = jerks_.high;
  double right = jerks_.high;
  bool found = false;
  for (int n = 1; n <= candidates && !found; ++n) {
    right = jerks_.high + (jerks_.low - jerks_.high) * n / candidates;
    found = controllable(right);
    if (!found) wrong = right;
  }
  if (!found && jerk_ >= jerks_.low && jerk_ <= jerks_.high) {
    right = jerk_;
    wrong = jerks_.high;
    found = controllable(right);
  }
  if (!found) return false;
  for (int n = 0; n < halvings; ++n) {
    const double middle = 0.5 * (wrong + right);
    (controllable(middle) ? right : wrong) = middle;
  }
  jerk = right;
  return true;
}

// Whether a landing keeps the limits where the path turns.
bool PathMotion::keeps_limits(const Landing& landing, double excess) const noexcept {
  double v = speed_;
  double a = acceleration_;
  double way = 0.0;
  const double t = period_s_;
  for (std::size_t part = 0; part < landing.jerk.size(); ++part) {
    const double jerk = landing.jerk[part];
    for (int n = 0; n < landing.periods[part]; ++n) {
      way += t * (v + t * (0.5 * a + t * jerk * (1.0 / 6.0)));
      v += t * (a + 0.5 * t * jerk);
      a += t * jerk;
      const Place place = place_at(way);
      if (!place.planned) return true;  // the last of it is slow
      const Station& station = plan_->station(place.station);
      if (v > speed_ && v * v > station.squared_limit()) return false;
      const AxisLimits limits = plan_->limits_at(station);
      const Derivatives path = derivatives_at(station, plan_->segment_of(station), place.offset);
      for (std::size_t i = 0; i < axis_count; ++i) {
        const double acceleration = path.first[i] * a + path.second[i] * v * v;
        const double axis_jerk = path.first[i] * jerk + v * (3.0 * path.second[i] * a + path.third[i] * v * v);
        if (std::abs(acceleration) > excess * (1.0 + landing_rounding) * limits.acceleration[i] ||
            std::abs(axis_jerk) > excess * (1.0 + landing_rounding) * limits.jerk[i]) {
          return false;
        }
      }
    }
  }
  return true;
}

// The shortest landing after `way` mm within the limits times `excess`.
bool PathMotion::land(double way, double excess) noexcept {
  const Station& here = plan_->station(station_);
  const AxisLimits limits = plan_->limits_at(here);
  const Derivatives path = derivatives_at(here, plan_->segment_of(here), offset_);
  const double most_jerk = excess * (1.0 + landing_rounding) * along(path.first, limits.jerk);
  const double steepest =
      excess * (1.0 + rounding) * std::max(along(path.first, limits.acceleration), std::abs(acceleration_));
  const double a = acceleration_;
  const double v = speed_;
  // No shorter than with a jerk that is constant.
  const double shortest_s = 0.5 * std::max(std::abs(a) / most_jerk, std::cbrt(6.0 * way / most_jerk));
  int periods = std::max(3, static_cast<int>(shortest_s / period_s_));
  for (int n = 0; n < landings; ++n, periods += 1 + periods / (n < landings / 3 ? 32 : 8)) {
    Landing found;
    found.periods = {periods / 3, periods - 2 * (periods / 3), periods / 3};
    std::array<double, 3> time{};
    for (std::size_t i = 0; i < 3; ++i) time[i] = found.periods[i] * period_s_;
    const double whole = time[0] + time[1] + time[2];
    // What a jerk of 1 in each part makes of acceleration, speed and way at the end.
    Eigen::Matrix3d effect;
    double after = whole;
    for (Eigen::Index i = 0; i < 3; ++i) {
      const double t = time[static_cast<std::size_t>(i)];
      after -= t;
      effect(0, i) = t;
      effect(1, i) = t * (0.5 * t + after);
      effect(2, i) = t * (t * t / 6.0 + after * 0.5 * (t + after));
    }
    const Vector3 jerk = effect.inverse() * Vector3(-a, -v - a * whole, way - whole * (v + 0.5 * a * whole));
    double speed = v;
    double steep = a;
    bool keeps = jerk.cwiseAbs().maxCoeff() <= most_jerk;
    for (std::size_t i = 0; i < 3 && keeps; ++i) {
      found.jerk[i] = jerk[static_cast<Eigen::Index>(i)];
      speed += time[i] * (steep + 0.5 * time[i] * found.jerk[i]);
      steep += time[i] * found.jerk[i];
      keeps = speed >= -rounding && std::abs(steep) <= steepest;
    }
    if (!keeps || !keeps_limits(found, excess)) continue;
    landing_ = found;
    return true;
  }
  return false;
}

void PathMotion::fly_on() noexcept {
  std::size_t part = 0;
  while (landing_.periods[part] == 0) ++part;
  move(landing_.jerk[part], period_s_);
  --landing_.periods[part];
  if (!landing_.runs()) come_to_rest();
}

void PathMotion::pass(double way) noexcept {
  offset_ += std::max(way, 0.0);
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
  if (acceleration_ < 0.0 && jerk > 0.0 && speed_ * 2.0 * jerk <= acceleration_ * acceleration_ * (1.0 + rounding)) {
    t = std::min(t, -acceleration_ / jerk);
  }
  const double way = t * (speed_ + t * (0.5 * acceleration_ + jerk * t * (1.0 / 6.0)));
  speed_ = std::max(0.0, speed_ + t * (acceleration_ + 0.5 * jerk * t));
  acceleration_ += jerk * t;
  jerk_ = jerk;
  pass(way);
  if (t < time_s || (speed_ <= 0.0 && acceleration_ < 0.0)) speed_ = acceleration_ = jerk_ = 0.0;
}

void PathMotion::come_to_rest() noexcept {
  speed_ = acceleration_ = jerk_ = 0.0;
  if (plan_->ends_in_stop(station_) && offset_ >= plan_->station(station_).length - at_end_mm) {
    ++station_;
    offset_ = 0.0;
  }
}

// The choice of c for what is left of an interval.
double PathMotion::course(double left, PathState state) noexcept {
  const Station& here = plan_->station(station_);
  const Range leading = ControllableSets::leading_to(plan_->set(station_ + 1), state, left);
  Rows rows;
  plan_->rules().rows_of(here, plan_->segment_of(here),
                         {offset_, left, state.speed_squared, state.squared_after(left),
                          std::max(state.speed_squared, here.squared_limit())},
                         rows);
  const Range range = ControllableSets::within(rows, state, leading);
  double c = leading.high;
  if (range.low <= range.high) {
    // What the limits allow at once, if the rest lets it.
    c = nearest(range, speed_ > 0.0 ? jerks_.high / speed_ : range.high);
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
      return left <= at_end_mm ? come_to_rest() : move(0.0, rest);
    }
    const PathState state{speed_ * speed_, acceleration_};
    const double c = course(left, state);
    if (acceleration_ < 0.0 && -acceleration_ < c * left && acceleration_ * acceleration_ > c * state.speed_squared) {
      // That would be rest within the interval: with the jerk that ends both.
      return move(speed_ > 0.0 ? acceleration_ * acceleration_ / (2.0 * speed_) : 0.0, rest);
    }
    double way = 0.0;
    double speed = 0.0;
    double t = rest;
    go(state, c, t, way, speed);
    if (way > left) {
      double low = 0.0;
      double high = rest;
      for (int halving = 0; halving < 40; ++halving) {
        t = 0.5 * (low + high);
        go(state, c, t, way, speed);
        (way > left ? high : low) = t;
      }
      t = high;
      way = left;
    }
    way = std::max(way, 0.0);
    acceleration_ += c * way;
    speed_ = std::max(speed, 0.0);
    jerk_ = c * speed_;
    pass(way);
    rest -= t;
    // There is no way back.
    if (speed_ <= 0.0 && acceleration_ < 0.0) acceleration_ = 0.0;
  }
}

void PathMotion::advance() noexcept {
  if (landing_.runs()) return fly_on();
  if (at_end()) return;
  const double near = landing_lengths * plan_->stopping_length();
  const double way = to_stop(near);
  const bool last = plan_->ends_in_stop(station_);
  if (last || (way <= near && acceleration_ < 0.0)) {
    if (land(way, 1.0)) return fly_on();
  }
  after_period_ = derivatives_after(period_s_);
  after_two_ = derivatives_after(2.0 * period_s_);
  jerks_ = allowed();
  double jerk = 0.0;
  if (jerks_.low <= jerks_.high && choose(jerk)) return move(jerk, period_s_);
  if (last) {
    // Whatever the limits are, not past the stop.
    for (double excess = first_excess; excess < last_excess; excess *= next_excess) {
      if (land(way, excess)) return fly_on();
    }
  }
  follow();
}

}  // namespace shapegcode
