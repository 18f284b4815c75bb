#include <doctest/doctest.h>

#include <algorithm>
#include <cmath>
#include <numbers>
#include <stdexcept>
#include <string>
#include <vector>

#include "shapegcode/error.hpp"
#include "shapegcode/milling/material.hpp"

using Eigen::Vector2d;
using shapegcode::EngagementTrack;
using shapegcode::Error;
using shapegcode::layer_borders;
using shapegcode::make_arc;
using shapegcode::make_line;
using shapegcode::Material;
using shapegcode::Path;
using shapegcode::Ring;
using shapegcode::Segment;
using shapegcode::sweep;
using shapegcode::SweepOptions;
using shapegcode::Vector3;

namespace {

constexpr double pi = std::numbers::pi;
constexpr double degree = pi / 180.0;
constexpr double diameter = 8.0;
constexpr double radius = 4.0;
const std::vector<double> one_layer = {-5.0, 0.0};

Ring box(double x0, double y0, double x1, double y1) { return {{x0, y0}, {x1, y0}, {x1, y1}, {x0, y1}}; }

Ring circle(double r) {
  constexpr int points = 1500;  // off by less than 0.03 um at 10 mm
  Ring ring;
  for (int k = 0; k < points; ++k)
    ring.emplace_back(r * std::cos(2.0 * pi * k / points), r * std::sin(2.0 * pi * k / points));
  return ring;
}

Material block(std::vector<Ring> rings, std::vector<double> borders = one_layer, double resolution = 0.08) {
  return Material(rings, borders, resolution);
}

/// Once around the origin, counter-clockwise, from +X.
Path orbit(double path_radius, double z = -5.0, double sweep_rad = 2.0 * pi) {
  const Vector3 start(path_radius, 0.0, z);
  const Vector3 end(path_radius * std::cos(sweep_rad), path_radius * std::sin(sweep_rad), z);
  return Path({make_arc(start, end, {0.0, 0.0, z}, sweep_rad, 2, 10.0)});
}

/// Largest errors of the azimuths against expected ones, over samples whose s lies within limits; each must have one
/// arc.
double worst_azimuth(const EngagementTrack& track, double from_mm, double to_mm, double from_rad, double to_rad) {
  double worst = 0.0;
  int compared = 0;
  for (std::size_t i = 0; i < track.size(); ++i) {
    if (track.s_mm[i] < from_mm || track.s_mm[i] > to_mm) continue;
    REQUIRE(track.arcs_of(i).size() == 1);
    worst = std::max(
        {worst, std::abs(track.arcs_of(i)[0].from_rad - from_rad), std::abs(track.arcs_of(i)[0].to_rad - to_rad)});
    ++compared;
  }
  CHECK(compared > 10);
  return worst;
}

double most(const std::vector<double>& values) { return *std::max_element(values.begin(), values.end()); }

double removed_by(const EngagementTrack& track) {
  double volume = 0.0;
  for (std::size_t i = 0; i < track.size(); ++i) {
    volume += track.section_mm2[i] * (track.s_mm[i] - (i > 0 ? track.s_mm[i - 1] : 0.0));
  }
  return volume;
}

}  // namespace

TEST_CASE("slot: exactly the front half, in every direction") {
  for (double heading = 0.0; heading < 6.3; heading += 0.37) {
    Material material = block({box(-25, -25, 25, 25)});
    const Vector3 along(std::cos(heading), std::sin(heading), 0.0);
    const Vector3 start = Vector3(0.3, 0.1, -5.0) - 18.0 * along;
    const EngagementTrack track = sweep(material, Path({make_line(start, start + 30.0 * along, 10.0)}), diameter);
    CHECK(worst_azimuth(track, 1e-9, 30.0, -0.5 * pi, 0.5 * pi) == 0.0);
    for (std::size_t i = 0; i < track.size(); ++i) {
      CHECK(track.radial_depth_mm[i] == doctest::Approx(diameter).epsilon(1e-12));
      CHECK(track.section_mm2[i] == doctest::Approx(5.0 * diameter).epsilon(1e-12));
      CHECK(track.direction_rad[i] == doctest::Approx(std::remainder(heading, 2.0 * pi)));
      CHECK(track.horizontal[i] == 1.0);
    }
    CHECK(track.s_mm.back() == doctest::Approx(30.0).epsilon(1e-12));
  }
}

