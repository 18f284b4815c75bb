#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

namespace shapegcode {

/// A stretch of the tool's circumference that is in material, over a stretch of its length. Azimuths in rad from the
/// direction of feed, positive to its left (counter-clockwise seen from +Z); only the front half cuts, so
/// -pi/2 <= from < to <= pi/2. With a clockwise spindle a tooth passes from +pi/2 (left, up milling) to -pi/2 (right,
/// down milling), and its chip is feed per tooth times cos(azimuth) thick.
struct EngagedArc {
  double from_rad = 0.0;
  double to_rad = 0.0;
  double bottom_mm = 0.0;  ///< above the tool's tip
  double top_mm = 0.0;
};

/// What the tool meets along a path, in the order of travel; columns of one length but for `arcs`.
struct EngagementTrack {
  std::vector<double> s_mm;  ///< distance along the path at which the sample stands
  std::vector<double> x_mm;  ///< of the tool's axis
  std::vector<double> y_mm;
  std::vector<double> direction_rad;     ///< of feed in the XY plane, from +X; 0 where the tool only plunges
  std::vector<double> horizontal;        ///< share of the travel that lies in the XY plane: 1 level, 0 a plunge
  std::vector<std::uint32_t> segment;    ///< of the path
  std::vector<double> radial_depth_mm;   ///< width of what is met, across the direction of feed: R (sin to - sin from)
  std::vector<double> section_mm2;       ///< area across the direction of feed; times the feed: material removal rate
  std::vector<double> plunged_mm2;       ///< area of material below the end of a tool that goes down (0: goes level)
  std::vector<std::uint32_t> first_arc;  ///< size() + 1 entries, into `arcs`
  std::vector<EngagedArc> arcs;

  [[nodiscard]] std::size_t size() const noexcept { return s_mm.size(); }
  [[nodiscard]] std::span<const EngagedArc> arcs_of(std::size_t i) const noexcept {
    return {arcs.data() + first_arc[i], arcs.data() + first_arc[i + 1]};
  }
};

}  // namespace shapegcode
