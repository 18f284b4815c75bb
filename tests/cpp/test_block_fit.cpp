#include <doctest/doctest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <functional>
#include <limits>
#include <numbers>
#include <random>
#include <vector>

#include "shapegcode/emission/block_fit.hpp"
#include "shapegcode/error.hpp"

using shapegcode::BlockKind;
using shapegcode::Error;
using shapegcode::fit_blocks;
using shapegcode::FitOptions;
using shapegcode::FittedBlock;
using shapegcode::Vector3;

namespace {

constexpr double pi = std::numbers::pi;

using Position = std::array<std::int64_t, 3>;

/// A command on the grid and half-way between.
struct Command {
  Eigen::MatrixXd grid, middle;
  std::vector<std::int8_t> normals;
};

/// Samples `at(period)`, a position for any real period number.
Command sampled(int periods, const std::function<Vector3(double)>& at, int normal = -1) {
  Command command;
  command.grid.resize(periods + 1, 3);
  command.middle.resize(periods, 3);
  for (int k = 0; k <= periods; ++k) command.grid.row(k) = at(k);
  for (int k = 0; k < periods; ++k) command.middle.row(k) = at(k + 0.5);
  command.normals.assign(static_cast<std::size_t>(periods), static_cast<std::int8_t>(normal));
  return command;
}

std::vector<FittedBlock> fit(const Command& command, const FitOptions& options = {},
                             const std::vector<std::uint32_t>& breaks = {}) {
  return fit_blocks(command.grid, command.middle, command.normals, breaks, options);
}

Position rounded(const Command& command, Eigen::Index k, double increment) {
  Position p;
  for (Eigen::Index i = 0; i < 3; ++i) p[static_cast<std::size_t>(i)] = std::llround(command.grid(k, i) / increment);
  return p;
}

Vector3 to_mm(const Position& p, double increment) {
  return increment * Vector3(static_cast<double>(p[0]), static_cast<double>(p[1]), static_cast<double>(p[2]));
}

/// A block as a controller sees it: from its words alone.
struct Played {
  Vector3 start, end;
  BlockKind kind;
  int normal = 2;
  Vector3 centre = Vector3::Zero();
  double radius = 0.0, sweep = 0.0, length = 0.0;

