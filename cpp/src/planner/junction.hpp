// Jumps of the derivatives where two segments meet, and the tolerance that their rounding needs.
#pragma once

#include <array>
#include <cstddef>

#include "planner/segments.hpp"

namespace shapegcode {

/// Deviations that are allowed: of the path, and of each axis behind Z in its own unit; infinite: any.
struct PathTolerance {
  double contour_mm = no_limit;
  AxisValues axis{};
  std::size_t axes = axis_count;
};

/// Fills in the junction of a segment with the one before it.
void look_at_junction(const PlannedSegment& before, const PathTolerance& tolerance, PlannedSegment& segment) noexcept;

}  // namespace shapegcode
