#pragma once

#include <cstdint>
#include <optional>

#include "shapegcode/path.hpp"

namespace shapegcode {

/// A circular block as programmed, in mm: G02 (clockwise) or G03 seen along the plane's normal towards the plane.
struct ArcWords {
  Vector3 start_mm;
  Vector3 end_mm;
  bool clockwise = false;
  int normal = 2;                       ///< 2 for G17, 1 for G18, 0 for G19
  std::optional<double> radius_mm;      ///< R; negative for the sweep over 180 degrees
  Vector3 centre_mm = Vector3::Zero();  ///< from I J K, already absolute; used when R is not given
  double tolerance_mm = 0.01;           ///< largest difference of the radii at start and end
};

/// Turns a circular block into an arc segment: a full circle where start and end coincide (I J K form), a helix where
/// the normal axis moves. Throws Error(program) with start, end, centre, both radii, difference and tolerance.
[[nodiscard]] Segment resolve_arc(const ArcWords& words, double feed_mm_per_s, std::uint32_t line,
                                  std::uint32_t column);

}  // namespace shapegcode
