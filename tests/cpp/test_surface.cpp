#include <doctest/doctest.h>

#include <algorithm>
#include <cmath>
#include <numbers>
#include <vector>

#include "shapegcode/error.hpp"
#include "shapegcode/milling/force.hpp"

using shapegcode::compliance_um_per_n;
using shapegcode::CuttingCoefficients;
using shapegcode::EndMill;
using shapegcode::EngagedArc;
using shapegcode::EngagementTrack;
using shapegcode::Error;
using shapegcode::MillingForce;
using shapegcode::SpindleSense;
using shapegcode::ToolBeam;
using shapegcode::wall_error_um;
using shapegcode::WallSide;

namespace {

constexpr double pi = std::numbers::pi;
using Arcs = std::vector<EngagedArc>;

const CuttingCoefficients steel{.specific_n_per_mm2 = 2000.0, .ratio = 0.4};
const ToolBeam beam{.overhang_mm = 35.0,
                    .fluted_length_mm = 35.0,
                    .effective_diameter_mm = 8.0,
                    .shank_diameter_mm = 10.0,
                    .young_modulus_gpa = 600.0};

}  // namespace

TEST_CASE("surface: one flute, one wall, in small steps along the flute") {
  const double lag = std::tan(0.6) / 5.0;
  const double to = -0.2;
  MillingForce force({.diameter_mm = 10.0, .flutes = 1, .helix_rad = 0.6}, steel, 2000.0);
  const std::vector<double> heights{0.0, 1.0, 4.0, 7.5, 9.9};
  const Eigen::VectorXd error =
      wall_error_um(force, beam, Arcs{{-pi / 2, to, 0.0, 10.0}}, 160.0, {WallSide::right, heights});
  for (std::size_t k = 0; k < heights.size(); ++k) {
    CAPTURE(heights[k]);
    // As the flute passes -pi/2 at this height, what is above it is still in the arc.
    double expected = 0.0;
    const int n = 4000;
    for (int i = 0; i < n; ++i) {
      const double z = 10.0 * (i + 0.5) / n;
      const double p = -pi / 2 + lag * (z - heights[k]);
      if (p < -pi / 2 || p > to) continue;
      const double across = 2000.0 * 0.08 * std::cos(p) * (std::cos(p) - 0.4 * std::sin(p)) * 10.0 / n;
      expected += across * compliance_um_per_n(beam, heights[k], z);
    }
    CHECK(error[static_cast<Eigen::Index>(k)] == doctest::Approx(expected).epsilon(1e-3));
    if (heights[k] < 9.0) CHECK(expected > 0.1);  // climb milling leaves material
  }
}

TEST_CASE("surface: only where the engagement reaches the wall") {
  MillingForce force({.diameter_mm = 10.0, .flutes = 4, .helix_rad = 0.6}, steel, 2000.0);
  const std::vector<double> heights{1.0, 6.0, 9.0};
  const Arcs arcs{{-pi / 2, -0.5, 0.0, 5.0}, {-pi / 2 + 0.1, -0.5, 5.0, 8.0}};
  const Eigen::VectorXd right = wall_error_um(force, beam, arcs, 640.0, {WallSide::right, heights});
  CHECK(std::isfinite(right[0]));
  CHECK(std::isnan(right[1]));
  CHECK(std::isnan(right[2]));
  CHECK(wall_error_um(force, beam, arcs, 640.0, {WallSide::right, heights, 0.11}).head(2).allFinite());
  CHECK(wall_error_um(force, beam, arcs, 640.0, {WallSide::left, heights}).array().isNaN().all());
}

TEST_CASE("surface: a counter-clockwise spindle is the mirror image") {
  const EndMill tool{.diameter_mm = 10.0, .flutes = 3, .helix_rad = 0.6, .runout_mm = {0.002, -0.004, 0.001}};
  MillingForce clockwise(tool, steel, 2000.0);
  MillingForce counter(tool, steel, 2000.0, SpindleSense::counter_clockwise);
  const std::vector<double> heights{0.5, 3.0, 7.0};
  const Eigen::VectorXd a =
      wall_error_um(clockwise, beam, Arcs{{-pi / 2, 0.3, 0.0, 8.0}}, 480.0, {WallSide::right, heights});
  const Eigen::VectorXd b =
      wall_error_um(counter, beam, Arcs{{-0.3, pi / 2, 0.0, 8.0}}, 480.0, {WallSide::left, heights});
  CHECK((a - b).cwiseAbs().maxCoeff() < 1e-9);
  const Eigen::VectorXd up =
      wall_error_um(clockwise, beam, Arcs{{-0.3, pi / 2, 0.0, 8.0}}, 480.0, {WallSide::left, heights});
  CHECK((a - up).cwiseAbs().maxCoeff() > 0.1);  // up milling is not the same as down milling
}

TEST_CASE("surface: of flutes with runout the longest makes the wall") {
  ToolBeam rigid = beam;
  rigid.young_modulus_gpa = 1e9;
  MillingForce force({.diameter_mm = 10.0, .flutes = 2, .helix_rad = 0.6, .runout_mm = {-0.003, 0.003}}, steel, 2000.0);
  const std::vector<double> heights{2.0};
  const Eigen::VectorXd error =
      wall_error_um(force, rigid, Arcs{{-pi / 2, 0.3, 0.0, 8.0}}, 480.0, {WallSide::right, heights});
  CHECK(error[0] == doctest::Approx(-3.0).epsilon(1e-3));
}

TEST_CASE("surface: along a track, and refusals") {
  MillingForce force({.diameter_mm = 10.0, .flutes = 4, .helix_rad = 0.6}, steel, 2000.0);
  EngagementTrack track;
  track.s_mm = {0.0, 1.0};
  track.horizontal = {1.0, 1.0};
  track.arcs = {{-pi / 2, -0.5, 0.0, 8.0}};
  track.first_arc = {0, 0, 1};
  const std::vector<double> feeds{640.0, 320.0};
  const std::vector<double> heights{1.0, 4.0};
  const Eigen::MatrixXd map = shapegcode::wall_errors_um(force, beam, track, feeds, {WallSide::right, heights});
  CHECK(map.rows() == 2);
  CHECK(map.cols() == 2);
  CHECK(map.row(0).array().isNaN().all());
  CHECK(map.row(1).transpose() == wall_error_um(force, beam, track.arcs, 320.0, {WallSide::right, heights}));
  CHECK_THROWS_AS(
      (void)shapegcode::wall_errors_um(force, beam, track, std::vector<double>{1.0}, {WallSide::right, heights}),
      Error);
  CHECK_THROWS_AS((void)wall_error_um(force, beam, track.arcs, 320.0, {WallSide::right, std::vector<double>{-1.0}}),
                  Error);
}
