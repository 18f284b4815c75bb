#include "planner/junction.hpp"

#include <algorithm>
#include <cmath>

namespace shapegcode {
namespace {

// Deviation from the path when a jump is rounded over the half-width d on both sides: of the direction, times d, and of
// the second derivative, times d^2.
constexpr double turn_deviation = 1.0 / 6.0;
constexpr double bend_deviation = 1.0 / 120.0;
// Jumps of a derivative that are rounding of coordinates.
constexpr double no_jump = 1e-9;

double size_of(const Vector3& jump) noexcept {
  const double size = jump.norm();
  return size > no_jump ? size : 0.0;
}

}  // namespace

void look_at_junction(const PlannedSegment& before, const PathTolerance& tolerance, PlannedSegment& segment) noexcept {
  const Segment& last = before.segment;
  segment.stop = segment.stop || last.stop_at_end;
  const Vector3 turn = tangent_at(segment.segment, 0.0) - tangent_at(last, last.length_mm);
  const Vector3 bend = bend_at(segment.segment, 0.0) - bend_at(last, last.length_mm);
  std::copy_n(turn.data(), axis_count, segment.turn.begin());
  std::copy_n(bend.data(), axis_count, segment.bend.begin());
  const double shorter_mm = 0.5 * std::min(last.length_mm, segment.segment.length_mm);
  // Where any deviation will do, roundings of neighbours do not overlap.
  const bool any = !std::isfinite(tolerance.contour_mm);
  segment.turn_share = segment.bend_share = 0.0;
  if (const double turned = size_of(turn); turned > 0.0) {
    segment.turn_share = any ? 1.0 / shorter_mm : turn_deviation * turned / tolerance.contour_mm;
  }
  if (const double bent = size_of(bend); bent > 0.0) {
    segment.bend_share = any ? 1.0 / (shorter_mm * shorter_mm) : bend_deviation * bent / tolerance.contour_mm;
  }
  for (std::size_t i = axis_count; i < tolerance.axes; ++i) {
    segment.turn[i] = segment.rate[i] - before.rate[i];
    const double jump = std::abs(segment.turn[i]);
    if (jump <= no_jump) continue;
    segment.turn_share += std::isfinite(tolerance.axis[i]) ? turn_deviation * jump / tolerance.axis[i]
                          : segment.turn_share > 0.0       ? 0.0
                                                           : 1.0 / shorter_mm;
  }
}

}  // namespace shapegcode
