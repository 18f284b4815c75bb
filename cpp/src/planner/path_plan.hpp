// The look-ahead over a whole path: intervals, and for every station the states from which a stop is certain.
#pragma once

#include <cstddef>
#include <vector>

#include "planner/controllable_set.hpp"
#include "planner/rounded_path.hpp"
#include "planner/stations.hpp"

namespace shapegcode {

/// Sets from the end backwards; then forwards how a motion goes that keeps to them, and sets again, as exact as they
/// can be for that motion: some rounds of it.
class PathPlan {
 public:
  PathPlan(std::vector<PlannedSegment> segments, const AxisLimits& limits, double period_s);

  /// Index of the last station, where the path ends.
  [[nodiscard]] std::size_t end() const noexcept { return stations_.size() - 1; }
  [[nodiscard]] const Station& station(std::size_t index) const noexcept { return stations_[index]; }
  [[nodiscard]] const ControllableSet& set(std::size_t index) const noexcept { return sets_[index]; }
  [[nodiscard]] const PlannedSegment& segment_of(const Station& station) const noexcept {
    return path_.segments()[station.segment];
  }
  [[nodiscard]] const ControllableSets& rules() const noexcept { return rules_; }
  [[nodiscard]] AxisLimits limits_at(const Station& station) const noexcept { return rules_.limits_at(station); }
  [[nodiscard]] double stopping_length() const noexcept { return path_.stopping_length(); }
  /// Whether the motion rests at the end of an interval.
  [[nodiscard]] bool ends_in_stop(std::size_t index) const noexcept { return stations_[index + 1].stop; }

 private:
  void make_stations();
  void make_sets(bool first) noexcept;
  void expect() noexcept;
  [[nodiscard]] double cap_at(std::size_t index) const noexcept;
  [[nodiscard]] PathState fastest_after(std::size_t index, PathState state) const noexcept;
  [[nodiscard]] double best_passing(std::size_t index) const noexcept;

  RoundedPath path_;
  ControllableSets rules_;
  std::vector<Station> stations_;
  std::vector<ControllableSet> sets_;
  std::vector<PathState> expected_;
};

}  // namespace shapegcode