TEST_CASE("wall milling: from the wall to acos(1 - ae / R), on either side") {
  for (const double depth : {0.01, 0.1, 0.8, 2.0, 4.0, 6.0, 7.9}) {
    const double turn = std::acos(1.0 - depth / radius);
    for (const bool wall_right : {true, false}) {
      for (const double resolution : {0.08, 0.02}) {
        Material material = block({box(0, -20, 40, 0)}, one_layer, resolution);
        // Going +X with the material to the right, or back with the material to the left.
        const double y = radius - depth;
        const double x0 = wall_right ? 5.0 : 35.0;
        const double x1 = wall_right ? 35.0 : 5.0;
        const EngagementTrack track = sweep(material, Path({make_line({x0, y, -5}, {x1, y, -5}, 10.0)}), diameter);
        const double from = wall_right ? -0.5 * pi : 0.5 * pi - turn;
        const double to = wall_right ? -0.5 * pi + turn : 0.5 * pi;
        CAPTURE(depth);
        CHECK(worst_azimuth(track, 0.0, 30.0, from, to) < 1e-5);
        for (const double width : track.radial_depth_mm) CHECK(width == doctest::Approx(depth).epsilon(1e-4));
      }
    }
  }
}

TEST_CASE("circle inside circle: a tool orbits in a bore") {
  // Where circles about the origin and about the tool cross: law of cosines.
  for (const double bore : {9.0, 6.0}) {
    for (const double path_radius : {bore - radius + 0.5, bore - radius + 2.0}) {
      for (const double resolution : {0.08, 0.02}) {
        const Ring around = box(-12, -12, 12, 12);
        Material material = block({around, circle(bore)}, one_layer, resolution);
        const Path path = orbit(path_radius);
        const EngagementTrack track = sweep(material, path, diameter);
        const double cosine =
            (bore * bore - path_radius * path_radius - radius * radius) / (2.0 * path_radius * radius);
        const double to = std::acos(cosine) - 0.5 * pi;
        CAPTURE(bore);
        CAPTURE(path_radius);
        CHECK(worst_azimuth(track, 0.3 * path.length_mm(), 0.7 * path.length_mm(), -0.5 * pi, to) < 0.02 * degree);
        // A second time round there is nothing left.
        CHECK(most(sweep(material, path, diameter).radial_depth_mm) == 0.0);
      }
    }
  }
}

TEST_CASE("outside of a disc, and an arc in the full") {
  for (const double stock : {5.0, 15.0}) {
    for (const double depth : {0.2, 1.0, 5.0}) {
      Material material = block({circle(stock)});
      const double path_radius = stock - depth + radius;
      const Path path = orbit(path_radius);
      const EngagementTrack track = sweep(material, path, diameter);
      const double cosine =
          (stock * stock - path_radius * path_radius - radius * radius) / (2.0 * path_radius * radius);
      const double from = std::acos(cosine) - 0.5 * pi;
      if (depth < stock) {
        CHECK(worst_azimuth(track, 0.3 * path.length_mm(), 0.7 * path.length_mm(), from, 0.5 * pi) < 0.02 * degree);
      }
      CHECK(most(sweep(material, path, diameter).radial_depth_mm) == 0.0);
    }
  }
  for (const double path_radius : {4.5, 10.0, 200.0}) {
    Material material = block({box(path_radius - 30, -20, path_radius + 30, 40)});
    const EngagementTrack track = sweep(material, orbit(path_radius, -5.0, std::min(pi, 10.0 / path_radius)), diameter);
    CHECK(worst_azimuth(track, 0.0, 100.0, -0.5 * pi, 0.5 * pi) == 0.0);
  }
}

