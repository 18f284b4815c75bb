// A control in motion: against the planner of whole paths, finite differences of the set-points, closed forms.

#include <algorithm>
#include <array>
#include <cmath>
#include <complex>
#include <memory>
#include <numbers>
#include <random>
#include <thread>
#include <vector>

#include <doctest/doctest.h>

#include "limited_settings.hpp"
#include "random_motion.hpp"
#include "sanitized.hpp"
#include "shapegcode/controller.hpp"
#include "shapegcode/error.hpp"
#include "shapegcode/planner.hpp"
#include "winding_path.hpp"

using namespace shapegcode;
using namespace shapegcode::tests;

namespace {

constexpr double period_s = 0.001;

struct Run {
  std::vector<Vector3> set_points;
  Activity last = Activity::idle;
};

Run run_until_idle(MotionController& control, std::size_t most = 1'000'000) {
  Run run;
  Vector3 point;
  do {
    run.last = control.step(values_of(point));
    run.set_points.push_back(point);
  } while (run.last != Activity::idle && run.set_points.size() < most);
  return run;
}

// What a mode of the machine keeps of a motion: |sum of accelerations times the impulse response|.
double residual(const std::vector<Vector3>& points, int axis, double frequency_hz, double damping) {
  const double omega = 2.0 * std::numbers::pi * frequency_hz;
  const std::complex<double> pole(-damping * omega, omega * std::sqrt(1.0 - damping * damping));
  std::complex<double> sum = 0.0;
  const auto n = points.size();
  for (std::size_t k = 2; k < n; ++k) {
    const double change = points[k][axis] - 2.0 * points[k - 1][axis] + points[k - 2][axis];
    sum = sum * std::exp(pole * period_s) + change;
  }
  return std::abs(sum);
}

}  // namespace

TEST_CASE("a path that is pushed at once is run as a whole path is planned, bit for bit") {
  for (const bool smooth : {false, true}) {
    for (unsigned seed = 0; seed < trials(60); ++seed) {
      CAPTURE(seed);
      CAPTURE(smooth);
      std::mt19937 random(seed);
      const std::vector<Segment> segments = random_segments(random, 1 + seed % 40, 120.0, smooth);
      const ControllerSettings settings = limited();
      MotionController control(settings);
      for (const Segment& segment : segments) REQUIRE(control.push(segment) == PushResult::accepted);
      const Run online = run_until_idle(control);
      TrajectoryLimits limits;
      limits.max_feed_mm_per_s.setConstant(max_speed);
      limits.max_acceleration_mm_per_s2.setConstant(max_acceleration);
      limits.max_jerk_mm_per_s3.setConstant(max_jerk);
      limits.contour_tolerance_mm = settings.contour_tolerance_mm;
      const Samples offline = time_optimal_trajectory(Path(segments), limits, period_s);
      // The first one is the start.
      REQUIRE(static_cast<std::ptrdiff_t>(online.set_points.size()) == offline.positions_mm.rows() - 1);
      bool is_same = true;
      for (std::size_t k = 0; k < online.set_points.size(); ++k) {
        const Vector3 point = offline.positions_mm.row(static_cast<Eigen::Index>(k) + 1);
        is_same = is_same && point == online.set_points[k];
      }
      CHECK(is_same);
      CHECK((online.set_points.back() == segments.back().end_mm));
    }
  }
}

TEST_CASE("limits are kept at every set-point, whatever the operator does") {
  for (unsigned seed = 0; seed < trials(40); ++seed) {
    CAPTURE(seed);
    std::mt19937 random(seed);
    std::uniform_real_distribution<double> uniform(0.0, 1.0);
    ControllerSettings settings = limited();
    settings.window = 8 + seed % 60;
    if (seed % 3 == 1) settings.shaper = Fir({0, 11}, {0.516, 0.484});
    settings.contour_correction = seed % 4 == 3;
    MotionController control(settings);
    std::vector<Segment> segments = random_segments(random, 30, 300.0, seed % 2 == 0);
    Differences differences(axis_count, period_s);
    Vector3 point;
    std::size_t pushed = 0;
    for (std::size_t step = 0; step < 200'000; ++step) {
      while (pushed < segments.size() && uniform(random) < 0.3) {
        if (control.push(segments[pushed]) == PushResult::accepted) ++pushed;
      }
      const double what = uniform(random);
      if (what < 0.002) control.feed_override(2.0 * uniform(random));
      if (what > 0.997) control.hold();
      if (uniform(random) < 0.01) control.resume();
      const Activity activity = control.step(values_of(point));
      differences.add(values_of(point));
      if (activity == Activity::idle && pushed == segments.size()) break;
      if (step == 150'000) {
        control.feed_override(1.0);
        control.resume();
      }
    }
    CHECK((point == segments.back().end_mm));
    CHECK(differences.speed() <= 1.001 * max_speed);
    CHECK(differences.acceleration() <= 1.001 * max_acceleration);
    CHECK(differences.jerk() <= 1.001 * max_jerk + 100.0);  // a coordinate of 100 mm is rounded to 1.4e-14
  }
}

