#include "shapegcode/milling/feed.hpp"

#include <doctest/doctest.h>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <limits>
#include <random>
#include <string>
#include <vector>

#include "shapegcode/error.hpp"

using namespace shapegcode;

namespace {

constexpr double infinity = std::numeric_limits<double>::infinity();

FeedStations even_stations(double length_mm, double step_mm, double (*feed)(double s_mm)) {
  FeedStations stations;
  const auto count = static_cast<std::size_t>(std::lround(length_mm / step_mm));
  for (std::size_t i = 1; i <= count; ++i) {
    const double s = length_mm * static_cast<double>(i) / static_cast<double>(count);
    stations.s_mm.push_back(s);
    stations.feed_mm_per_min.push_back(feed(s));
  }
  return stations;
}

double lowest(const FeedStations& stations, double begin_mm, double end_mm) {
  double feed = infinity;
  double before = 0.0;
  for (std::size_t i = 0; i < stations.s_mm.size(); ++i) {
    if (before < end_mm - 1e-9 && stations.s_mm[i] > begin_mm + 1e-9) {
      feed = std::min(feed, stations.feed_mm_per_min[i]);
    }
    before = stations.s_mm[i];
  }
  return feed;
}

double time_min(const std::vector<FeedStretch>& sections) {
  double time = 0.0;
  for (const FeedStretch& section : sections) {
    time += (section.end_mm - section.begin_mm) / section.feed_mm_per_min;
  }
  return time;
}

// Every way to place borders on a grid: what dynamic programming must not be slower than.
double best_time_by_trying(const FeedStations& stations, double length_mm, double step_mm, double least_mm,
                           double begin_mm = 0.0) {
  double best = infinity;
  for (double end = begin_mm + least_mm; end <= length_mm + 1e-9; end += step_mm) {
    const bool last = end > length_mm - 1e-9;
    if (!last && length_mm - end < least_mm - 1e-9) {
      continue;
    }
    const double here = (end - begin_mm) / lowest(stations, begin_mm, end);
    best = std::min(best, here + (last ? 0.0 : best_time_by_trying(stations, length_mm, step_mm, least_mm, end)));
  }
  return best;
}

}  // namespace

TEST_CASE("a feed schedule keeps every station, the least length and the borders of blocks") {
  std::mt19937 random(7);
  std::uniform_real_distribution<double> uniform(0.0, 1.0);
  for (int draw = 0; draw < 200; ++draw) {
    std::vector<FeedBlock> blocks;
    double length = 0.0;
    while (length < 20.0) {
      length += 0.05 + 4.0 * std::pow(uniform(random), 3.0);
      blocks.push_back({length, uniform(random) < 0.05 ? 150.0 : 0.0, uniform(random) < 0.8});
    }
    FeedStations stations;
    double feed = 300.0;
    for (double s = 0.0; s < length;) {
      s = std::min(length, s + 0.02 + 0.3 * uniform(random));
      feed = std::clamp(feed * std::exp(0.4 * (uniform(random) - 0.5)), 50.0, 800.0);
      stations.s_mm.push_back(s);
      stations.feed_mm_per_min.push_back(feed);
    }
    const auto sections = schedule_feed(blocks, stations, {0.6, infinity, 0.1});
    double at = 0.0;
    for (const FeedStretch& section : sections) {
      CHECK(section.begin_mm == at);
      at = section.end_mm;
      const auto inside = std::find_if(blocks.begin(), blocks.end(),
                                       [&](const FeedBlock& block) { return block.end_mm > section.end_mm - 1e-9; });
      REQUIRE(inside != blocks.end());
      const double begin = inside == blocks.begin() ? 0.0 : (inside - 1)->end_mm;
      if (std::abs(inside->end_mm - section.end_mm) > 1e-9) {  // within a block: both pieces are long enough
        CHECK(inside->divisible);
        CHECK(inside->kept_mm_per_min == 0.0);
        CHECK(section.end_mm - begin >= 0.6 - 1e-9);
        CHECK(inside->end_mm - section.end_mm >= 0.6 - 1e-9);
      }
      if (inside->kept_mm_per_min == 0.0) {
        CHECK(section.feed_mm_per_min <= lowest(stations, section.begin_mm, section.end_mm) + 1e-9);
      }
    }
    CHECK(at == doctest::Approx(length));
  }
}

TEST_CASE("a feed schedule is as fast as the best of all ways to place the borders") {
  const std::vector<FeedBlock> blocks = {{6.0, 0.0, true}};
  const auto dip = [](double s) { return 300.0 - 220.0 * std::exp(-(s - 3.1) * (s - 3.1) / 0.8); };
  const FeedStations stations = even_stations(6.0, 0.15, +dip);
  const auto sections = schedule_feed(blocks, stations, {0.6, infinity, 1e-6});
  // The same places for borders: every 0.15 mm.
  const double best = best_time_by_trying(stations, 6.0, 0.15, 0.6);
  CHECK(time_min(sections) >= best - 1e-9);
  // Each border costs at most a hundredth of the time of the shortest section.
  CHECK(time_min(sections) <= best + 10 * 0.01 * 0.6 / 80.0);
  for (const FeedStretch& section : sections) {
    CHECK(section.end_mm - section.begin_mm >= 0.6 - 1e-9);
  }
}

