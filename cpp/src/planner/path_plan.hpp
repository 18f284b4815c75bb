// The look-ahead over a whole path: intervals, and for every station the states from which it can stop.
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "planner/controllable_set.hpp"
#include "planner/rounded_path.hpp"
#include "planner/stations.hpp"

namespace shapegcode {

/// Sets from the end backwards; then forwards how a motion goes that keeps to them, and sets again, as exact as they
/// can be for that motion: some rounds of it. What the plan before found for intervals that are the same is kept.
class PathPlan {
 public:
  /// At most so many stations are planned; 0: as many as there are, with memory allocated for them. `max_across`:
  /// acceleration across the path that the motion may have. The ring must outlive it.
  PathPlan(SegmentRing& ring, const AxisLimits& limits, double period_s, std::size_t capacity,
           double max_across = no_limit);

  /// Plans from a position on, where the motion is in a state, to the end of what is known, or as far as the stations
  /// reach.
  void make(const PathStart& start, const AlongPath& state, std::uint64_t end, const FeedRatios& ratios);

  /// Lets the motion brake through corners where that is expected to take less time; whether there are any. It is only
  /// expected: compare the motion of this plan with that of the one before.
  bool choose_valleys() noexcept;

  /// Nothing of the plan before holds for what comes.
  void forget() noexcept {
    count_ = 0;
    anew_ = 0;
  }

  /// How long the motion is expected to take.
  [[nodiscard]] double expected_s() const noexcept;

  /// Whether it ends before the end of what is known.
  [[nodiscard]] bool is_cut() const noexcept { return is_cut_; }
  /// Motion was planned up to a position, in a section: the roundings that it has begun stay as they are. The last one
  /// of them.
  std::uint64_t fix(std::uint64_t from, std::uint64_t segment, double offset, std::uint64_t section) noexcept {
    return path_.fix(from, segment, offset, section);
  }
  /// What only sections behind `last` have begun, which will not be run, is free again. The last one that is not.
  std::uint64_t release(std::uint64_t first, std::uint64_t end, std::uint64_t last) noexcept {
    return path_.release(first, end, last);
  }

  /// Whether a rounding that stays reaches over a junction: no stop is possible there.
  [[nodiscard]] bool is_covered(std::uint64_t junction) const noexcept { return path_.is_covered(junction); }

  /// Index of the last station, where what is planned ends.
  [[nodiscard]] std::size_t end() const noexcept { return count_ - 1; }
  [[nodiscard]] const Station& station(std::size_t index) const noexcept { return stations_[index]; }
  /// States that lead on as fast as can be.
  [[nodiscard]] const ControllableSet& set(std::size_t index) const noexcept { return sets_[index]; }
  /// All states from which a stop is certain, however slowly that leads through the valleys.
  [[nodiscard]] const ControllableSet& slow_set(std::size_t index) const noexcept { return slow_sets_[index]; }
  [[nodiscard]] const PlannedSegment& segment_of(const Station& station) const noexcept {
    return path_.segment(station.segment);
  }
  /// At `x` mm behind a station.
  [[nodiscard]] Derivatives derivatives(const Station& station, double x) const noexcept {
    return derivatives_at(station, segment_of(station), x, axes());
  }
  [[nodiscard]] const ControllableSets& rules() const noexcept { return rules_; }
  [[nodiscard]] AxisLimits limits_at(const Station& station) const noexcept { return rules_.limits_at(station); }
  [[nodiscard]] double stopping_length() const noexcept { return path_.stopping_length(); }
  [[nodiscard]] std::size_t axes() const noexcept { return rules_.axes(); }
  /// Whether the motion rests at the end of an interval.
  [[nodiscard]] bool ends_in_stop(std::size_t index) const noexcept { return stations_[index + 1].stop; }
  /// The limits of a motion along a station's direction.
  [[nodiscard]] double steepest(const Station& station, const Derivatives& path) const noexcept {
    return shapegcode::steepest(station, path, limits_at(station));
  }
  [[nodiscard]] double highest_jerk(const Station& station, const Derivatives& path) const noexcept {
    return shapegcode::highest_jerk(station, path, limits_at(station));
  }

 private:
  void resize(std::size_t capacity);
  void make_stations();
  void keep(const Station& station, std::size_t before, std::size_t before_end) noexcept;
  [[nodiscard]] bool is_changed(std::size_t index) const noexcept;
  bool make_set(std::size_t index) noexcept;
  void make_sets(bool is_first) noexcept;
  [[nodiscard]] double duration_s(std::size_t index, double squared, double squared_after) const noexcept;
  bool brake_through(std::size_t valley) noexcept;
  void make_slow_sets() noexcept;
  [[nodiscard]] Making making_of(std::size_t index) const noexcept;
  [[nodiscard]] bool is_approach(std::size_t index) const noexcept;
  void expect() noexcept;
  bool lay_tangents() noexcept;
  [[nodiscard]] double cap_at(std::size_t index) const noexcept;
  [[nodiscard]] PathState fastest_after(std::size_t index, PathState state) const noexcept;

  RoundedPath path_;
  ControllableSets rules_;
  double max_across_;
  bool grows_;
  bool is_cut_ = false;
  int anew_ = 0;  // plans that keep nothing
  std::size_t count_ = 0;
  std::vector<Station> stations_;
  std::vector<ControllableSet> sets_, slow_sets_;
  // Of a station: what is expected there, and how the valley that follows is approached: no harder than so that it is
  // passed as fast as it can be, from a distance on.
  struct Course {
    PathState expected;
    double laid = -1.0;  // the square of the speed at which its tangents were laid
    bool relaid = false;
    bool is_kept = false;      // from the plan before
    bool is_remade = true;     // its set, in this plan
    bool is_expected = false;  // `expected` belongs to it
    bool is_another = true;    // its set is another than when that was expected
    bool approaches = false;
    PathState approach;
    double approach_begin = 0.0;
  };
  std::vector<Course> courses_;
  PathState begin_;
  // What a valley changes.
  struct Saved {
    ControllableSet set;
    Course course;
  };
  std::vector<Saved> saved_;
  std::vector<PathState> expected_;
};

}  // namespace shapegcode
