#include <doctest/doctest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <numbers>
#include <random>
#include <span>
#include <utility>
#include <vector>

#include "shapegcode/error.hpp"
#include "shapegcode/fanuc_model.hpp"
#include "stepped_into.hpp"

using shapegcode::BlockEnd;
using shapegcode::BlockInterpolator;
using shapegcode::blocks_duration_s;
using shapegcode::Error;
using shapegcode::make_arc;
using shapegcode::make_line;
using shapegcode::Segment;
using shapegcode::Vector3;

namespace {

/// Lines along X, one after the other.
std::vector<Segment> row_of_lines(const std::vector<double>& lengths, const std::vector<double>& feeds) {
  std::vector<Segment> blocks;
  double x = 0.0;
  for (std::size_t i = 0; i < lengths.size(); ++i) {
    blocks.push_back(make_line({x, 0, 0}, {x + lengths[i], 0, 0}, feeds[i], static_cast<std::uint32_t>(i + 1)));
    x += lengths[i];
  }
  return blocks;
}

std::vector<double> simulated(const std::vector<Segment>& blocks, double period, BlockEnd end, double ratio = 1.0) {
  BlockInterpolator interpolator(blocks, period, end, ratio);
  std::vector<double> x;
  Vector3 position;
  while (interpolator.step(position)) x.push_back(position.x());
  return x;
}

void check_set_points(const std::vector<double>& found, const std::vector<double>& expected) {
  REQUIRE(found.size() == expected.size());
  for (std::size_t i = 0; i < found.size(); ++i) {
    CAPTURE(i);
    CHECK(found[i] == doctest::Approx(expected[i]).epsilon(1e-12));
  }
}

}  // namespace

TEST_CASE(
    "block interpolator: a block of two and a half periods lasts three under ceil, its successor starts on the tick") {
  // Period 1 ms: 0.25 mm at 100 mm/s, then 0.2 mm at 50 mm/s.
  const auto blocks = row_of_lines({0.25, 0.2}, {100.0, 50.0});
  check_set_points(simulated(blocks, 1e-3, BlockEnd::ceil), {0.0, 0.1, 0.2, 0.25, 0.3, 0.35, 0.4, 0.45});
  CHECK(blocks_duration_s(blocks, 1e-3, BlockEnd::ceil) == doctest::Approx(0.007));
}

TEST_CASE("block interpolator: under carry the remainder goes on at the successor's feed") {
  // The first block ends at 2.5 ms: at 3 ms the second has run half a millisecond; it ends at 6.5 ms.
  const auto blocks = row_of_lines({0.25, 0.2}, {100.0, 50.0});
  check_set_points(simulated(blocks, 1e-3, BlockEnd::carry), {0.0, 0.1, 0.2, 0.275, 0.325, 0.375, 0.425, 0.45});
  CHECK(blocks_duration_s(blocks, 1e-3, BlockEnd::carry) == doctest::Approx(0.0065));
}

TEST_CASE("block interpolator: several blocks within one period") {
  // 0.03 mm at 100 mm/s last 0.3 ms each: under carry three and a third to the period, under ceil one.
  const std::vector<double> lengths(10, 0.03);
  const std::vector<double> feeds(10, 100.0);
  const auto blocks = row_of_lines(lengths, feeds);
  check_set_points(simulated(blocks, 1e-3, BlockEnd::carry), {0.0, 0.1, 0.2, 0.3});
  check_set_points(simulated(blocks, 1e-3, BlockEnd::ceil),
                   {0.0, 0.03, 0.06, 0.09, 0.12, 0.15, 0.18, 0.21, 0.24, 0.27, 0.3});
}

TEST_CASE("block interpolator: feed override scales the time") {
  const auto blocks = row_of_lines({0.5}, {100.0});  // 5 ms
  CHECK(blocks_duration_s(blocks, 1e-3, BlockEnd::carry, 0.5) == doctest::Approx(0.010));
  CHECK(blocks_duration_s(blocks, 1e-3, BlockEnd::carry, 1.2) == doctest::Approx(0.005 / 1.2));
  CHECK(blocks_duration_s(blocks, 1e-3, BlockEnd::ceil, 0.9) == doctest::Approx(0.006));  // 5.56 ms
  CHECK(blocks_duration_s(blocks, 1e-3, BlockEnd::ceil, 1.2) == doctest::Approx(0.005));  // 4.17 ms
  check_set_points(simulated(blocks, 1e-3, BlockEnd::carry, 2.0), {0.0, 0.2, 0.4, 0.5});
}

TEST_CASE("block interpolator: a block that ends on a tick to within rounding ends there") {
  // 5 ms at feeds of a tenth of mm/min: l = F*5 ms in doubles.
  int wrong = 0;
  for (int f = 1; f < 20000; ++f) {
    const double feed = f / 10.0 / 60.0;
    const std::vector<Segment> block{make_line({0, 0, 0}, {feed * 0.005, 0, 0}, feed)};
    if (std::abs(blocks_duration_s(block, 1e-3, BlockEnd::ceil) - 0.005) > 1e-12) ++wrong;
  }
  CHECK(wrong == 0);
  // One part in a thousand longer is a tick more.
  const std::vector<Segment> longer{make_line({0, 0, 0}, {0.1001, 0, 0}, 20.0)};
  CHECK(blocks_duration_s(longer, 1e-3, BlockEnd::ceil) == doctest::Approx(0.006));
}

