#include <doctest/doctest.h>

#include <algorithm>
#include <cmath>
#include <complex>
#include <cstdint>
#include <memory>
#include <numbers>
#include <vector>

#include "shapegcode/command.hpp"
#include "shapegcode/error.hpp"
#include "shapegcode/shaper.hpp"

using shapegcode::Error;
using shapegcode::Fir;
using shapegcode::make_arc;
using shapegcode::make_line;
using shapegcode::Mode;
using shapegcode::Path;
using shapegcode::Segment;
using shapegcode::shape_path;
using shapegcode::ShapedCommand;
using shapegcode::ShapingOptions;
using shapegcode::Vector3;

namespace {

using PathPointer = std::shared_ptr<const Path>;

PathPointer path_of(std::vector<Segment> segments) { return std::make_shared<const Path>(std::move(segments)); }

PathPointer straight(double length, double feed) { return path_of({make_line({1, 2, 3}, {1 + length, 2, 3}, feed)}); }

/// Constant-time ramps of 50 ms.
double trapezoid(double t, double length, double feed) {
  const double end = length / feed + 0.05;
  if (t <= 0.0) return 0.0;
  if (t < 0.05) return 0.5 * feed / 0.05 * t * t;
  if (t < end - 0.05) return feed * (t - 0.025);
  if (t < end) return length - 0.5 * feed / 0.05 * (end - t) * (end - t);
  return length;
}

ShapingOptions on_grid(double block_period_s, double interpolation_period_s) {
  ShapingOptions options;
  options.block_period_s = block_period_s;
  options.interpolation_period_s = interpolation_period_s;
  return options;
}

const Fir unshaped({0}, {1.0});
const Fir three_taps({0, 2, 5}, {0.5, 0.2, 0.3});

}  // namespace

TEST_CASE("shaped command: rows are the shaped position at whole and half block periods") {
  // Even, odd and single ticks to a block period.
  struct Grid {
    double block, tick;
  };
  for (const Grid& g : {Grid{0.004, 0.001}, Grid{0.005, 0.001}, Grid{0.008, 0.008}, Grid{0.005, 0.0005}}) {
    for (const Fir* fir : {&unshaped, &three_taps}) {
      const ShapedCommand command = shape_path(straight(37.0, 90.0), *fir, {}, on_grid(g.block, g.tick));
      const double duration = 37.0 / 90.0 + 0.05;
      const auto periods = static_cast<Eigen::Index>(std::ceil(duration / g.block - 1e-9)) + fir->duration_samples();
      CAPTURE(g.block);
      CAPTURE(g.tick);
      REQUIRE(command.grid_mm.rows() == periods + 1);
      REQUIRE(command.middle_mm.rows() == periods);
      REQUIRE(command.arc_normal.size() == static_cast<std::size_t>(periods));
      CHECK(command.run_ends == std::vector<std::uint32_t>{static_cast<std::uint32_t>(periods)});
      double worst = 0.0;
      for (Eigen::Index half = 0; half <= 2 * periods; ++half) {
        double expected = 1.0;
        for (std::size_t k = 0; k < fir->taps().size(); ++k) {
          const double time = g.block * (0.5 * static_cast<double>(half) - fir->delays()[k]);
          expected += fir->taps()[k] * trapezoid(time, 37.0, 90.0);
        }
        const double found = half % 2 == 0 ? command.grid_mm(half / 2, 0) : command.middle_mm(half / 2, 0);
        worst = std::max(worst, std::abs(found - expected));
      }
      CHECK(worst < 1e-11);
      CHECK(command.grid_mm.row(0) == Vector3(1, 2, 3).transpose());
      CHECK((command.grid_mm.row(periods) - Vector3(38, 2, 3).transpose()).norm() < 1e-13);
      CHECK((command.grid_mm.col(2).array() - 3.0).abs().maxCoeff() < 1e-14);
    }
  }
}