TEST_CASE("after a hold anywhere the mode is at rest") {
  // Half a swing of the mode is ten periods: two taps cancel it.
  constexpr double damping = 0.05;
  const double frequency_hz = 50.0 / std::sqrt(1.0 - damping * damping);
  const double decay = std::exp(-damping * std::numbers::pi / std::sqrt(1.0 - damping * damping));
  for (unsigned seed = 0; seed < trials(40); ++seed) {
    CAPTURE(seed);
    std::mt19937 random(seed);
    const std::vector<Segment> segments = random_segments(random, 20, 150.0, true);
    std::array<double, 2> left{};
    for (const bool shaped : {false, true}) {
      ControllerSettings settings = limited();
      settings.limits.max_jerk_mm_per_s3.setConstant(1e6);
      settings.smoothing_time_s = 0.0;
      settings.limits.corner_speed_difference_mm_per_s.setConstant(20.0);
      if (shaped) settings.shaper = Fir({0, 10}, {1.0 / (1.0 + decay), decay / (1.0 + decay)});
      MotionController control(settings);
      for (const Segment& segment : segments) REQUIRE(control.push(segment) == PushResult::accepted);
      Run run{.set_points = {2, segments.front().start_mm}};  // at rest before the first step
      Vector3 point;
      Activity activity = Activity::moving;
      for (std::size_t k = 0; k < 60 + 40 * seed; ++k) {
        activity = control.step(values_of(point));
        run.set_points.push_back(point);
      }
      control.hold();
      while (activity != Activity::held && activity != Activity::idle) {
        activity = control.step(values_of(point));
        run.set_points.push_back(point);
      }
      run.set_points.insert(run.set_points.end(), 2, point);  // it stays there
      for (int axis = 0; axis < 2; ++axis) {
        const double part = residual(run.set_points, axis, frequency_hz, damping);
        left[shaped ? 1 : 0] = std::max(left[shaped ? 1 : 0], part);
      }
    }
    CHECK(left[1] <= 1e-6 * left[0] + 1e-12);
  }
}

TEST_CASE("a single move takes the time of its closed form") {
  ControllerSettings settings = limited();
  settings.smoothing_time_s = 0.0;
  MotionController control(settings);
  Segment move = make_line({0, 0, 0}, {100, 0, 0}, 100.0);
  move.stop_at_end = true;
  REQUIRE(control.push(move) == PushResult::accepted);
  const Run run = run_until_idle(control);
  // 100 mm at 100 mm/s and 1000 mm/s2: 1 s and a ramp of .1 s, and a/J = 20 ms of jerk.
  std::size_t moving = 0;
  for (const Vector3& point : run.set_points) moving += point[0] > 0.0 && point[0] < 100.0 ? 1 : 0;
  CHECK(moving == doctest::Approx(1120.0).epsilon(0.002));
  CHECK(run.set_points.back() == Vector3(100.0, 0.0, 0.0));
}