TEST_CASE("a pass along finished walls is an air cut, also at vertices and on arcs") {
  const std::vector<Segment> moves = {make_line({-30, 3.33, -5}, {0, 3.33, -5}, 10),
                                      make_line({0, 3.33, -5}, {7, 20.1, -5}, 10),
                                      make_line({7, 20.1, -5}, {-10, 25, -5}, 10),
                                      make_arc({-10, 25, -5}, {-14, 21, -5}, {-10, 21, -5}, 0.5 * pi, 2, 10),
                                      make_line({-14, 21, -5}, {-14.0, 12.0, -5}, 10),
                                      make_arc({-14, 12, -5}, {-24, 12, -5}, {-19, 12, -5}, -pi, 2, 10),
                                      make_line({-24, 12, -5}, {-24.0, 30.0, -5}, 10)};
  for (const double resolution : {0.2, 0.08, 0.03}) {
    Material material = block({box(-40, -20, 30, 40)}, one_layer, resolution);
    const Path path(moves);
    CHECK(most(sweep(material, path, diameter).radial_depth_mm) == doctest::Approx(diameter));
    SweepOptions fine;
    fine.step_mm = 0.05;
    CHECK(most(sweep(material, path, diameter, fine).radial_depth_mm) == 0.0);
    std::vector<Segment> back;
    for (auto move = moves.rbegin(); move != moves.rend(); ++move) {
      back.push_back(move->kind == shapegcode::SegmentKind::arc
                         ? make_arc(move->end_mm, move->start_mm, move->centre_mm, -move->sweep_rad, 2, 10)
                         : make_line(move->end_mm, move->start_mm, 10));
    }
    CHECK(most(sweep(material, Path(back), diameter).radial_depth_mm) == 0.0);
  }
}

TEST_CASE("behind a vertex the state is true from the first sample on") {
  Material material = block({box(-40, -40, 40, 40)});
  const EngagementTrack track = sweep(
      material, Path({make_line({-20, 0, -5}, {0, 0, -5}, 10), make_line({0, 0, -5}, {0, 20, -5}, 10)}), diameter);
  int compared = 0;
  for (std::size_t i = 0; i < track.size(); ++i) {
    if (track.segment[i] != 1) continue;
    // To the left all up to the slot's edge, y = R, has gone: R cos(azimuth) + y of the axis = R.
    const double y = track.s_mm[i] - 20.0;
    const double to = y < radius ? std::acos(1.0 - y / radius) : 0.5 * pi;
    REQUIRE(track.arcs_of(i).size() == 1);
    CHECK(track.arcs_of(i)[0].from_rad == -0.5 * pi);
    CHECK(track.arcs_of(i)[0].to_rad == doctest::Approx(to).epsilon(1e-3));
    ++compared;
  }
  CHECK(compared > 100);
  CHECK(track.s_mm[static_cast<std::size_t>(std::find(track.segment.begin(), track.segment.end(), 1U) -
                                            track.segment.begin())] < 20.0 + 0.02);
}

TEST_CASE("layers: heights, arcs shared by layers, and what a level leaves to the next") {
  const std::vector<double> borders = {-9.0, -6.0, -4.0, 0.0};
  Material material = block({box(0, -20, 40, 20)}, borders);
  // 1 mm deep into the wall at -4, then 3 mm at -6: the upper layer has 2 mm left, the lower one 3 mm.
  (void)sweep(material, Path({make_line({-9, 23, -4}, {49, 23, -4}, 10)}), diameter);
  const EngagementTrack track = sweep(material, Path({make_line({-9, 21, -6}, {49, 21, -6}, 10)}), diameter);
  const std::size_t middle = track.size() / 2;
  REQUIRE(track.arcs_of(middle).size() == 2);
  const auto& lower = track.arcs_of(middle)[0];
  const auto& upper = track.arcs_of(middle)[1];
  CHECK(lower.bottom_mm == 0.0);
  CHECK(lower.top_mm == 2.0);
  CHECK(upper.bottom_mm == 2.0);
  CHECK(upper.top_mm == 6.0);
  CHECK(radius * (1.0 + std::sin(lower.to_rad)) == doctest::Approx(3.0).epsilon(1e-4));
  CHECK(radius * (1.0 + std::sin(upper.to_rad)) == doctest::Approx(2.0).epsilon(1e-4));
  CHECK(track.radial_depth_mm[middle] == doctest::Approx(3.0).epsilon(1e-4));
  CHECK(track.section_mm2[middle] == doctest::Approx(3.0 * 2.0 + 2.0 * 4.0).epsilon(1e-3));
  // In one go through all layers there is one arc.
  const EngagementTrack slot = sweep(material, Path({make_line({-9, 0, -9}, {49, 0, -9}, 10)}), diameter);
  REQUIRE(slot.arcs_of(slot.size() / 2).size() == 1);
  CHECK(slot.arcs_of(slot.size() / 2)[0].bottom_mm == 0.0);
  CHECK(slot.arcs_of(slot.size() / 2)[0].top_mm == 9.0);
  // Above everything, or beside it, nothing is met.
  CHECK(most(sweep(material, Path({make_line({-9, -10, 0.5}, {49, -10, 0.5}, 10)}), diameter).section_mm2) == 0.0);
  CHECK(most(sweep(material, Path({make_line({-9, 60, -6}, {49, 60, -6}, 10)}), diameter).section_mm2) == 0.0);
}

