#include <doctest/doctest.h>

#include <algorithm>
#include <cmath>
#include <numbers>
#include <vector>

#include "random_blocks.hpp"
#include "sanitized.hpp"
#include "shapegcode/error.hpp"
#include "shapegcode/simulation.hpp"

// The largest deviations at other overrides, beside a run, are those of runs in full.

using shapegcode::BlockEnd;
using shapegcode::Error;
using shapegcode::Fir;
using shapegcode::make_line;
using shapegcode::Mode;
using shapegcode::Path;
using shapegcode::Segment;
using shapegcode::Segments;
using shapegcode::simulate_blocks;
using shapegcode::SimulationFigures;
using shapegcode::SimulationOptions;
using shapegcode::Vector3;
using shapegcode::tests::block_from;
using shapegcode::tests::Random;
using shapegcode::tests::uniform;

namespace {

constexpr double pi = std::numbers::pi;

/// Lines and arcs, smooth or with corners, some of which turn back.
std::vector<Segment> random_path(Random& random, double feed) {
  const bool has_corners = uniform(random, 0.0, 1.0) < 0.5;
  const bool has_arcs = uniform(random, 0.0, 1.0) < 0.5;
  const double shortest = uniform(random, 0.0, 1.0) < 0.5 ? 0.1 : 5.0;
  std::vector<Segment> path;
  Vector3 at(uniform(random, -50.0, 50.0), uniform(random, -50.0, 50.0), 0.0);
  double heading = uniform(random, -pi, pi);
  const auto count = static_cast<std::size_t>(uniform(random, 2.0, shortest < 1.0 ? 400.0 : 40.0));
  for (std::size_t i = 0; i < count; ++i) {
    const double length = shortest * uniform(random, 1.0, 6.0);
    const double radius = has_arcs && uniform(random, 0.0, 1.0) < 0.3 ? length * uniform(random, 0.3, 5.0) : 0.0;
    const double sense = uniform(random, 0.0, 1.0) < 0.5 ? -1.0 : 1.0;
    path.push_back(block_from(at, heading, length, radius, sense, feed));
    at = path.back().end_mm;
    heading += radius > 0.0 ? sense * length / radius : 0.0;
    heading += uniform(random, -0.03, 0.03);
    if (has_corners && uniform(random, 0.0, 1.0) < 0.1) heading += uniform(random, -pi, pi);
  }
  return path;
}

/// Blocks that follow it within some micrometres, as long as a few periods, now and then a whole segment.
std::vector<Segment> random_blocks(Random& random, const std::vector<Segment>& path, double period_s) {
  const double off_mm = uniform(random, 0.0, 1.0) < 0.2 ? 0.0 : uniform(random, 0.001, 0.02);
  std::vector<Segment> blocks;
  Vector3 at = path.front().start_mm;
  for (std::size_t i = 0; i < path.size(); ++i) {
    const Segment& segment = path[i];
    if (at == segment.start_mm && uniform(random, 0.0, 1.0) < 0.2) {
      blocks.push_back(segment);
      at = segment.end_mm;
      continue;
    }
    for (double s = 0.0; s < segment.length_mm;) {
      const double feed = segment.feed_mm_per_s * uniform(random, 0.3, 1.0);
      s = std::min(segment.length_mm, s + feed * period_s * uniform(random, 2.0, 12.0));
      const bool ends = s >= segment.length_mm && (i + 1 == path.size() || uniform(random, 0.0, 1.0) < 0.3);
      const Vector3 off(uniform(random, -off_mm, off_mm), uniform(random, -off_mm, off_mm), 0.0);
      const Vector3 next = ends ? segment.end_mm : Vector3(point_at(segment, s) + off);
      if (next == at) continue;
      blocks.push_back(make_line(at, next, feed));
      at = next;
    }
  }
  return blocks;
}

SimulationOptions random_options(Random& random) {
  SimulationOptions options;
  options.period_s = uniform(random, 0.0, 1.0) < 0.5 ? 0.001 : 0.002;
  for (std::size_t axis = 0; axis < 2; ++axis) {
    const double count = uniform(random, 0.0, 3.0);
    for (double k = 1.0; k <= count; ++k) {
      const double weight = uniform(random, 0.2, 1.0);
      options.modes[axis].push_back(Mode{uniform(random, 20.0, 150.0), uniform(random, 0.002, 0.1), weight});
    }
  }
  // One in three has a mode that moves one axis and is excited by others.
  if (uniform(random, 0.0, 3.0) < 1.0) {
    options.modes[1].push_back(Mode{uniform(random, 20.0, 150.0), 0.01, 0.3, {uniform(random, -1.0, 1.0), 0.2, 0.0}});
  }
  return options;
}

void check_alike(double found, double full) {
  CAPTURE(full);
  CHECK(std::abs(found - full) <= 1e-9 * full + 1e-10);
}

}  // namespace