TEST_CASE("what cannot be run is refused, and says why") {
  ControllerSettings settings = limited();
  settings.queue = 16;
  settings.window = 8;
  MotionController control(settings);
  const double nan = std::nan("");
  CHECK(control.push(make_line({1, 0, 0}, {2, 0, 0}, 10.0)) == PushResult::not_connected);
  CHECK(control.push(make_arc({0, 0, 0}, {20, 20, 0}, {20, 0, 0}, -1.5, 2, 10.0)) == PushResult::not_connected);
  CHECK(control.push(make_line({0, 0, 0}, {0, 0, 0}, 10.0)) == PushResult::no_length);
  CHECK(control.push(make_line({0, 0, 0}, {1, 0, 0}, 0.0)) == PushResult::no_feed);
  CHECK(control.push(make_line({0, 0, 0}, {1, 0, 0}, nan)) == PushResult::no_feed);
  CHECK(control.push(make_line({0, 0, 0}, {nan, 0, 0}, 10.0)) == PushResult::not_finite);
  const std::array<double, 1> angle{3.0};
  CHECK(control.push(make_line({0, 0, 0}, {1, 0, 0}, 10.0), angle) == PushResult::wrong_axes);
  for (int k = 0; k < 16; ++k) {
    CHECK(control.push(make_line({1.0 * k, 0, 0}, {1.0 * k + 1.0, 0, 0}, 10.0)) == PushResult::accepted);
  }
  CHECK(control.push(make_line({16, 0, 0}, {17, 0, 0}, 10.0)) == PushResult::queue_full);
  Vector3 point;
  for (int k = 0; k < 100; ++k) control.step(values_of(point));
  control.abort();
  Differences differences(axis_count, period_s);
  Activity activity = Activity::stopping;
  for (int k = 0; k < 1000 && activity != Activity::aborted; ++k) {
    activity = control.step(values_of(point));
    differences.add(values_of(point));
  }
  CHECK(activity == Activity::aborted);
  CHECK(differences.acceleration() <= 1.001 * max_acceleration);
  CHECK(control.push(make_line({4, 0, 0}, {5, 0, 0}, 10.0)) == PushResult::aborted);
  CHECK(control.step(values_of(point)) == Activity::aborted);
  for (const double value : {std::nan(""), MotionLimits::none}) {
    CHECK_FALSE(control.restart(std::array{0.0, value, 0.0}));
    CHECK(control.step(values_of(point)) == Activity::aborted);
    CHECK(point.allFinite());
  }
  CHECK(control.restart(values_of(point)));
  CHECK(control.push(make_line(point, {9, 0, 0}, 10.0)) == PushResult::accepted);
  CHECK(run_until_idle(control).set_points.back() == Vector3(9, 0, 0));
  for (int result = 0; result <= static_cast<int>(PushResult::aborted); ++result) {
    CHECK(std::string(text_of(static_cast<PushResult>(result))).size() > 4);
  }
  settings.window = 7;
  CHECK_THROWS_AS(MotionController{settings}, Error);
  settings.window = 8;
  settings.limits.max_acceleration_mm_per_s2.setZero();
  CHECK_THROWS_AS(MotionController{settings}, Error);
  settings = limited();
  settings.limits.max_acceleration_mm_per_s2.setConstant(MotionLimits::none);
  CHECK_THROWS_AS(MotionController{settings}, Error);
  settings = limited();
  settings.limits.feed_override = 2.5;
  CHECK_THROWS_AS(MotionController{settings}, Error);
}

TEST_CASE("limits hold for any later override, whatever the control begins with") {
  for (const AccelerationLaw law : {AccelerationLaw::jerk_limited, AccelerationLaw::constant_time}) {
    for (const double begin : {0.05, 0.25, 0.7, 1.0, 2.0}) {
      for (const double later : {0.5, 1.0, 2.0}) {
        CAPTURE(begin);
        CAPTURE(later);
        ControllerSettings settings = limited();
        settings.limits.law = law;
        settings.limits.feed_override = begin;
        MotionController control(settings);
        CHECK(control.state().feed_override == begin);
        std::mt19937 random(7);
        const std::vector<Segment> segments = random_segments(random, is_sanitized ? 5 : 24, 150.0, false);
        for (const Segment& segment : segments) REQUIRE(control.push(segment) == PushResult::accepted);
        Differences differences(axis_count, period_s);
        Vector3 point = Vector3::Zero();
        differences.add(values_of(point));
        Activity activity = Activity::moving;
        for (int k = 0; activity != Activity::idle; ++k) {
          REQUIRE(k < 1'000'000);
          if (k == 40) control.feed_override(later);
          activity = control.step(values_of(point));
          differences.add(values_of(point));
        }
        CHECK(differences.speed() <= 1.001 * max_speed);
        CHECK(differences.acceleration() <= 1.001 * max_acceleration);
        CHECK(differences.jerk() <= 1.001 * max_jerk);
      }
    }
  }
}

