#include "planner/path_plan.hpp"

#include <algorithm>
#include <cmath>

namespace shapegcode {
namespace {

// Rounds of the plan after the first; more have no significant effect.
constexpr int rounds = 3;
// Stations that are made room for at first, where they may become more.
constexpr std::size_t first_capacity = 1024;
// The jerk limit is J / sqrt(b), of which a set has a tangent. It may lie too high better than too low: there its bound
// comes down to nothing at three times the square of the speed where it was laid.
constexpr double tangent_on_lines = 1.1;
constexpr double tangent_on_curves = 1.3;
// Corners of a set where the path turns: each costs there what all limits of all axes do.
constexpr std::size_t corners_on_curves = 8;
// As near to where the motion is expected as that is near enough: what it costs grows with its square.
constexpr double near_share = 0.02;
// Motions that differ by less, as a share of the square of their speed, are one.
constexpr double joining_share = 1e-4;
// Sets that differ by less are the same, as a share of each coordinate.
constexpr double same_share = 1e-9;
// A motion is as good as at rest whose square of the speed is less than this, of what rest becomes on the interval.
constexpr double slow_share = 0.01;
// Where keeping sets was of no use, because nearly all of them depend on the end, so many plans are made without.
constexpr int plans_anew = 16;
// Rounds in which each valley is tried; what makes one worth while.
constexpr int valley_rounds = 3;
constexpr double least_gain_s = 1e-5;
// As far as what a valley changes is looked at, in stations.
constexpr std::size_t most_changed = 256;
// An interval is coarse over which the jerk can change the speed by more than this share.
constexpr double coarse_share = 0.2;
// Relative, of the length of a direction.
constexpr double direction_rounding = 1e-9;
// Of an interval at rest, mm/s.
constexpr double least_speed = 1e-9;

}  // namespace

PathPlan::PathPlan(SegmentRing& ring, const AxisLimits& limits, double period_s, std::size_t capacity,
                   double max_across)
    : path_(ring, limits, period_s),
      rules_(limits),
      max_across_(max_across),
      grows_(capacity == 0),
      saved_(most_changed),
      expected_(2 * most_changed) {
  resize(grows_ ? first_capacity : capacity);
}

void PathPlan::resize(std::size_t capacity) {
  stations_.resize(capacity);
  sets_.resize(capacity);
  slow_sets_.resize(capacity);
  courses_.resize(capacity);
}

void PathPlan::make(const PathStart& start, const AlongPath& state, std::uint64_t end, const FeedRatios& ratios) {
  path_.start(start, end, ratios);
  begin_ = {state.speed * state.speed, state.acceleration};
  make_stations();
  make_sets(true);
  std::size_t kept = 0;
  std::size_t remade = 0;
  for (std::size_t k = 0; k + 1 < count_; ++k) {
    kept += courses_[k].is_kept ? 1 : 0;
    remade += courses_[k].is_kept && courses_[k].is_remade ? 1 : 0;
  }
  const bool is_worth = 2 * remade <= kept;
  anew_ = anew_ > 0 ? anew_ - 1 : (is_worth ? 0 : plans_anew);
  for (int round = 0; round < rounds; ++round) {
    expect();
    if (!lay_tangents()) break;
    make_sets(false);
  }
  make_slow_sets();
}

// What the plan before found for an interval holds for the same one.
void PathPlan::keep(const Station& station, std::size_t before, std::size_t before_end) noexcept {
  if (before < before_end) {
    Station moved = stations_[before];
    const double further = station.distance - moved.distance;
    moved.distance = station.distance;
    if (moved == station) {
      courses_[count_] = courses_[before];
      courses_[count_].approach_begin += further;
      courses_[count_].is_kept = true;
      courses_[count_].is_remade = false;
      sets_[count_] = sets_[before];
      slow_sets_[count_] = slow_sets_[before];
      return;
    }
  }
  courses_[count_] = Course{};
}

void PathPlan::make_stations() {
  const std::size_t before_end = count_ > 0 && anew_ == 0 ? end() : 0;
  std::size_t passed = before_end;  // of the stations before
  count_ = 0;
  Station station;
  while ((grows_ || count_ + 1 < stations_.size()) && path_.next(station)) {
    if (count_ + 1 == stations_.size()) resize(2 * stations_.size());
    // What the axes and the filters behind allow; and the feed, where X, Y and Z move further than the path does.
    const Derivatives begin = derivatives(station, 0.0);
    const AxisLimits limits = limits_at(station);
    const double feed = station.speed_limit;
    double longest = 1.0;
    const auto slow_down = [&](const Derivatives& path) {
      longest = std::max(longest, Vector3(path.first[0], path.first[1], path.first[2]).norm());
      station.speed_limit = std::min(station.speed_limit, along(path.first, limits.speed, axes()));
      if (max_across_ < no_limit) {
        const double bend = Vector3(path.second[0], path.second[1], path.second[2]).norm();
        if (bend > 0.0) station.speed_limit = std::min(station.speed_limit, std::sqrt(max_across_ / bend));
      }
    };
    slow_down(begin);
    if (!station.straight) {
      slow_down(derivatives(station, 0.5 * station.length));
      slow_down(derivatives(station, station.length));
    }
    if (longest > 1.0 + direction_rounding) station.speed_limit = std::min(station.speed_limit, feed / longest);
    const double jerk = highest_jerk(station, begin);
    if (station.straight) {
      station.max_acceleration = steepest(station, begin);
      station.max_jerk = jerk;
    }
    // What the jerk makes of the speed over it.
    station.coarse = jerk * station.length * station.length > coarse_share * std::pow(station.speed_limit, 3.0);
    if (count_ == 0) {
      passed = 0;
      while (passed < before_end &&
             (stations_[passed].segment != station.segment || stations_[passed].offset != station.offset)) {
        ++passed;
      }
    }
    keep(station, count_ + passed, before_end);
    stations_[count_++] = station;
  }
  courses_[count_] = Course{};
  Station& last = stations_[count_];
  last = stations_[count_ - 1];
  last.stop = true;
  last.valley = false;
  ++count_;
  is_cut_ = path_.next(station);
}

double PathPlan::cap_at(std::size_t index) const noexcept {
  const double cap = stations_[index].squared_limit();
  return stations_[index].stop || index == 0 ? cap : std::min(cap, stations_[index - 1].squared_limit());
}

namespace {

bool is_same(const ControllableSet& one, const ControllableSet& other) noexcept {
  if (one.count != other.count) return false;
  const auto is_near = [](double x, double y) { return std::abs(x - y) <= same_share * std::abs(x); };
  for (std::size_t i = 0; i < one.count; ++i) {
    if (!is_near(one.b[i], other.b[i]) || !is_near(one.a[i], other.a[i])) return false;
  }
  return true;
}

// Whether two states at the begin of an interval go on alike.
bool is_near(PathState one, PathState other, double length) noexcept {
  return std::abs(one.speed_squared - other.speed_squared) +
             2.0 * length * std::abs(one.acceleration - other.acceleration) <=
         joining_share * std::abs(one.speed_squared);
}

}  // namespace

Making PathPlan::making_of(std::size_t index) const noexcept {
  const double higher = stations_[index].straight ? tangent_on_lines : tangent_on_curves;
  return {cap_at(index), higher * courses_[index].laid, higher * courses_[index + 1].laid, -no_limit};
}

// Whether the valley that follows is being approached.
bool PathPlan::is_approach(std::size_t index) const noexcept {
  const Course& next = courses_[index + 1];
  return next.approaches && stations_[index].distance > next.approach_begin;
}

// Whether what a set is made from is another than in the plan before.
bool PathPlan::is_changed(std::size_t index) const noexcept {
  return index == 0 || !courses_[index - 1].is_kept || !courses_[index].is_kept || !courses_[index + 1].is_kept;
}

// Makes one set; whether it is another than before.
bool PathPlan::make_set(std::size_t index) noexcept {
  const Station& here = stations_[index];
  const PlannedSegment& segment = segment_of(here);
  Course& course = courses_[index];
  const Course& next = courses_[index + 1];
  Making making = making_of(index);
  if (!here.straight) making.corners = corners_on_curves;
  if (here.valley) making.cap = std::min(making.cap, segment_of(here).passed);
  course.approaches = is_approach(index);
  if (course.approaches) {
    course.approach = rules_.hardest_before(here, segment, making.cap, next.approach);
    course.approach_begin = next.approach_begin;
    making.least_acceleration = course.approach.acceleration;
    course.approaches = course.approach.speed_squared < making.cap;
  }
  if (here.valley) making.least_acceleration = 0.0;
  const ControllableSet set = rules_.before(here, segment, making, sets_[index + 1]);
  const bool differs = !is_same(set, sets_[index]);
  course.is_another = course.is_another || differs;
  sets_[index] = set;
  course.is_remade = true;
  if (here.valley) {
    course.approaches = true;
    course.approach = {ControllableSets::steady(set), 0.0};
    course.approach_begin = here.slower_feed ? -no_limit : here.distance - segment.half_width;
  }
  return differs;
}

// Of the first round, those of intervals that are not those of the plan before; later, those that depend on tangents
// that were laid again.
void PathPlan::make_sets(bool is_first) noexcept {
  bool differs = false;  // the next one
  for (std::size_t k = end(); k-- > 0;) {
    Course& course = courses_[k];
    const bool is_new = is_first ? is_changed(k) : course.relaid || courses_[k + 1].relaid;
    if (ends_in_stop(k)) {
      if (is_first && is_new) sets_[k] = rules_.before_stop(stations_[k], segment_of(stations_[k]), cap_at(k));
      course.is_remade = course.is_remade || (is_first && is_new);
      course.approaches = false;
      differs = false;
    } else if (is_new || differs) {
      differs = make_set(k);
    }
  }
}

double PathPlan::duration_s(std::size_t index, double squared, double squared_after) const noexcept {
  return 2.0 * stations_[index].length / (std::sqrt(squared) + std::sqrt(squared_after) + least_speed);
}

double PathPlan::expected_s() const noexcept {
  double sum_s = 0.0;
  for (std::size_t k = 0; k < end(); ++k) {
    sum_s += duration_s(k, courses_[k].expected.speed_squared, courses_[k + 1].expected.speed_squared);
  }
  return sum_s;
}

// Lets the motion brake through a valley if the path is expected to take less time then; whether it is.
bool PathPlan::brake_through(std::size_t valley) noexcept {
  stations_[valley].valley = false;
  std::size_t saved = 0;
  std::size_t first = valley;
  bool is_known = true;  // how far it changes what is planned
  while (true) {
    saved_[saved++] = {sets_[first], courses_[first]};
    const bool approached = courses_[first].approaches;
    const bool differs = make_set(first) || courses_[first].approaches != approached || first == valley;
    if (!differs || first == 0 || ends_in_stop(first - 1)) break;
    is_known = saved < saved_.size();
    if (!is_known) break;
    --first;
  }
  // From there on the motion is another, until it is again what it was.
  std::size_t count = 0;
  PathState state = courses_[first].expected;
  double gain_s = 0.0;
  std::size_t k = first;
  for (; is_known && !ends_in_stop(k); ++k) {
    if (k > valley && is_near(courses_[k].expected, state, stations_[k].length)) break;
    is_known = count + 1 < expected_.size();
    expected_[count++] = state;
    const PathState next = fastest_after(k, state);
    gain_s += duration_s(k, courses_[k].expected.speed_squared, courses_[k + 1].expected.speed_squared) -
              duration_s(k, state.speed_squared, next.speed_squared);
    state = next;
  }
  if (is_known && ends_in_stop(k)) {
    expected_[count++] = state;
    gain_s += duration_s(k, courses_[k].expected.speed_squared, 0.0) - duration_s(k, state.speed_squared, 0.0);
  }
  if (is_known && gain_s > least_gain_s) {
    for (std::size_t i = 0; i < count; ++i) {
      courses_[first + i].expected = expected_[i];
      courses_[first + i].is_another = false;
    }
    return true;
  }
  stations_[valley].valley = true;
  for (std::size_t i = 0; i < saved; ++i) {
    sets_[valley - i] = saved_[i].set;
    courses_[valley - i] = saved_[i].course;
  }
  return false;
}

// Tried one by one: where the motion is slower than a corner allows, braking need not be over there.
bool PathPlan::choose_valleys() noexcept {
  expect();
  bool is_another = false;
  for (int n = 0; n < valley_rounds; ++n) {
    bool is_any = false;
    for (std::size_t k = 1; k < end(); ++k) {
      if (!stations_[k].valley || stations_[k].slower_feed || ends_in_stop(k)) continue;
      is_any = brake_through(k) || is_any;
    }
    if (!is_any) break;
    is_another = true;
    for (int round = 0; round < rounds && lay_tangents(); ++round) {
      make_sets(false);
      expect();
    }
  }
  if (is_another) make_slow_sets();
  return is_another;
}

// Those that differ from the sets that approach valleys, as far as these are not those of the plan before.
void PathPlan::make_slow_sets() noexcept {
  bool differs = false;     // the next one, from the other one there
  bool is_another = false;  // than in the plan before
  for (std::size_t k = end(); k-- > 0;) {
    const Station& here = stations_[k];
    if (is_another || courses_[k].is_remade || courses_[k + 1].is_remade || is_changed(k)) {
      ControllableSet set = sets_[k];
      if (!ends_in_stop(k) && (differs || here.valley || is_approach(k))) {
        set = rules_.before(here, segment_of(here), making_of(k), slow_sets_[k + 1]);
      }
      is_another = !is_same(set, slow_sets_[k]);
      slow_sets_[k] = set;
    }
    differs = !ends_in_stop(k) && !is_same(slow_sets_[k], sets_[k]);
  }
}

// The state at the next station that a state leads to as fast as the limits and its set allow.
PathState PathPlan::fastest_after(std::size_t index, PathState state) const noexcept {
  const Station& here = stations_[index];
  const double h = here.length;
  const Range leading = ControllableSets::leading_to(sets_[index + 1], state, h);
  double c = leading.high;
  // From rest with a constant jerk, which from rest on an interval is one of b^3 = (4.5 j h^2)^2.
  double from_rest = -1.0;
  if (state.acceleration >= 0.0) {
    const double jerk = highest_jerk(here, derivatives(here, 0.0));
    from_rest = std::cbrt(jerk * jerk * 4.5 / (h * h));
  }
  if (state.speed_squared <= slow_share * from_rest * h * h) {
    c = std::min(c, from_rest);
  } else {
    Rows rows;
    rules_.rows_of(
        here, segment_of(here),
        {0.0, h, state.speed_squared, state.squared_after(h), std::max(state.speed_squared, here.squared_limit())},
        rows);
    const Range range = ControllableSets::within(rows, state, leading);
    c = range.empty() ? std::min(leading.high, std::max(leading.low, 0.5 * (range.low + range.high))) : range.high;
  }
  if (!std::isfinite(c)) c = 0.0;
  return {std::max(0.0, state.speed_squared + h * (2.0 * state.acceleration + c * h)), state.acceleration + c * h};
}

// How a motion goes; where it joins one that was expected before, on sets that are the same, it goes on as that did.
void PathPlan::expect() noexcept {
  PathState state = begin_;
  for (std::size_t k = 0; k < end(); ++k) {
    if (stations_[k].stop) state = {};
    Course& course = courses_[k];
    Course& next = courses_[k + 1];
    const bool is_known = course.is_expected && next.is_expected && !next.is_another &&
                          is_near(course.expected, state, stations_[k].length);
    next.is_another = false;
    if (is_known) {
      state = next.expected;
      continue;
    }
    course.expected = state;
    course.is_expected = true;
    state = ends_in_stop(k) ? PathState{} : fastest_after(k, state);
  }
  courses_[end()].expected = {};
}

// The tangents of the jerk limit, where the motion is expected, unless they lie there as good as they have to; false:
// all do.
bool PathPlan::lay_tangents() noexcept {
  bool is_any = false;
  for (std::size_t k = 0; k < count_; ++k) {
    Course& course = courses_[k];
    const double expected = course.expected.speed_squared;
    course.relaid = std::abs(expected - course.laid) > near_share * course.laid;
    if (course.relaid) course.laid = expected;
    is_any = is_any || course.relaid;
  }
  return is_any;
}

}  // namespace shapegcode