TEST_CASE("largest deviations at other overrides are those of runs in full") {
  Random random(20241);
  const std::vector<double> overrides{0.5, 0.63, 0.8, 0.9, 1.1, 1.2};
  for (int trial = 0; trial < static_cast<int>(shapegcode::tests::trials(150)); ++trial) {
    CAPTURE(trial);
    SimulationOptions options = random_options(random);
    const std::vector<Segment> segments = random_path(random, uniform(random, 5.0, 150.0));
    const Path path(segments);
    const std::vector<Segment> blocks = random_blocks(random, segments, options.period_s);
    for (const BlockEnd rule : {BlockEnd::ceil, BlockEnd::carry}) {
      options.other_overrides = overrides;
      const SimulationFigures beside = simulate_blocks(blocks, path, rule, 1.0, options);
      options.other_overrides.clear();
      const SimulationFigures alone = simulate_blocks(blocks, path, rule, 1.0, options);
      CHECK(beside.response.max_abs_mm == alone.response.max_abs_mm);
      CHECK(alone.other_overrides.empty());
      REQUIRE(beside.other_overrides.size() == overrides.size());
      for (std::size_t i = 0; i < overrides.size(); ++i) {
        CAPTURE(overrides[i]);
        const SimulationFigures full = simulate_blocks(blocks, path, rule, overrides[i], options);
        CHECK(beside.other_overrides[i].override_ratio == overrides[i]);
        check_alike(beside.other_overrides[i].command_mm, full.command.max_abs_mm);
        check_alike(beside.other_overrides[i].response_mm, full.response.max_abs_mm);
      }
    }
  }
}

TEST_CASE("where the bounds do not hold other overrides are runs in full") {
  Random random(7);
  const std::vector<Segment> segments = random_path(random, 40.0);
  const Path path(segments);
  SimulationOptions options;
  options.modes[0] = {Mode{46.0, 0.02, 1.0}};
  const std::vector<Segment> blocks = random_blocks(random, segments, options.period_s);
  options.axis_filters = {Fir::moving_average(12)};
  options.other_overrides = {0.7};
  const SimulationFigures beside = simulate_blocks(blocks, path, BlockEnd::ceil, 1.0, options);
  options.other_overrides.clear();
  const SimulationFigures full = simulate_blocks(blocks, path, BlockEnd::ceil, 0.7, options);
  REQUIRE(beside.other_overrides.size() == 1);
  CHECK(beside.other_overrides[0].command_mm == full.command.max_abs_mm);
  CHECK(beside.other_overrides[0].response_mm == full.response.max_abs_mm);
  CHECK(full.response.max_abs_mm > 0.0);

  options.other_overrides = {0.0};
  CHECK_THROWS_AS(static_cast<void>(simulate_blocks(blocks, path, BlockEnd::ceil, 1.0, options)), Error);
  options.other_overrides = {0.7};
  options.last_seconds = 1.0;
  CHECK_THROWS_AS(static_cast<void>(simulate_blocks(blocks, path, BlockEnd::ceil, 1.0, options)), Error);
}
