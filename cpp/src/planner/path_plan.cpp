#include "planner/path_plan.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <utility>

namespace shapegcode {
namespace {

// Rounds of the plan after the first; more change nothing that counts.
constexpr int rounds = 4;
// The jerk limit is J / sqrt(b), of which a set has a tangent. It may lie too high better than too low: there its bound
// comes down to nothing at three times the square of the speed where it was laid.
constexpr double tangent_on_lines = 1.1;
constexpr double tangent_on_curves = 1.3;
// Behind a valley, over which the time is compared, and shares of the square of its highest speed that are tried.
constexpr int passing_stations = 64;
constexpr std::array<double, 5> passings{1.0, 0.85, 0.7, 0.55, 0.4};

}  // namespace

PathPlan::PathPlan(std::vector<PlannedSegment> segments, const AxisLimits& limits, double period_s)
    : path_(std::move(segments), limits, period_s), rules_(limits) {
  make_stations();
  sets_.resize(stations_.size());
  expected_.resize(stations_.size());
  make_sets(true);
  for (int round = 0; round < rounds; ++round) {
    expect();
    make_sets(false);
  }
}

void PathPlan::make_stations() {
  Station station;
  while (path_.next(station)) {
    // What the axes allow.
    for (const double x : {0.0, station.length}) {
      const Derivatives path = derivatives_at(station, segment_of(station), x);
      station.speed_limit = std::min(station.speed_limit, along(path.first, limits_at(station).speed));
    }
    if (station.straight) {
      station.straight_acceleration = along(station.first, limits_at(station).acceleration);
      station.straight_jerk = along(station.first, limits_at(station).jerk);
    }
    stations_.push_back(station);
  }
  Station end = stations_.back();
  end.stop = true;
  end.valley = false;
  stations_.push_back(end);
}

double PathPlan::cap_at(std::size_t index) const noexcept {
  const double cap = stations_[index].squared_limit();
  return stations_[index].stop ? cap : std::min(cap, stations_[index - 1].squared_limit());
}

void PathPlan::make_sets(bool first) noexcept {
  // How a valley is approached: no harder than so that it is passed as fast as it can be.
  bool approaches = false;
  PathState approach;
  double approach_begin = 0.0;
  for (std::size_t k = end(); k-- > 0;) {
    const Station& here = stations_[k];
    const PlannedSegment& segment = segment_of(here);
    double cap = cap_at(k);
    if (ends_in_stop(k)) {
      approaches = false;
      sets_[k] = rules_.before_stop(here, segment, cap);
      continue;
    }
    if (here.valley) cap = std::min(cap, best_passing(k));
    double least = -std::numeric_limits<double>::infinity();
    approaches = approaches && here.distance > approach_begin;
    if (approaches) {
      approach = rules_.hardest_before(here, segment, cap, approach);
      least = approach.acceleration;
      approaches = approach.speed_squared < cap;
    }
    if (here.valley) least = 0.0;
    const double higher = here.straight ? tangent_on_lines : tangent_on_curves;
    Making making{cap, -1.0, -1.0, least};
    if (!first) {
      making.b_begin = higher * expected_[k].speed_squared;
      making.b_end = higher * expected_[k + 1].speed_squared;
    }
    sets_[k] = rules_.before(here, segment, making, sets_[k + 1]);
    if (here.valley) {
      approaches = true;
      approach = {ControllableSets::steady(sets_[k]), 0.0};
      approach_begin = here.distance - segment.half_width;
    }
  }
}

// The state at the next station that a state leads to as fast as the limits and its set allow.
PathState PathPlan::fastest_after(std::size_t index, PathState state) const noexcept {
  const Station& here = stations_[index];
  const double h = here.length;
  const Range leading = ControllableSets::leading_to(sets_[index + 1], state, h);
  double c = leading.high;
  if (state.speed_squared <= 0.0) {
    // From rest with a constant jerk.
    const double jerk = along(derivatives_at(here, segment_of(here), 0.0).first, limits_at(here).jerk);
    c = std::min(c, std::cbrt(jerk * jerk * 4.5 / (h * h)));
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

// At which speed a valley is passed best: what is gained there is lost behind it, where the jerk that turns the motion
// leaves less for its acceleration.
double PathPlan::best_passing(std::size_t index) const noexcept {
  const double most = segment_of(stations_[index]).passed;
  double best = most;
  double least_s = std::numeric_limits<double>::infinity();
  for (const double share : passings) {
    PathState state{most * share, 0.0};
    double time_s = 0.0;
    std::size_t k = index;
    for (int n = 0; n < passing_stations && !ends_in_stop(k); ++n, ++k) {
      if (k > index && stations_[k].valley) break;
      const PathState next = fastest_after(k, state);
      time_s += 2.0 * stations_[k].length / (std::sqrt(state.speed_squared) + std::sqrt(next.speed_squared) + 1e-9);
      state = next;
    }
    if (time_s < least_s) {
      least_s = time_s;
      best = most * share;
    }
  }
  return best;
}

// How a motion goes: where the next round lays the tangents of the jerk limit.
void PathPlan::expect() noexcept {
  PathState state;
  for (std::size_t k = 0; k < end(); ++k) {
    if (stations_[k].stop) state = {};
    expected_[k] = state;
    state = ends_in_stop(k) ? PathState{} : fastest_after(k, state);
  }
  expected_.back() = {};
}

}  // namespace shapegcode
