#include "shapegcode/milling/force.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>

#include "milling/checks.hpp"

namespace shapegcode {

namespace {

using detail::check_positive;

/// Second moment of area of a round bar, m^4.
double second_moment_m4(double diameter_mm) {
  const double diameter_m = diameter_mm * 1e-3;
  return std::numbers::pi / 64.0 * std::pow(diameter_m, 4);
}

}  // namespace

void check(const ToolBeam& beam) {
  check_positive(beam.overhang_mm, "overhang of the tool", "mm");
  check_positive(beam.fluted_length_mm, "fluted length of the tool", "mm");
  check_positive(beam.effective_diameter_mm, "effective diameter of the fluted part", "mm");
  check_positive(beam.shank_diameter_mm, "diameter of the shank", "mm");
  check_positive(beam.young_modulus_gpa, "modulus of elasticity", "GPa");
  constexpr double rigid = std::numeric_limits<double>::infinity();
  if (beam.holder_n_per_um != rigid) check_positive(beam.holder_n_per_um, "stiffness of the holder", "N/um");
  if (beam.spindle_n_per_um != rigid) check_positive(beam.spindle_n_per_um, "stiffness of the spindle", "N/um");
}

double compliance_um_per_n(const ToolBeam& beam, double at_mm, double load_mm) noexcept {
  const double modulus_pa = beam.young_modulus_gpa * 1e9;
  // Distances from the clamped end, m.
  const double at = std::max(0.0, beam.overhang_mm - at_mm) * 1e-3;
  const double load = std::max(0.0, beam.overhang_mm - load_mm) * 1e-3;
  const double shank = std::max(0.0, beam.overhang_mm - beam.fluted_length_mm) * 1e-3;
  // Castigliano: integral of (at - s)(load - s) / (E I) from the clamped end to the nearer of both.
  const auto moments = [&](double s) { return s * (at * load + s * (-0.5 * (at + load) + s / 3.0)); };
  const double end = std::min(at, load);
  const double step = std::min(end, shank);
  const double bent_m_per_n =
      moments(step) / (modulus_pa * second_moment_m4(beam.shank_diameter_mm)) +
      (moments(end) - moments(step)) / (modulus_pa * second_moment_m4(beam.effective_diameter_mm));
  return bent_m_per_n * 1e6 + 1.0 / beam.holder_n_per_um + 1.0 / beam.spindle_n_per_um;
}

}  // namespace shapegcode
