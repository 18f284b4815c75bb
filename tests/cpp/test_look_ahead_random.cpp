#include <doctest/doctest.h>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <numbers>
#include <random>
#include <vector>

#include "shapegcode/motion.hpp"
#include "speed_plans.hpp"

using shapegcode::AccelerationLaw;
using shapegcode::make_arc;
using shapegcode::make_line;
using shapegcode::MotionLimits;
using shapegcode::Path;
using shapegcode::plan_speed;
using shapegcode::Segment;
using shapegcode::SegmentKind;
using shapegcode::SpeedPhase;
using shapegcode::SpeedProfile;
using shapegcode::Vector3;
using shapegcode::tests::check_joined;
using shapegcode::tests::distance_at;
using shapegcode::tests::none;
using shapegcode::tests::pi;
using shapegcode::tests::speed_at;

namespace {

std::vector<Segment> random_segments(std::mt19937_64& generator, int count, bool arcs, double longest) {
  std::uniform_real_distribution<double> unit(-1.0, 1.0);
  std::uniform_real_distribution<double> share(0.0, 1.0);
  std::vector<Segment> segments;
  Vector3 at = Vector3::Zero();
  Vector3 direction(1, 0, 0);
  for (int i = 0; i < count; ++i) {
    const double feed = 5.0 + 295.0 * share(generator);
    const double length = longest * std::pow(10.0, -2.5 * share(generator));
    // A mixture of soft and sharp turns.
    const Vector3 turn(unit(generator), unit(generator), 0.3 * unit(generator));
    direction = (direction + (i % 3 == 0 ? 2.0 : 0.1) * turn).normalized();
    if (arcs && i % 4 == 3) {
      const int normal = static_cast<int>(3 * share(generator)) % 3;
      const int a = (normal + 1) % 3;
      const int b = (normal + 2) % 3;
      const double radius = 0.2 + length;
      const double from = pi * unit(generator);
      const double sweep = 1.9 * pi * unit(generator) + 0.01;
      Vector3 centre = at;
      centre[a] -= radius * std::cos(from);
      centre[b] -= radius * std::sin(from);
      Vector3 end = centre;
      end[a] += radius * std::cos(from + sweep);
      end[b] += radius * std::sin(from + sweep);
      end[normal] = at[normal] + (i % 8 == 3 ? length * unit(generator) : 0.0);
      segments.push_back(make_arc(at, end, centre, sweep, normal, feed));
      direction = tangent_at(segments.back(), segments.back().length_mm);
      at = end;
    } else {
      const Vector3 end = at + length * direction;
      segments.push_back(make_line(at, end, feed));
      at = end;
    }
  }
  return segments;
}

struct Worst {
  double segment_speed = 0.0, corner_speed = 0.0, axis_acceleration = 0.0, axis_speed = 0.0, centripetal = 0.0;
};

/// How far a motion s(t) along the path uses each limit (1 = all of it), from the geometry alone.
class Judge {
 public:
  Judge(const Path& path, const MotionLimits& limits) : path_(path), limits_(limits) {}

  void at(double s, double speed, double acceleration, Worst& worst) {
    while (cursor_ + 1 < path_.size() && s >= path_.distance_mm(cursor_ + 1)) ++cursor_;
    const Segment& segment = path_[cursor_];
    // Within rounding of a junction a sample may belong to either side.
    if (std::min(std::abs(s - path_.distance_mm(cursor_)), std::abs(s - path_.distance_mm(cursor_ + 1))) < 1e-9) return;
    const double ratio = segment.kind == SegmentKind::arc ? limits_.arc_feed_ratio : 1.0;
    worst.segment_speed = std::max(worst.segment_speed, speed / (ratio * segment.feed_mm_per_s));
    const double local = std::clamp(s - path_.distance_mm(cursor_), 0.0, segment.length_mm);
    const Vector3 tangent = tangent_at(segment, local);
    Vector3 total = acceleration * tangent;
    if (segment.kind == SegmentKind::arc) {
      // Towards the centre.
      Vector3 inwards = segment.centre_mm - point_at(segment, local);
      inwards[segment.normal] = 0.0;
      const double turning = speed * speed * curvature(segment);
      total += turning * inwards.normalized();
      worst.centripetal = std::max(worst.centripetal, turning / limits_.centripetal_acceleration_mm_per_s2);
    }
    for (int i = 0; i < 3; ++i) {
      worst.axis_speed = std::max(worst.axis_speed, std::abs(speed * tangent[i]) / limits_.max_feed_mm_per_s[i]);
      worst.axis_acceleration =
          std::max(worst.axis_acceleration, std::abs(total[i]) / limits_.max_acceleration_mm_per_s2[i]);
    }
  }

