#include <doctest/doctest.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <numbers>
#include <vector>

#include "shapegcode/error.hpp"
#include "shapegcode/measure/sections.hpp"

using shapegcode::ContourTracker;
using shapegcode::make_arc;
using shapegcode::make_line;
using shapegcode::MetrologyOptions;
using shapegcode::Path;
using shapegcode::SectionFigures;
using shapegcode::SectionMetrology;
using shapegcode::TrackFigures;
using shapegcode::Vector3;

namespace {

constexpr double pi = std::numbers::pi;

Path line_arc_line() {
  return Path({make_line({0, 0, 0}, {20, 0, 0}, 100.0),
               make_arc({20, 0, 0}, {40, 20, 0}, {20, 20, 0}, 0.5 * pi, 2, 100.0),
               make_line({40, 20, 0}, {40, 40, 0}, 100.0)});
}

/// A command along the path in equal steps, then `rest` samples at its end; the response is beside it by `left`.
void run(SectionMetrology& metrology, const Path& path, double step_mm, int rest,
         const std::function<double(double)>& left, const std::function<Vector3(int)>& swing) {
  std::size_t cursor = 0;
  const auto count = static_cast<int>(std::ceil(path.length_mm() / step_mm));
  for (int i = 0; i <= count; ++i) {
    const double s = path.length_mm() * i / count;
    const Vector3 p = path.point(s, cursor);
    const Vector3 t = tangent_at(path[cursor], s - path.distance_mm(cursor));
    metrology.step(p, p + left(s) * Vector3(-t.y(), t.x(), 0.0));
  }
  const Vector3 end = path[path.size() - 1].end_mm;
  for (int i = 1; i <= rest; ++i) metrology.step(end, end + swing(i));
}

const auto still = [](int) -> Vector3 { return Vector3::Zero(); };

}  // namespace

TEST_CASE("section metrology: a constant offset on line, arc, line") {
  const Path path = line_arc_line();
  SectionMetrology metrology(path, path_sections(path), {});
  const double offset = 0.02;
  run(
      metrology, path, 0.05, 30, [&](double) { return offset; }, [&](int) { return Vector3(-offset, 0, 0); });
  const TrackFigures figures = metrology.finish();
  REQUIRE(figures.sections.size() == 3);
  CHECK(figures.response.max_abs_mm == doctest::Approx(offset));
  for (const SectionFigures& section : figures.sections) {
    CHECK(section.response.most_positive_mm == doctest::Approx(offset));
    CHECK(section.command.max_abs_mm < 1e-9);
    CHECK(section.left.mean_mm == doctest::Approx(offset).epsilon(0.01));
    CHECK(section.right.mean_mm == doctest::Approx(offset).epsilon(0.01));
    CHECK(section.width.mean_mm == doctest::Approx(3.0).epsilon(1e-4));
    REQUIRE(section.left_roughness.has_value());
    CHECK(section.left_roughness->ra_mm < 1e-5);
  }
  CHECK(figures.sections[0].time_s == doctest::Approx(0.4).epsilon(0.01));
  const SectionFigures& arc = figures.sections[1];
  CHECK(arc.nominal_radius_mm == doctest::Approx(20.0));
  CHECK(arc.turns_left);
  CHECK(arc.command_arc->fit.radius_mm == doctest::Approx(20.0).epsilon(1e-6));
  CHECK(arc.response_arc->fit.radius_mm == doctest::Approx(19.98).epsilon(1e-6));
  CHECK(arc.response_arc->mean_radius_mm == doctest::Approx(19.98).epsilon(1e-6));
  CHECK(arc.left_wall_arc->fit.radius_mm == doctest::Approx(18.48).epsilon(1e-5));
  CHECK(arc.right_wall_arc->fit.radius_mm == doctest::Approx(21.48).epsilon(1e-5));
  // Quarter ring between 20 and 19.98 over the quarter disc; its ends are cut by the steps into and out of it.
  CHECK(*arc.response_orbit_percent == doctest::Approx(100.0 * (1.0 - std::pow(19.98 / 20.0, 2))).epsilon(2e-3));
  CHECK(*arc.command_orbit_percent < 1e-3);
  CHECK_FALSE(figures.sections[0].response_orbit_percent.has_value());
}

