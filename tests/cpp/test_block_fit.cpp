#include <doctest/doctest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <limits>
#include <numbers>
#include <random>
#include <set>
#include <vector>

#include "fitted_blocks.hpp"
#include "shapegcode/error.hpp"
#include "shapegcode/write.hpp"

using namespace shapegcode::tests;
using shapegcode::Error;
using shapegcode::fit_blocks;
using shapegcode::FitOptions;
using shapegcode::FittedBlock;
using shapegcode::FittedKind;
using shapegcode::Vector3;

TEST_CASE("block fit: a steady line is one block, F exact") {
  // 0.3 mm per 5 ms: 60 mm/s, F3600.
  const Command command = sampled(1000, [](double k) { return Vector3(0.3 * k, 0.0, 0.0); });
  const auto blocks = fit(command);
  REQUIRE(blocks.size() == 1);
  CHECK(blocks[0].end == Position{300000, 0, 0});
  CHECK(blocks[0].feed == 36000);
  CHECK(blocks[0].periods == 1000);
  CHECK(blocks[0].first_period == 0);
  CHECK(blocks[0].kind == FittedKind::line);
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
    CHECK(block.feed <= exact + 1 + exact / 200);  // a round number near by
  }
}

TEST_CASE("block fit: F goes up, never down, by no more than half a percent or a quarter of an increment") {
  // Whatever the length, a block of one period ends within its last tick.
  const FitOptions options;
  for (std::int64_t um = 1; um < 3000; ++um) {
    const Command command =
        sampled(1, [&](double k) { return Vector3(0.001 * static_cast<double>(um) * k, 0.0, 0.0); });
    const auto blocks = fit(command);
    REQUIRE(blocks.size() == 1);
    const double exact = 0.001 * static_cast<double>(um) / 0.005 / options.feed_unit_mm_per_s;
    CHECK(static_cast<double>(blocks[0].feed) >= exact * (1.0 - 1e-12));
    const double allowed = std::min(0.005, 0.25 / static_cast<double>(um));
    CHECK(static_cast<double>(blocks[0].feed) <= (exact + 1.0) * (1.0 + allowed) * (1.0 + 3e-5));
  }
}

