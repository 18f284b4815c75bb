#include <doctest/doctest.h>

#include <cmath>

#include "shapegcode/motion.hpp"

using shapegcode::SpeedPhase;
using shapegcode::SpeedProfile;

namespace {

/// 0 to 100 mm/s in 0.1 s, 0.2 s steady, to 50 mm/s in 0.1 s, to rest in 0.05 s: 5 + 20 + 7.5 + 1.25 mm.
SpeedProfile by_hand() {
  return SpeedProfile({{9.0, 0.1, 0.0, 0.0, 1000.0},
                       {9.0, 0.2, 5.0, 100.0, 0.0},
                       {9.0, 0.1, 25.0, 100.0, -500.0},
                       {9.0, 0.05, 32.5, 50.0, -1000.0}},
                      33.75, 0.02);
}

}  // namespace

TEST_CASE("speed profile: start times follow from the durations") {
  const SpeedProfile profile = by_hand();
  REQUIRE(profile.phases().size() == 4);
  CHECK(profile.phases()[0].start_s == 0.0);
  CHECK(profile.phases()[3].start_s == doctest::Approx(0.4));
  CHECK(profile.ramp_duration_s() == doctest::Approx(0.45));
  CHECK(profile.duration_s() == doctest::Approx(0.47));
  CHECK(profile.length_mm() == 33.75);
  CHECK(profile.jerk_time_s() == 0.02);
}

TEST_CASE("speed profile: distance, speed and time by hand, from any cursor") {
  const SpeedProfile profile = by_hand();
  struct Point {
    double time, distance, speed;
  };
  for (const Point& p : {Point{0.0, 0.0, 0.0}, Point{0.05, 1.25, 50.0}, Point{0.2, 15.0, 100.0},
                         Point{0.35, 29.375, 75.0}, Point{0.425, 33.4375, 25.0}}) {
    for (const std::size_t from : {0U, 1U, 3U, 77U}) {
      std::size_t cursor = from;
      CHECK(profile.distance_mm(p.time, cursor) == doctest::Approx(p.distance));
      cursor = from;
      CHECK(profile.speed_mm_per_s(p.time, cursor) == doctest::Approx(p.speed));
      cursor = from;
      CHECK(profile.time_s(p.distance, cursor) == doctest::Approx(p.time));
    }
  }
  std::size_t cursor = 0;
  CHECK(profile.distance_mm(0.45, cursor) == 33.75);
  CHECK(profile.distance_mm(1e9, cursor) == 33.75);
  CHECK(profile.distance_mm(-1.0, cursor) == 0.0);
  CHECK(profile.speed_mm_per_s(-1.0, cursor) == 0.0);
  CHECK(profile.speed_mm_per_s(0.5, cursor) == 0.0);
  CHECK(profile.time_s(-1.0, cursor) == 0.0);
  CHECK(profile.time_s(40.0, cursor) == doctest::Approx(0.45));
}

TEST_CASE("speed profile: empty") {
  const SpeedProfile profile;
  std::size_t cursor = 0;
  CHECK(profile.duration_s() == 0.0);
  CHECK(profile.distance_mm(1.0, cursor) == 0.0);
  CHECK(profile.speed_mm_per_s(1.0, cursor) == 0.0);
  CHECK(profile.time_s(1.0, cursor) == 0.0);
}
