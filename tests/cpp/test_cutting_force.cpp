#include <doctest/doctest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <random>
#include <vector>

#include "shapegcode/error.hpp"
#include "shapegcode/milling/force.hpp"

using shapegcode::ChipThickness;
using shapegcode::CuttingCoefficients;
using shapegcode::EndMill;
using shapegcode::EngagedArc;
using shapegcode::EngagementTrack;
using shapegcode::Error;
using shapegcode::ForceCurve;
using shapegcode::ForceFigures;
using shapegcode::MillingForce;
using shapegcode::SpindleSense;
using shapegcode::ToolBeam;

namespace {

constexpr double pi = std::numbers::pi;
constexpr double degree = pi / 180.0;
using Arcs = std::vector<EngagedArc>;

const CuttingCoefficients constant{.specific_n_per_mm2 = 700.0, .ratio = 0.3};
const CuttingCoefficients with_edges{
    .specific_n_per_mm2 = 700.0, .ratio = 0.3, .tangential_edge_n_per_mm = 12.0, .radial_edge_n_per_mm = 17.0};
const CuttingCoefficients aluminium{
    .specific_n_per_mm2 = 221.3, .specific_exponent = -0.153, .ratio = 0.41, .ratio_exponent = -0.0775};

CuttingCoefficients local(CuttingCoefficients c) {
  c.thickness = ChipThickness::local;
  return c;
}

// Altintas' mean forces (Manufacturing Automation, 2.3.3) for constant coefficients: his immersion angle counts from
// the left of the feed, clockwise; his frame and signs are the tool's.
Eigen::Vector2d altintas_mean(const CuttingCoefficients& k, int flutes, double depth, double feed_per_tooth,
                              double start, double exit) {
  const double tangential = k.specific_n_per_mm2;
  const double radial = k.ratio * k.specific_n_per_mm2;
  const auto x = [&](double p) {
    return feed_per_tooth / 4.0 * (tangential * std::cos(2 * p) - radial * (2 * p - std::sin(2 * p))) -
           k.tangential_edge_n_per_mm * std::sin(p) + k.radial_edge_n_per_mm * std::cos(p);
  };
  const auto y = [&](double p) {
    return feed_per_tooth / 4.0 * (tangential * (2 * p - std::sin(2 * p)) + radial * std::cos(2 * p)) -
           k.tangential_edge_n_per_mm * std::cos(p) - k.radial_edge_n_per_mm * std::sin(p);
  };
  return flutes * depth / (2 * pi) * Eigen::Vector2d(x(exit) - x(start), y(exit) - y(start));
}

// The same book's closed form for one flute of a helical end mill (2.3.4), its tip at immersion angle `tip`.
Eigen::Vector2d altintas_flute(const CuttingCoefficients& k, double lag, double depth, double feed_per_tooth,
                               double tip, double start, double exit) {
  const double tangential = k.specific_n_per_mm2;
  const double radial = k.ratio * k.specific_n_per_mm2;
  Eigen::Vector2d force = Eigen::Vector2d::Zero();
  for (int turn = -3; turn <= 3; ++turn) {
    const double bottom = std::min(tip + 2 * pi * turn, exit);
    const double top = std::max(tip + 2 * pi * turn - lag * depth, start);
    if (top >= bottom) continue;
    const auto at = [&](double p) {
      return Eigen::Vector2d(
          feed_per_tooth / (4 * lag) * (-tangential * std::cos(2 * p) + radial * (2 * p - std::sin(2 * p))) +
              (k.tangential_edge_n_per_mm * std::sin(p) - k.radial_edge_n_per_mm * std::cos(p)) / lag,
          -feed_per_tooth / (4 * lag) * (tangential * (2 * p - std::sin(2 * p)) + radial * std::cos(2 * p)) +
              (k.tangential_edge_n_per_mm * std::cos(p) + k.radial_edge_n_per_mm * std::sin(p)) / lag);
    };
    force += at(top) - at(bottom);
  }
  return force;
}

double apart(const Eigen::Vector2d& a, const Eigen::Vector2d& b) { return (a - b).norm(); }

}  // namespace