  [[nodiscard]] Vector3 at(double fraction) const {
    Vector3 p = start + fraction * (end - start);
    if (kind == BlockKind::line) return p;
    const int a = (normal + 1) % 3;
    const int b = (normal + 2) % 3;
    const double turn = sweep * fraction;
    const double da = start[a] - centre[a];
    const double db = start[b] - centre[b];
    p[a] = centre[a] + da * std::cos(turn) - db * std::sin(turn);
    p[b] = centre[b] + da * std::sin(turn) + db * std::cos(turn);
    return p;
  }
};

/// R > 0: the centre lies left of the chord for G03, right of it for G02; the sweep is below 180 degrees.
Played as_played(const Position& from, const FittedBlock& block, double increment) {
  Played played{to_mm(from, increment), to_mm(block.end, increment), block.kind, block.normal};
  const Vector3 move = played.end - played.start;
  played.length = move.norm();
  if (block.kind == BlockKind::line) return played;
  const int a = (played.normal + 1) % 3;
  const int b = (played.normal + 2) % 3;
  const double chord = std::hypot(move[a], move[b]);
  const double sense = block.kind == BlockKind::counter_clockwise ? 1.0 : -1.0;
  played.radius = static_cast<double>(block.radius) * increment;
  const double height = std::sqrt(std::max(0.0, played.radius * played.radius - 0.25 * chord * chord));
  played.centre = played.start;
  played.centre[a] += 0.5 * move[a] - sense * height * move[b] / chord;
  played.centre[b] += 0.5 * move[b] + sense * height * move[a] / chord;
  played.sweep = sense * 2.0 * std::asin(0.5 * chord / played.radius);
  played.length = std::hypot(played.radius * played.sweep, move[played.normal]);
  return played;
}

struct Findings {
  int wrong_end = 0;         // not the command's position, rounded once
  int wrong_ticks = 0;       // does not last its periods on a controller that starts blocks on ticks
  int late = 0;              // takes longer than its periods on one that carries remainders
  int out_of_tolerance = 0;  // a merged sample further off than the tolerance
  int empty = 0;             // no move
  int arcs = 0;
  int bad_sweep = 0;
  std::uint64_t periods = 0;
};

Findings judge(const Command& command, const std::vector<FittedBlock>& blocks, const FitOptions& options) {
  Findings found;
  const double ticks_per_period = std::round(options.block_period_s / options.interpolation_period_s);
  Position from = rounded(command, 0, options.increment_mm);
  for (std::size_t n = 0; n < blocks.size(); ++n) {
    const FittedBlock& block = blocks[n];
    const auto first = static_cast<Eigen::Index>(block.first_period);
    // The rest behind the last block is left out.
    const Eigen::Index last = n + 1 < blocks.size()
                                  ? static_cast<Eigen::Index>(blocks[n + 1].first_period)
                                  : std::min<Eigen::Index>(first + block.periods, command.grid.rows() - 1);
    if (block.end != rounded(command, last, options.increment_mm)) ++found.wrong_end;
    if (block.end == from) ++found.empty;
    const Played played = as_played(from, block, options.increment_mm);
    const double speed = static_cast<double>(block.feed) * options.feed_unit_mm_per_s;
    const double ticks = played.length / speed / options.interpolation_period_s;
    const double wanted = static_cast<double>(block.periods) * ticks_per_period;
    if (std::ceil(ticks - 1e-6) != wanted) ++found.wrong_ticks;
    if (ticks > wanted + 1e-6) ++found.late;
    // Samples between the ends; while nothing has moved there is nothing to follow.
    Eigen::Index moving = first;
    while (moving < last && rounded(command, moving, options.increment_mm) == from) ++moving;
    const double slack = options.merge_tolerance_increments + (block.kind == BlockKind::line ? 1e-3 : 0.251);
    for (Eigen::Index k = first + 1; k < last && moving < last; ++k) {
      const Vector3 p = played.at(static_cast<double>(k - first) / static_cast<double>(last - first));
      const Vector3 off = (p - command.grid.row(k).transpose()).cwiseAbs() / options.increment_mm;
      if (off.maxCoeff() > slack) ++found.out_of_tolerance;
    }
    if (block.kind != BlockKind::line) {
      ++found.arcs;
      if (!(std::abs(played.sweep) < pi / 2)) ++found.bad_sweep;
    }
    found.periods += block.periods;
    from = block.end;
  }
  return found;
}

/// A smooth random command: three moving averages over a random speed, at rest at both ends.
Command random_command(int periods, unsigned seed, double speed_mm_per_period, int steady_for) {
  std::mt19937_64 generator(seed);
  std::normal_distribution<double> speed(0.0, speed_mm_per_period);
  const int half_steps = 2 * periods + 1;
  Eigen::MatrixXd velocity = Eigen::MatrixXd::Zero(half_steps, 3);
  for (int i = 20; i < half_steps - 60; ++i) {
    if ((i - 20) % steady_for == 0) {
      velocity.row(i) = 0.5 * Vector3(speed(generator), speed(generator), 0.2 * speed(generator)).transpose();
    } else {
      velocity.row(i) = velocity.row(i - 1);
    }
  }
  for (const int length : {8, 11, 17}) {
    Eigen::MatrixXd smooth = Eigen::MatrixXd::Zero(half_steps, 3);
    for (int i = 0; i < half_steps; ++i) {
      for (int k = 0; k < length && k <= i; ++k) smooth.row(i) += velocity.row(i - k) / length;
    }
    velocity = smooth;
  }
  Command command = sampled(periods, [](double) { return Vector3::Zero(); });
  Vector3 at(12.3456789, -98.7654321, 5.5);
  for (int i = 0; i < half_steps; ++i) {
    at += velocity.row(i).transpose();
    if (i % 2 == 0) {
      command.grid.row(i / 2) = at;
    } else {
      command.middle.row(i / 2) = at;
    }
  }
  return command;
}

}  // namespace

TEST_CASE("block fit: a steady line is one block, F exact") {
  // 0.3 mm per 5 ms: 60 mm/s, F3600.
  const Command command = sampled(1000, [](double k) { return Vector3(0.3 * k, 0.0, 0.0); });
  const auto blocks = fit(command);
  REQUIRE(blocks.size() == 1);
  CHECK(blocks[0].end == Position{300000, 0, 0});
  CHECK(blocks[0].feed == 36000);
  CHECK(blocks[0].periods == 1000);
  CHECK(blocks[0].first_period == 0);
  CHECK(blocks[0].kind == BlockKind::line);
}

