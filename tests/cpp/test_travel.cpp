#include "shapegcode/simulation.hpp"

#include <doctest/doctest.h>

#include <memory>
#include <numeric>
#include <span>
#include <vector>

#include "shapegcode/error.hpp"
#include "shapegcode/motion.hpp"

using namespace shapegcode;

namespace {

// 10 mm at 10 mm/s, then 10 mm at 5 mm/s.
std::shared_ptr<const Path> two_lines() {
  return std::make_shared<const Path>(
      std::vector<Segment>{make_line({0, 0, 0}, {10, 0, 0}, 10.0), make_line({10, 0, 0}, {20, 0, 0}, 5.0)});
}

std::vector<double> stations() {
  std::vector<double> s(80);
  for (std::size_t i = 0; i < s.size(); ++i) {
    s[i] = 0.25 * static_cast<double>(i + 1);
  }
  return s;
}

}  // namespace

TEST_CASE("blocks without acceleration are travelled at their feed") {
  const auto path = two_lines();
  const Travel travel = travel_blocks(path->segments(), *path, BlockEnd::ceil, stations(), {0.001, {}, 0.0});
  CHECK(travel.highest_mm_per_s[20] == doctest::Approx(10.0).epsilon(1e-9));
  CHECK(travel.highest_mm_per_s[60] == doctest::Approx(5.0).epsilon(1e-9));
  CHECK(travel.duration_s == doctest::Approx(3.0).epsilon(1e-3));
  CHECK(std::accumulate(travel.time_s.begin(), travel.time_s.end(), 0.0) == doctest::Approx(3.0).epsilon(1e-3));
}

TEST_CASE("a moving average carries the feed of a block into the next one") {
  // While the command is t behind the border, the mean over the last T = 0.1 s moves at v1 - (v1 - v2) t / T and is
  // -v1 T / 2 + v1 t - (v1 - v2) t^2 / (2 T) past it: it arrives after 58.6 ms at 7.07 mm/s and is down 0.25 mm on.
  const auto path = two_lines();
  const Travel travel =
      travel_blocks(path->segments(), *path, BlockEnd::ceil, stations(), {0.001, {Fir::moving_average(100)}, 0.0});
  CHECK(travel.highest_mm_per_s[39] == doctest::Approx(8.66).epsilon(0.01));  // from 9.75 mm on
  CHECK(travel.highest_mm_per_s[40] == doctest::Approx(7.07).epsilon(0.01));  // from 10 mm on
  CHECK(travel.highest_mm_per_s[41] == doctest::Approx(5.0).epsilon(1e-3));
}

TEST_CASE("a window takes the mean over its time") {
  const auto path = two_lines();
  const Travel travel = travel_blocks(path->segments(), *path, BlockEnd::ceil, stations(), {0.001, {}, 0.1});
  // 0.25 mm behind the border, reached after 50 ms at 5 mm/s: half of the window was at 10 mm/s.
  CHECK(travel.highest_mm_per_s[41] == doctest::Approx(7.5).epsilon(0.01));
  CHECK(travel.highest_mm_per_s[42] == doctest::Approx(5.0).epsilon(0.01));
}

TEST_CASE("a path with look-ahead is slow enough where a slower segment begins") {
  const auto path = two_lines();
  MotionLimits limits;
  limits.time_constant_s = 0.05;
  const auto profile = std::make_shared<const SpeedProfile>(plan_speed(*path, limits));
  const Travel travel = travel_path(path, profile, *path, stations(), {0.001, {}, 0.0});
  CHECK(travel.highest_mm_per_s[20] == doctest::Approx(10.0).epsilon(1e-6));
  for (std::size_t i = 40; i < travel.highest_mm_per_s.size(); ++i) {
    CHECK(travel.highest_mm_per_s[i] <= 5.0 * 1.02);  // the step that passes the border began before it
  }
}

TEST_CASE("stations that do not fit are refused") {
  const auto path = two_lines();
  const auto run = [&](const std::vector<double>& s, const TravelOptions& options) {
    (void)travel_blocks(path->segments(), *path, BlockEnd::ceil, s, options);
  };
  CHECK_THROWS_AS(run({}, {}), Error);
  CHECK_THROWS_AS(run({10.0}, {}), Error);
  CHECK_THROWS_AS(run({15.0, 10.0, 20.0}, {}), Error);
  CHECK_THROWS_AS(run({20.0}, {0.0, {}, 0.0}), Error);
  CHECK_THROWS_AS(run({20.0}, {0.001, {}, -1.0}), Error);
}

TEST_CASE("a travel without a way is refused, not read past its end") {
  const auto path = two_lines();
  const auto profile = std::make_shared<const SpeedProfile>();
  const auto nothing = std::make_shared<const Path>();
  const auto of_blocks = [&](const shapegcode::Segments& blocks, double window_s) {
    static_cast<void>(travel_blocks(blocks, *path, BlockEnd::ceil, stations(), {0.001, {}, window_s}));
  };
  const auto of_path = [&] { static_cast<void>(travel_path(nothing, profile, *path, stations(), {0.001, {}, 0.0})); };
  CHECK_THROWS_WITH_AS(of_blocks({}, 0.0), "a travel needs a path with at least one segment", Error);
  CHECK_THROWS_WITH_AS(of_path(), "a travel needs a path with at least one segment", Error);
  CHECK_THROWS_WITH_AS(of_blocks(path->segments(), 1e9),
                       "window of a travel takes 1e+12 periods, at most 10000000 are possible", Error);
}