TEST_CASE("section metrology: a full circle turned right, off centre") {
  // What a plant with another gain on X would do: an ellipse about a shifted centre.
  const Path path({make_arc({10, 0, 0}, {10, 0, 0}, {0, 0, 0}, -2.0 * pi, 2, 100.0)});
  SectionMetrology metrology(path, path_sections(path), {});
  const int count = 4000;
  for (int i = 0; i <= count; ++i) {
    const double angle = -2.0 * pi * i / count;
    const Vector3 p(10.0 * std::cos(angle), 10.0 * std::sin(angle), 0.0);
    metrology.step(p, {1.002 * p.x() + 0.01, p.y() - 0.005, 0.0});
  }
  const SectionFigures arc = metrology.finish().sections.at(0);
  CHECK_FALSE(arc.turns_left);
  CHECK(arc.response_arc->fit.radius_mm == doctest::Approx(10.01).epsilon(2e-6));  // mean of the half axes
  CHECK(arc.response_arc->fit.centre_mm.x() == doctest::Approx(0.01).epsilon(0.02));
  CHECK(arc.response_arc->fit.centre_mm.y() == doctest::Approx(-0.005).epsilon(0.02));
  CHECK(arc.response_arc->fit.form_mm == doctest::Approx(0.02).epsilon(0.01));
  CHECK(arc.right_wall_arc->fit.radius_mm == doctest::Approx(8.51).epsilon(1e-4));  // inside of a right turn
  CHECK(arc.left_wall_arc->fit.radius_mm == doctest::Approx(11.51).epsilon(1e-4));
}

TEST_CASE("section metrology: which stop belongs to which section, and what is no stop") {
  const Path path({make_line({0, 0, 0}, {10, 0, 0}, 100.0), make_line({10, 0, 0}, {10, 10, 0}, 100.0)});
  const auto measured = [&path](int pause) {
    MetrologyOptions options;
    SectionMetrology metrology(path, path_sections(path), options);
    for (int i = 0; i < 50; ++i) metrology.step({0, 0, 0}, {0, 0, 0});  // before the start
    for (int i = 1; i <= 100; ++i) metrology.step({0.1 * i, 0, 0}, {0.1 * i, 0, 0});
    for (int i = 0; i < pause; ++i) metrology.step({10, 0, 0}, {10.0 + 0.004 * (i % 2), 0, 0});
    for (int i = 1; i <= 100; ++i) metrology.step({10, 0.1 * i, 0}, {10, 0.1 * i, 0});
    for (const double swing : {0.0, 0.001, 0.002, 0.001, 0.0}) metrology.step({10, 10, 0}, {10, 10 + swing, 0});
    return metrology.finish();
  };
  const TrackFigures stopped = measured(40);
  REQUIRE(stopped.sections[0].rest.has_value());
  CHECK(stopped.sections[0].rest->residual_mm[0] == doctest::Approx(0.004));
  CHECK(stopped.sections[0].peak_mm[0] < 1e-12);
  CHECK(stopped.sections[1].rest->residual_mm[1] == doctest::Approx(0.002));
  CHECK(stopped.rest.residual_mm[1] == doctest::Approx(0.002));
  const TrackFigures hesitated = measured(10);
  CHECK_FALSE(hesitated.sections[0].rest.has_value());
  CHECK(hesitated.sections[0].peak_mm[0] == doctest::Approx(0.004));
}

TEST_CASE("section metrology: only the sections that are asked for; the whole is the whole") {
  const Path path = line_arc_line();
  const std::vector<shapegcode::PathSection> all = path_sections(path);
  SectionMetrology metrology(path, {all[2]}, {});
  run(
      metrology, path, 0.05, 0, [](double s) { return s < 20.0 ? 0.03 : 0.01; }, still);
  const TrackFigures figures = metrology.finish();
  REQUIRE(figures.sections.size() == 1);
  CHECK(figures.sections[0].response.max_abs_mm == doctest::Approx(0.01));
  CHECK(figures.response.max_abs_mm == doctest::Approx(0.03));
}

TEST_CASE("section metrology: refusals") {
  const Path path = line_arc_line();
  const std::vector<shapegcode::PathSection> all = path_sections(path);
  MetrologyOptions bad;
  bad.period_s = 0.0;
  CHECK_THROWS_AS(SectionMetrology(path, all, bad), shapegcode::Error);
  bad = {};
  bad.cutoff_mm = -1.0;
  CHECK_THROWS_AS(SectionMetrology(path, all, bad), shapegcode::Error);
  CHECK_THROWS_AS(SectionMetrology(path, {all[1], all[0]}, {}), shapegcode::Error);
  CHECK_THROWS_AS(SectionMetrology(Path({make_line({0, 0, 0}, {5, 0, 0}, 1.0)}), all, {}), shapegcode::Error);
  CHECK_THROWS_AS(SectionMetrology(Path({make_line({0, 0, 0}, {0, 0, 0}, 1.0)}), {}, {}), shapegcode::Error);
}