TEST_CASE("cutting force: means are Altintas' closed form, any immersion and helix") {
  for (const CuttingCoefficients& k : {constant, with_edges, local(with_edges)}) {
    for (const double helix : {0.0, 0.0001, 30.0, 60.0}) {
      for (const auto& [from_left, to_left] : {std::pair{0.0, 180.0},
                                               {0.0, 90.0},
                                               {90.0, 180.0},
                                               {0.0, 37.0},
                                               {141.0, 180.0},
                                               {20.0, 155.0},
                                               {80.0, 81.0}}) {
        const double start = from_left * degree;
        const double exit = to_left * degree;
        CAPTURE(helix);
        CAPTURE(start);
        CAPTURE(exit);
        MillingForce force({.diameter_mm = 10.0, .flutes = 3, .helix_rad = helix * degree}, k, 2000.0);
        const Arcs arcs{{pi / 2 - exit, pi / 2 - start, 0.0, 7.0}};
        const ForceFigures f = force.figures(arcs, 480.0);
        const Eigen::Vector2d expected = altintas_mean(k, 3, 7.0, 0.08, start, exit);
        CHECK(apart(f.mean_n, expected) < 1e-8 * expected.norm());
        const double length = 7.0 * (std::cos(start) - std::cos(exit));  // chip area per feed
        const double torque =
            3 / (2 * pi) * 5.0 *
            (k.specific_n_per_mm2 * 0.08 * length + k.tangential_edge_n_per_mm * 7.0 * (exit - start));
        CHECK(f.mean_torque_nm == doctest::Approx(torque * 1e-3).epsilon(1e-9));
        CHECK(f.mean_power_w == doctest::Approx(torque * 1e-3 * 2000.0 * 2 * pi / 60).epsilon(1e-9));
      }
    }
  }
}

TEST_CASE("cutting force: power over removal rate is the specific force") {
  for (const double helix : {0.0, 45.0}) {
    for (const std::vector<double>& runout : {std::vector<double>{}, {0.004, -0.003, 0.002, -0.003}}) {
      MillingForce force({.diameter_mm = 12.0, .flutes = 4, .helix_rad = helix * degree, .runout_mm = runout}, constant,
                         3000.0);
      const Arcs arcs{{-pi / 2, 0.3, 0.0, 4.0}, {-pi / 2, -0.4, 4.0, 9.0}};
      const double section = 6.0 * ((std::sin(0.3) + 1.0) * 4.0 + (std::sin(-0.4) + 1.0) * 5.0);
      const double removed_mm3_per_s = section * 900.0 / 60.0;
      // Between +-pi/2 all that the flutes ahead leave is cut by those behind, runout or not.
      CHECK(force.figures(arcs, 900.0).mean_power_w * 1e3 / removed_mm3_per_s ==
            doctest::Approx(700.0).epsilon(runout.empty() ? 1e-9 : 2e-5));
    }
  }
}

TEST_CASE("cutting force: every flute's curve is Altintas' closed form") {
  const double start = 35.0 * degree;
  const double exit = 170.0 * degree;
  for (const double helix : {5.0, 30.0, 72.0}) {  // the last winds more than once around
    CAPTURE(helix);
    const EndMill tool{.diameter_mm = 10.0, .flutes = 4, .helix_rad = helix * degree};
    const double lag = std::tan(helix * degree) / 5.0;
    MillingForce force(tool, with_edges, 2000.0);
    const ForceCurve curve = force.curve(Arcs{{pi / 2 - exit, pi / 2 - start, 0.0, 11.0}}, 800.0, 90);
    for (int i = 0; i < 90; ++i) {
      Eigen::Vector2d sum = Eigen::Vector2d::Zero();
      for (int flute = 0; flute < 4; ++flute) {
        // Immersion of the tip: straight ahead is 90 degrees, and it grows as a clockwise spindle turns.
        const double tip = std::remainder(pi / 2 + curve.turned_rad[i] - flute * pi / 2, 2 * pi);
        const Eigen::Vector2d expected = altintas_flute(with_edges, lag, 11.0, 0.1, tip, start, exit);
        const Eigen::Vector2d found = curve.flute_n[static_cast<std::size_t>(flute)].row(i).transpose();
        CHECK(apart(found, expected) < 1e-6);
        sum += found;
      }
      CHECK(apart(curve.force_n.row(i).transpose(), sum) < 1e-9);
    }
  }
}

