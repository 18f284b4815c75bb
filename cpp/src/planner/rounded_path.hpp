// The path that can be run through: junctions rounded within the tolerance, cut into intervals between stations.
#pragma once

#include <cstddef>
#include <vector>

#include "planner/stations.hpp"

namespace shapegcode {

/// Every junction is rounded by itself: its jump of the direction, or of the second derivative, is spread over the path
/// by a curve of its own, which is nothing beyond the half-width. Where the curves of several junctions overlap they
/// add up. Half-widths are so chosen that what adds up stays within the tolerance.
class RoundedPath {
 public:
  /// Chooses the half-widths.
  RoundedPath(std::vector<PlannedSegment> segments, const AxisLimits& limits, double period_s);

  /// The next interval; false at the end.
  [[nodiscard]] bool next(Station& station) noexcept;
  [[nodiscard]] const std::vector<PlannedSegment>& segments() const noexcept { return segments_; }
  /// How long the last interval before a stop is, mm.
  [[nodiscard]] double stopping_length() const noexcept { return stopping_length_; }

 private:
  void choose(std::size_t junction) noexcept;
  void stop_at(std::size_t junction) noexcept;
  [[nodiscard]] double widest(std::size_t junction) const noexcept;
  [[nodiscard]] double end_of(std::size_t segment) const noexcept;
  [[nodiscard]] bool starts_anew(std::size_t segment) const noexcept;
  [[nodiscard]] bool ends_in_stop(std::size_t segment) const noexcept;
  [[nodiscard]] double to_stop() const noexcept;
  [[nodiscard]] double next_break() const noexcept;
  [[nodiscard]] double squared_speed() const noexcept;
  [[nodiscard]] double step() const noexcept;
  template <class See>
  void see_roundings(const See& see) const noexcept;
  [[nodiscard]] Derivatives roundings_at(double x, AxisValues& position) const noexcept;
  void fill(double length, Station& station) const noexcept;

  std::vector<PlannedSegment> segments_;
  AxisLimits limits_;
  double period_s_;
  double stopping_length_;
  std::size_t segment_ = 0;  // of the next interval
  double x_ = 0.0;           // where it begins, since the last stop
};

}  // namespace shapegcode
