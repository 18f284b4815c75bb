#pragma once

#include <cstdint>
#include <span>

#include <Eigen/Core>

#include "shapegcode/milling/cutting_force.hpp"
#include "shapegcode/milling/deflection.hpp"
#include "shapegcode/milling/engagement.hpp"

namespace shapegcode {

/// The wall that a tool finishes beside its way, seen along the feed. With a clockwise spindle the right one is made by
/// down milling, the left one by up milling.
enum class WallSide : std::uint8_t {
  right,
  left,
};

/// An arc that ends this close to +-pi/2 counts as reaching the wall; a bit more than what a material model of 20 um
/// leaves open.
inline constexpr double wall_tolerance_rad = 0.02;

/// Form error of the wall across itself, um, at heights above the tip: + material is left standing, - the wall is cut
/// too deep. Each height is finished as a flute passes +-pi/2 there; the error is what the beam is deflected at that
/// height under all forces of that moment, and of several flutes with runout the one that reaches deepest counts (from
/// the mean radius). Paper 001, section 2.3; the load is taken as spread along the flutes instead of at its centre. NaN
/// where the engagement does not reach the wall. Throws Error(argument) as MillingForce::deflection_um, or on a height
/// below the tip or not finite.
[[nodiscard]] Eigen::VectorXd wall_error_um(MillingForce& force, const ToolBeam& beam, std::span<const EngagedArc> arcs,
                                            double feed_mm_per_min, WallSide side, std::span<const double> height_mm,
                                            double tolerance_rad = wall_tolerance_rad);

/// The same along a track, (n_samples, n_heights); feeds along the path, one per sample (its horizontal part makes the
/// chip). Throws also on another number of feeds.
[[nodiscard]] Eigen::MatrixXd wall_errors_um(MillingForce& force, const ToolBeam& beam, const EngagementTrack& track,
                                             std::span<const double> feed_mm_per_min, WallSide side,
                                             std::span<const double> height_mm,
                                             double tolerance_rad = wall_tolerance_rad);

}  // namespace shapegcode