TEST_CASE("cutting force: power laws of the local chip against quadrature") {
  const double q1 = 1.0 - 0.153;
  const double q2 = q1 - 0.0775;
  for (const auto& [from, to] : {std::pair{-pi / 2, -0.9}, {-pi / 2, pi / 2}, {-0.2, 1.5}}) {
    MillingForce force({.diameter_mm = 8.0, .flutes = 6, .helix_rad = 50 * degree}, local(aluminium), 1800.0);
    const ForceFigures f = force.figures(Arcs{{from, to, 0.0, 15.0}}, 216.0);
    Eigen::Vector2d sum = Eigen::Vector2d::Zero();
    double torque = 0.0;
    const int n = 200000;
    for (int i = 0; i < n; ++i) {
      const double p = from + (to - from) * (i + 0.5) / n;
      const double t = 0.02 * std::cos(p);
      const double along = 221.3 * std::pow(t, q1);
      const double across = 221.3 * 0.41 * std::pow(t, q2);
      sum += Eigen::Vector2d(-along * std::sin(p) - across * std::cos(p), along * std::cos(p) - across * std::sin(p));
      torque += along;
    }
    const double weight = (to - from) / n * 6 * 15.0 / (2 * pi);
    CHECK(apart(f.mean_n, sum * weight) < 1e-7 * f.mean_n.norm());
    CHECK(f.mean_torque_nm == doctest::Approx(torque * weight * 4e-3).epsilon(1e-7));
  }
}

TEST_CASE("cutting force: climb milling pushes the tool off its wall and along the feed") {
  MillingForce force({.diameter_mm = 10.0, .flutes = 2}, constant, 2000.0);
  const ForceFigures down = force.figures(Arcs{{-pi / 2, -1.0, 0.0, 5.0}}, 400.0);
  CHECK(down.mean_n.x() > 0.0);
  CHECK(down.mean_n.y() > 0.0);
  const ForceFigures up = force.figures(Arcs{{1.0, pi / 2, 0.0, 5.0}}, 400.0);
  CHECK(up.mean_n.x() < 0.0);
  // In a slot the tool is bent towards the side where the teeth enter.
  CHECK(force.figures(Arcs{{-pi / 2, pi / 2, 0.0, 5.0}}, 400.0).mean_n.y() > 0.0);
}

TEST_CASE("cutting force: a counter-clockwise spindle is the mirror image") {
  const EndMill tool{.diameter_mm = 8.0, .flutes = 3, .helix_rad = 40 * degree, .runout_mm = {0.004, -0.006, 0.002}};
  for (const CuttingCoefficients& k : {aluminium, local(aluminium), local(with_edges)}) {
    MillingForce clockwise(tool, k, 1800.0);
    MillingForce counter(tool, k, 1800.0, SpindleSense::counter_clockwise);
    const Arcs arcs{{-1.5, -0.4, 0.0, 6.0}, {-1.4, 0.7, 6.0, 9.0}};
    const Arcs mirrored{{0.4, 1.5, 0.0, 6.0}, {-0.7, 1.4, 6.0, 9.0}};
    const ForceFigures a = clockwise.figures(arcs, 216.0);
    const ForceFigures b = counter.figures(mirrored, 216.0);
    CHECK(b.mean_n.x() == doctest::Approx(a.mean_n.x()).epsilon(1e-12));
    CHECK(b.mean_n.y() == doctest::Approx(-a.mean_n.y()).epsilon(1e-12));
    CHECK(b.peak_resultant_n == doctest::Approx(a.peak_resultant_n).epsilon(1e-12));
    CHECK(b.mean_torque_nm == doctest::Approx(a.mean_torque_nm).epsilon(1e-12));
    const ForceCurve p = clockwise.curve(arcs, 216.0, 30);
    const ForceCurve q = counter.curve(mirrored, 216.0, 30);
    CHECK((p.force_n.col(0) - q.force_n.col(0)).cwiseAbs().maxCoeff() < 1e-9);
    CHECK((p.force_n.col(1) + q.force_n.col(1)).cwiseAbs().maxCoeff() < 1e-9);
    CHECK((p.torque_nm - q.torque_nm).cwiseAbs().maxCoeff() < 1e-12);
  }
}

