// A path divided where its speed limit changes, for planners that consider only feeds and axes.
#pragma once

#include <cstdint>
#include <vector>

#include "shapegcode/motion.hpp"
#include "shapegcode/path.hpp"

namespace shapegcode {

struct FeedSections {
  Path path;  ///< the same geometry; the feed of each segment is the highest speed that it may have
  std::vector<std::uint32_t> segments;  ///< of the path that was cut, for each of them
};

/// `limits` as `plan_speed` looks at them, but for acceleration and jerk. The speed of a corner, of `filter` and
/// `caps`, holds for `corner_spread_s` around it; a lower programmed feed holds as long before and behind its segment
/// as `limits` say. Throws Error(argument) as plan_speed does.
[[nodiscard]] FeedSections feed_sections(const Path& path, const MotionLimits& limits, const FilterTolerance& filter,
                                         const SpeedCaps* caps, double corner_spread_s);

/// What of a segment lies between two distances from its start.
[[nodiscard]] Segment section_of(const Segment& segment, double begin_mm, double end_mm) noexcept;

}  // namespace shapegcode
