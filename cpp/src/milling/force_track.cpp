// Figures of the cutting force along a whole track.

#include "milling/checks.hpp"
#include "shapegcode/milling/force.hpp"

namespace shapegcode {

Eigen::MatrixXd figures_of(MillingForce& force, const EngagementTrack& track, std::span<const double> feed_mm_per_min,
                           const ToolBeam* beam) {
  detail::check_feeds(feed_mm_per_min.size(), track);
  Eigen::MatrixXd table(static_cast<Eigen::Index>(track.size()), force_columns);
  for (std::size_t i = 0; i < track.size(); ++i) {
    const auto arcs = track.arcs_of(i);
    const double feed = feed_mm_per_min[i] * track.horizontal[i];
    const ForceFigures f = force.quick_figures(arcs, feed);
    const double deflection = beam != nullptr && !arcs.empty() ? force.peak_deflection_um(arcs, feed, *beam) : 0.0;
    table.row(static_cast<Eigen::Index>(i)) << f.mean_n.x(), f.mean_n.y(), f.mean_resultant_n, f.peak_resultant_n,
        f.peak_torque_nm, f.mean_torque_nm, f.mean_power_w, f.peak_chip_mm, deflection;
  }
  return table;
}

}  // namespace shapegcode
