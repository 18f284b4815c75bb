#pragma once

#include <cstddef>
#include <cstdint>
#include <limits>
#include <memory>
#include <span>
#include <vector>

#include <Eigen/Core>

namespace shapegcode {

/// Direction of spindle rotation, seen from the spindle towards the workpiece.
enum class SpindleSense : std::uint8_t {
  clockwise,          ///< M03
  counter_clockwise,  ///< M04
};

/// A cylindrical end mill with a flat end. Its axis is Z; heights count from the tip.
struct EndMill {
  double diameter_mm = 0.0;
  int flutes = 0;
  double helix_rad = 0.0;  ///< of a right-hand helix on a right-hand cutter: the tip enters first
  /// Radius of each flute less the mean radius, in the order in which they cut; empty: no runout.
  std::vector<double> runout_mm = {};

  [[nodiscard]] double radius_mm() const noexcept { return 0.5 * diameter_mm; }
};

/// Throws Error(argument) on a diameter or number of flutes that is not positive, a helix outside 0 ... 80 degrees, or
/// a runout that is not one finite number per flute or reaches the radius; also on more than 1000 flutes.
void check(const EndMill& tool);

/// A section of the tool's circumference that is in material, over a section of its length. Azimuths in rad from the
/// direction of feed, positive to its left (counter-clockwise seen from +Z); only the front half cuts, so
/// -pi/2 <= from < to <= pi/2. With a clockwise spindle a tooth passes from +pi/2 (left, up milling) to -pi/2 (right,
/// down milling), and its chip is feed per tooth times cos(azimuth) thick.
struct EngagedArc {
  double from_rad = 0.0;
  double to_rad = 0.0;
  double bottom_mm = 0.0;  ///< above the tool's tip
  double top_mm = 0.0;
};

/// Engagement of the tool along a path, in the order of travel; all columns except `arcs` have the same length.
struct EngagementTrack {
  std::vector<double> s_mm;  ///< distance of the sample along the path
  std::vector<double> x_mm;  ///< of the tool's axis
  std::vector<double> y_mm;
  std::vector<double> direction_rad;    ///< of feed in the XY plane, from +X; 0 where the tool only plunges
  std::vector<double> horizontal;       ///< component of the travel in the XY plane: 1 level, 0 a plunge
  std::vector<std::uint32_t> segment;   ///< of the path
  std::vector<double> radial_depth_mm;  ///< width of cut, perpendicular to the feed: R (sin to - sin from)
  std::vector<double> section_mm2;  ///< area of cut, perpendicular to the feed; times the feed: material removal rate
  std::vector<double> plunged_mm2;  ///< area of material below the end of a descending tool (0: level)
  std::vector<std::uint32_t> first_arc;  ///< size() + 1 entries, into `arcs`
  std::vector<EngagedArc> arcs;

  [[nodiscard]] std::size_t size() const noexcept { return s_mm.size(); }
  [[nodiscard]] std::span<const EngagedArc> arcs_of(std::size_t i) const noexcept {
    return {arcs.data() + first_arc[i], arcs.data() + first_arc[i + 1]};
  }
};

/// An end mill as a beam clamped at its overhang: a shank, and below it the fluted part, modelled as a round bar of an
/// effective diameter. Heights count from the tip.
struct ToolBeam {
  double overhang_mm = 0.0;            ///< from the tip to the clamping (effective length of paper 001)
  double fluted_length_mm = 0.0;       ///< from the tip; at or above the overhang: no shank is free
  double effective_diameter_mm = 0.0;  ///< of the fluted part: about 0.8 of the cutter's diameter
  double shank_diameter_mm = 0.0;
  double young_modulus_gpa = 0.0;
  /// Springs across the axis between the clamped end and the frame, in series.
  double holder_n_per_um = std::numeric_limits<double>::infinity();
  double spindle_n_per_um = std::numeric_limits<double>::infinity();
};

/// Throws Error(argument) on a length, diameter, modulus or stiffness that is not positive, or a value that is not
/// finite (a stiffness may be infinite: rigid).
void check(const ToolBeam& beam);

/// Deflection at one height under a load of 1 N across the axis at another, um/N: Euler-Bernoulli beam of two sections
/// in closed form, plus springs. Symmetric in both heights. Heights beyond the overhang count as clamped. The beam must
/// be checked before.
[[nodiscard]] double compliance_um_per_n(const ToolBeam& beam, double at_mm, double load_mm) noexcept;

/// Chip thickness used in the specific cutting force.
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

/// Throws Error(argument) on a value that is not finite, a specific force, ratio or edge force below 0, or an exponent
/// at which the force would not grow with the chip (specific_exponent or its sum with ratio_exponent <= -1).
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
  Eigen::VectorXd
      turned_rad;  ///< spindle angle in its direction of rotation; at 0 the first flute's tip points along the feed
  Eigen::MatrixX2d force_n;               ///< (n_angles, 2)
  Eigen::VectorXd torque_nm;              ///< (n_angles,); positive: against the spindle
  std::vector<Eigen::MatrixX2d> flute_n;  ///< of each flute, (n_angles, 2)
};

