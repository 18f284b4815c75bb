#include <doctest/doctest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <random>
#include <string>
#include <vector>

#include "milling/material_layer.hpp"
#include "shapegcode/error.hpp"
#include "shapegcode/milling/material.hpp"

using Eigen::Vector2d;
using shapegcode::Error;
using shapegcode::layer_borders;
using shapegcode::make_arc;
using shapegcode::make_line;
using shapegcode::Material;
using shapegcode::MaterialLayer;
using shapegcode::Path;
using shapegcode::Ring;
using shapegcode::ToolStep;
using shapegcode::Vector3;

namespace {

constexpr double pi = std::numbers::pi;
const std::vector<double> one_layer = {-5.0, 0.0};

Ring box(double x0, double y0, double x1, double y1) { return {{x0, y0}, {x1, y0}, {x1, y1}, {x0, y1}}; }

Ring circle(const Vector2d& centre, double radius, int points) {
  Ring ring;
  for (int k = 0; k < points; ++k) {
    const double angle = 2.0 * pi * k / points;
    ring.emplace_back(centre + radius * Vector2d(std::cos(angle), std::sin(angle)));
  }
  return ring;
}

/// Signed distance by all edges and the winding of all angles: nothing of the grid's own way.
double brute_distance(const std::vector<Ring>& rings, const Vector2d& p) {
  double distance = std::numeric_limits<double>::infinity();
  double turns = 0.0;
  for (const Ring& ring : rings) {
    double turn = 0.0;
    for (std::size_t k = 0; k < ring.size(); ++k) {
      const Vector2d a = ring[k] - p;
      const Vector2d b = ring[(k + 1) % ring.size()] - p;
      turn += std::atan2(a.x() * b.y() - a.y() * b.x(), a.dot(b));
      const Vector2d along = b - a;
      const double share = std::clamp(-a.dot(along) / along.squaredNorm(), 0.0, 1.0);
      distance = std::min(distance, (a + share * along).norm());
    }
    turns += std::abs(std::round(turn / (2.0 * pi)));
  }
  return std::fmod(turns, 2.0) == 1.0 ? distance : -distance;
}

std::string message_of(const auto& action) {
  try {
    action();
  } catch (const Error& error) {
    CHECK(error.kind() == shapegcode::ErrorKind::argument);
    return error.what();
  }
  return "no error";
}

}  // namespace

TEST_CASE("the stock is the signed distance from its outlines") {
  std::mt19937 random(1);
  std::uniform_real_distribution<double> uniform(0.0, 1.0);
  for (int draw = 0; draw < 5; ++draw) {
    Ring outer;  // a star about the origin with a hole in its heart
    for (int k = 0; k < 11; ++k) {
      const double angle = 2.0 * pi * k / 11;
      outer.emplace_back((8.0 + 6.0 * uniform(random)) * Vector2d(std::cos(angle), std::sin(angle)));
    }
    const std::vector<Ring> rings = {outer, circle({0.5, -0.3}, 4.0, 7)};
    const MaterialLayer layer(rings, 0.05);
    double worst = 0.0;
    for (int k = 0; k < 4000; ++k) {
      const Vector2d p(32.0 * uniform(random) - 16.0, 32.0 * uniform(random) - 16.0);
      const double expected = std::clamp(brute_distance(rings, p), -layer.band_mm(), layer.band_mm());
      worst = std::max(worst, std::abs(layer.distance_mm(p.x(), p.y()) - expected));
    }
    CHECK(worst < 0.05);  // corners are rounded by less than a node
  }
  // Away from corners a straight wall is exact, however it lies.
  const MaterialLayer layer(std::vector<Ring>{{{0.0, 0.0}, {30.0, 10.0}, {20.0, 40.0}, {-10.0, 30.0}}}, 0.1);
  const Vector2d along = Vector2d(3.0, 1.0) / std::sqrt(10.0);
  for (double offset = -0.05; offset <= 0.05; offset += 0.01) {
    const Vector2d p = Vector2d(15.0, 5.0) + offset * Vector2d(-along.y(), along.x());
    CHECK(layer.distance_mm(p.x(), p.y()) == doctest::Approx(offset).epsilon(1e-6));
  }
}

