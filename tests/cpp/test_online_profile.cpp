// The look-ahead of a control in portions: how much a period does, and what stays true while a draft is being made.
#include <algorithm>
#include <bit>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <random>
#include <vector>

#include <doctest/doctest.h>

#include "controller/intake.hpp"
#include "controller/online_profile.hpp"
#include "controller/settings.hpp"
#include "random_motion.hpp"
#include "shapegcode/controller.hpp"

using namespace shapegcode;
using namespace shapegcode::tests;

namespace {

constexpr double period_s = 0.001;

ControllerSettings limited(std::size_t window) {
  ControllerSettings settings;
  settings.limits.law = AccelerationLaw::jerk_limited;
  settings.limits.max_feed_mm_per_s.setConstant(200.0);
  settings.limits.max_acceleration_mm_per_s2.setConstant(1000.0);
  settings.limits.max_jerk_mm_per_s3.setConstant(50000.0);
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

// A profile without what follows it.
class Alone {
 public:
  explicit Alone(const ControllerSettings& settings)
      : control_(settings),
        ring_(std::bit_ceil(settings.queue)),
        intake_(control_.planning_limits(), {}, control_.planning_tolerance()),
        profile_(ring_, control_.planning_limits(), settings.window, settings.period_s) {
    intake_.restart(values_of(Vector3(Vector3::Zero())));
    profile_.restart(0);
  }
  void push(const Segment& segment) {
    if (pushed_ - profile_.running() >= ring_.capacity()) return;
    REQUIRE(intake_.take(segment, {}, ring_[pushed_]) == PushResult::accepted);
    ++pushed_;
  }
  void step() {
    profile_.look_ahead(pushed_);
    profile_.advance(true);
    most_ = std::max(most_, profile_.looked());
  }
  [[nodiscard]] OnlineProfile& profile() { return profile_; }
  [[nodiscard]] std::size_t pushed() const { return pushed_; }
  [[nodiscard]] int most() const { return most_; }

 private:
  MotionController control_;  // for what its settings come to
  SegmentRing ring_;
  Intake intake_;
  OnlineProfile profile_;
  std::uint64_t pushed_ = 0;
  int most_ = 0;
};

std::vector<Vector3> run(MotionController& control) {
  std::vector<Vector3> points;
  Activity activity = Activity::moving;
  while (activity != Activity::idle && points.size() < 100'000) {
    activity = control.step(values_of(points.emplace_back()));
  }
  return points;
}

}  // namespace

TEST_CASE("the look-ahead of a period is bounded, whatever the window and the operator do") {
  for (const std::size_t window : {32, 128, 1024}) {
    CAPTURE(window);
    const std::vector<Segment> segments = circle(6000, 0.05, 100.0);
    Alone alone(limited(window));
    OnlineProfile& profile = alone.profile();
    int steps = 0;
    while (alone.pushed() < segments.size() || !profile.ran_out()) {
      for (int k = 0; k < 8 && alone.pushed() < segments.size(); ++k) alone.push(segments[alone.pushed()]);
      alone.step();
      ++steps;
      if (steps % 400 == 0) profile.override_feeds(0.5 + 0.25 * (steps / 400 % 5));
      if (steps % 700 == 0) profile.override_feeds(0.0);
      if (steps % 700 == 100) profile.override_feeds(1.5);
      profile.stop(steps % 900 < 60);
      REQUIRE(steps < 100'000);
    }
    CHECK(profile.running() == segments.size());
    CHECK(alone.most() <= OnlinePlan::portion + OnlinePlan::beyond_portion);
    CHECK(alone.most() >= OnlinePlan::portion);
  }
}

TEST_CASE("a new override is followed after as many periods as the window takes") {
  for (const std::size_t window : {128, 1024}) {
    CAPTURE(window);
    const std::vector<Segment> segments = circle(40'000, 0.05, 60.0);
    Alone alone(limited(window));
    OnlineProfile& profile = alone.profile();
    const auto steps = [&](int count) {
      for (int k = 0; k < count; ++k) {
        for (int more = 0; more < 8; ++more) alone.push(segments[alone.pushed()]);
        alone.step();
      }
    };
    steps(1500);
    CHECK(profile.speed() == doctest::Approx(60.0));
    profile.override_feeds(0.5);
    // Eight for each segment, and for those that came meanwhile; then it brakes, at half of 1000 mm/s2.
    const int planned = static_cast<int>(8 * (window + window / 8)) / OnlinePlan::portion + 4;
    steps(planned);
    CHECK(profile.speed() < 60.0);
    steps(80);
    CHECK(profile.speed() == doctest::Approx(30.0));
    // Zero does not wait for a plan, and what is asked for behind it holds from the begin.
    profile.override_feeds(0.0);
    steps(1);
    CHECK(profile.speed() < 30.0);
    steps(80);
    CHECK(profile.at_rest());
    profile.override_feeds(0.25);
    double fastest = 0.0;
    for (int k = 0; k < planned + 100; ++k) {
      steps(1);
      fastest = std::max(fastest, profile.speed());
    }
    CHECK(fastest == doctest::Approx(15.0));
  }
}

TEST_CASE("a dial that never rests keeps neither a motion from its begin nor segments from being seen") {
  MotionController control(limited(64));
  const std::vector<Segment> segments = circle(1000, 0.2, 100.0);
  Differences differences(axis_count, period_s);
  Vector3 point = Vector3::Zero();
  std::size_t pushed = 0;
  std::size_t step = 0;
  Activity activity = Activity::moving;
  for (; activity != Activity::idle && step < 20'000; ++step) {
    while (pushed < segments.size() && control.push(segments[pushed]) == PushResult::accepted) ++pushed;
    control.feed_override(1.0 + 0.5 * std::sin(0.01 * static_cast<double>(step)));
    activity = control.step(values_of(point));
    differences.add(values_of(point));
  }
  CHECK(activity == Activity::idle);
  CHECK((point == segments.back().end_mm));
  CHECK(step < 3500);  // 200 mm at 100 mm/s, and what the window is too short for
  CHECK(differences.acceleration() <= 1.001 * 1000.0);
  CHECK(differences.jerk() <= 1.001 * 50000.0 + 100.0);
}

TEST_CASE("an override that was asked for at rest is that of the whole path, bit for bit") {
  for (unsigned seed = 0; seed < 40; ++seed) {
    CAPTURE(seed);
    std::mt19937 random(seed);
    const std::vector<Segment> segments = random_segments(random, 2 + 3 * seed, 120.0, seed % 2 == 0);
    std::vector<std::vector<Vector3>> runs;
    for (const int when : {1, 2, 40}) {  // before all; while it is being planned; while it is held
      MotionController control(limited(128));
      if (when > 1) control.hold();
      if (when == 1) control.feed_override(0.7);
      for (const Segment& segment : segments) REQUIRE(control.push(segment) == PushResult::accepted);
      Vector3 point;
      for (int k = 1; k < when; ++k) control.step(values_of(point));
      control.feed_override(0.7);
      control.resume();
      runs.push_back(run(control));
      const auto leaves = std::ranges::find_if(runs.back(), [](const Vector3& at) { return at != Vector3::Zero(); });
      runs.back().erase(runs.back().begin(), leaves);
      CHECK((runs.back() == runs.front()));
    }
  }
}

TEST_CASE("the same pushes at the same periods give the same bits") {
  for (unsigned seed = 0; seed < 20; ++seed) {
    CAPTURE(seed);
    std::vector<Vector3> first;
    for (int pass = 0; pass < 2; ++pass) {
      std::mt19937 random(seed);
      std::uniform_real_distribution<double> uniform(0.0, 1.0);
      MotionController control(limited(16 + seed));
      const std::vector<Segment> segments = random_segments(random, 60, 200.0, true);
      std::size_t pushed = 0;
      std::size_t different = 0;
      Vector3 point;
      for (std::size_t step = 0; step < 6000; ++step) {
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