TEST_CASE("block interpolator: blocks without length take no time and need no feed") {
  auto blocks = row_of_lines({0.1, 0.0, 0.0, 0.1}, {100.0, 0.0, 100.0, 100.0});
  for (const BlockEnd end : {BlockEnd::ceil, BlockEnd::carry})
    check_set_points(simulated(blocks, 1e-3, end), {0.0, 0.1, 0.2});
  blocks = row_of_lines({0.0}, {0.0});
  CHECK(simulated(blocks, 1e-3, BlockEnd::ceil).size() == 1);
  CHECK(simulated({}, 1e-3, BlockEnd::ceil).empty());
  CHECK(blocks_duration_s({}, 1e-3, BlockEnd::ceil) == 0.0);
}

TEST_CASE("block interpolator: random blocks against times added up by hand") {
  std::mt19937_64 generator(9);
  std::uniform_real_distribution<double> length(0.001, 0.4);
  std::uniform_real_distribution<double> feed(5.0, 120.0);
  std::vector<double> lengths;
  std::vector<double> feeds;
  for (int i = 0; i < 500; ++i) {
    lengths.push_back(length(generator));
    feeds.push_back(feed(generator));
  }
  const auto blocks = row_of_lines(lengths, feeds);
  for (const BlockEnd end : {BlockEnd::ceil, BlockEnd::carry}) {
    constexpr double period = 1e-3;
    // Start time and start of every block.
    std::vector<double> starts{0.0};
    for (std::size_t i = 0; i < lengths.size(); ++i) {
      const double exact = lengths[i] / feeds[i];
      starts.push_back(starts.back() + (end == BlockEnd::ceil ? std::ceil(exact / period) * period : exact));
    }
    CHECK(blocks_duration_s(blocks, period, end) == doctest::Approx(starts.back()).epsilon(1e-12));
    BlockInterpolator interpolator(blocks, period, end);
    Vector3 position;
    double worst = 0.0;
    int wrong_block = 0;
    std::size_t count = 0;
    for (; interpolator.step(position); ++count) {
      const double time = period * static_cast<double>(count);
      std::size_t block = 0;
      while (block + 1 < lengths.size() && time >= starts[block + 1] - 1e-9) ++block;
      const double expected =
          blocks[block].start_mm.x() + std::min(lengths[block], feeds[block] * (time - starts[block]));
      worst = std::max(worst, std::abs(position.x() - expected));
      if (interpolator.block() != block) ++wrong_block;
    }
    CHECK(worst < 1e-9);
    CHECK(wrong_block == 0);
    CHECK(count == static_cast<std::size_t>(std::ceil(starts.back() / period - 1e-6)) + 1);
    CHECK_FALSE(interpolator.step(position));
    CHECK(position == blocks.back().end_mm);  // to the last bit
  }
}

TEST_CASE("block interpolator: an arc is run along its circle at its feed") {
  const double half_turn = 5.0 * std::numbers::pi;  // mm
  const std::vector<Segment> blocks{make_arc({10, 0, 0}, {0, 0, 0}, {5, 0, 0}, std::numbers::pi, 2, half_turn / 0.1)};
  BlockInterpolator interpolator(blocks, 1e-3, BlockEnd::ceil);
  Vector3 position;
  for (int i = 0; i <= 100; ++i) {
    REQUIRE(interpolator.step(position));
    const double angle = std::numbers::pi * i / 100.0;
    CHECK((position - Vector3(5.0 + 5.0 * std::cos(angle), 5.0 * std::sin(angle), 0.0)).norm() < 1e-12);
  }
  CHECK_FALSE(interpolator.step(position));
}

TEST_CASE("block interpolator: refuses a period, an override or a feed that is not positive") {
  const auto blocks = row_of_lines({1.0}, {10.0});
  const double nan = std::numeric_limits<double>::quiet_NaN();
  for (const double bad : {0.0, -1.0, nan}) {
    CHECK_THROWS_AS(BlockInterpolator(blocks, bad, BlockEnd::ceil), Error);
    CHECK_THROWS_AS(BlockInterpolator(blocks, 1e-3, BlockEnd::ceil, bad), Error);
    const auto without_feed = row_of_lines({1.0, 1.0}, {10.0, bad});
    CHECK_THROWS_AS(BlockInterpolator(without_feed, 1e-3, BlockEnd::ceil), Error);
  }
}