TEST_CASE("a tool that comes down to the material, but not into it, does not plunge") {
  Material material = block({box(-20, -20, 20, 20)}, {-20.0, -8.0, -4.0, 0.0});
  CHECK(most(sweep(material, Path({make_line({0, 0, 5}, {0, 0, 0}, 10)}), diameter).plunged_mm2) == 0.0);
  (void)sweep(material, Path({make_line({0, 0, 0}, {0, 0, -8}, 10)}), diameter);
  const EngagementTrack again = sweep(material, Path({make_line({0, 0, 2}, {0, 0, -8}, 10)}), diameter);
  CHECK(most(again.plunged_mm2) == 0.0);
  CHECK(most(again.section_mm2) == 0.0);
}

TEST_CASE("a material from which whole layers are taken keeps what a ramp may have left") {
  const Path ramp({make_line({-12, 0, 0}, {12, 0, -4}, 10)});
  const Path level({make_line({12, 0, -4}, {-12, 0, -4}, 10)});
  const std::vector<const Path*> paths = {&ramp, &level};
  Material material = block({box(-20, -20, 20, 20)}, layer_borders(paths, -6.0, 0.0, 1.0));
  Material cautious = material;
  cautious.take_whole_layers();
  (void)sweep(material, ramp, diameter);
  (void)sweep(cautious, ramp, diameter);
  CHECK(cautious.volume_mm3() > material.volume_mm3());
  for (double x = -12.0; x <= 12.0; x += 0.5) {
    // The tool's end is nowhere lower than the ramp under its rear: there is material below it.
    const double end_mm = -4.0 * (std::min(x + radius, 12.0) + 12.0) / 24.0;
    CHECK(cautious.is_material(x, 0.0, end_mm - 0.01));
  }
  (void)sweep(material, level, diameter);
  (void)sweep(cautious, level, diameter);
  CHECK(cautious.volume_mm3() == doctest::Approx(material.volume_mm3()).epsilon(1e-9));
}

TEST_CASE("plunges and ramps: what is removed is what the track tells") {
  {
    Material material = block({box(-20, -20, 20, 20)}, {-8.0, -5.0, 0.0});
    const Path path({make_line({0, 0, 2}, {0, 0, -5}, 10)});
    const EngagementTrack track = sweep(material, path, diameter);
    CHECK(material.is_material(0, 0, -6));
    CHECK_FALSE(material.is_material(0, 0, -1));
    CHECK(most(track.radial_depth_mm) == 0.0);
    CHECK(track.arcs.empty());
    CHECK(most(track.plunged_mm2) == doctest::Approx(pi * 16.0).epsilon(1e-3));
    CHECK(track.horizontal[3] == 0.0);
    CHECK(track.direction_rad[3] == 0.0);
    // On the edge of the block half of the tool finds material.
    const EngagementTrack edge = sweep(material, Path({make_line({20, 10, 2}, {20, 10, -5}, 10)}), diameter);
    CHECK(most(edge.plunged_mm2) == doctest::Approx(pi * 8.0).epsilon(1e-3));
  }
  const Path ramp({make_line({-12, 0, 0}, {12, 0, -4}, 10), make_line({12, 0, -4}, {-12, 0, -4}, 10)});
  const Path helix({make_arc({6, 0, 0}, {6, 0, -2}, {0, 0, -2}, 2.0 * pi, 2, 10),
                    make_arc({6, 0, -2}, {6, 0, -4}, {0, 0, -4}, 2.0 * pi, 2, 10),
                    make_arc({6, 0, -4}, {6, 0, -4}, {0, 0, -4}, 2.0 * pi, 2, 10)});
  for (const Path* path : {&ramp, &helix}) {
    const std::vector<const Path*> paths = {path};
    Material material = block({box(-20, -20, 20, 20)}, layer_borders(paths, -6.0, 0.0, 0.2));
    const double before = material.volume_mm3();
    const EngagementTrack track = sweep(material, *path, diameter);
    const double removed = before - material.volume_mm3();
    const double expected = path == &ramp ? 4.0 * (24.0 * diameter + pi * 16.0) : 4.0 * pi * (100.0 - 4.0);
    CHECK(removed == doctest::Approx(expected).epsilon(2e-4));
    CHECK(removed_by(track) == doctest::Approx(expected).epsilon(0.02));
    // Half way down the ramp or helix the side cuts from the tip up to the top of the stock.
    const std::size_t i = track.size() / 4;
    CHECK(track.horizontal[i] < 1.0);
    CHECK(track.plunged_mm2[i] > 10.0);
  }
}

