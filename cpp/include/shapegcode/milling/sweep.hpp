#pragma once

#include <functional>

#include "shapegcode/milling/engagement.hpp"
#include "shapegcode/milling/material.hpp"
#include "shapegcode/path/path.hpp"

namespace shapegcode {

/// How finely engagement is looked at along a path.
struct SweepOptions {
  double step_mm = 0.0;  ///< largest distance between samples; 0: a fortieth of the tool's diameter
  /// What is met less wide than this across the direction of feed is no contact: a second pass along a finished wall.
  double touch_mm = 0.002;
  std::function<void(double s_mm)> progress;  ///< called now and then with the distance travelled; may throw
};

/// Moves a cylindrical tool along a path through the material, takes away what it sweeps, and tells what it met.
/// A sample stands at the end of every segment and in between at most a step apart, closer behind a vertex. It tells
/// what the front half of the tool meets of the material that all of the path up to the sample has left, and so what
/// is cut there; on ramps the heights are those of the layers. What stands in the tool at the start of the path counts
/// as gone. A rapid is swept like any other move: a section above 0 is a collision. Layers with the same azimuths
/// (within 1e-4 rad) share an arc. Section times feed is the material removal rate, downward moves included.
/// Throws Error(argument) on a diameter, step or touch that is not a positive number (touch: below 0), an arc that is
/// not in the XY plane, or if the material needs more memory than its limit; the material is then cut up to there.
[[nodiscard]] EngagementTrack sweep(Material& material, const Path& path, double tool_diameter_mm,
                                    const SweepOptions& options = {});

}  // namespace shapegcode