TEST_CASE("block fit: first blocks of a ramp by hand") {
  // Constant acceleration 2000 mm/s2 on 5 ms: x = 25*k^2 um. F = 60*dx/5 ms, rounded up to a tenth.
  const Command command = sampled(8, [](double k) { return Vector3(0.025 * k * k, 0.0, 0.0); });
  const auto blocks = fit(command);
  REQUIRE(blocks.size() == 8);
  for (std::int64_t k = 0; k < 8; ++k) {
    const FittedBlock& block = blocks[static_cast<std::size_t>(k)];
    CHECK(block.end[0] == 25 * (k + 1) * (k + 1));
    CHECK(block.periods == 1);
    const std::int64_t exact = 3000 * (2 * k + 1);  // 25*(2k+1) um in 5 ms, tenths of mm/min
    CHECK(block.feed >= exact);
    CHECK(block.feed <= exact + 1 + exact / 4000);
  }
}

TEST_CASE("block fit: F goes up, never down, and by no more than a step") {
  // Whatever the length, a block of one period ends within its last tick.
  const FitOptions options;
  for (std::int64_t um = 1; um < 3000; ++um) {
    const Command command =
        sampled(1, [&](double k) { return Vector3(0.001 * static_cast<double>(um) * k, 0.0, 0.0); });
    const auto blocks = fit(command);
    REQUIRE(blocks.size() == 1);
    const double exact = 0.001 * static_cast<double>(um) / 0.005 / options.feed_unit_mm_per_s;
    CHECK(static_cast<double>(blocks[0].feed) >= exact * (1.0 - 1e-12));
    CHECK(static_cast<double>(blocks[0].feed) <= exact * (1.0 + 3e-5) + 1.0);
  }
}

TEST_CASE("block fit: random smooth commands keep time, place and tolerance") {
  int seed = 0;
  for (const double speed : {0.5, 0.05, 0.004}) {
    for (const int steady_for : {1, 40, 400}) {
      for (const double increment : {0.001, 0.00254, 0.0001}) {
        const Command command = random_command(3000, static_cast<unsigned>(++seed), speed, steady_for);
        FitOptions options;
        options.increment_mm = increment;
        const auto blocks = fit(command, options);
        const Findings found = judge(command, blocks, options);
        CAPTURE(speed);
        CAPTURE(steady_for);
        CAPTURE(increment);
        REQUIRE(!blocks.empty());
        CHECK(found.wrong_end == 0);
        CHECK(found.empty == 0);
        CHECK(found.wrong_ticks == 0);
        CHECK(found.late == 0);
        CHECK(found.out_of_tolerance == 0);
        CHECK(found.periods <= 3000);
        // Only the rest at the end is left out.
        std::uint64_t resting = 0;
        while (rounded(command, 3000 - static_cast<Eigen::Index>(resting) - 1, increment) == blocks.back().end)
          ++resting;
        CHECK(found.periods + resting >= 3000);
      }
    }
  }
}

TEST_CASE("block fit: nothing drifts over 1e5 blocks") {
  const Command command = random_command(120000, 77, 0.5, 1);
  const FitOptions options;
  const auto blocks = fit(command, options);
  CHECK(blocks.size() > 100000);
  const Findings found = judge(command, blocks, options);
  CHECK(found.wrong_end == 0);
  CHECK(found.wrong_ticks == 0);
  CHECK(found.out_of_tolerance == 0);
}

TEST_CASE("block fit: rest at the start lends its time to the first block, rest at the end is left out") {
  // Ten periods of rest, ten of 0.1 mm, twenty of rest.
  const Command command =
      sampled(40, [](double k) { return Vector3(0.1 * std::clamp(k - 10.0, 0.0, 10.0), 0.0, 0.0); });
  const auto blocks = fit(command);
  REQUIRE(blocks.size() == 2);
  CHECK(blocks[0].first_period == 0);
  CHECK(blocks[0].periods == 11);
  CHECK(blocks[0].end[0] == 100);
  CHECK(blocks[1].first_period == 11);
  CHECK(blocks[1].periods == 9);
  CHECK(blocks[1].end[0] == 1000);
  CHECK(fit(sampled(40, [](double) { return Vector3(1.0, 2.0, 3.0); })).empty());
  CHECK(fit(sampled(40, [](double k) { return Vector3(1.0, 2.0, 3.0 + 1e-5 * k); })).empty());  // 0.4 um
}

TEST_CASE("block fit: a block that rounds to nothing lends its time to its successor") {
  // 0.4 um per period: an increment every two or three periods; no block is empty, no time is lost.
  const Command command =
      sampled(100, [](double k) { return Vector3(0.0004 * k + (k > 50 ? 0.01 * (k - 50) : 0.0), 0.0, 0.0); });
  const FitOptions options;
  const auto blocks = fit(command, options);
  const Findings found = judge(command, blocks, options);
  CHECK(found.empty == 0);
  CHECK(found.wrong_end == 0);
  CHECK(found.wrong_ticks == 0);
  CHECK(found.periods == 100);
}

