#include <doctest/doctest.h>

#include <array>
#include <vector>

#include "shapegcode/error.hpp"
#include "shapegcode/fanuc_model.hpp"

using namespace shapegcode;

TEST_CASE("controller: filters of each kind of motion, and how many periods they add") {
  FanucModel model;
  model.motion = MotionKind::after_interpolation;
  model.time_constant_s = 0.05;
  CHECK(filter_periods(acceleration_filters(model)) == 50);
  model.bell_time_s = 0.02;
  REQUIRE(acceleration_filters(model).size() == 2);
  CHECK(filter_periods(acceleration_filters(model)) == 69);  // of their convolution: 50 + 20 - 1 taps
  model.filter_shape = FilterShape::exponential;
  CHECK(filter_periods(acceleration_filters(model)) == 461);  // 50 ln(1e4) = 460.5
  model.motion = MotionKind::look_ahead;
  CHECK(acceleration_filters(model).empty());
  model.look_ahead_filter_time_constant_s = 0.024;
  CHECK(filter_periods(acceleration_filters(model)) == 24);
  CHECK(filter_periods({}) == 0);
}

TEST_CASE("controller: block overlap after paper 004, by hand") {
  FanucModel model;
  model.motion = MotionKind::after_interpolation;
  // 10.5 ms -> 11, 10 ms exactly, 0.2 ms -> 1, none; and 50 ms.
  const std::array<double, 4> lengths = {0.105, 1.0, 0.02, 0.0};
  const std::array<double, 4> feeds = {10.0, 100.0, 100.0, 5.0};
  CHECK(block_overlap_time_s(lengths, feeds, model) == doctest::Approx(0.072));
  model.block_end = BlockEnd::carry;
  CHECK(block_overlap_time_s(lengths, feeds, model) == doctest::Approx(0.071));  // 20.7 ms -> 21
  CHECK(block_overlap_time_s({}, {}, model) == 0.0);
  CHECK_THROWS_AS((void)block_overlap_time_s(std::span(lengths).first(2), feeds, model), Error);
  const std::array<double, 4> no_feed = {10.0, 0.0, 100.0, 5.0};
  CHECK_THROWS_AS((void)block_overlap_time_s(lengths, no_feed, model), Error);
}

TEST_CASE("controller: override and largest feeds of the axes") {
  FanucModel model;
  model.feed_override = 1.5;
  const Segment line = make_line({0, 0, 0}, {30, 40, 0}, 100.0);
  CHECK(controlled_feed_mm_per_s(line, model) == doctest::Approx(150.0));
  model.limits.max_feed_mm_per_s = {90.0, 80.0, 1.0};
  CHECK(controlled_feed_mm_per_s(line, model) == doctest::Approx(100.0));  // Y: 80 / 0.8
  const Segment arc = make_arc({10, 0, 0}, {0, 10, 0}, {0, 0, 0}, 1.5707963267948966, 2, 100.0);
  CHECK(controlled_feed_mm_per_s(arc, model) == doctest::Approx(80.0));
}

TEST_CASE("controller: a filter or rapid of more periods than can be counted is refused, unchecked models too") {
  FanucModel model;
  model.look_ahead_filter_time_constant_s = 1e20;
  CHECK_THROWS_WITH_AS(static_cast<void>(acceleration_filters(model)),
                       "a filter takes 1e+23 periods, at most 10000000 are possible", Error);
  model.rapid_bell_time_s = 1e20;
  CHECK_THROWS_WITH_AS(static_cast<void>(rapid_shape({1.0, 0.0, 0.0}, model)),
                       "rapid takes 1e+23 periods, at most 100000000 are possible", Error);
}
