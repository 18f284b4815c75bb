// Segments as the planner has them: what each of them and its junction with the one before allow.
#pragma once

#include <array>
#include <cstddef>

#include "shapegcode/path.hpp"

namespace shapegcode {

using AxisValues = std::array<double, axis_count>;

struct PlannedSegment {
  Segment segment;
  // The junction at its start.
  bool stop = false;         ///< the motion comes to rest there
  AxisValues turn{};         ///< jump of the direction, the first derivative by the path length
  AxisValues bend{};         ///< jump of the second derivative, 1/mm
  double turn_share = 0.0;   ///< of the tolerance, per mm of the half-width of its rounding
  double bend_share = 0.0;   ///< the same per mm^2
  double programmed = 0.0;   ///< feed; that of the segment is the one that is planned, mm/s
  double limit_share = 1.0;  ///< of acceleration and jerk that is planned on it

  double distance = 0.0;    ///< of its start, since the last stop
  double half_width = 0.0;  ///< over which the junction is rounded, to both sides
  double passed = 0.0;      ///< square of the speed at which that can be passed
};

}  // namespace shapegcode