TEST_CASE("block fit: a move too slow for any F is run faster, in whole periods, and the time is not lost") {
  // 1 um in 1 s is 0.06 mm/min, the least F is 1.0: at most 60 ms of it.
  const Command command =
      sampled(400, [](double k) { return Vector3(k < 200 ? 0.000005 * k : 0.001 + 0.1 * (k - 200), 0.0, 0.0); });
  const FitOptions options;
  const auto blocks = fit(command, options);
  const Findings found = judge(command, blocks, options);
  CHECK(found.wrong_ticks == 0);
  CHECK(found.wrong_end == 0);
  for (const FittedBlock& block : blocks) CHECK(block.feed >= options.minimum_feed);
  CHECK(found.periods == 400);
}

TEST_CASE("block fit: a block ends at every break") {
  const Command command = sampled(100, [](double k) { return Vector3(0.3 * k, 0.0, 0.0); });
  const auto blocks = fit(command, {}, {17, 18, 60, 100});
  REQUIRE(blocks.size() == 4);
  CHECK(blocks[0].end[0] == 17 * 300);
  CHECK(blocks[1].end[0] == 18 * 300);
  CHECK(blocks[2].end[0] == 60 * 300);
  CHECK(blocks[3].end[0] == 100 * 300);
  CHECK(blocks[3].first_period == 60);
}

// --- Arcs
// -------------------------------------------------------------------------------------------------------------

namespace {

Vector3 on_circle(const Vector3& centre, double radius, double angle, int normal, double height) {
  Vector3 p = centre;
  p[(normal + 1) % 3] += radius * std::cos(angle);
  p[(normal + 2) % 3] += radius * std::sin(angle);
  p[normal] += height;
  return p;
}

}  // namespace

TEST_CASE("block fit: steady arcs in three planes and both senses are few blocks that follow the circle") {
  int seed = 0;
  for (int normal = 0; normal < 3; ++normal) {
    for (const double sense : {1.0, -1.0}) {
      for (const double radius : {0.5, 20.0, 300.0}) {
        for (const double climb : {0.0, 0.002}) {
          const Vector3 centre(1.2345 + seed, -0.4567 * seed, 3.3333);
          const double step = 0.3 / radius;  // 60 mm/s
          const int periods = static_cast<int>(std::min(1000.0, 2.0 * pi / step));
          ++seed;
          const Command command = sampled(
              periods,
              [&](double k) { return on_circle(centre, radius, 0.1 * seed + sense * step * k, normal, climb * k); },
              normal);
          const FitOptions options;
          const auto blocks = fit(command, options);
          const Findings found = judge(command, blocks, options);
          CAPTURE(normal);
          CAPTURE(sense);
          CAPTURE(radius);
          CAPTURE(climb);
          CHECK(found.wrong_end == 0);
          CHECK(found.wrong_ticks == 0);
          CHECK(found.late == 0);
          CHECK(found.out_of_tolerance == 0);
          CHECK(found.bad_sweep == 0);
          CHECK(found.periods == static_cast<std::uint64_t>(periods));
          CHECK(found.arcs + 2 >= static_cast<int>(blocks.size()));  // a piece at either end may pass for a line
          CHECK(blocks.size() <= 8);                                 // five of 80 degrees make a full circle
          // Whatever a controller makes of the words stays on the circle between the samples too.
          double off = 0.0;
          int wrong_sense = 0;
          Position from = rounded(command, 0, options.increment_mm);
          for (const FittedBlock& block : blocks) {
            const Played played = as_played(from, block, options.increment_mm);
            const BlockKind expected = sense > 0.0 ? BlockKind::counter_clockwise : BlockKind::clockwise;
            if (block.kind != BlockKind::line && (block.kind != expected || int{block.normal} != normal)) ++wrong_sense;
            for (int i = 0; i <= 20; ++i) {
              Vector3 p = played.at(i / 20.0) - centre;
              p[normal] = 0.0;
              off = std::max(off, std::abs(p.norm() - radius));
            }
            from = block.end;
          }
          CHECK(wrong_sense == 0);
          CHECK(off < 0.0016);  // ends rounded to half an increment per axis, the middle by what the fit allows
        }
      }
    }
  }
}

TEST_CASE("block fit: a steady quarter arc is not cut into periods") {
  // 60 mm/s on a radius of 20 mm: 105 periods. F takes the arc's length, so whole periods are possible.
  const Command command = sampled(
      105,
      [&](double k) {
        return on_circle({20, 20, 0}, 20.0, -pi / 2 + 0.015 * k, 2, 0.0);
      },
      2);
  const auto blocks = fit(command);
  CHECK(blocks.size() <= 5);
}

