#pragma once

#include <vector>

#include "shapegcode/program.hpp"

namespace shapegcode {

/// A drilling cycle G73 ... G89 at one hole, with its present modal words.
struct CannedCycle {
  int code = 80;
  double r_mm = 0.0;          ///< R level, absolute
  double bottom_mm = 0.0;     ///< Z, absolute
  double peck_mm = 0.0;       ///< Q, 0 if none
  double clearance_mm = 0.5;  ///< to which a peck returns before it feeds on (parameters 5114, 5115)
  double dwell_s = 0.0;       ///< P
  double initial_mm = 0.0;    ///< level before the cycle, the return level of G98
  bool return_to_r = false;   ///< G99
  bool has_r = true;          ///< R was given; else R is the level before the cycle
  bool has_bottom = true;     ///< Z was given; else nothing is drilled
};

/// How often the tool feeds down in one hole: the pecks of G73 and G83, else 1.
[[nodiscard]] double cuts_per_hole(const CannedCycle& cycle) noexcept;

/// Moves of each of them, the return included.
[[nodiscard]] double max_moves_per_cut(const CannedCycle& cycle) noexcept;

/// Expands one hole into rapid and feed moves along `axis` from `position` (already over the hole), for cycle time and
/// picture; the text itself stays a cycle. A shallow peck makes for millions
/// of moves: ask `cuts_per_hole` first. Returns the tool's position after it.
Vector3 expand_cycle(const CannedCycle& cycle, const Vector3& position, int axis, double feed_mm_per_s,
                     std::uint32_t line, std::vector<OtherMove>& moves);

}  // namespace shapegcode