TEST_CASE("segments that run out stop the motion and are counted; it goes on with the next") {
  MotionController control(limited());
  REQUIRE(control.push(make_line({0, 0, 0}, {10, 0, 0}, 50.0)) == PushResult::accepted);
  Vector3 point;
  Activity activity = Activity::moving;
  bool starved = false;
  while (activity != Activity::idle) {
    activity = control.step(values_of(point));
    starved = starved || activity == Activity::starved;
  }
  CHECK(starved);
  CHECK(control.state().starvations == 1);
  Segment last = make_line({10, 0, 0}, {10, 10, 0}, 50.0);
  last.stop_at_end = true;
  REQUIRE(control.push(last) == PushResult::accepted);
  CHECK(run_until_idle(control).set_points.back() == Vector3(10, 10, 0));
  CHECK(control.state().starvations == 1);
  CHECK(control.state().segments_done == 2);
}

TEST_CASE("axes that follow end where they are told to, within their limits") {
  ControllerSettings settings = limited();
  settings.following = {{30.0, 100.0, 5000.0}, {MotionLimits::none, MotionLimits::none, MotionLimits::none}};
  MotionController control(settings);
  CHECK(control.axes() == 5);
  const std::array<double, 2> first{20.0, 1.0};
  const std::array<double, 2> second{-20.0, 2.0};
  const std::array<double, 2> third{70.0, 2.0};
  REQUIRE(control.push(make_line({0, 0, 0}, {50, 0, 0}, 100.0), first) == PushResult::accepted);
  REQUIRE(control.push(make_line({50, 0, 0}, {50, 40, 0}, 100.0), second) == PushResult::accepted);
  REQUIRE(control.push(make_line({50, 40, 0}, {50, 40, 0}, 90.0), third) == PushResult::accepted);
  std::array<double, 5> point{};
  Differences differences(5, period_s);
  Differences turning(1, period_s);
  Activity activity = Activity::moving;
  while (activity != Activity::idle) {
    activity = control.step(point);
    differences.add(point);
    turning.add(std::span(point).subspan(3, 1));
  }
  CHECK(point[0] == doctest::Approx(50.0));
  CHECK(point[1] == doctest::Approx(40.0));
  CHECK(point[3] == doctest::Approx(70.0));
  CHECK(point[4] == doctest::Approx(2.0));
  CHECK(differences.jerk() <= 1.001 * max_jerk);
  CHECK(turning.speed() <= 1.001 * 30.0);
  CHECK(turning.acceleration() <= 1.001 * 100.0);
  CHECK(turning.jerk() <= 1.001 * 5000.0);
}

TEST_CASE("one thread pushes while another steps") {
  ControllerSettings settings = limited();
  settings.queue = 32;
  settings.window = 16;
  MotionController control(settings);
  std::mt19937 random(7);
  const std::vector<Segment> segments = random_segments(random, 400, 200.0, true);
  std::thread planner([&] {
    for (const Segment& segment : segments) {
      while (control.push(segment) == PushResult::queue_full) std::this_thread::yield();
    }
  });
  Vector3 point = Vector3::Zero();
  while (control.state().segments_done < segments.size()) control.step(values_of(point));
  planner.join();
  CHECK((run_until_idle(control).set_points.back() - segments.back().end_mm).norm() < 1e-9);
}

TEST_CASE("the correction brings an arc back to its radius") {
  const auto short_of_radius = [](bool corrected) {
    ControllerSettings settings = limited();
    settings.limits.max_jerk_mm_per_s3.setConstant(MotionLimits::none);
    settings.smoothing_time_s = 0.01;
    settings.contour_tolerance_mm = MotionLimits::none;
    settings.shaper = Fir({0, 11}, {0.5, 0.5});
    settings.contour_correction = corrected;
    MotionController control(settings);
    const Vector3 start(10, 0, 0);
    control.restart(values_of(start));
    CHECK((control.correction_delay() > 0) == corrected);
    REQUIRE(control.push(make_arc(start, start, {0, 0, 0}, 8.0 * std::numbers::pi, 2, 60.0)) == PushResult::accepted);
    const Run run = run_until_idle(control);
    double mean = 0.0;
    std::size_t count = 0;
    for (std::size_t k = run.set_points.size() / 3; k < run.set_points.size() / 2; ++k, ++count) {
      mean += run.set_points[k].norm();
    }
    return 10.0 - mean / static_cast<double>(count);
  };
  // Two averages over 10 ms and two taps 11 ms apart: a second moment of 46.75 ms2, v^2 m / 2 r.
  const double cut = short_of_radius(false);
  CHECK(cut == doctest::Approx(60.0 * 60.0 * 46.75e-6 / 20.0).epsilon(0.01));
  CHECK(std::abs(short_of_radius(true)) < 0.01 * cut);
}