TEST_CASE("a limited change of feed holds from section to section") {
  const std::vector<FeedBlock> blocks = {{30.0, 0.0, true}, {34.0, 0.0, true}, {60.0, 0.0, true}};
  const auto step = [](double s) { return s > 30.0 && s < 34.0 ? 80.0 : 216.0; };
  const auto sections = schedule_feed(blocks, even_stations(60.0, 0.1, +step), {0.6, 20.0, 0.1});
  for (std::size_t i = 1; i < sections.size(); ++i) {
    CHECK(std::abs(sections[i].feed_mm_per_min - sections[i - 1].feed_mm_per_min) <= 20.0 + 1e-9);
  }
  CHECK(sections.front().feed_mm_per_min == 216.0);
  CHECK(sections.front().end_mm > 20.0);  // the ramp is as short as it may be
}

TEST_CASE("feeds are low before a load and behind it as long as the travel lags") {
  FeedStations stations = even_stations(
      10.0, 0.1, +[](double s) { return s > 5.05 && s < 6.05 ? 60.0 : 600.0; });
  const std::vector<double> load = stations.feed_mm_per_min;
  const std::vector<double> before(stations.s_mm.size(), 0.45);  // at 1 mm/s: 0.45 mm
  const std::vector<double> behind(stations.s_mm.size(), 0.25);
  look_ahead_on_load(stations, load, before, behind);
  for (std::size_t i = 0; i < stations.s_mm.size(); ++i) {
    // A station speaks for the 0.1 mm before it; whole ones are lowered.
    const bool low = stations.s_mm[i] > 4.55 && stations.s_mm[i] < 6.35;
    CHECK(stations.feed_mm_per_min[i] == (low ? 60.0 : 600.0));
  }
}

TEST_CASE("a feed that is low without need is not looked ahead on") {
  FeedStations stations = even_stations(
      10.0, 0.1, +[](double s) { return s > 5.05 ? 60.0 : 600.0; });
  const std::vector<double> load(stations.s_mm.size(), infinity);
  const std::vector<double> times(stations.s_mm.size(), 1.0);
  const std::vector<double> wanted = stations.feed_mm_per_min;
  look_ahead_on_load(stations, load, times, times);
  CHECK(stations.feed_mm_per_min == wanted);
}

TEST_CASE("a path with other feeds has the same points") {
  const Path path({make_line({0, 0, 0}, {10, 0, 0}, 5.0, 3),
                   make_arc({10, 0, 0}, {14, 4, 0}, {10, 4, 0}, 1.5707963267948966, 2, 5.0, 4)});
  const std::vector<FeedStretch> sections = {{0.0, 4.0, 120.0}, {4.0, 12.0, 60.0}, {12.0, path.length_mm(), 90.0}};
  const Path other = with_feeds(path, sections);
  REQUIRE(other.size() == 4);
  CHECK(other.length_mm() == doctest::Approx(path.length_mm()).epsilon(1e-12));
  CHECK(other[0].feed_mm_per_s == 2.0);
  CHECK(other[1].feed_mm_per_s == 1.0);
  CHECK(other[2].feed_mm_per_s == 1.0);
  CHECK(other[3].feed_mm_per_s == 1.5);
  CHECK(other[2].line == 4);
  std::size_t a = 0;
  std::size_t b = 0;
  for (double s = 0.0; s < path.length_mm(); s += 0.37) {
    CHECK((path.point(s, a) - other.point(s, b)).norm() < 1e-12);
  }
}

TEST_CASE("bad feed schedules are refused") {
  const FeedStations stations{{1.0, 2.0}, {100.0, 100.0}};
  const std::vector<FeedBlock> blocks = {{2.0, 0.0, true}};
  CHECK_THROWS_AS((void)schedule_feed({}, stations, {}), Error);
  CHECK_THROWS_AS((void)schedule_feed(std::vector<FeedBlock>{{3.0, 0.0, true}}, stations, {}), Error);
  CHECK_THROWS_AS((void)schedule_feed(blocks, {{1.0, 2.0}, {100.0, 0.0}}, {}), Error);
  CHECK_THROWS_AS((void)schedule_feed(blocks, {{2.0, 1.0}, {100.0, 100.0}}, {}), Error);
  CHECK_THROWS_AS((void)schedule_feed(blocks, stations, {0.0, infinity, 0.1}), Error);
  const auto refusal = [](const std::vector<FeedBlock>& of, const FeedStations& at,
                          const FeedScheduleOptions& options) {
    try {
      (void)schedule_feed(of, at, options);
    } catch (const Error& error) {
      return std::string(error.what());
    }
    return std::string("no error");
  };
  CHECK(refusal({{0.0, 0.0, true}}, {{0.0}, {100.0}}, {}) ==
        "the blocks of a feed schedule end at 0 mm, must have a length");
  CHECK(refusal({{infinity, 0.0, true}}, {{infinity}, {100.0}}, {}) ==
        "blocks of a feed schedule must ascend: one ends at inf mm");
  CHECK(refusal(blocks, stations, {1e-300, infinity, 0.1}) ==
        "a quarter of the least length of 2.5e-301 mm cuts 2 mm into 8e+300 pieces, limit 1e+09");
  CHECK(refusal({{1e-7, 0.0, true}}, {{1e-5}, {100.0}}, {}) == "the stations end at 1e-05 mm, the blocks at 1e-07 mm");
  const Path line({make_line({0, 0, 0}, {2, 0, 0}, 1.0)});
  using Sections = std::vector<FeedStretch>;
  for (const Sections& sections : {Sections{}, Sections{{1.0, 2.0, 60.0}}, Sections{{0.0, 1.0, 60.0}},
                                   Sections{{0.0, 0.5, 60.0}, {1.0, 2.0, 60.0}}, Sections{{0.0, -infinity, 60.0}}}) {
    CHECK_THROWS_AS((void)with_feeds(line, sections), Error);
  }
}
