// Segments in the planner, with the limits of each and of its junction with the previous one.
#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <vector>

#include "shapegcode/limits.hpp"
#include "shapegcode/path.hpp"

namespace shapegcode {

/// X, Y and Z, and axes that follow the path.
inline constexpr std::size_t max_path_axes = 9;
using AxisValues = std::array<double, max_path_axes>;

inline constexpr double no_limit = std::numeric_limits<double>::infinity();
/// Nothing moves by so little; as near as that to the end of a segment is its end.
inline constexpr double no_travel_mm = 1e-9;

struct PlannedSegment {
  Segment segment;
  AxisValues rate{};          ///< of an axis behind Z: its travel per mm of the path
  AxisValues start{}, end{};  ///< position of such an axis at both ends

  // Of the segment; without the override.
  FeedRate rate_of = FeedRate::per_time;
  double programmed = 0.0;             ///< feed, mm/s or mm per revolution
  double max_speed = no_limit;         ///< whatever the override
  double max_acceleration = no_limit;  ///< along the path, beside the limits of the axes
  double max_jerk = no_limit;

  // The junction at its start.
  bool stop = false;               ///< the motion comes to rest there
  std::uint32_t dwell = 0;         ///< periods that it rests beside what filters behind need
  std::uint64_t waits = 0;         ///< until so many stops of the queue are over
  AxisValues turn{};               ///< jump of the direction, the first derivative by the path length
  AxisValues bend{};               ///< jump of the second derivative, 1/mm
  double turn_share = 0.0;         ///< of the tolerance, per mm of the half-width of its rounding
  double bend_share = 0.0;         ///< the same per mm^2
  double corner_speed = no_limit;  ///< the fastest that it is passed

  // Of the planner.
  double feed_share = 1.0;      ///< of the feed that is planned
  double limit_share = 1.0;     ///< of acceleration and jerk that is planned on it
  bool is_narrow = false;       ///< the rounding would be too small: a stop
  double distance = 0.0;        ///< of its start, since the last stop
  double half_width = 0.0;      ///< over which the junction is rounded, to both sides
  double passed = 0.0;          ///< square of the speed at which that can be passed
  bool is_fixed = false;        ///< the motion has been planned into the rounding
  std::uint64_t fixed_by = 0;   ///< which section does that, counted
  std::uint64_t saw_until = 0;  ///< segments before this one were considered when the rounding was chosen
};

/// What the programmed feeds are multiplied with.
struct FeedRatios {
  double feed = 1.0, rapid = 1.0, revolutions_per_s = 1.0;

  [[nodiscard]] double of(FeedRate rate) const noexcept {
    switch (rate) {
      case FeedRate::per_time:
        return feed;
      case FeedRate::rapid:
        return rapid;
      case FeedRate::per_revolution:
        return feed * revolutions_per_s;
      case FeedRate::synchronous:
        break;
    }
    return 1.0;
  }
  [[nodiscard]] double of(const PlannedSegment& segment) const noexcept { return of(segment.rate_of); }
  friend bool operator==(const FeedRatios&, const FeedRatios&) = default;
};
[[nodiscard]] inline FeedRatios larger(const FeedRatios& a, const FeedRatios& b) noexcept {
  return {std::max(a.feed, b.feed), std::max(a.rapid, b.rapid), std::max(a.revolutions_per_s, b.revolutions_per_s)};
}

/// A ring of segments: segment `index`, counted from the first one ever, is entry `index & mask`.
class SegmentRing {
 public:
  /// `capacity`: a power of two.
  explicit SegmentRing(std::size_t capacity) : entries_(capacity) {}
  [[nodiscard]] PlannedSegment& operator[](std::uint64_t index) noexcept {
    return entries_[index & (entries_.size() - 1)];
  }
  [[nodiscard]] const PlannedSegment& operator[](std::uint64_t index) const noexcept {
    return entries_[index & (entries_.size() - 1)];
  }
  [[nodiscard]] std::size_t capacity() const noexcept { return entries_.size(); }

 private:
  std::vector<PlannedSegment> entries_;
};

}  // namespace shapegcode