TEST_CASE("a motion of many metres ends") {
  ControllerSettings settings = limited();
  MotionController control(settings);
  // Distances of 50 m have an ulp of 7e-12 mm.
  double at = 0.0;
  constexpr int moves = is_sanitized ? 30 : 200;
  for (int k = 0; k < moves; ++k) {
    const double to = k % 2 == 0 ? 50.1 + 0.01 * k : 0.3;
    Segment segment = make_line({at, 0, 0}, {to, 0, 0}, 200.0);
    segment.stop_at_end = k + 1 == moves;
    REQUIRE(control.push(segment) == PushResult::accepted);
    at = to;
  }
  const Run run = run_until_idle(control);
  CHECK(run.last == Activity::idle);
  CHECK(run.set_points.back()[0] == at);
}

TEST_CASE("an emergency stop in any period keeps the emergency acceleration, with as much as the axes have as well") {
  for (const double ratio : {1.0, 1.2, 2.0}) {
    Activity activity = Activity::moving;
    for (int at = 2; activity == Activity::moving; at += is_sanitized ? 17 : 3) {
      CAPTURE(at);
      ControllerSettings settings = limited();
      settings.plans_in_step = true;
      const double allowed = ratio * max_acceleration;
      settings.emergency_acceleration.assign(axis_count, allowed);
      MotionController control(settings);
      REQUIRE(control.push(make_line({0, 0, 0}, {9, 3, 0}, 140.0)) == PushResult::accepted);
      REQUIRE(control.push(make_line({9, 3, 0}, {9, 9, 0}, 140.0)) == PushResult::accepted);
      Vector3 point;
      Differences differences(axis_count, period_s);
      for (int k = 0; k < at; ++k) {
        activity = control.step(values_of(point));
        differences.add(values_of(point));
      }
      control.emergency_stop();
      for (int k = 0; k < 1000 && control.step(values_of(point)) != Activity::aborted; ++k) {
        differences.add(values_of(point));
      }
      differences.add(values_of(point));
      // With no more than the path is planned with: in a corner nearly so.
      CHECK(differences.acceleration() <= (ratio > 1.0 ? 1.001 : 1.02) * allowed);
    }
  }
}

