// The planner of a control: what it gives out, when, and what happens where nothing comes in time.
#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <random>
#include <vector>

#include <doctest/doctest.h>

#include "limited_settings.hpp"
#include "random_motion.hpp"
#include "sanitized.hpp"
#include "shapegcode/controller.hpp"

using namespace shapegcode;
using namespace shapegcode::tests;

namespace {

constexpr double period_s = 0.001;
// Periods of the longest section.
constexpr int longest_section = 32;

ControllerSettings limited_to(std::size_t window) {
  ControllerSettings settings = limited();
  settings.window = window;
  settings.queue = 2 * window;
  return settings;
}

// A circle of 100 mm in lines, and in the end a stop.
std::vector<Segment> circle(std::size_t lines, double length_mm, double feed_mm_per_s) {
  std::vector<Segment> segments;
  Vector3 at = Vector3::Zero();
  for (std::size_t i = 0; i < lines; ++i) {
    const double angle = 0.01 * length_mm * static_cast<double>(i);
    const Vector3 end = at + length_mm * Vector3(std::cos(angle), std::sin(angle), 0.0);
    segments.push_back(make_line(at, end, feed_mm_per_s));
    at = end;
  }
  segments.back().stop_at_end = true;
  return segments;
}

// A control that is fed as it takes segments, and watched.
class Watched {
 public:
  Watched(const ControllerSettings& settings, std::vector<Segment> segments)
      : control(settings), segments_(std::move(segments)) {}

  Activity step() {
    while (pushed_ < segments_.size() && control.push(segments_[pushed_]) == PushResult::accepted) ++pushed_;
    const Activity activity = control.step(values_of(point));
    differences_.add(values_of(point));
    return activity;
  }
  void steps(int count) {
    for (int k = 0; k < count; ++k) step();
  }
  [[nodiscard]] double speed() const { return control.state().speed_mm_per_s; }
  void check_limits() const {
    CHECK(differences_.acceleration() <= 1.001 * max_acceleration);
    CHECK(differences_.jerk() <= 1.001 * max_jerk + 100.0);  // a coordinate of 100 mm is rounded to 1.4e-14
  }

  MotionController control;
  Vector3 point = Vector3::Zero();

 private:
  std::vector<Segment> segments_;
  std::size_t pushed_ = 0;
  Differences differences_{axis_count, period_s};
};

}  // namespace