TEST_CASE("block fit: an arc of changing speed and radius is followed too") {
  const auto at = [](double k) { return on_circle({0, 0, 0}, 5.0 + 0.2 * std::sin(0.05 * k), 0.0002 * k * k, 2, 0.0); };
  const Command command = sampled(150, at, 2);
  const FitOptions options;
  const auto blocks = fit(command, options);
  const Findings found = judge(command, blocks, options);
  CHECK(found.wrong_end == 0);
  CHECK(found.wrong_ticks == 0);
  CHECK(found.out_of_tolerance == 0);
  CHECK(found.bad_sweep == 0);
  CHECK(found.arcs > 50);
  double off = 0.0;
  Position from = rounded(command, 0, options.increment_mm);
  for (const FittedBlock& block : blocks) {
    if (block.periods == 1) {
      off = std::max(off, (as_played(from, block, 0.001).at(0.5) - at(block.first_period + 0.5)).norm());
    }
    from = block.end;
  }
  CHECK(off < 0.0015);
}

TEST_CASE("block fit: pieces below the chord limit are lines, straight ones too") {
  // 0.01 mm per period on a radius of 0.05 mm: chords of 10 um, bulging by 0.25 um.
  const Command small = sampled(
      30,
      [](double k) {
        return on_circle({0, 0, 0}, 0.05, 0.2 * k, 2, 0.0);
      },
      2);
  FitOptions options;
  options.arc_min_chord_mm = 0.5;
  for (const FittedBlock& block : fit(small, options)) CHECK(block.kind == BlockKind::line);
  const Command straight = sampled(
      100, [](double k) { return Vector3(0.3 * k, 0.1 * k, 0.0); }, 2);
  for (const FittedBlock& block : fit(straight)) CHECK(block.kind == BlockKind::line);
}

TEST_CASE("block fit: no piece sweeps more than asked for") {
  // A quarter turn per period cannot be one arc of 80 degrees.
  for (const double turn : {0.3, 1.0, 1.39, 1.5}) {
    const Command command = sampled(
        40,
        [&](double k) {
          return on_circle({0, 0, 0}, 2.0, turn * k, 2, 0.0);
        },
        2);
    Position from = rounded(command, 0, 0.001);
    for (const FittedBlock& block : fit(command)) {
      CHECK(std::abs(as_played(from, block, 0.001).sweep) <= FitOptions{}.max_sweep_rad);
      from = block.end;
    }
  }
}

TEST_CASE("block fit: the last block is an arc where the original ended with one") {
  // Slows down along a quarter circle; the last periods are too short to be arcs.
  const auto at = [](double k) {
    const double u = std::min(k, 100.0) / 100.0;
    return on_circle({0, 0, 0}, 20.0, pi / 2 * u * (2.0 - u), 2, 0.0);
  };
  const Command command = sampled(110, at, 2);
  FitOptions options;
  const auto plain = fit(command, options);
  REQUIRE(plain.back().kind == BlockKind::line);
  options.last_kind = BlockKind::counter_clockwise;
  options.last_normal = 2;
  options.last_radius_mm = 20.0;
  const auto blocks = fit(command, options);
  REQUIRE(!blocks.empty());
  CHECK(blocks.back().kind == BlockKind::counter_clockwise);
  CHECK(blocks.back().radius == 20000);
  CHECK(blocks.back().end == Position{0, 20000, 0});
  const Findings found = judge(command, blocks, options);
  CHECK(found.wrong_end == 0);
  CHECK(found.wrong_ticks == 0);
  CHECK(found.bad_sweep == 0);
}

TEST_CASE("block fit: refuses sizes that do not match and positions out of range") {
  Command command = sampled(10, [](double k) { return Vector3(k, 0, 0); });
  CHECK_THROWS_AS((void)fit_blocks(command.grid.topRows(10), command.middle, command.normals, {}, FitOptions{}), Error);
  CHECK_THROWS_AS((void)fit_blocks(command.grid.leftCols(2), command.middle, command.normals, {}, FitOptions{}), Error);
  const std::vector<std::int8_t> nine(9, -1);
  CHECK_THROWS_AS((void)fit_blocks(command.grid, command.middle, nine, {}, FitOptions{}), Error);
  command.grid(3, 1) = std::numeric_limits<double>::quiet_NaN();
  CHECK_THROWS_AS((void)fit(command), Error);
  command.grid(3, 1) = 100000.0;
  CHECK_THROWS_AS((void)fit(command), Error);
  command.grid(3, 1) = -99999.9;
  CHECK_NOTHROW((void)fit(command));
}