  void corner(std::size_t i, double speed, Worst& worst) const {
    const Vector3 before = tangent_at(path_[i - 1], path_[i - 1].length_mm);
    const Vector3 after = tangent_at(path_[i], 0.0);
    for (int k = 0; k < 3; ++k) {
      worst.corner_speed = std::max(
          worst.corner_speed, std::abs(speed * (after[k] - before[k])) / limits_.corner_speed_difference_mm_per_s[k]);
    }
    const double angle = std::acos(std::clamp(before.dot(after), -1.0, 1.0));
    const double bend = angle / (0.5 * (path_[i - 1].length_mm + path_[i].length_mm));
    if (angle > 1e-5) {
      worst.corner_speed = std::max(worst.corner_speed, speed * speed * bend / limits_.polyline_acceleration_mm_per_s2);
      worst.corner_speed = std::max(worst.corner_speed, speed * speed / deviating_squared(before, after, angle));
    }
    if (angle >= limits_.corner_stop_angle_rad) {
      worst.corner_speed = std::max(worst.corner_speed, speed / 2e-3);
    }
  }

 private:
  // v^2 of the rule of junction deviation, from the radius of the arc that is tangent to both sides and stays within
  // the deviation of the corner: r = d / (1 / sin(half of the inner angle) - 1).
  [[nodiscard]] double deviating_squared(const Vector3& before, const Vector3& after, double angle) const {
    const double inner = std::sin(0.5 * (std::numbers::pi - angle));
    const double radius = inner < 1.0 ? limits_.junction_deviation_mm / (1.0 / inner - 1.0) : MotionLimits::none;
    const Vector3 turn = (after - before).normalized();
    double acceleration = MotionLimits::none;
    for (int k = 0; k < 3; ++k) {
      if (turn[k] != 0.0) {
        acceleration = std::min(acceleration, limits_.max_acceleration_mm_per_s2[k] / std::abs(turn[k]));
      }
    }
    return std::max(acceleration * radius, 1e-6);
  }

  const Path& path_;
  const MotionLimits& limits_;
  std::size_t cursor_ = 0;
};

MotionLimits all_limits(AccelerationLaw law) {
  MotionLimits limits;
  limits.law = law;
  limits.time_constant_s = 0.05;
  limits.max_feed_mm_per_s = {200.0, 150.0, 60.0};
  limits.max_acceleration_mm_per_s2 = {3000.0, 2000.0, 900.0};
  limits.corner_speed_difference_mm_per_s = {15.0, 12.0, 6.0};
  limits.centripetal_acceleration_mm_per_s2 = 800.0;
  limits.polyline_acceleration_mm_per_s2 = 800.0;
  limits.arc_feed_ratio = 0.8;
  return limits;
}

}  // namespace