TEST_CASE("segments that nothing moves by have no length; a stop behind them is reached, each of two at one place") {
  ControllerSettings settings = limited();
  settings.plans_in_step = true;
  MotionController control(settings);
  CHECK(control.push(make_line({0, 0, 0}, {5e-10, 0, 0}, 10.0)) == PushResult::no_length);
  CHECK(control.push(make_line({0, 0, 0}, {2e-9, 0, 0}, 10.0)) == PushResult::accepted);
  CHECK(control.push_stop() == PushResult::accepted);
  CHECK(control.push_event({1, 0}) == PushResult::accepted);
  CHECK(control.push_stop() == PushResult::accepted);
  CHECK(control.push_event({2, 0}) == PushResult::accepted);
  CHECK(control.push(make_line({2e-9, 0, 0}, {5, 0, 0}, 50.0)) == PushResult::accepted);
  Vector3 point;
  ControllerEvent event;
  for (std::uint32_t stop = 0; stop < 2; ++stop) {
    CAPTURE(stop);
    Activity activity = Activity::moving;
    for (int k = 0; k < 1000 && activity != Activity::held; ++k) activity = control.step(values_of(point));
    REQUIRE(activity == Activity::held);
    CHECK_FALSE(control.next_event(event));
    control.resume();
    control.step(values_of(point));
    REQUIRE(control.next_event(event));
    CHECK(event.id == stop + 1);
  }
  CHECK(run_until_idle(control, 10'000).set_points.back() == Vector3(5, 0, 0));
}

TEST_CASE("a gap that is accepted is no jump, however short the period") {
  for (const double t : {1e-3, 1e-4}) {
    ControllerSettings settings = limited();
    settings.period_s = t;
    settings.plans_in_step = true;
    MotionController control(settings);
    REQUIRE(control.push(make_line({0, 0, 0}, {5, 0, 0}, 100.0)) == PushResult::accepted);
    REQUIRE(control.push(make_line({5, 9e-7, 0}, {8, 2, 0}, 100.0)) == PushResult::accepted);
    const Segment arc = make_arc({8, 2 + 9e-7, 0}, {10, 4, 0}, {8, 4, 0}, 0.5 * std::numbers::pi, 2, 100.0);
    REQUIRE(control.push(arc) == PushResult::accepted);
    Differences differences(axis_count, t);
    Vector3 point;
    Activity activity = Activity::moving;
    int periods = 0;
    for (; periods < 60'000 && activity != Activity::idle; ++periods) {
      activity = control.step(values_of(point));
      differences.add(values_of(point));
    }
    CHECK(activity == Activity::idle);
    CHECK(point == Vector3(10, 4, 0));
    CHECK(differences.acceleration() <= 1.001 * max_acceleration);
    CHECK(differences.jerk() <= 1.001 * max_jerk);
  }
}

TEST_CASE("a motion that strays from its plan in a sharp corner is planned again from where it rests") {
  ControllerSettings settings = limited();
  settings.plans_in_step = true;
  settings.limits.max_feed_mm_per_s.setConstant(450.77);
  settings.limits.max_acceleration_mm_per_s2.setConstant(9614.6);
  settings.limits.max_jerk_mm_per_s3.setConstant(1627582.0);
  settings.contour_tolerance_mm = 0.003;
  settings.shaper = Fir({0, 10, 11}, {0.5157, 0.06, 0.4243});
  MotionController control(settings);
  const Vector3 corner(-3.87823935, 1.07668667, 0.0);
  const Vector3 end(-2.87823935, 1.07668667, 0.0);
  REQUIRE(control.push(make_line({0, 0, 0}, corner, 252.0)) == PushResult::accepted);
  REQUIRE(control.push(make_line(corner, end, 50.0)) == PushResult::accepted);
  CHECK(run_until_idle(control, 4000).set_points.back() == end);
}

TEST_CASE("what leaves the control is within the contour tolerance, with a shaper, one for each axis, a correction") {
  const Fir zv46({0, 10, 11}, {0.5157, 0.06, 0.4243});
  const std::vector<Fir> each{zv46, Fir({0, 5, 6}, {0.51, 0.22, 0.27}), Fir({0}, {1.0})};
  for (std::uint64_t seed = 0; seed < trials(16); ++seed) {
    for (const int kind : {0, 1, 2, 3}) {
      CAPTURE(seed);
      CAPTURE(kind);
      ControllerSettings settings = limited();
      settings.limits.max_acceleration_mm_per_s2.setConstant(5000.0);
      settings.limits.max_jerk_mm_per_s3.setConstant(seed % 2 == 0 ? 2e5 : 1e6);
      settings.contour_tolerance_mm = seed % 3 == 0 ? 0.01 : 0.02;
      settings.plans_in_step = true;
      if (kind == 1 || kind == 3) settings.shaper = zv46;
      if (kind == 2) settings.shaper = each;
      settings.contour_correction = kind == 3;
      const WindingRun run = run_winding_path(settings, seed);
      CHECK(run.ended);
      CHECK(run.farthest_mm <= 1.01 * settings.contour_tolerance_mm);
    }
  }
}

TEST_CASE("behind a shaper an exact stop is reached, however short the lines and however high the jerk") {
  for (unsigned seed = 0; seed < trials(1200); ++seed) {
    CAPTURE(seed);
    std::mt19937 random(seed);
    const auto draw = [&](double low, double high) {
      return std::pow(10.0, std::uniform_real_distribution<double>(low, high)(random));
    };
    ControllerSettings settings = limited();
    settings.period_s = 0.001 * (1 << (seed % 3));
    const double acceleration = draw(2.7, 3.8);
    settings.limits.max_acceleration_mm_per_s2.setConstant(acceleration);
    settings.limits.max_jerk_mm_per_s3.setConstant(
        std::min(acceleration * draw(1.3, 3.0), acceleration / settings.period_s));
    settings.shaper = Fir({0, 2 + static_cast<int>(seed % 23)}, {0.52, 0.48});
    MotionController control(settings);
    const double length = draw(-3.5, -0.5);
    const double feed = draw(-0.5, 2.0);
    std::vector<Vector3> stops;
    Vector3 end = Vector3::Zero();
    for (int i = 0; i < 13; ++i) {
      const Vector3 start = end;
      end[i % 2] += length;
      Segment line = make_line(start, end, feed);
      line.stop_at_end = random() % 5 < 2 || i == 12;
      if (line.stop_at_end) stops.push_back(end);
      REQUIRE(control.push(line) == PushResult::accepted);
    }
    const Run run = run_until_idle(control);
    for (const Vector3& stop : stops) {
      double off = length;
      for (const Vector3& point : run.set_points) off = std::min(off, (point - stop).cwiseAbs().maxCoeff());
      CHECK(off <= 1e-9);
    }
  }
}