TEST_CASE("block interpolator: a pause holds the end of its block, and the next one starts when it is over") {
  // Period 1 ms: 0.25 mm at 100 mm/s (2.5 ms), then 0.2 mm at 50 mm/s (4 ms).
  const auto blocks = row_of_lines({0.25, 0.2}, {100.0, 50.0});
  const auto paused = [&](BlockEnd end, double seconds, std::size_t steps_before) {
    BlockInterpolator interpolator(blocks, 1e-3, end);
    std::vector<double> x;
    std::vector<std::size_t> pausing;
    Vector3 position;
    for (std::size_t i = 0; i < steps_before; ++i) {
      REQUIRE(interpolator.step(position));
      x.push_back(position.x());
    }
    interpolator.pause_after(0, seconds);
    while (interpolator.step(position)) {
      if (interpolator.pausing()) pausing.push_back(x.size());
      x.push_back(position.x());
    }
    return std::pair(x, pausing);
  };
  // ceil: the block ends at 3 ms, 1.5 ms are two periods, the next one starts at 5 ms.
  for (const std::size_t before : {0U, 1U, 2U}) {
    const auto [x, pausing] = paused(BlockEnd::ceil, 0.0015, before);
    check_set_points(x, {0.0, 0.1, 0.2, 0.25, 0.25, 0.25, 0.3, 0.35, 0.4, 0.45});
    CHECK(pausing == std::vector<std::size_t>{3, 4});
  }
  // carry: it ends at 2.5 ms, the next one starts at 4.8 ms.
  const auto [x, pausing] = paused(BlockEnd::carry, 0.0023, 1);
  check_set_points(x, {0.0, 0.1, 0.2, 0.25, 0.25, 0.26, 0.31, 0.36, 0.41, 0.45});
  CHECK(pausing == std::vector<std::size_t>{3, 4});
  // No time is no pause.
  const auto [same, none] = paused(BlockEnd::carry, 0.0, 1);
  check_set_points(same, simulated(blocks, 1e-3, BlockEnd::carry));
  CHECK(none.empty());
}

TEST_CASE("block interpolator: a pause behind a later block, and pauses that cannot be") {
  const auto blocks = row_of_lines({0.1, 0.1, 0.1}, {100.0, 100.0, 100.0});
  BlockInterpolator interpolator(blocks, 1e-3, BlockEnd::ceil);
  interpolator.pause_after(0, 0.003);
  interpolator.pause_after(1, 0.002);  // takes its place
  std::vector<double> x;
  Vector3 position;
  while (interpolator.step(position)) x.push_back(position.x());
  check_set_points(x, {0.0, 0.1, 0.2, 0.2, 0.2, 0.3});

  BlockInterpolator other(blocks, 1e-3, BlockEnd::ceil);
  CHECK_THROWS_AS(other.pause_after(3, 0.001), Error);
  CHECK_THROWS_AS(other.pause_after(0, -0.001), Error);
  CHECK_THROWS_AS(other.pause_after(0, std::numeric_limits<double>::infinity()), Error);
  while (other.block() == 0) REQUIRE(other.step(position));
  CHECK_THROWS_AS(other.pause_after(0, 0.001), Error);
}

TEST_CASE(
    "block interpolator: thousands of blocks that end within one period are passed in groups, to the same set-points") {
  // Blocks of no length under `ceil`, of 10 ns under `carry`, between two of 2.5 periods, and a pause among them.
  constexpr std::size_t count = 70'000;
  for (const BlockEnd end : {BlockEnd::ceil, BlockEnd::carry}) {
    for (const bool pauses : {false, true}) {
      CAPTURE(pauses);
      std::vector<double> lengths{0.25};
      for (std::size_t i = 0; i < count; ++i) lengths.push_back(end == BlockEnd::ceil ? 0.0 : 1e-6);
      lengths.push_back(0.25);
      const auto blocks = row_of_lines(lengths, std::vector<double>(lengths.size(), 100.0));
      BlockInterpolator interpolator(blocks, 1e-3, end);
      constexpr std::size_t paused = 40'000;
      if (pauses) interpolator.pause_after(paused, 0.01);
      double time_s = 0.0;  // as the documentation says: each block for its time, one after the other
      std::size_t block = 0;
      Vector3 position;
      for (int i = 0; interpolator.step(position); ++i) {
        const auto lasts = [&](std::size_t k) {
          return interpolator.block_duration_s(blocks[k]) + (pauses && k == paused ? 0.01 : 0.0);
        };
        while (block + 1 < blocks.size() && i * 1e-3 - time_s >= lasts(block) - 1e-9) time_s += lasts(block++);
        CHECK(interpolator.block() == block);
        const double expected = std::min(blocks[block].length_mm, 100.0 * (i * 1e-3 - time_s));
        const bool ended = block + 1 == blocks.size() && i * 1e-3 - time_s >= lasts(block) - 1e-9;
        CHECK(position.x() ==
              doctest::Approx(ended ? blocks.back().end_mm.x() : blocks[block].start_mm.x() + expected).epsilon(1e-9));
      }
    }
  }
}

TEST_CASE("block interpolator: into memory of the caller's, the same set-points") {
  const std::vector<Segment> blocks = row_of_lines({1.0, 0.4, 2.0}, {10.0, 20.0, 30.0});
  BlockInterpolator interpolator(blocks, 0.01, BlockEnd::ceil);
  BlockInterpolator other(blocks, 0.01, BlockEnd::ceil);
  shapegcode::tests::check_same_into_memory(interpolator, other);
}