TEST_CASE("cutting force: figures against a finely sampled revolution, at random") {
  std::mt19937 random(20);
  const auto draw = [&](double low, double high) { return std::uniform_real_distribution<double>(low, high)(random); };
  double worst_peak = 0.0;
  double worst_mean = 0.0;
  double worst_torque = 0.0;
  double worst_flute = 0.0;
  for (int run = 0; run < 150; ++run) {
    CAPTURE(run);
    EndMill tool{.diameter_mm = 10.0, .flutes = 1 + run % 6, .helix_rad = run % 5 == 0 ? 0.0 : draw(2, 60) * degree};
    if (run % 3 == 0) {
      for (int i = 0; i < tool.flutes; ++i) tool.runout_mm.push_back(draw(-0.01, 0.01));
    }
    CuttingCoefficients k = run % 2 == 0 ? aluminium : local(aluminium);
    if (run % 4 == 0) k.tangential_edge_n_per_mm = k.radial_edge_n_per_mm = 4.0;
    Arcs arcs;
    double z = 0.0;
    for (int i = 0; i < 1 + run % 3; ++i) {
      const double from = run % 4 == 1 ? -pi / 2 : draw(-pi / 2, 1.2);
      const double top = z + draw(0.2, 8.0);
      arcs.push_back({from, std::min(pi / 2, from + draw(0.1, 3.0)), z, top});
      z = top;
    }
    MillingForce force(tool, k, 1500.0);
    const double feed = draw(40.0, 900.0);
    const ForceFigures f = force.figures(arcs, feed);
    // Forces jump or kink where arcs begin and end, and the samples of a curve miss the top by up to a step.
    const ForceCurve curve = force.curve(arcs, feed, tool.helix_rad > 0.0 ? 14400 : 57600);
    const Eigen::VectorXd magnitude = curve.force_n.rowwise().norm();
    worst_peak = std::max(worst_peak, std::abs(f.peak_resultant_n / magnitude.maxCoeff() - 1.0));
    worst_mean = std::max(worst_mean, std::abs(f.mean_resultant_n / magnitude.mean() - 1.0));
    worst_torque = std::max(worst_torque, std::abs(f.peak_torque_nm / curve.torque_nm.maxCoeff() - 1.0));
    double flute = 0.0;
    for (const auto& one : curve.flute_n) flute = std::max(flute, one.rowwise().norm().maxCoeff());
    worst_flute = std::max(worst_flute, std::abs(f.peak_flute_n / flute - 1.0));
    CHECK(apart(curve.force_n.colwise().mean(), f.mean_n) < 1e-3 * f.peak_resultant_n);
  }
  CHECK(worst_peak < 1e-3);
  CHECK(worst_torque < 1e-3);
  CHECK(worst_flute < 1e-3);
  CHECK(worst_mean < 1e-3);
}

