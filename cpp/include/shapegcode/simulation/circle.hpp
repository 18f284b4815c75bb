#pragma once

#include "shapegcode/motion/controller.hpp"

namespace shapegcode {

/// What acceleration after interpolation and servo lag make of a circle.
struct CircleFigures {
  double command_error_mm = 0.0;  ///< programmed radius minus radius of the set-points behind the acceleration filters
  double radial_error_mm = 0.0;   ///< programmed radius minus radius of the axes behind the servo loop
};

/// Runs circles in XY at a constant feed until the transient is gone and measures the mean radius over whole turns. To
/// second order the result is (sum of the filters' variances + (1 - a^2) / K^2) v^2 / (2 r): the radial error formulas
/// of the controller manual (fanuc.md B1). Throws Error(argument) on a radius or feed <= 0.
[[nodiscard]] CircleFigures simulate_circle(double radius_mm, double feed_mm_per_s, const ControllerModel& model);

}  // namespace shapegcode
