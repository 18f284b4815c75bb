// Checks common to the parts of milling.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <span>
#include <string_view>

#include "base/refuse.hpp"
#include "shapegcode/milling/force.hpp"

namespace shapegcode::detail {

/// So many samples, chords or layers of one path are never meant: a step that is wrong by orders of magnitude.
inline constexpr double max_pieces = 1e9;

inline void check_positive(double value, std::string_view what, std::string_view unit) {
  if (!(value > 0.0 && std::isfinite(value))) refuse("{} is {} {}, must be above 0", what, value, unit);
}

/// `step`: of what `travel_mm` is cut up into.
inline void check_pieces(double travel_mm, double step_mm, std::string_view step) {
  const double pieces = travel_mm / step_mm;
  if (pieces <= max_pieces) return;
  refuse("{} of {} mm cuts {} mm into {:g} pieces, limit {:g}", step, step_mm, travel_mm, pieces, max_pieces);
}

inline void check_feeds(std::size_t feeds, const EngagementTrack& track) {
  if (feeds != track.size()) refuse("feeds are {} for a track of {} samples", feeds, track.size());
}

inline bool same_arcs(std::span<const EngagedArc> a, std::span<const EngagedArc> b) {
  return std::equal(a.begin(), a.end(), b.begin(), b.end(), [](const EngagedArc& p, const EngagedArc& q) {
    return p.from_rad == q.from_rad && p.to_rad == q.to_rad && p.bottom_mm == q.bottom_mm && p.top_mm == q.top_mm;
  });
}

}  // namespace shapegcode::detail
