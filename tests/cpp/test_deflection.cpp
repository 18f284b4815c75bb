#include <doctest/doctest.h>

#include <cmath>
#include <limits>
#include <numbers>
#include <vector>

#include "shapegcode/error.hpp"
#include "shapegcode/milling/force.hpp"

using shapegcode::compliance_um_per_n;
using shapegcode::CuttingCoefficients;
using shapegcode::EndMill;
using shapegcode::EngagedArc;
using shapegcode::Error;
using shapegcode::ForceCurve;
using shapegcode::MillingForce;
using shapegcode::ToolBeam;

namespace {

constexpr double pi = std::numbers::pi;

const ToolBeam stepped{.overhang_mm = 40.0,
                       .fluted_length_mm = 19.0,
                       .effective_diameter_mm = 6.4,
                       .shank_diameter_mm = 8.0,
                       .young_modulus_gpa = 600.0};

ToolBeam uniform(double length_mm, double diameter_mm, double modulus_gpa) {
  return {.overhang_mm = length_mm,
          .fluted_length_mm = length_mm,
          .effective_diameter_mm = diameter_mm,
          .shank_diameter_mm = diameter_mm,
          .young_modulus_gpa = modulus_gpa};
}

// The curvature M / (E I) integrated twice from the clamped end, um at a height.
double integrated(const ToolBeam& beam, double at_mm, double load_mm) {
  const int n = 400000;
  const double end = beam.overhang_mm - at_mm;
  const double load = beam.overhang_mm - load_mm;
  const double step = end / n;
  double slope = 0.0;
  double deflection = 0.0;
  for (int i = 0; i < n; ++i) {
    const double s = (i + 0.5) * step;
    const double d = s < beam.overhang_mm - beam.fluted_length_mm ? beam.shank_diameter_mm : beam.effective_diameter_mm;
    const double bend = std::max(0.0, load - s) / (beam.young_modulus_gpa * 1e3 * pi * std::pow(d, 4) / 64.0);
    deflection += slope * step + 0.5 * bend * step * step;
    slope += bend * step;
  }
  return deflection * 1e3;
}

}  // namespace

TEST_CASE("deflection: textbook cantilever") {
  const ToolBeam beam = uniform(50.0, 10.0, 210.0);
  const double second_moment = pi * 1e4 / 64.0;  // mm4
  const double stiffness = 210e3 * second_moment;
  CHECK(compliance_um_per_n(beam, 0.0, 0.0) ==
        doctest::Approx(1e3 * std::pow(50.0, 3) / (3.0 * stiffness)).epsilon(1e-12));
  // Load at a from the clamped end: at the tip a^2 (3 L - a) / (6 E I), under the load a^3 / (3 E I).
  CHECK(compliance_um_per_n(beam, 0.0, 20.0) ==
        doctest::Approx(1e3 * 900.0 * (150.0 - 30.0) / (6.0 * stiffness)).epsilon(1e-12));
  CHECK(compliance_um_per_n(beam, 20.0, 20.0) == doctest::Approx(1e3 * 27000.0 / (3.0 * stiffness)).epsilon(1e-12));
  CHECK(compliance_um_per_n(beam, 50.0, 0.0) == 0.0);
  CHECK(compliance_um_per_n(beam, 0.0, 60.0) == 0.0);  // a load beyond the clamp does nothing
}

TEST_CASE("deflection: a stepped beam is the curvature integrated twice, and reciprocal") {
  for (const double at : {0.0, 10.0, 18.999, 19.0, 25.0, 39.0}) {
    for (const double load : {0.0, 7.0, 19.0, 30.0}) {
      CAPTURE(at);
      CAPTURE(load);
      CHECK(compliance_um_per_n(stepped, at, load) == doctest::Approx(integrated(stepped, at, load)).epsilon(1e-5));
      CHECK(compliance_um_per_n(stepped, at, load) ==
            doctest::Approx(compliance_um_per_n(stepped, load, at)).epsilon(1e-13));
    }
  }
  ToolBeam sprung = stepped;
  sprung.holder_n_per_um = 20.0;
  sprung.spindle_n_per_um = 50.0;
  CHECK(compliance_um_per_n(sprung, 3.0, 9.0) - compliance_um_per_n(stepped, 3.0, 9.0) ==
        doctest::Approx(0.05 + 0.02).epsilon(1e-10));
}

