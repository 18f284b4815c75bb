#pragma once

#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include <Eigen/Core>

#include "shapegcode/milling/deflection.hpp"
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

/// Forces on the tool over one revolution, sample by sample; frame of the tool.
struct ForceCurve {
  Eigen::VectorXd turned_rad;  ///< by the spindle, in its own sense; at 0 the first flute's tip looks along the feed
  Eigen::MatrixX2d force_n;    ///< (n_angles, 2)
  Eigen::VectorXd torque_nm;   ///< (n_angles,); positive: against the spindle
  std::vector<Eigen::MatrixX2d> flute_n;  ///< of each flute, (n_angles, 2)
};

/// A force in the frame of the tool (x along the feed, y to its left) in the frame of the machine (paper 001 eq. 4, 5,
/// whose angle counts the other way); `direction_rad`: of the feed, from +X towards +Y.
[[nodiscard]] Eigen::Vector2d machine_frame(const Eigen::Vector2d& tool_frame, double direction_rad) noexcept;

/// Forces of an end mill at one engagement. The chip of a tooth at azimuth p is feed per tooth * cos p thick (paper 001
/// eq. 1); with runout that of flute i is the least of m * feed per tooth * cos p + r_i - r_(i-m), m >= 1, and not
/// below 0. A flute with a helix takes its force from the integral of the chip's powers over azimuth, so nothing is cut
/// into discs. With a counter-clockwise spindle all is mirrored, helix and order of the flutes included. The mean chip
/// thickness, where the coefficients ask for it, is that of the whole engagement without runout.
///
/// Holds the tables that many engagements share, and the last engagement, so make one and keep it. Not for several
/// threads at a time. All members throw Error(argument) on an arc that does not lie within -pi/2 ... pi/2 and above the
/// tip, or on a feed that is negative or not finite; a feed of 0 and an empty engagement give zeros.
class MillingForce {
 public:
  /// Throws Error(argument) on a tool or coefficients that `check` refuses, or a speed that is not positive.
  MillingForce(EndMill tool, CuttingCoefficients coefficients, double spindle_rev_per_min,
               SpindleSense sense = SpindleSense::clockwise);
  ~MillingForce();
  MillingForce(MillingForce&&) noexcept;
  MillingForce& operator=(MillingForce&&) noexcept;
  MillingForce(const MillingForce&) = delete;
  MillingForce& operator=(const MillingForce&) = delete;

  [[nodiscard]] const EndMill& tool() const noexcept;
  [[nodiscard]] const CuttingCoefficients& coefficients() const noexcept;
  [[nodiscard]] double spindle_rev_per_min() const noexcept;
  [[nodiscard]] SpindleSense sense() const noexcept;
  [[nodiscard]] double feed_per_tooth_mm(double feed_mm_per_min) const noexcept;

  /// Figures over one revolution at a feed along the path. Means of force and torque are exact; the mean of the
  /// magnitude and the peaks are good to 0.1 % (angles at most 4 degrees apart, ends of arcs included, parabolas
  /// between).
  [[nodiscard]] ForceFigures figures(std::span<const EngagedArc> arcs, double feed_mm_per_min);

  /// The same without the largest force on a single flute, which stays 0: what a search for a feed needs.
  [[nodiscard]] ForceFigures quick_figures(std::span<const EngagedArc> arcs, double feed_mm_per_min);

  /// Forces at `angles` equal steps of the spindle. Throws Error(argument) on angles < 1.
  [[nodiscard]] ForceCurve curve(std::span<const EngagedArc> arcs, double feed_mm_per_min, int angles);

  /// Largest deflection of the tip over one revolution, um: quasi-static, the beam under the load along its flutes.
  /// Throws Error(argument) also on an engagement above the overhang.
  [[nodiscard]] double peak_deflection_um(std::span<const EngagedArc> arcs, double feed_mm_per_min,
                                          const ToolBeam& beam);

  /// Deflection at a height above the tip, at an angle of the spindle as in ForceCurve, um, frame of the tool. Throws
  /// as peak_deflection_um.
  [[nodiscard]] Eigen::Vector2d deflection_um(std::span<const EngagedArc> arcs, double feed_mm_per_min,
                                              double turned_rad, double height_mm, const ToolBeam& beam);

  /// Centre of the force along x and along y (paper 001 eq. 6), as distance from the clamped end, mm; NaN where that
  /// force is 0. `overhang_mm`: the effective length of the tool.
  [[nodiscard]] Eigen::Vector2d force_centre_mm(std::span<const EngagedArc> arcs, double feed_mm_per_min,
                                                double turned_rad, double overhang_mm);

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

/// Figures of a whole track, a row per sample: mean_x_n, mean_y_n, mean_resultant_n, peak_resultant_n, peak_torque_nm,
/// mean_torque_nm, mean_power_w, peak_chip_mm, peak_deflection_um; forces in the frame of the tool.
enum class ForceColumn : std::uint8_t {
  mean_x_n,
  mean_y_n,
  mean_resultant_n,
  peak_resultant_n,
  peak_torque_nm,
  mean_torque_nm,
  mean_power_w,
  peak_chip_mm,
  peak_deflection_um,
};
inline constexpr int force_columns = 9;

/// `feed_mm_per_min`: along the path, one per sample; the chip comes from its horizontal part. Throws as
/// MillingForce::figures, and on another number of feeds. The deflection of the tip is 0 without a beam.
[[nodiscard]] Eigen::MatrixXd figures_of(MillingForce& force, const EngagementTrack& track,
                                         std::span<const double> feed_mm_per_min, const ToolBeam* beam = nullptr);

}  // namespace shapegcode