TEST_CASE("block fit: blocks of nearly one length share a round F") {
  // 100 um in 5 ms and a little more: 1200 ... 1203 mm/min. Each block for itself would have its own F.
  const Command even = sampled(40, [](double k) { return Vector3(0.1 * k, 0.002 * k * k / 40.0, 0.0); });
  FitOptions options;
  options.merge_tolerance_increments = 0.0;
  std::set<std::int64_t> feeds;
  for (const FittedBlock& block : fit(even, options)) {
    feeds.insert(block.feed);
    CHECK(block.feed % 10 == 0);  // in tenths: no digit behind the point
  }
  CHECK(feeds.size() <= 3);
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

namespace {

/// Blocks between the transitions of a line at `units` of F: 6 periods of acceleration at either end.
int steady_blocks(std::mt19937& random, const FitOptions& options, int units) {
  const double speed = units * options.feed_unit_mm_per_s;
  const int last = 500 + static_cast<int>(random() % 4000);
  const double ramp = 6.0;
  const double angle = std::array{0.0, 0.3, 0.9272952180016122}[random() % 3];
  const Vector3 direction(std::cos(angle), std::sin(angle), 0.0);
  const double phase = std::uniform_real_distribution<>(0.0, 1.0)(random) * options.increment_mm;
  const auto travelled = [&](double k) {
    if (k < ramp) return 0.5 * k * k / ramp;
    if (k < last) return k - 0.5 * ramp;
    const double past = std::min(k - last, ramp);
    return last - 0.5 * ramp + past - 0.5 * past * past / ramp;
  };
  const Command command = sampled(last + 6, [&](double k) {
    return Vector3(direction * speed * options.block_period_s * travelled(k) + Vector3(phase, 0.3 * phase, 0.0));
  });
  int count = 0;
  for (const FittedBlock& block : fit(command, options)) {
    count += block.first_period >= 6 && block.first_period + block.periods <= static_cast<unsigned>(last) ? 1 : 0;
  }
  return count;
}

}  // namespace

TEST_CASE("block fit: a steady line takes few blocks, whatever its F, its direction and the grid") {
  std::mt19937 random(7);
  int over_four = 0;
  for (int trial = 0; trial < 1000; ++trial) {
    FitOptions options;
    options.block_period_s = std::array{0.001, 0.002, 0.004, 0.005, 0.008}[random() % 5];
    options.merge_tolerance_increments = 0.35;
    int units = 10 + static_cast<int>(random() % 149990);  // F1 ... F15000 in steps of a tenth
    if (trial % 4 == 3) {                                  // inch
      options.increment_mm = 0.00254;
      options.feed_unit_mm_per_s = 0.1 * 25.4 / 60.0;
      units = 10 + static_cast<int>(random() % 5900);
    }
    // Round feeds move by whole increments: the command may stay half between two of them for its whole length.
    units = trial % 3 == 0 ? units / 10 * 10 + 10 : trial % 5 == 0 ? units / 600 * 600 + 600 : units;
    CAPTURE(units);
    CAPTURE(options.block_period_s);
    CAPTURE(options.increment_mm);
    const int count = steady_blocks(random, options, units);
    CHECK(count <= 8);
    over_four += count > 4 ? 1 : 0;
  }
  CHECK(over_four <= 5);
  // F60 at 5 ms is five increments a period; so are the others.
  for (const int units : {600, 4800, 9000, 12000, 30000}) {
    CAPTURE(units);
    CHECK(steady_blocks(random, FitOptions{}, units) <= 4);
  }
}

TEST_CASE("block fit: blocks of one duration, but where it is slow or far from the ends") {
  const Command command = sampled(2000, [](double k) { return Vector3(0.3 * k, 0.0, 0.0); });
  FitOptions options;
  CHECK(fit(command, options).size() <= 4);
  options.most_periods = 1;
  CHECK(fit(command, options).size() == 2000);
  options.equal_above_increments = 61.0;  // 300 increments per block of five ticks are 60 per tick
  CHECK(fit(command, options).size() <= 4);
  options.equal_above_increments = 59.0;
  options.equal_periods = 100;
  const auto blocks = fit(command, options);
  REQUIRE(blocks.size() > 200);
  CHECK(blocks.size() <= 204);
  CHECK(std::all_of(blocks.begin(), blocks.begin() + 100, [](const FittedBlock& each) { return each.periods == 1; }));
  CHECK(std::all_of(blocks.end() - 100, blocks.end(), [](const FittedBlock& each) { return each.periods == 1; }));
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
            const Simulated simulated = as_simulated(from, block, options.increment_mm);
            const FittedKind expected = sense > 0.0 ? FittedKind::counter_clockwise : FittedKind::clockwise;
            if (block.kind != FittedKind::line && (block.kind != expected || int{block.normal} != normal))
              ++wrong_sense;
            for (int i = 0; i <= 20; ++i) {
              Vector3 p = simulated.at(i / 20.0) - centre;
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
      off = std::max(off, (as_simulated(from, block, 0.001).at(0.5) - at(block.first_period + 0.5)).norm());
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
  for (const FittedBlock& block : fit(small, options)) CHECK(block.kind == FittedKind::line);
  const Command straight = sampled(
      100, [](double k) { return Vector3(0.3 * k, 0.1 * k, 0.0); }, 2);
  for (const FittedBlock& block : fit(straight)) CHECK(block.kind == FittedKind::line);
}

TEST_CASE("block fit: R has no more digits than a word can have") {
  // In steps of 0.1 um a radius of 10 m has nine digits.
  for (const double radius : {8000.0, 12000.0, 60000.0}) {
    const Command flat = sampled(
        60,
        [&](double k) {
          return on_circle({0, 0, 0}, radius, 50.0 * k / radius, 2, 0.0);
        },
        2);
    for (const double increment : {0.001, 0.0001}) {
      FitOptions options;
      options.increment_mm = increment;
      int arcs = 0;
      for (const FittedBlock& block : fit(flat, options)) {
        CHECK(block.radius <= 99999999);
        arcs += block.kind == FittedKind::line ? 0 : 1;
      }
      CHECK((arcs > 0) == (radius / increment < 1e8));
    }
  }
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
      CHECK(std::abs(as_simulated(from, block, 0.001).sweep) <= FitOptions{}.max_sweep_rad);
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
  REQUIRE(plain.back().kind == FittedKind::line);
  options.last_kind = FittedKind::counter_clockwise;
  options.last_normal = 2;
  options.last_radius_mm = 20.0;
  const auto blocks = fit(command, options);
  REQUIRE(!blocks.empty());
  CHECK(blocks.back().kind == FittedKind::counter_clockwise);
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

TEST_CASE("block fit: arcs meet at smaller angles where that is asked for") {
  // A path whose direction swings by 0.1 rad over 7 mm: arcs through ends and middles of blocks of 1 mm are off its
  // tangents, now more and now less.
  const Command command = sampled(60, [&](double k) {
    Vector3 at = Vector3::Zero();
    const int steps = 400;
    for (int i = 0; i < steps; ++i) {
      const double s = k * (i + 0.5) / steps;
      const double direction = 0.1 * std::sin(0.9 * s);
      at += Vector3(std::cos(direction), std::sin(direction), 0.0) * k / steps;
    }
    return at;
  });
  const std::vector<std::int8_t> normals(60, std::int8_t{2});
  const auto largest_angle = [&](double smooth_mm) {
    FitOptions options;
    options.increment_mm = 1e-5;
    options.feed_unit_mm_per_s = 1e-3 / 60.0;
    options.smooth_arcs_mm = smooth_mm;
    const auto blocks = shapegcode::fit_blocks(command.grid, command.middle, normals, {}, options);
    double largest = 0.0;
    double before = 0.0;
    Position start{};
    for (std::size_t i = 0; i < blocks.size(); ++i) {
      const double dx = static_cast<double>(blocks[i].end[0] - start[0]) * 1e-5;
      const double dy = static_cast<double>(blocks[i].end[1] - start[1]) * 1e-5;
      const bool is_arc = blocks[i].kind != FittedKind::line;
      const double half =
          is_arc ? std::asin(0.5 * std::hypot(dx, dy) / (static_cast<double>(blocks[i].radius) * 1e-5)) : 0.0;
      const double side = blocks[i].kind == FittedKind::clockwise ? -1.0 : 1.0;
      const double chord = std::atan2(dy, dx);
      if (i > 2 && i + 1 < blocks.size()) {
        largest = std::max(largest, std::abs(std::remainder(chord - side * half - before, 2.0 * std::numbers::pi)));
      }
      before = chord + side * half;
      start = blocks[i].end;
    }
    return largest;
  };
  CHECK(largest_angle(0.0) > 5e-4);
  CHECK(largest_angle(1e-3) < 0.5 * largest_angle(0.0));
  CHECK(largest_angle(2e-4) < 0.8 * largest_angle(0.0));
}