TEST_CASE("shaped command: a grid-exact shaper leaves no vibration of its modes behind the blocks' staircase") {
  // A command that is linear between grid points leaves sum of second differences times e^(-s*k*T) in a mode with the
  // pole s.
  constexpr double period = 0.005;
  const std::vector<Mode> modes{{46.0, 0.02, 1.0}, {131.0, 0.02, 1.0}};
  const Fir shaper = to_fir(shapegcode::grid_polynomial(modes, period), period);
  const auto path = path_of({make_line({0, 0, 0}, {20, 0, 0}, 200.0),
                             make_arc({20, 0, 0}, {40, 20, 0}, {20, 20, 0}, std::numbers::pi / 2, 2, 200.0),
                             make_line({40, 20, 0}, {40, 40, 0}, 200.0)});
  const auto left_over = [&](const ShapedCommand& command, const Mode& mode, Eigen::Index axis) {
    const double omega = 2.0 * std::numbers::pi * mode.frequency_hz;
    const std::complex<double> s(-mode.damping_ratio * omega,
                                 omega * std::sqrt(1.0 - mode.damping_ratio * mode.damping_ratio));
    std::complex<double> sum = 0.0;
    const Eigen::Index last = command.grid_mm.rows() - 1;
    for (Eigen::Index k = 0; k <= last; ++k) {
      const double here = command.grid_mm(k, axis);
      const double before = command.grid_mm(std::max<Eigen::Index>(k - 1, 0), axis);
      const double after = command.grid_mm(std::min(k + 1, last), axis);
      sum += (after - 2.0 * here + before) * std::exp(s * (static_cast<double>(last - k) * period));
    }
    return std::abs(sum) / (std::abs(s) * period);  // mm of deflection, to within a factor near one
  };
  const ShapedCommand plain = shape_path(path, unshaped, {}, on_grid(period, 0.001));
  const ShapedCommand shaped = shape_path(path, shaper, {}, on_grid(period, 0.001));
  for (const Mode& mode : modes) {
    for (const Eigen::Index axis : {0, 1}) {
      CHECK(left_over(plain, mode, axis) > 1e-4);
      CHECK(left_over(shaped, mode, axis) < 1e-11);
    }
  }
}

TEST_CASE("shaped command: marks stand where the shaped command has their segment's begin in its middle") {
  // Four collinear lines at 100 mm/s: begins at 0, 10, 25 and 60 mm are reached at 0 and x/100 + 25 ms, shaped by the
  // mean later.
  const auto path = path_of({make_line({0, 0, 0}, {10, 0, 0}, 100), make_line({10, 0, 0}, {25, 0, 0}, 100),
                             make_line({25, 0, 0}, {60, 0, 0}, 100), make_line({60, 0, 0}, {100, 0, 0}, 100)});
  const std::vector<std::uint32_t> marks{0, 1, 2, 2, 3, 4};
  const ShapedCommand command = shape_path(path, three_taps, marks, on_grid(0.005, 0.001));
  REQUIRE(command.segment_periods.size() == marks.size());
  const double mean = 0.005 * (0.2 * 2 + 0.3 * 5);
  CHECK(command.segment_periods[0] == 0);
  CHECK(std::abs(command.segment_periods[1] * 0.005 - (0.125 + mean)) < 0.0026);
  CHECK(std::abs(command.segment_periods[2] * 0.005 - (0.275 + mean)) < 0.0026);
  CHECK(command.segment_periods[3] == command.segment_periods[2]);
  CHECK(std::abs(command.segment_periods[4] * 0.005 - (0.625 + mean)) < 0.0026);
  CHECK(command.segment_periods[5] == static_cast<std::uint32_t>(command.middle_mm.rows()));
}

TEST_CASE("shaped command: comes to rest at a plunge's foot, and stays for the rest asked for") {
  const auto path = path_of({make_line({0, 0, 10}, {0, 0, 0}, 50), make_line({0, 0, 0}, {30, 0, 0}, 100),
                             make_line({30, 0, 0}, {30, 30, 0}, 100), make_line({30, 30, 0}, {30, 30, 10}, 100)});
  for (const double rest : {0.0, 0.05, 0.052}) {
    ShapingOptions options = on_grid(0.005, 0.001);
    options.rest_at_stop_s = rest;
    options.limits.corner_speed_difference_mm_per_s = Vector3::Constant(20.0);
    const std::vector<std::uint32_t> marks{1, 3};
    const ShapedCommand command = shape_path(path, three_taps, marks, options);
    REQUIRE(command.run_ends.size() == 3);
    const std::vector<Vector3> stops{{0, 0, 0}, {30, 30, 0}, {30, 30, 10}};
    const auto rest_periods = static_cast<Eigen::Index>(std::ceil(rest / 0.005 - 1e-9));
    for (std::size_t i = 0; i < 3; ++i) {
      const auto end = static_cast<Eigen::Index>(command.run_ends[i]);
      const Eigen::Index still = i < 2 ? rest_periods : 0;
      for (Eigen::Index k = end - still; k <= end; ++k) {
        CHECK((command.grid_mm.row(k) - stops[i].transpose()).norm() < 1e-12);
      }
      // Moving before.
      CHECK((command.grid_mm.row(end - still - 1) - stops[i].transpose()).norm() > 1e-9);
    }
    CHECK(command.grid_mm.rows() == static_cast<Eigen::Index>(command.run_ends[2]) + 1);
    // The plunge: 10 mm at 50 mm/s, 50 ms ramps, 25 ms of shaper: 275 ms.
    CHECK(command.run_ends[0] == 55 + static_cast<std::uint32_t>(rest_periods));
    // Neither run mixes Z with X and Y.
    for (Eigen::Index k = 0; k + 1 < command.grid_mm.rows(); ++k) {
      const Vector3 step = (command.grid_mm.row(k + 1) - command.grid_mm.row(k)).cwiseAbs();
      CHECK((step.z() < 1e-12 || step.head<2>().norm() < 1e-12));
    }
    // What begins at a stop is marked at the stop's end.
    REQUIRE(command.segment_periods.size() == 2);
    CHECK(command.segment_periods[0] == command.run_ends[0]);
    CHECK(command.segment_periods[1] == command.run_ends[1]);
  }
}