TEST_CASE("volume, heights and places of a block with a hole") {
  const std::vector<Ring> rings = {box(0, 0, 20, 10), circle({5.0, 5.0}, 3.0, 400)};
  const Material material(rings, std::vector<double>{-6.0, -2.0, 0.0}, 0.05);
  const double hole = 0.5 * 400 * 9.0 * std::sin(2.0 * pi / 400);
  CHECK(material.volume_mm3() == doctest::Approx(6.0 * (200.0 - hole)).epsilon(5e-5));
  CHECK(material.volume_in_cylinder_mm3(15.0, 5.0, 3.0, -4.0, 1.0) == doctest::Approx(4.0 * pi * 9.0).epsilon(5e-4));
  CHECK(material.volume_in_cylinder_mm3(20.0, 5.0, 3.0, -9.0, -2.0) == doctest::Approx(2.0 * pi * 9.0).epsilon(1e-3));
  CHECK(material.volume_in_cylinder_mm3(5.0, 5.0, 2.9, -9.0, 9.0) == 0.0);
  CHECK(material.is_material(10.0, 5.0, -1.0));
  CHECK_FALSE(material.is_material(5.0, 5.0, -1.0));
  CHECK_FALSE(material.is_material(10.0, 5.0, 0.1));
  CHECK_FALSE(material.is_material(10.0, 5.0, std::nan("")));
  CHECK_FALSE(material.is_material(std::nan(""), 5.0, -1.0));
  const Eigen::MatrixXd heights = material.heights_mm({-1.0, 5.0}, {5.0, 9.0}, 2, 3);
  CHECK(std::isnan(heights(0, 0)));
  CHECK(heights(0, 1) == doctest::Approx(0.0));
  CHECK(std::isnan(heights(0, 2)));
  CHECK(heights(1, 2) == doctest::Approx(0.0));
  CHECK(material.volume_in_cylinder_mm3(std::nan(""), 5.0, 3.0, -4.0, 1.0) == 0.0);
  CHECK(material.low_mm() == Vector2d(0.0, 0.0));
  CHECK(material.high_mm() == Vector2d(20.0, 10.0));
}

TEST_CASE("a step takes away the distance from a line or an arc") {
  std::mt19937 random(2);
  std::uniform_real_distribution<double> uniform(-1.0, 1.0);
  constexpr double h = 0.08;
  constexpr double radius = 4.0;
  for (int draw = 0; draw < 20; ++draw) {
    MaterialLayer layer(std::vector<Ring>{box(-10, -10, 10, 10)}, h);
    const Vector2d from(uniform(random), uniform(random));
    const double heading = pi * uniform(random);
    const double curvature = draw % 3 == 0 ? 0.0 : (draw % 3 == 1 ? 2.0 : 0.3 / radius) * uniform(random);
    const double length = 0.7 / std::max(1.0, std::abs(curvature));
    Ring chords;  // the same way in 2000 chords
    Vector2d to = from;
    for (int k = 0; k <= 2000; ++k) {
      const double s = length * k / 2000;
      const double turned = 0.5 * curvature * s;
      const double chord = turned == 0.0 ? s : s * std::sin(turned) / turned;
      to = from + chord * Vector2d(std::cos(heading + turned), std::sin(heading + turned));
      chords.push_back(to);
    }
    const ToolStep start(from, from);
    const ToolStep step(from, to, curvature);
    CHECK(layer.remove(start, radius, false));
    CHECK(layer.remove(step, radius, true));
    CHECK_FALSE(layer.remove(step, radius, false));
    MaterialLayer at_once(std::vector<Ring>{box(-10, -10, 10, 10)}, h);
    at_once.remove(step, radius, false);
    MaterialLayer compacted = layer;
    compacted.compact();
    CHECK(compacted.tiles() <= layer.tiles());
    double worst = 0.0;
    double worst_at_once = 0.0;
    for (int k = 0; k < 300; ++k) {
      const double angle = pi * uniform(random);
      const Vector2d p = to + (radius + h * uniform(random)) * Vector2d(std::cos(angle), std::sin(angle));
      double nearest = std::numeric_limits<double>::infinity();
      for (const Vector2d& place : chords) nearest = std::min(nearest, (p - place).norm());
      CHECK(step.distance_mm(p) == doctest::Approx(nearest).epsilon(1e-6));
      const double expected = std::clamp(nearest - radius, -layer.band_mm(), layer.band_mm());
      if (std::abs(expected) > 0.5 * h) continue;  // cells there reach to where the distance is cut off
      worst = std::max(worst, std::abs(layer.distance_mm(p.x(), p.y()) - expected));
      worst_at_once = std::max(worst_at_once, std::abs(at_once.distance_mm(p.x(), p.y()) - expected));
      CHECK(compacted.distance_mm(p.x(), p.y()) == layer.distance_mm(p.x(), p.y()));
    }
    // Inside of an arc of a smaller radius than the tool's the boundary has a kink.
    const double bound = draw % 3 == 1 ? 0.1 * h : h * h / (8.0 * radius) * 1.5 + 1e-6;
    CHECK(worst < bound);
    CHECK(worst_at_once < bound);
  }
}

TEST_CASE("copies are independent, and memory follows the boundary") {
  Material material(std::vector<Ring>{box(0, 0, 300, 300)}, one_layer, 0.03);
  CHECK(material.bytes() < 20'000'000);  // 400 MB if every node had a value
  const Material before = material;
  material.remove(0, ToolStep({100.0, 100.0}, {101.0, 100.0}), 1.5, false);
  CHECK(before.is_material(100.0, 100.0, -1.0));
  CHECK_FALSE(material.is_material(100.0, 100.0, -1.0));
  CHECK(before.volume_mm3() - material.volume_mm3() == doctest::Approx(5.0 * (pi * 2.25 + 3.0)).epsilon(1e-3));
}

