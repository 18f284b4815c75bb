#include "shapegcode/milling/force.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>

#include "milling/azimuth.hpp"
#include "milling/checks.hpp"

namespace shapegcode {

namespace {

using detail::half_pi;
using detail::inside_rad;
using detail::refuse;

bool reaches(std::span<const EngagedArc> arcs, const WallHeights& wall, double height_mm) {
  return std::any_of(arcs.begin(), arcs.end(), [&](const EngagedArc& arc) {
    const bool there = wall.side == WallSide::right ? arc.from_rad <= -half_pi + wall.tolerance_rad
                                                    : arc.to_rad >= half_pi - wall.tolerance_rad;
    return there && arc.bottom_mm <= height_mm && height_mm <= arc.top_mm;
  });
}

}  // namespace

Eigen::VectorXd wall_error_um(MillingForce& force, const ToolBeam& beam, std::span<const EngagedArc> arcs,
                              double feed_mm_per_min, const WallHeights& wall) {
  const EndMill& tool = force.tool();
  const double lag_rad_per_mm = std::tan(tool.helix_rad) / tool.radius_mm();
  const double pitch = 2.0 * std::numbers::pi / tool.flutes;
  // In the direction of spindle rotation teeth pass from +pi/2 to -pi/2.
  const bool tooth_leaves = (wall.side == WallSide::right) == (force.sense() == SpindleSense::clockwise);
  const double finish = tooth_leaves ? -half_pi + inside_rad : half_pi - inside_rad;
  const double away = wall.side == WallSide::right ? 1.0 : -1.0;
  const bool one_kind = std::all_of(tool.runout_mm.begin(), tool.runout_mm.end(),
                                    [&](double value) { return value == tool.runout_mm.front(); });
  Eigen::VectorXd error = Eigen::VectorXd::Constant(static_cast<Eigen::Index>(wall.height_mm.size()),
                                                    std::numeric_limits<double>::quiet_NaN());
  for (std::size_t k = 0; k < wall.height_mm.size(); ++k) {
    const double z = wall.height_mm[k];
    if (!(z >= 0.0) || !std::isfinite(z)) {
      refuse("height on the wall is {} mm, must be 0 or above", z);
    }
    if (!reaches(arcs, wall, z)) continue;
    double least = std::numeric_limits<double>::infinity();
    for (int flute = 0; flute < (one_kind ? 1 : tool.flutes); ++flute) {
      const double turned = flute * pitch + lag_rad_per_mm * z - finish;
      const Eigen::Vector2d bent = force.deflection_um(arcs, feed_mm_per_min, turned, z, beam);
      const double out = tool.runout_mm.empty() ? 0.0 : 1e3 * tool.runout_mm[static_cast<std::size_t>(flute)];
      least = std::min(least, away * bent.y() - out);
    }
    error[static_cast<Eigen::Index>(k)] = least;
  }
  return error;
}

Eigen::MatrixXd wall_errors_um(MillingForce& force, const ToolBeam& beam, const EngagementTrack& track,
                               std::span<const double> feed_mm_per_min, const WallHeights& wall) {
  detail::check_feeds(feed_mm_per_min.size(), track);
  Eigen::MatrixXd map(static_cast<Eigen::Index>(track.size()), static_cast<Eigen::Index>(wall.height_mm.size()));
  for (std::size_t i = 0; i < track.size(); ++i) {
    map.row(static_cast<Eigen::Index>(i)) =
        wall_error_um(force, beam, track.arcs_of(i), feed_mm_per_min[i] * track.horizontal[i], wall).transpose();
  }
  return map;
}

}  // namespace shapegcode