TEST_CASE("cutting force: a flute cannot cut what the ones ahead have taken") {
  // Two flutes, one 0.05 mm shorter at 0.04 mm per tooth: it is out of work, the other takes two feeds per tooth.
  MillingForce both({.diameter_mm = 10.0, .flutes = 2, .runout_mm = {0.025, -0.025}}, constant, 1000.0);
  MillingForce one({.diameter_mm = 10.0, .flutes = 1}, constant, 1000.0);
  const Arcs arcs{{-1.2, 1.2, 0.0, 5.0}};
  const ForceFigures a = both.figures(arcs, 80.0);
  const ForceFigures b = one.figures(arcs, 80.0);
  CHECK(a.peak_chip_mm == doctest::Approx(0.08).epsilon(1e-12));
  CHECK(a.peak_resultant_n == doctest::Approx(b.peak_resultant_n).epsilon(1e-9));
  CHECK(a.mean_resultant_n == doctest::Approx(b.mean_resultant_n).epsilon(1e-6));
  // At 0.08 mm per tooth both cut, where the chip is thick enough.
  CHECK(both.figures(arcs, 160.0).peak_chip_mm == doctest::Approx(0.13).epsilon(1e-12));
  // Equal values are no runout.
  MillingForce equal({.diameter_mm = 10.0, .flutes = 2, .runout_mm = {0.01, 0.01}}, constant, 1000.0);
  CHECK(equal.figures(arcs, 80.0).peak_chip_mm == doctest::Approx(0.04).epsilon(1e-12));
}

TEST_CASE("cutting force: paper 001, from the entry of the corner to its deepest point") {
  MillingForce force({.diameter_mm = 8.0, .flutes = 6, .helix_rad = 50 * degree}, aluminium, 1800.0);
  const Arcs entry{{-pi / 2, std::asin(0.8 / 4.0 - 1.0), 0.0, 15.0}};
  const Arcs deepest{{-pi / 2, std::asin(2.103 / 4.0 - 1.0), 0.0, 15.0}};
  const ForceFigures at_entry = force.figures(entry, 216.0);
  const ForceFigures at_deepest = force.figures(deepest, 216.0);
  // Eq. 7 with the mean of the magnitude; the magnitude of the mean gives the same.
  const double feed = 216.0 * at_entry.mean_resultant_n / at_deepest.mean_resultant_n;
  CHECK(feed == doctest::Approx(90.8).epsilon(1e-3));
  CHECK(216.0 * at_entry.mean_n.norm() / at_deepest.mean_n.norm() == doctest::Approx(feed).epsilon(1e-3));
  // One step of it leaves the mean 16 % and the peak 10 % above the target.
  const ForceFigures after = force.figures(deepest, feed);
  CHECK(after.mean_resultant_n / at_entry.mean_resultant_n == doctest::Approx(1.16).epsilon(5e-3));
  CHECK(after.peak_resultant_n / at_entry.peak_resultant_n == doctest::Approx(1.10).epsilon(5e-3));
}

TEST_CASE("cutting force: what is kept between calls does not show") {
  MillingForce kept({.diameter_mm = 8.0, .flutes = 2, .helix_rad = 0.5, .runout_mm = {0.003, -0.003}}, local(aluminium),
                    1800.0);
  const Arcs wide{{-pi / 2, 0.4, 0.0, 6.0}};
  const Arcs thin{{-pi / 2, -1.0, 0.0, 6.0}};
  for (const auto& [arcs, feed] : {std::pair{wide, 100.0},
                                   {wide, 300.0},
                                   {thin, 300.0},
                                   {thin, 0.0},
                                   {thin, 300.0},
                                   {Arcs{}, 300.0},
                                   {wide, 300.0},
                                   {wide, 100.0}}) {
    MillingForce fresh(kept.tool(), kept.coefficients(), 1800.0);
    const ForceFigures a = kept.figures(arcs, feed);
    const ForceFigures b = fresh.figures(arcs, feed);
    CHECK(a.mean_n == b.mean_n);
    CHECK(a.peak_resultant_n == b.peak_resultant_n);
    CHECK(a.peak_flute_n == b.peak_flute_n);
    CHECK(a.mean_resultant_n == kept.quick_figures(arcs, feed).mean_resultant_n);
  }
}