TEST_CASE("deflection: the tip under the spread load of the flutes") {
  // Fine slices of a tool with a helix, each with its own force, and the beam's influence at its middle.
  const EndMill tool{.diameter_mm = 8.0, .flutes = 3, .helix_rad = 40.0 / 180.0 * pi};
  const CuttingCoefficients k{.specific_n_per_mm2 = 700.0, .ratio = 0.35};
  MillingForce force(tool, k, 2000.0);
  const std::vector<EngagedArc> arcs{{-pi / 2, -0.3, 0.0, 12.0}};
  const int slices = 300;
  const int angles = 720;
  Eigen::MatrixX2d tip = Eigen::MatrixX2d::Zero(angles, 2);
  Eigen::MatrixX2d moment = Eigen::MatrixX2d::Zero(angles, 2);
  for (int i = 0; i < slices; ++i) {
    const double low = 12.0 * i / slices;
    const double high = 12.0 * (i + 1) / slices;
    const ForceCurve curve = force.curve(std::vector<EngagedArc>{{-pi / 2, -0.3, low, high}}, 600.0, angles);
    tip += curve.force_n * compliance_um_per_n(stepped, 0.0, 0.5 * (low + high));
    moment += curve.force_n * (40.0 - 0.5 * (low + high));
  }
  const ForceCurve whole = force.curve(arcs, 600.0, angles);
  CHECK(force.peak_deflection_um(arcs, 600.0, stepped) ==
        doctest::Approx(tip.rowwise().norm().maxCoeff()).epsilon(1e-3));
  for (const int i : {0, 100, 333, 600}) {
    CAPTURE(i);
    const Eigen::Vector2d bent = force.deflection_um(arcs, 600.0, whole.turned_rad[i], 0.0, stepped);
    CHECK((bent - tip.row(i).transpose()).norm() < 1e-3 * tip.row(i).norm() + 1e-9);
    const Eigen::Vector2d centre = force.force_centre_mm(arcs, 600.0, whole.turned_rad[i], 40.0);
    for (int axis = 0; axis < 2; ++axis) {
      CHECK(centre[axis] * whole.force_n(i, axis) == doctest::Approx(moment(i, axis)).epsilon(1e-3));
    }
  }
  CHECK(force.peak_deflection_um({}, 600.0, stepped) == 0.0);
  CHECK(std::isnan(force.force_centre_mm({}, 600.0, 0.0, 40.0).x()));
}

TEST_CASE("deflection: a load without helix acts at the middle of its height") {
  const CuttingCoefficients k{.specific_n_per_mm2 = 700.0, .ratio = 0.35};
  MillingForce force({.diameter_mm = 8.0, .flutes = 2}, k, 2000.0);
  const std::vector<EngagedArc> arcs{{-pi / 2, pi / 2, 2.0, 8.0}};
  const ForceCurve curve = force.curve(arcs, 400.0, 12);
  const Eigen::Vector2d centre = force.force_centre_mm(arcs, 400.0, curve.turned_rad[1], 40.0);
  CHECK(centre.x() == doctest::Approx(35.0).epsilon(1e-9));
  CHECK(centre.y() == doctest::Approx(35.0).epsilon(1e-9));
  // Uniform over the height: mean of the influence, by Simpson's rule exact for a cubic.
  const auto influence = [](double z) { return compliance_um_per_n(stepped, 0.0, z); };
  const double mean = (influence(2.0) + 4.0 * influence(5.0) + influence(8.0)) / 6.0;
  const Eigen::Vector2d bent = force.deflection_um(arcs, 400.0, curve.turned_rad[1], 0.0, stepped);
  CHECK((bent - mean * curve.force_n.row(1).transpose()).norm() < 1e-4 * bent.norm());
}

TEST_CASE("deflection: refusals") {
  for (double ToolBeam::*member :
       {&ToolBeam::overhang_mm, &ToolBeam::fluted_length_mm, &ToolBeam::effective_diameter_mm,
        &ToolBeam::shank_diameter_mm, &ToolBeam::young_modulus_gpa, &ToolBeam::holder_n_per_um,
        &ToolBeam::spindle_n_per_um}) {
    for (const double bad : {0.0, -1.0, std::numeric_limits<double>::quiet_NaN()}) {
      ToolBeam beam = stepped;
      beam.*member = bad;
      CHECK_THROWS_AS(check(beam), Error);
    }
  }
  MillingForce force({.diameter_mm = 8.0, .flutes = 2}, {.specific_n_per_mm2 = 700.0}, 2000.0);
  const std::vector<EngagedArc> deep{{-1.0, 0.0, 0.0, 41.0}};
  CHECK_THROWS_AS((void)force.peak_deflection_um(deep, 100.0, stepped), Error);
  CHECK_THROWS_AS((void)force.deflection_um(deep, 100.0, 0.0, 0.0, stepped), Error);
  CHECK_THROWS_AS((void)force.force_centre_mm(deep, 100.0, 0.0, 0.0), Error);
}
