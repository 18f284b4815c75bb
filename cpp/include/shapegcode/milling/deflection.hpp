#pragma once

#include <limits>

namespace shapegcode {

/// An end mill as a beam that is clamped at its overhang: a shank, and below it the fluted part, which is as stiff as a
/// round bar of an effective diameter. Heights count from the tip.
struct ToolBeam {
  double overhang_mm = 0.0;            ///< from the tip to where it is clamped (effective length of paper 001)
  double fluted_length_mm = 0.0;       ///< from the tip; at or above the overhang: no shank is free
  double effective_diameter_mm = 0.0;  ///< of the fluted part: about 0.8 of the cutter's diameter
  double shank_diameter_mm = 0.0;
  double young_modulus_gpa = 0.0;
  /// Springs across the axis between the clamped end and the frame, one behind the other.
  double holder_n_per_um = std::numeric_limits<double>::infinity();
  double spindle_n_per_um = std::numeric_limits<double>::infinity();
};

/// Throws Error(argument) on a length, diameter, modulus or stiffness that is not positive, or a value that is not
/// finite (a stiffness may be infinite: rigid).
void check(const ToolBeam& beam);

/// Deflection at one height under a load of 1 N across the axis at another, um/N: Euler-Bernoulli beam of two sections
/// in closed form, springs added. The same when both heights change places. Heights beyond the overhang count as
/// clamped. The beam is taken as checked.
[[nodiscard]] double compliance_um_per_n(const ToolBeam& beam, double at_mm, double load_mm) noexcept;

/// Deflection of the tip under a load of 1 N at a height, um/N.
[[nodiscard]] inline double tip_compliance_um_per_n(const ToolBeam& beam, double load_mm) noexcept {
  return compliance_um_per_n(beam, 0.0, load_mm);
}

}  // namespace shapegcode