TEST_CASE("a new override acts behind the section that is being run") {
  for (const std::size_t window : {32, 1024}) {
    CAPTURE(window);
    Watched watched(limited_to(window), circle(40'000, 0.2, 60.0));
    watched.steps(1500);
    CHECK(watched.speed() == doctest::Approx(60.0).epsilon(1e-3));
    watched.control.feed_override(0.5);
    watched.steps(longest_section + 1);
    CHECK(watched.speed() < 60.0);
    // From 60 to 30 mm/s at 1000 mm/s2, building that up and down with the jerk: 50 ms.
    watched.steps(70);
    CHECK(watched.speed() == doctest::Approx(30.0).epsilon(2e-3));
    watched.control.feed_override(0.0);
    watched.steps(longest_section + 70);
    CHECK(watched.speed() == 0.0);
    watched.control.feed_override(0.25);
    double fastest = 0.0;
    for (int k = 0; k < 300; ++k) {
      watched.step();
      fastest = std::max(fastest, watched.speed());
    }
    CHECK(fastest == doctest::Approx(15.0).epsilon(2e-3));
    watched.check_limits();
  }
}

TEST_CASE("a window that is hardly longer than the braking distance costs 2 % at most") {
  // From 200 mm/s within 1000 mm/s2 and 50 000 mm/s3: 22 mm, 110 blocks.
  ControllerSettings settings = limited_to(112);
  settings.smoothing_time_s = 0.0;
  std::vector<Segment> row;
  constexpr int blocks = 1500;
  for (int k = 0; k < blocks; ++k) row.push_back(make_line({0.2 * k, 0, 0}, {0.2 * (k + 1), 0, 0}, max_speed));
  row.back().stop_at_end = true;
  Watched watched(settings, row);
  int moving = 0;
  while (watched.step() != Activity::idle) ++moving;
  watched.check_limits();
  // The shortest time in its closed form: the row at full speed, and one more ramp.
  const double ramp_s = max_speed / max_acceleration + max_acceleration / max_jerk;
  CHECK(period_s * moving <= 1.02 * (row.back().end_mm[0] / max_speed + ramp_s));
}

TEST_CASE("a hold brakes behind the section that is being run, and the motion goes on from there") {
  for (int when = 100; when < 1500; when += is_sanitized ? 487 : 61) {
    CAPTURE(when);
    Watched watched(limited_to(64), circle(1000, 0.2, 100.0));
    watched.steps(when);
    watched.control.hold();
    const double before = watched.speed();
    int periods = 0;
    while (watched.step() != Activity::held) REQUIRE(++periods < 1000);
    // Braking, with the jerk to build it up and down.
    CHECK(periods <= longest_section + static_cast<int>(before) + 40 + 8);
    watched.steps(20);
    CHECK(watched.speed() == 0.0);
    watched.control.resume();
    int more = 0;
    while (watched.step() != Activity::idle) REQUIRE(++more < 10'000);
    watched.check_limits();
  }
}

TEST_CASE("an override that is turned without rest keeps no motion from its end") {
  Watched watched(limited_to(64), circle(1000, 0.2, 100.0));
  int step = 0;
  Activity activity = Activity::moving;
  for (; activity != Activity::idle && step < 20'000; ++step) {
    watched.control.feed_override(1.0 + 0.5 * std::sin(0.01 * step));
    activity = watched.step();
  }
  CHECK(activity == Activity::idle);
  CHECK(step < 3000);  // 200 mm at 100 mm/s
  watched.check_limits();
}

TEST_CASE("where plan() comes too late the motion stops within the limits, counts it, and goes on") {
  ControllerSettings settings = limited_to(64);
  settings.plans_in_step = false;
  settings.lead_periods = 20;
  Watched watched(settings, circle(600, 0.2, 100.0));
  watched.step();
  CHECK(watched.speed() == 0.0);  // nothing is planned
  std::mt19937 random(3);
  Activity activity = Activity::moving;
  int step = 0;
  int silent = 0;
  for (; activity != Activity::idle || step < 100; ++step) {
    REQUIRE(step < 100'000);
    if (silent == 0 && random() % 300 == 0) silent = 150;
    if (silent > 0) --silent;
    if (silent == 0) watched.control.plan();
    activity = watched.step();
  }
  CHECK(watched.control.state().late_plans > 0);
  CHECK(watched.control.state().segments_done == 600);
  watched.check_limits();
}

TEST_CASE("planned ahead by another caller it is the same motion, and nothing is late") {
  std::vector<std::vector<Vector3>> runs;
  for (const bool in_step : {true, false}) {
    ControllerSettings settings = limited_to(128);
    settings.queue = 1024;
    settings.plans_in_step = in_step;
    Watched watched(settings, circle(400, 0.2, 100.0));
    std::vector<Vector3>& points = runs.emplace_back();
    Activity activity = Activity::moving;
    while (activity != Activity::idle || points.size() < 50) {
      REQUIRE(points.size() < 10'000);
      if (!in_step) watched.control.plan();
      activity = watched.step();
      points.push_back(watched.point);
    }
    CHECK(watched.control.state().late_plans == 0);
  }
  // The first call of plan() comes before the first segment.
  const std::size_t count = std::min(runs[0].size(), runs[1].size() - 1);
  std::size_t different = 0;
  for (std::size_t k = 0; k < count; ++k) different += runs[0][k] != runs[1][k + 1] ? 1 : 0;
  CHECK(different == 0);
}

TEST_CASE("the path is left by no more than the tolerance") {
  for (unsigned seed = 0; seed < trials(12); ++seed) {
    CAPTURE(seed);
    std::mt19937 random(seed);
    ControllerSettings settings = limited_to(16);
    settings.contour_tolerance_mm = 0.02;
    const std::vector<Segment> segments = random_segments(random, 30, 150.0, seed % 2 == 0);
    Watched watched(settings, segments);
    Activity activity = Activity::moving;
    double farthest = 0.0;
    for (int step = 0; activity != Activity::idle; ++step) {
      REQUIRE(step < 100'000);
      if (step % 200 == 50) watched.control.hold();
      if (step % 200 == 120) watched.control.resume();
      activity = watched.step();
      double nearest_mm = 1e9;
      for (const Segment& segment : segments) {
        nearest_mm = std::min(nearest_mm, nearest_on(segment, watched.point).distance_mm);
      }
      farthest = std::max(farthest, nearest_mm);
    }
    CHECK(farthest <= 0.02 * 1.001);
  }
}

TEST_CASE("the same pushes at the same periods give the same bits") {
  for (unsigned seed = 0; seed < trials(5); ++seed) {
    CAPTURE(seed);
    std::vector<Vector3> first;
    for (int pass = 0; pass < 2; ++pass) {
      std::mt19937 random(seed);
      std::uniform_real_distribution<double> uniform(0.0, 1.0);
      MotionController control(limited_to(16 + 8 * seed));
      const std::vector<Segment> segments = random_segments(random, 60, 200.0, true);
      std::size_t pushed = 0;
      std::size_t different = 0;
      Vector3 point;
      for (std::size_t step = 0; step < 3000; ++step) {
        if (pushed < segments.size() && uniform(random) < 0.05) {
          pushed += control.push(segments[pushed]) == PushResult::accepted ? 1 : 0;
        }
        if (uniform(random) < 0.01) control.feed_override(2.0 * uniform(random));
        control.step(values_of(point));
        if (pass == 0) first.push_back(point);
        different += point != first[step] ? 1 : 0;
      }
      CHECK(different == 0);
    }
  }
}
