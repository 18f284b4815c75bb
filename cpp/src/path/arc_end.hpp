// Private: checks that segments connect, and that the sweep of an arc leads to its end.
#pragma once

#include <cmath>
#include <numbers>

#include "path/arc_frame.hpp"
#include "shapegcode/path.hpp"

namespace shapegcode {

/// By how much a segment may start beside the end of the one before, or an arc miss its own.
inline constexpr double largest_gap_mm = 1e-6;

/// What must be added to the sweep of an arc so that it leads to the end, within half a turn.
[[nodiscard]] inline double missing_sweep_rad(const Segment& arc) noexcept {
  const double end_rad = ArcFrame(arc.normal).angle_rad(arc.end_mm, arc.centre_mm);
  return std::remainder(end_rad - (arc.start_angle_rad + arc.sweep_rad), 2.0 * std::numbers::pi);
}

/// The same segment from a start that is within the largest gap of its own, to its end without a gap.
[[nodiscard]] Segment begun_at(const Segment& segment, const Vector3& start) noexcept;

}  // namespace shapegcode