TEST_CASE("programs in pieces, rapids, progress") {
  const Path first({make_line({-10, 0, -5}, {10, 0, -5}, 10)});
  const Path second({make_line({10, 0, -5}, {30, 3, -5}, 10)});
  const Path whole({first[0], second[0]});
  Material in_pieces = block({box(-20, -20, 40, 20)});
  Material at_once = in_pieces;
  (void)sweep(in_pieces, first, diameter);
  const EngagementTrack piece = sweep(in_pieces, second, diameter);
  const EngagementTrack all = sweep(at_once, whole, diameter);
  CHECK(in_pieces.volume_mm3() == doctest::Approx(at_once.volume_mm3()).epsilon(1e-9));
  for (std::size_t i = 0; i < piece.size(); ++i) {
    CHECK(piece.radial_depth_mm[i] ==
          doctest::Approx(all.radial_depth_mm[all.size() - piece.size() + i]).epsilon(1e-3));
  }
  Segment fast = make_line({0, 15, -4}, {20, 15, -4}, 0.0);
  fast.kind = shapegcode::SegmentKind::rapid;
  CHECK(most(sweep(at_once, Path({fast}), diameter).section_mm2) > 10.0);

  SweepOptions options;
  options.step_mm = 0.01;
  std::vector<double> reported;
  options.progress = [&](double s) { reported.push_back(s); };
  (void)sweep(at_once, whole, diameter, options);
  CHECK(reported.size() >= 3);
  CHECK(std::is_sorted(reported.begin(), reported.end()));
  options.progress = [](double) { throw std::runtime_error("enough"); };
  CHECK_THROWS_WITH_AS((void)sweep(at_once, whole, diameter, options), "enough", std::runtime_error);
  CHECK(sweep(at_once, Path(), diameter).size() == 0);
  CHECK(sweep(at_once, Path(), diameter).first_arc == std::vector<std::uint32_t>{0});
}

TEST_CASE("what cannot be swept is refused with value and limit") {
  Material material = block({box(0, 0, 10, 10)});
  const Path path({make_line({0, 0, -5}, {1, 0, -5}, 10)});
  const auto refusal = [&](const Path& way, double tool, const SweepOptions& options) -> std::string {
    try {
      (void)sweep(material, way, tool, options);
    } catch (const Error& error) {
      CHECK(error.kind() == shapegcode::ErrorKind::argument);
      return error.what();
    }
    return "no error";
  };
  CHECK(refusal(path, 0.0, {}) == "tool diameter is 0 mm, must be above 0");
  CHECK(refusal(path, std::nan(""), {}) == "tool diameter is nan mm, must be above 0");
  SweepOptions options;
  options.step_mm = -1.0;
  CHECK(refusal(path, 8.0, options) == "step is -1 mm, must be above 0, or 0 for a fortieth of the diameter");
  options = {};
  options.touch_mm = -1.0;
  CHECK(refusal(path, 8.0, options) == "touch is -1 mm, must be at least 0");
  options = {};
  options.step_mm = 1e-300;
  CHECK(refusal(path, 8.0, options) == "a step of 1e-300 mm cuts 1 mm into 1e+300 pieces, limit 1e+09");
  CHECK(refusal(path, 1e300, {}).starts_with("a grid of "));
  options.step_mm = -1e-7;
  CHECK(refusal(path, 8.0, options) == "step is -1e-07 mm, must be above 0, or 0 for a fortieth of the diameter");
  const Path upright({make_arc({0, 0, 0}, {0, 2, 0}, {0, 1, 0}, pi, 0, 10.0, 17)});
  CHECK(refusal(upright, 8.0, {}) == "line 17: arc outside of the XY plane (G17)");
}