TEST_CASE("look-ahead: no limit is passed anywhere on random paths, sampled") {
  std::mt19937_64 generator(101);
  for (int round = 0; round < 120; ++round) {
    const auto law = round % 2 == 0 ? AccelerationLaw::constant_time : AccelerationLaw::jerk_limited;
    MotionLimits limits = all_limits(law);
    if (round % 5 == 0) {
      limits.junction_deviation_mm = 0.005;
    }
    if (round % 7 == 0) {
      limits.corner_stop_angle_rad = 1.0;
    }
    const Path path(random_segments(generator, 40, round % 3 != 0, 20.0));
    const SpeedProfile profile = plan_speed(path, limits);
    CAPTURE(round);
    check_joined(profile, path.length_mm());
    Worst worst;
    Judge judge(path, limits);
    std::size_t cursor = 0;
    for (const SpeedPhase& phase : profile.phases()) {
      for (int k = 0; k <= 40; ++k) {
        const double t = phase.duration_s * std::clamp(k / 40.0, 1e-9, 1.0 - 1e-9);
        const double speed = phase.speed_mm_per_s + phase.acceleration_mm_per_s2 * t;
        judge.at(phase.distance_mm + t * (phase.speed_mm_per_s + 0.5 * phase.acceleration_mm_per_s2 * t), speed,
                 phase.acceleration_mm_per_s2, worst);
      }
    }
    for (std::size_t i = 1; i < path.size(); ++i) {
      judge.corner(i, profile.speed_mm_per_s(profile.time_s(path.distance_mm(i), cursor), cursor), worst);
    }
    CHECK(worst.segment_speed < 1.0 + 1e-6);
    CHECK(worst.axis_speed < 1.0 + 1e-6);
    CHECK(worst.centripetal < 1.0 + 1e-6);
    CHECK(worst.axis_acceleration < 1.0 + 1e-6);
    CHECK(worst.corner_speed < 1.0 + 1e-5);
    // Every limit that can be reached is reached somewhere: the plan is not merely slow.
    CHECK(std::max(worst.axis_speed, worst.segment_speed) > 0.5);
    if (law == AccelerationLaw::jerk_limited) CHECK(worst.axis_acceleration > 0.9);
    CHECK(worst.corner_speed > 0.9);
  }
}

TEST_CASE("look-ahead: distance never runs backwards, and time and distance are each other's inverse") {
  std::mt19937_64 generator(7);
  const Path path(random_segments(generator, 60, true, 10.0));
  const SpeedProfile profile = plan_speed(path, all_limits(AccelerationLaw::constant_time));
  double last = -1.0;
  std::size_t cursor = 0;
  std::size_t inverse = 0;
  for (int i = 0; i <= 20000; ++i) {
    const double time = profile.ramp_duration_s() * i / 20000.0;
    const double distance = profile.distance_mm(time, cursor);
    CHECK(distance >= last);
    last = distance;
    CHECK(std::abs(profile.distance_mm(profile.time_s(distance, inverse), inverse) - distance) < 1e-9);
  }
  CHECK(last == path.length_mm());
  CHECK(distance_at(profile, -1.0) == 0.0);
  CHECK(speed_at(profile, profile.ramp_duration_s() + 1.0) == 0.0);
}

TEST_CASE("look-ahead: no plan that keeps the limits is faster, against a fine grid of speeds") {
  // Lines only, acceleration law: the best plan is the forward and backward pass over a grid of small steps.
  std::mt19937_64 generator(55);
  for (int round = 0; round < 10; ++round) {
    const MotionLimits limits = all_limits(AccelerationLaw::jerk_limited);
    const Path path(random_segments(generator, 12, false, 20.0));
    const double duration = plan_speed(path, limits).duration_s();
    // Square of the speed at grid points; the segments' own grid keeps corners on it.
    std::vector<double> square{0.0};
    std::vector<double> step;
    std::vector<double> acceleration;
    for (std::size_t i = 0; i < path.size(); ++i) {
      const Vector3 tangent = tangent_at(path[i], 0.0).cwiseAbs();
      double speed = path[i].feed_mm_per_s;
      double a = none;
      for (int k = 0; k < 3; ++k) {
        speed = std::min(speed, limits.max_feed_mm_per_s[k] / tangent[k]);
        a = std::min(a, limits.max_acceleration_mm_per_s2[k] / tangent[k]);
      }
      if (i > 0) {
        const Vector3 before = tangent_at(path[i - 1], 0.0);
        const Vector3 change = (tangent_at(path[i], 0.0) - before).cwiseAbs();
        double corner = none;
        for (int k = 0; k < 3; ++k) corner = std::min(corner, limits.corner_speed_difference_mm_per_s[k] / change[k]);
        const double angle = std::acos(std::clamp(before.dot(tangent_at(path[i], 0.0)), -1.0, 1.0));
        corner = std::min(corner, std::sqrt(800.0 * 0.5 * (path[i - 1].length_mm + path[i].length_mm) / angle));
        square.back() = std::min({square.back(), corner * corner, speed * speed});
      }
      constexpr int n = 2000;
      for (int k = 0; k < n; ++k) {
        step.push_back(path[i].length_mm / n);
        acceleration.push_back(a);
        square.push_back(speed * speed);
      }
    }
    square.back() = 0.0;
    for (std::size_t i = 0; i < step.size(); ++i) {
      square[i + 1] = std::min(square[i + 1], square[i] + 2.0 * acceleration[i] * step[i]);
    }
    for (std::size_t i = step.size(); i-- > 0;) {
      square[i] = std::min(square[i], square[i + 1] + 2.0 * acceleration[i] * step[i]);
    }
    double expected = 0.0;
    for (std::size_t i = 0; i < step.size(); ++i) {
      expected += 2.0 * step[i] / (std::sqrt(square[i]) + std::sqrt(square[i + 1]));
    }
    CAPTURE(round);
    CHECK(duration == doctest::Approx(expected).epsilon(1e-4));
  }
}

