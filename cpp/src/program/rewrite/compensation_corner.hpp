#pragma once

#include <cstdint>
#include <vector>

#include "program/rewrite/plane_geometry.hpp"

// Cutter compensation between two blocks that move in the plane.
namespace shapegcode::plane {

/// A moving block and its signed offset: positive to the left of the path.
struct OffsetCurve {
  Curve curve;
  double left_mm = 0.0;
  std::uint32_t line = 0;
};

/// The tool goes to `points.front()` in the block before the corner and leaves `points.back()` in the block after it.
/// The turns are how much of an arc's sweep falls away at the corner; they are exact only up to a full turn.
struct Corner {
  std::vector<Vector2> points;
  double turn_before_rad = 0.0;
  double turn_after_rad = 0.0;
};

/// Refuses an arc whose offset leaves no arc: alarms 0038, 0041.
void require_offset_arc(const OffsetCurve& block, bool at_end);

/// The vector across the end (start) of one block alone.
[[nodiscard]] Vector2 across_end(const OffsetCurve& block);
[[nodiscard]] Vector2 across_start(const OffsetCurve& block);

/// The corner between two compensated blocks.
[[nodiscard]] Corner offset_corner(const OffsetCurve& before, const OffsetCurve& after);
/// The corner at the end of the start-up block, type 'A' or 'B'.
[[nodiscard]] Corner start_up_corner(const OffsetCurve& before, const OffsetCurve& after, char type);
/// The corner at the start of the cancel block.
[[nodiscard]] Corner cancel_corner(const OffsetCurve& before, const OffsetCurve& after, char type);

/// Makes one of points that differ by no more than `limit_mm` on both axes: the later one goes, but an arc keeps its
/// own point (parameter 5010).
void drop_minute_moves(Corner& corner, bool arc_before, bool arc_after, double limit_mm);

}  // namespace shapegcode::plane
