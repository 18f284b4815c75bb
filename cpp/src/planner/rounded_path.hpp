// The path with junctions rounded within the tolerance, divided into intervals between stations.
#pragma once

#include <cstddef>
#include <cstdint>

#include "planner/stations.hpp"

namespace shapegcode {

/// A position on the path, so many mm behind the start of a segment, and the segment with which the path begins.
struct PathStart {
  std::uint64_t first = 0, segment = 0;
  double offset = 0.0;
  double in_station = 0.0;    ///< mm from the begin of the first station to it
  std::uint64_t section = 0;  ///< which section is planned from there, counted
};

/// Every junction is rounded by itself: its jump of the direction, or of the second derivative, is spread over the path
/// by a curve of its own, which is nothing beyond the half-width. Where the curves of several junctions overlap they
/// add up. Half-widths are so chosen that what adds up stays within the tolerance.
class RoundedPath {
 public:
  /// The ring must outlive it.
  RoundedPath(SegmentRing& ring, const AxisLimits& limits, double period_s);

  /// Chooses the half-widths of what is not fixed yet, from a position on: so many mm behind the start of a segment.
  /// `first`: the segment with which the path begins; segments before `end` are known. Feeds are run at these ratios.
  void start(const PathStart& start, std::uint64_t end, const FeedRatios& ratios) noexcept;
  /// The next interval; false at the end.
  [[nodiscard]] bool next(Station& station) noexcept;

  /// Motion was planned up to a position, in a section: the roundings that it has begun stay as they are. The last one
  /// of them.
  std::uint64_t fix(std::uint64_t from, std::uint64_t segment, double offset, std::uint64_t section) noexcept;
  /// Sections behind `last` will not be run: the roundings that only they have begun, of the segments from `first` to
  /// before `end`, are not fixed any more. The last segment that still is, at least `first`.
  std::uint64_t release(std::uint64_t first, std::uint64_t end, std::uint64_t last) noexcept;
  /// Whether a rounding that is fixed reaches over a junction.
  [[nodiscard]] bool is_covered(std::uint64_t junction) const noexcept;
  [[nodiscard]] const PlannedSegment& segment(std::uint64_t index) const noexcept { return (*ring_)[index]; }
  /// How long the last interval before a stop is, mm.
  [[nodiscard]] double stopping_length() const noexcept { return stopping_length_; }

  /// Segments behind a position that its roundings need.
  static constexpr std::size_t lookback = 18;

 private:
  void choose(std::uint64_t junction) noexcept;
  void fix(PlannedSegment& entry) const noexcept;
  void stop_at(std::uint64_t junction) noexcept;
  [[nodiscard]] double widest(std::uint64_t junction) const noexcept;
  [[nodiscard]] double end_of(std::uint64_t segment) const noexcept;
  [[nodiscard]] bool starts_anew(std::uint64_t segment) const noexcept;
  [[nodiscard]] bool ends_in_stop(std::uint64_t segment) const noexcept;
  [[nodiscard]] double stopping_length(const PlannedSegment& entry) const noexcept;
  [[nodiscard]] double to_stop() const noexcept;
  [[nodiscard]] double next_break() const noexcept;
  [[nodiscard]] double squared_speed() const noexcept;
  [[nodiscard]] double step() const noexcept;
  [[nodiscard]] double feed_of(const PlannedSegment& entry) const noexcept;
  [[nodiscard]] bool slows_at(std::uint64_t segment) const noexcept;
  [[nodiscard]] bool slows_on(std::uint64_t segment) const noexcept;
  template <class See>
  void see_roundings(const See& see) const noexcept;
  [[nodiscard]] Derivatives roundings_at(double x, AxisValues& position) const noexcept;
  void fill(double length, Station& station) const noexcept;

  SegmentRing* ring_;
  AxisLimits limits_;
  double period_s_;
  double least_acceleration_, highest_acceleration_;
  double stopping_length_;
  FeedRatios ratios_;
  PathStart start_;
  double start_x_ = 0.0;
  std::uint64_t end_ = 0;
  std::uint64_t segment_ = 0;  // of the next interval
  double x_ = 0.0;             // where it begins, since the last stop
};

}  // namespace shapegcode