/// A force in the frame of the tool (x along the feed, y to its left) in the frame of the machine (paper 001 eq. 4, 5,
/// whose angle counts the other way); `direction_rad`: of the feed, from +X towards +Y.
[[nodiscard]] Eigen::Vector2d machine_frame(const Eigen::Vector2d& tool_frame, double direction_rad) noexcept;

/// Forces of an end mill at one engagement. The chip of a tooth at azimuth p is feed per tooth * cos p thick (paper 001
/// eq. 1); with runout that of flute i is the minimum of m * feed per tooth * cos p + r_i - r_(i-m), m >= 1, and not
/// below 0. The force of a helical flute is an integral of the chip's powers over azimuth, without dividing the tool
/// into discs. With a counter-clockwise spindle everything is mirrored, including helix and order of the flutes. The
/// mean chip thickness, if the coefficients require it, is that of the whole engagement without runout.
///
/// Stores tables shared by many engagements, and the last engagement, so reuse one object. Not thread-safe. All members
/// throw Error(argument) on an arc that does not lie within -pi/2 ... pi/2 and above the tip, or up to which a flute
/// winds more than 1000 times around the tool, on a feed that is negative or not finite, or an angle of the spindle
/// beyond 1e9 rad; a feed of 0 and an empty engagement give zeros.
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
  /// magnitude and the peaks are accurate to 0.1 % (angles at most 4 degrees apart, ends of arcs included, parabolas
  /// between).
  [[nodiscard]] ForceFigures figures(std::span<const EngagedArc> arcs, double feed_mm_per_min);

  /// The same without the largest force on a single flute, which stays 0; for the search of a feed.
  [[nodiscard]] ForceFigures quick_figures(std::span<const EngagedArc> arcs, double feed_mm_per_min);

  /// Forces at `angles` equal steps of the spindle. Throws Error(argument) on angles < 1.
  [[nodiscard]] ForceCurve curve(std::span<const EngagedArc> arcs, double feed_mm_per_min, int angles);

  /// Largest deflection of the tip over one revolution, um: quasi-static, the beam under the load along its flutes.
  /// Also throws Error(argument) on an engagement above the overhang.
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

/// Columns of the figures of a whole track; forces in the frame of the tool.
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

/// Figures of a whole track, one row per sample, with the columns of ForceColumn. `feed_mm_per_min`: along the path,
/// one per sample; its horizontal component makes the chip. Throws as MillingForce::figures, and on another number of
/// feeds. The deflection of the tip is 0 without a beam.
[[nodiscard]] Eigen::MatrixXd figures_of(MillingForce& force, const EngagementTrack& track,
                                         std::span<const double> feed_mm_per_min, const ToolBeam* beam = nullptr);

/// The wall that a tool finishes beside its path, seen along the feed. With a clockwise spindle the right one is made
/// by down milling, the left one by up milling.
enum class WallSide : std::uint8_t {
  right,
  left,
};

/// An arc that ends this close to +-pi/2 counts as reaching the wall; slightly more than the uncertainty of a material
/// model of 20 um.
inline constexpr double wall_tolerance_rad = 0.02;

/// Side and heights at which a wall is evaluated.
struct WallHeights {
  WallSide side = WallSide::right;
  std::span<const double> height_mm = {};     ///< above the tip; a view: the caller's data must outlive it
  double tolerance_rad = wall_tolerance_rad;  ///< an arc that ends this close to +-pi/2 reaches the wall
};

/// Form error perpendicular to the wall, um, at heights above the tip: + material is left, - the wall is cut too deep.
/// Each height is finished when a flute passes +-pi/2 there; the error is the deflection of the beam at that height
/// under all forces at that moment. With runout the flute that cuts deepest counts (relative to the mean radius). Paper
/// 001, section 2.3; the load is distributed along the flutes instead of acting at its centre. NaN where the engagement
/// does not reach the wall. Throws Error(argument) as MillingForce::deflection_um, or on a height below the tip or not
/// finite.
[[nodiscard]] Eigen::VectorXd wall_error_um(MillingForce& force, const ToolBeam& beam, std::span<const EngagedArc> arcs,
                                            double feed_mm_per_min, const WallHeights& wall);

/// The same along a track, (n_samples, n_heights); feeds along the path, one per sample (its horizontal part makes the
/// chip). Throws also on another number of feeds.
[[nodiscard]] Eigen::MatrixXd wall_errors_um(MillingForce& force, const ToolBeam& beam, const EngagementTrack& track,
                                             std::span<const double> feed_mm_per_min, const WallHeights& wall);

}  // namespace shapegcode
