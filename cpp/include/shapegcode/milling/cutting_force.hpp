#pragma once

#include <cstdint>
#include <span>

#include <Eigen/Core>

#include "shapegcode/milling/end_mill.hpp"
#include "shapegcode/milling/engagement.hpp"

namespace shapegcode {

/// Which chip thickness the specific cutting force belongs to.
enum class ChipThickness : std::uint8_t {
  mean,   ///< of the whole engagement: how paper 001 fits its coefficients
  local,  ///< of each element of a flute
};

/// Power laws of the cutting force (paper 001 eq. 2, 3, 8, 9), with edge forces. t is the chip thickness in mm:
/// dF_t = k1(t) t dz + K_te dz, dF_r = k2(t) k1(t) t dz + K_re dz, k1 = specific * t^specific_exponent,
/// k2 = ratio * t^ratio_exponent.
struct CuttingCoefficients {
  double specific_n_per_mm2 = 0.0;
  double specific_exponent = 0.0;
  double ratio = 0.0;
  double ratio_exponent = 0.0;
  double tangential_edge_n_per_mm = 0.0;
  double radial_edge_n_per_mm = 0.0;
  ChipThickness thickness = ChipThickness::mean;
};

/// Throws Error(argument) on a value that is not finite, a specific force or edge force below 0, or an exponent at
/// which the force would not grow with the chip (specific_exponent or its sum with ratio_exponent <= -1).
void check(const CuttingCoefficients& coefficients);

/// Figures over one revolution. Forces on the tool, in N; frame of the tool: x along the feed, y to its left.
struct ForceFigures {
  Eigen::Vector2d mean_n = Eigen::Vector2d::Zero();  ///< mean of the vector
  double mean_resultant_n = 0.0;                     ///< mean of the magnitude
  double peak_resultant_n = 0.0;                     ///< largest magnitude
  double peak_flute_n = 0.0;                         ///< largest magnitude on a single flute
  double mean_torque_nm = 0.0;
  double peak_torque_nm = 0.0;
  double mean_power_w = 0.0;  ///< of the spindle: mean torque times angular speed
  double peak_chip_mm = 0.0;  ///< thickest chip
};

/// Forces of an end mill at one engagement; holds the tables that many engagements share, so make one and keep it.
/// Not for several threads at a time.
class MillingForce {
 public:
  /// Throws Error(argument) on a tool or coefficients that `check` refuses, or a speed that is not positive.
  MillingForce(EndMill tool, CuttingCoefficients coefficients, double spindle_rev_per_min,
               SpindleSense sense = SpindleSense::clockwise);

  [[nodiscard]] const EndMill& tool() const noexcept;
  [[nodiscard]] const CuttingCoefficients& coefficients() const noexcept;
  [[nodiscard]] double spindle_rev_per_min() const noexcept;
  [[nodiscard]] SpindleSense sense() const noexcept;

  /// Figures over one revolution at a feed along the path; zeros where nothing is met or the feed is 0.
  [[nodiscard]] ForceFigures figures(std::span<const EngagedArc> arcs, double feed_mm_per_min);

 private:
  // Filled by the implementation.
};

}  // namespace shapegcode
