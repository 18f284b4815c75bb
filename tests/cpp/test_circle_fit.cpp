#include <doctest/doctest.h>

#include <Eigen/Core>
#include <cmath>
#include <numbers>
#include <random>
#include <vector>

#include "shapegcode/error.hpp"
#include "shapegcode/measure/sections.hpp"

using Eigen::Vector2d;
using shapegcode::CircleFit;
using shapegcode::fit_circle;

namespace {

std::vector<Vector2d> arc(const Vector2d& centre, double radius, double from, double turn, int count) {
  std::vector<Vector2d> points;
  for (int i = 0; i < count; ++i) {
    const double angle = from + turn * i / (count - 1);
    points.emplace_back(centre + radius * Vector2d(std::cos(angle), std::sin(angle)));
  }
  return points;
}

}  // namespace

TEST_CASE("circle fit: exact points, far from the origin, short arcs") {
  for (const double turn : {6.2, 1.5, 0.2, 0.05}) {
    const CircleFit fit = fit_circle(arc({500.0, -300.0}, 18.5, 0.7, turn, 60));
    CAPTURE(turn);
    CHECK(std::abs(fit.radius_mm - 18.5) < 1e-13 * 500.0 / (turn * turn * turn * turn) + 1e-11);
    CHECK(fit.form_mm < 1e-11);
  }
}

TEST_CASE("circle fit: no circle nearby is better, and the residuals are orthogonal to centre and radius") {
  std::mt19937 random(11);
  std::uniform_real_distribution<double> unit(-1.0, 1.0);
  for (int trial = 0; trial < 200; ++trial) {
    const double radius = std::pow(10.0, 1.5 + unit(random));
    const double turn = 0.6 + 2.6 * (unit(random) + 1.0);
    const double noise = radius * std::pow(10.0, -3.0 + 2.0 * unit(random));
    std::vector<Vector2d> points = arc({30.0 * unit(random), unit(random)}, radius, unit(random), turn, 40);
    for (Vector2d& p : points) p += noise * Vector2d(unit(random), unit(random));
    const CircleFit fit = fit_circle(points);
    const auto cost = [&points](const Vector2d& centre, double r) {
      double sum = 0.0;
      for (const Vector2d& p : points) sum += std::pow((p - centre).norm() - r, 2);
      return sum;
    };
    const double best = cost(fit.centre_mm, fit.radius_mm);
    CHECK(fit.rms_mm == doctest::Approx(std::sqrt(best / 40.0)));
    Eigen::Vector3d gradient = Eigen::Vector3d::Zero();
    for (const Vector2d& p : points) {
      const Vector2d out = p - fit.centre_mm;
      const double residual = out.norm() - fit.radius_mm;
      gradient.head<2>() += residual * out.normalized();
      gradient[2] += residual;
    }
    CHECK(gradient.cwiseAbs().maxCoeff() < 1e-6 * noise * 40.0);
    const double step = 0.1 * noise;
    for (const double d : {-step, step}) {
      CHECK(cost(fit.centre_mm + Vector2d(d, 0), fit.radius_mm) > best);
      CHECK(cost(fit.centre_mm + Vector2d(0, d), fit.radius_mm) > best);
      CHECK(cost(fit.centre_mm, fit.radius_mm + d) > best);
    }
  }
}

TEST_CASE("circle fit: refuses what is no circle") {
  CHECK_THROWS_AS(static_cast<void>(fit_circle(std::vector<Vector2d>{{0, 0}, {1, 1}})), shapegcode::Error);
  CHECK_THROWS_AS(static_cast<void>(fit_circle(std::vector<Vector2d>{{0, 0}, {1, 1}, {2, 2}, {3, 3}})),
                  shapegcode::Error);
  CHECK_THROWS_AS(static_cast<void>(fit_circle(std::vector<Vector2d>(5, {1.0, 2.0}))), shapegcode::Error);
  CHECK_THROWS_WITH_AS(static_cast<void>(fit_circle(std::vector<Vector2d>{{0, 0}, {1, 1}, {2, std::nan("")}, {0, 1}})),
                       "point 2 is not finite", shapegcode::Error);
}