TEST_CASE("shaped command: exact stops split too") {
  std::vector<Segment> segments{make_line({0, 0, 0}, {10, 0, 0}, 100), make_line({10, 0, 0}, {20, 0, 0}, 100)};
  CHECK(shape_path(path_of(segments), unshaped, {}, on_grid(0.005, 0.001)).run_ends.size() == 1);
  segments[0].stop_at_end = true;
  const ShapedCommand command = shape_path(path_of(segments), unshaped, {}, on_grid(0.005, 0.001));
  REQUIRE(command.run_ends.size() == 2);
  CHECK(command.run_ends[0] == 30);  // 0.1 s and a ramp of 50 ms
  CHECK(command.run_ends[1] == 60);
}

TEST_CASE("shaped command: periods that may bend are those within the shaper's reach of an arc") {
  // 20 mm at 100 mm/s, a quarter arc of 20 mm, 20 mm: the arc begins at 0.225 s and lasts 0.314 s.
  const auto path = path_of({make_line({0, 0, 0}, {20, 0, 0}, 100),
                             make_arc({20, 0, 0}, {40, 20, 0}, {20, 20, 0}, std::numbers::pi / 2, 2, 100),
                             make_line({40, 20, 0}, {40, 40, 0}, 100)});
  const ShapedCommand command = shape_path(path, three_taps, {}, on_grid(0.005, 0.001));
  const double begin = 0.225;
  const double end = begin + 0.1 * std::numbers::pi + 0.025;  // shaper of 25 ms
  for (std::size_t k = 0; k < command.arc_normal.size(); ++k) {
    CAPTURE(k);
    const double from = 0.005 * static_cast<double>(k);
    if (from + 0.005 < begin - 1e-9 || from > end + 0.0051) CHECK(int{command.arc_normal[k]} == -1);
    if (from > begin && from + 0.005 < end) CHECK(int{command.arc_normal[k]} == 2);
  }
  const auto in_zx = path_of({make_arc({0, 0, 10}, {10, 0, 0}, {0, 0, 0}, std::numbers::pi / 2, 1, 100)});
  for (const std::int8_t normal : shape_path(in_zx, unshaped, {}, on_grid(0.005, 0.001)).arc_normal)
    CHECK(int{normal} == 1);
}

TEST_CASE("shaped command: the jerk time is part of the command") {
  ShapingOptions options = on_grid(0.005, 0.001);
  options.limits.jerk_time_s = 0.02;
  const ShapedCommand command = shape_path(straight(37.0, 90.0), unshaped, {}, options);
  // Mean of the distance over the last 20 ms, by a fine sum.
  double worst = 0.0;
  for (Eigen::Index k = 0; k < command.grid_mm.rows(); ++k) {
    double mean = 0.0;
    for (int i = 0; i < 4000; ++i)
      mean += trapezoid(0.005 * static_cast<double>(k) - 0.02 * (i + 0.5) / 4000, 37.0, 90.0) / 4000;
    worst = std::max(worst, std::abs(command.grid_mm(k, 0) - 1.0 - mean));
  }
  // The smoothing runs on half ticks: it may be early by half of one.
  CHECK(worst < 90.0 * 0.0005);
}

TEST_CASE("shaped command: refuses a block period that is no whole multiple of the interpolation period") {
  CHECK_THROWS_AS((void)shape_path(straight(10, 100), unshaped, {}, on_grid(0.005, 0.002)), Error);
  CHECK_THROWS_AS((void)shape_path(straight(10, 100), unshaped, {}, on_grid(0.001, 0.002)), Error);
  CHECK_THROWS_AS((void)shape_path(straight(10, 100), unshaped, {}, on_grid(0.005, 0.0)), Error);
  CHECK_THROWS_AS((void)shape_path(straight(10, 0.0), unshaped, {}, on_grid(0.005, 0.001)), Error);
  CHECK_NOTHROW((void)shape_path(straight(10, 100), unshaped, {}, on_grid(0.006, 0.002)));
}
