// Private: segments as LinuxCNC's planner queues them, with its blend arcs between them.
#pragma once

#include <algorithm>
#include <cstdint>
#include <vector>

#include "shapegcode/motion.hpp"
#include "shapegcode/path.hpp"
#include "shapegcode/planner_models.hpp"

namespace shapegcode::detail {

/// How a queued segment goes over into the next one.
enum class Termination : std::uint8_t {
  stop,
  tangent,  ///< at the speed at its end
};

/// A segment of the queue: one of the program, or an arc between two of them.
struct QueuedSegment {
  std::vector<Segment> geometry;   ///< in a row; more than one only of a blend arc
  double length_mm = 0.0;          ///< of all of it
  double nominal_length_mm = 0.0;  ///< before blends took from it
  double request_mm_per_s = 0.0;   ///< programmed
  double max_speed_mm_per_s = 0.0;
  double max_acceleration_mm_per_s2 = 0.0;
  double tangential_ratio = 1.0;  ///< share of the acceleration that is left along an arc
  double kink_before = 0.0;       ///< share of the acceleration that the kink at its start takes
  double kink_behind = 0.0;
  double kink_speed_mm_per_s = MotionLimits::none;  ///< at its end
  double final_speed_mm_per_s = 0.0;                ///< planned, whatever the feed is
  Termination termination = Termination::stop;
  bool overlaps = false;  ///< with its neighbour at an end, or would with what follows: half of the acceleration
  bool is_arc = false;    ///< of the program
  bool is_blend = false;  ///< between two of them

  [[nodiscard]] double acceleration_mm_per_s2() const noexcept {
    const double left = 1.0 - std::max(kink_before, kink_behind);
    return max_acceleration_mm_per_s2 * tangential_ratio * left * (overlaps ? 0.5 : 1.0);
  }
};

/// The segments of a path in LinuxCNC's queue, blends between them, final speeds not yet planned. Throws
/// Error(argument) on a segment without feed.
[[nodiscard]] std::vector<QueuedSegment> linuxcnc_queue(const Path& path, const MotionLimits& limits,
                                                        const PlannerRules& rules);

}  // namespace shapegcode::detail