TEST_CASE("cutting force: nothing met, no feed, and a whole track") {
  MillingForce force({.diameter_mm = 8.0, .flutes = 2, .helix_rad = 0.5}, with_edges, 1800.0);
  for (const ForceFigures& f : {force.figures({}, 100.0), force.figures(Arcs{{-1.0, 0.5, 0.0, 5.0}}, 0.0),
                                force.figures(Arcs{{0.5, 0.5, 0.0, 5.0}, {0.1, 0.5, 5.0, 5.0}}, 100.0)}) {
    CHECK(f.mean_n.norm() == 0.0);
    CHECK(f.peak_resultant_n == 0.0);
    CHECK(f.mean_power_w == 0.0);
    CHECK(f.peak_chip_mm == 0.0);
  }
  EngagementTrack track;
  track.s_mm = {0.0, 1.0, 2.0};
  track.horizontal = {1.0, 1.0, 0.8};
  track.arcs = {{-1.0, 0.5, 0.0, 5.0}, {-1.0, 0.5, 0.0, 3.0}, {-1.0, 0.7, 3.0, 5.0}};
  track.first_arc = {0, 1, 1, 3};
  const std::vector<double> feeds{100.0, 200.0, 300.0};
  const Eigen::MatrixXd table = shapegcode::figures_of(force, track, feeds);
  const ForceFigures last = force.figures(track.arcs_of(2), 240.0);
  CHECK(table.rows() == 3);
  CHECK(table.cols() == shapegcode::force_columns);
  CHECK(table.row(1).isZero(0.0));
  CHECK(table(2, 0) == last.mean_n.x());
  CHECK(table(2, 1) == last.mean_n.y());
  CHECK(table(2, 2) == last.mean_resultant_n);
  CHECK(table(2, 3) == last.peak_resultant_n);
  CHECK(table(2, 4) == last.peak_torque_nm);
  CHECK(table(2, 5) == last.mean_torque_nm);
  CHECK(table(2, 6) == last.mean_power_w);
  CHECK(table(2, 7) == last.peak_chip_mm);
  CHECK(table(2, 8) == 0.0);
  const shapegcode::ToolBeam beam{.overhang_mm = 30.0,
                                  .fluted_length_mm = 20.0,
                                  .effective_diameter_mm = 6.4,
                                  .shank_diameter_mm = 8.0,
                                  .young_modulus_gpa = 600.0};
  CHECK(shapegcode::figures_of(force, track, feeds, &beam)(2, 8) ==
        force.peak_deflection_um(track.arcs_of(2), 240.0, beam));
  CHECK_THROWS_AS((void)shapegcode::figures_of(force, track, std::vector<double>{1.0}), Error);
}

TEST_CASE("cutting force: layers that meet the tool alike are one") {
  for (const double helix : {0.0, 0.6}) {
    MillingForce force({.diameter_mm = 8.0, .flutes = 3, .helix_rad = helix}, local(aluminium), 1800.0);
    const Arcs one{{-1.2, -0.1, 0.0, 6.0}, {0.4, 0.9, 1.0, 6.0}};
    Arcs layers;
    for (int i = 0; i < 6; ++i) {
      layers.push_back({-1.2, -0.1, 1.0 * i, 1.0 * i + 1.0});
      if (i > 0) layers.push_back({0.4, 0.9, 1.0 * i, 1.0 * i + 1.0});
    }
    Arcs apart_by_a_little = layers;  // as a coarse model would have them: each for itself, and nearly the same
    for (std::size_t i = 0; i < apart_by_a_little.size(); ++i) {
      apart_by_a_little[i].to_rad += 1e-7 * static_cast<double>(i);
    }
    const ForceFigures a = force.figures(one, 300.0);
    for (const Arcs& arcs : {layers, apart_by_a_little}) {
      const ForceFigures b = force.figures(arcs, 300.0);
      CHECK(b.peak_resultant_n == doctest::Approx(a.peak_resultant_n).epsilon(1e-5));
      CHECK(b.mean_resultant_n == doctest::Approx(a.mean_resultant_n).epsilon(1e-4));
      CHECK(b.mean_torque_nm == doctest::Approx(a.mean_torque_nm).epsilon(1e-5));
    }
  }
}