TEST_CASE("look-ahead: with a jerk time no limit is passed either, at corners and between") {
  std::mt19937_64 generator(202);
  for (int round = 0; round < 60; ++round) {
    const double jerk_time = 0.02 + 0.01 * (round % 4);
    MotionLimits limits = all_limits(round % 2 == 0 ? AccelerationLaw::jerk_limited : AccelerationLaw::constant_time);
    limits.jerk_time_s = jerk_time;
    const Path path(random_segments(generator, 25, false, 20.0));
    const SpeedProfile profile = plan_speed(path, limits);
    REQUIRE(profile.jerk_time_s() == jerk_time);
    // Smoothed exactly: mean of distance(t') over t - jerk_time ... t, by the phases' own closed form.
    const auto integral = [&](double time) {
      double sum = 0.0;
      for (const SpeedPhase& phase : profile.phases()) {
        const double t = std::clamp(time - phase.start_s, 0.0, phase.duration_s);
        sum += t * (phase.distance_mm + t * (phase.speed_mm_per_s / 2.0 + phase.acceleration_mm_per_s2 * t / 6.0));
      }
      return sum + path.length_mm() * std::max(0.0, time - profile.ramp_duration_s());
    };
    const auto smooth = [&](double time) { return (integral(time) - integral(time - jerk_time)) / jerk_time; };
    const auto smooth_speed = [&](double time) {
      return (distance_at(profile, time) - distance_at(profile, time - jerk_time)) / jerk_time;
    };
    const auto smooth_acceleration = [&](double time) {
      return (speed_at(profile, time) - speed_at(profile, time - jerk_time)) / jerk_time;
    };
    Worst worst;
    Judge judge(path, limits);
    double steepest = 0.0;
    double strongest = 0.0;
    constexpr int n = 4000;
    for (int i = 0; i <= n; ++i) {
      const double time = profile.duration_s() * i / n;
      judge.at(smooth(time), smooth_speed(time), 0.0, worst);
      steepest = std::max(steepest, std::abs(smooth_acceleration(time) - smooth_acceleration(time - 1e-4)) / 1e-4);
    }
    for (const SpeedPhase& phase : profile.phases())
      strongest = std::max(strongest, std::abs(phase.acceleration_mm_per_s2));
    for (std::size_t i = 1; i < path.size(); ++i) {
      double low = 0.0;
      double high = profile.duration_s();
      for (int k = 0; k < 60; ++k) {
        const double middle = 0.5 * (low + high);
        (smooth(middle) < path.distance_mm(i) ? low : high) = middle;
      }
      judge.corner(i, smooth_speed(low), worst);
    }
    CAPTURE(round);
    CHECK(worst.corner_speed < 1.0 + 1e-6);
    CHECK(worst.segment_speed < 1.0 + 1e-6);
    CHECK(worst.axis_speed < 1.0 + 1e-6);
    CHECK(steepest < 2.0 * strongest / jerk_time * (1.0 + 1e-6));
  }
}