TEST_CASE("no stock, no layers or no memory is said so") {
  const std::vector<Ring> rings = {box(0, 0, 10, 10)};
  const auto refusal = [&](const std::vector<Ring>& outlines, const std::vector<double>& borders, double resolution,
                           std::size_t limit = Material::default_memory_limit_bytes) {
    return message_of([&] { const Material material(outlines, borders, resolution, limit); });
  };
  const double nan = std::numeric_limits<double>::quiet_NaN();
  CHECK(refusal({}, one_layer, 0.1) == "the stock has no outline");
  CHECK(refusal({{{0, 0}, {1, 0}}}, one_layer, 0.1) == "ring 0 of the stock has 2 points, must have at least 3");
  CHECK(refusal({{{0, 0}, {1, 0}, {nan, 1}}}, one_layer, 0.1) == "point 2 of ring 0 of the stock is not finite");
  CHECK(refusal({{{0, 0}, {1, 0}, {2, 0}}}, one_layer, 0.1) == "ring 0 of the stock encloses no area");
  CHECK(refusal({rings[0], rings[0]}, one_layer, 0.1) ==
        "the outlines of the stock enclose no material at a resolution of 0.1 mm");
  CHECK(refusal(rings, {0.0}, 0.1) == "the stock has 1 heights between layers, must have at least 2");
  CHECK(refusal(rings, {0.0, 0.0}, 0.1) == "height 0 mm between layers must lie above its predecessor, 0 mm");
  CHECK(refusal(rings, {0.0, nan}, 0.1) == "height 1 between layers is not finite");
  CHECK(refusal(rings, one_layer, 0.0) == "resolution is 0 mm, must be above 0");
  CHECK(refusal(rings, one_layer, nan) == "resolution is nan mm, must be above 0");
  CHECK(refusal(rings, one_layer, 1e308) == "resolution is 1e+308 mm, limit 1e+09 mm");
  // Nodes and outline would fall onto the same few numbers.
  CHECK(refusal({box(1e13, 1e13, 1e13 + 0.01, 1e13 + 0.01)}, one_layer, 1e-4).find("limit 1e+08 mm") !=
        std::string::npos);
  CHECK(refusal(rings, one_layer, 1e-6).find("limit 2147.48 MB") != std::string::npos);
  // Enough for the stock but not for what is cut into it.
  Material small(rings, one_layer, 0.01, 1'000'000);
  const auto cut = message_of([&] {
    for (double y = 0.5; y < 10.0; y += 0.3) small.remove(0, ToolStep({0.0, y}, {10.0, y}), 0.1, false);
  });
  CHECK(cut.find("limit 1 MB") != std::string::npos);
  CHECK(message_of([&] { (void)small.heights_mm({0, 0}, {1, 1}, 0, 5); }).find("0 x 5") != std::string::npos);
}

TEST_CASE("layers end where a program cuts on a level, and are thin where it ramps") {
  const Path path({make_line({0, 0, 1}, {10, 0, 1}, 1), make_line({10, 0, 1}, {10, 0, -3}, 1),
                   make_line({10, 0, -3}, {20, 0, -3}, 1), make_line({20, 0, -3}, {30, 0, -4}, 1),
                   make_line({30, 0, -4}, {20, 0, -5}, 1), make_line({20, 0, -5}, {20, 0, -5.0005}, 1),
                   make_line({20, 0, -5.0005}, {0, 0, -5.0005}, 1)});
  const Path drilling({make_line({0, 0, 1}, {0, 0, -7}, 1), make_line({0, 0, -7}, {0, 0, 1}, 1)});
  const std::vector<const Path*> paths = {&path, &drilling};
  const std::vector<double> borders = layer_borders(paths, -10.0, 0.0, 0.5);
  REQUIRE(borders.size() >= 7);
  CHECK(borders[0] == -10.0);
  CHECK(borders[1] == -7.0);
  CHECK(borders[2] == doctest::Approx(-5.0005));
  CHECK(borders.back() == 0.0);
  CHECK(borders[borders.size() - 2] == -3.0);
  for (std::size_t i = 3; i + 1 < borders.size(); ++i) CHECK(borders[i] - borders[i - 1] <= 0.5 + 1e-9);
  CHECK(layer_borders({}, -1.0, 0.0, 0.1) == std::vector<double>{-1.0, 0.0});
  CHECK(message_of([] { (void)layer_borders({}, 0.0, 0.0, 0.1); }) ==
        "the stock reaches from 0 to 0 mm, its bottom must lie below its top");
  CHECK(message_of([] { (void)layer_borders({}, -1.0, 0.0, 0.0); }) ==
        "layers of ramps are 0 mm thick, must be above 0");
  CHECK(message_of([] { (void)layer_borders({}, -1.0, 0.0, 1e-300); }) ==
        "a layer of 1e-300 mm cuts 1 mm into 1e+300 pieces, limit 1e+09");
}