TEST_CASE("cutting force: frame of the machine") {
  const Eigen::Vector2d turned = shapegcode::machine_frame({3.0, 1.0}, pi / 2);  // feed along +Y
  CHECK(turned.x() == doctest::Approx(-1.0));
  CHECK(turned.y() == doctest::Approx(3.0));
}

TEST_CASE("cutting force: refusals") {
  const EndMill tool{.diameter_mm = 8.0, .flutes = 2};
  const double nan = std::numeric_limits<double>::quiet_NaN();
  CHECK_THROWS_AS(MillingForce(tool, constant, 0.0), Error);
  CHECK_THROWS_AS(MillingForce(tool, constant, nan), Error);
  CHECK_THROWS_AS(MillingForce({.diameter_mm = 0.0, .flutes = 2}, constant, 1000.0), Error);
  CHECK_THROWS_AS(check(CuttingCoefficients{.specific_n_per_mm2 = -1.0}), Error);
  CHECK_THROWS_AS(check(CuttingCoefficients{.specific_n_per_mm2 = nan}), Error);
  CHECK_THROWS_AS(check(CuttingCoefficients{.specific_n_per_mm2 = 1.0, .radial_edge_n_per_mm = -1.0}), Error);
  CHECK_THROWS_AS(check(CuttingCoefficients{.specific_n_per_mm2 = 1.0, .specific_exponent = -1.0}), Error);
  CHECK_THROWS_AS(
      check(CuttingCoefficients{.specific_n_per_mm2 = 1.0, .specific_exponent = -0.5, .ratio_exponent = -0.6}), Error);
  MillingForce force(tool, constant, 1000.0);
  const Arcs good{{-1.0, 0.5, 0.0, 5.0}};
  CHECK_THROWS_AS((void)force.figures(good, -1.0), Error);
  CHECK_THROWS_AS((void)force.figures(good, nan), Error);
  CHECK_THROWS_AS((void)force.curve(good, 100.0, 0), Error);
  for (const EngagedArc& bad :
       {EngagedArc{-2.0, 0.5, 0.0, 5.0}, EngagedArc{0.5, -1.0, 0.0, 5.0}, EngagedArc{-1.0, 2.0, 0.0, 5.0},
        EngagedArc{-1.0, 0.5, -1.0, 5.0}, EngagedArc{-1.0, 0.5, 5.0, 4.0}, EngagedArc{nan, 0.5, 0.0, 5.0}}) {
    CHECK_THROWS_AS((void)force.figures(Arcs{bad}, 100.0), Error);
    CHECK_THROWS_AS((void)force.figures(Arcs{good[0], bad}, 100.0), Error);
    CHECK(force.figures({}, 100.0).peak_resultant_n == 0.0);
  }
  // Azimuths that no integer can count, and more flutes than a spindle's turn can hold.
  const ToolBeam beam{.overhang_mm = 40.0,
                      .fluted_length_mm = 20.0,
                      .effective_diameter_mm = 6.0,
                      .shank_diameter_mm = 8.0,
                      .young_modulus_gpa = 600.0};
  for (const double turned : {nan, 1e300}) {
    CHECK_THROWS_AS((void)force.deflection_um(good, 100.0, turned, 1.0, beam), Error);
    CHECK_THROWS_AS((void)force.force_centre_mm(good, 100.0, turned, 40.0), Error);
  }
  CHECK_THROWS_AS((void)force.deflection_um(good, 100.0, 0.0, nan, beam), Error);
  MillingForce wound({.diameter_mm = 8.0, .flutes = 2, .helix_rad = 0.8}, constant, 1000.0);
  CHECK_THROWS_AS((void)wound.figures(Arcs{{-1.0, 0.5, 0.0, 1e12}}, 100.0), Error);
  CHECK_THROWS_AS((void)wound.curve(Arcs{{-1.0, 0.5, 0.0, 1e12}}, 100.0, 4), Error);
  CHECK_THROWS_AS(check(EndMill{.diameter_mm = 8.0, .flutes = 2'000'000'000}), Error);
  CHECK(force.figures(good, 100.0).peak_resultant_n > 0.0);  // a refusal leaves nothing behind
}
