#include <doctest/doctest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <vector>

#include "shapegcode/measure/contour.hpp"

using shapegcode::ContourTracker;
using shapegcode::make_arc;
using shapegcode::make_line;
using shapegcode::OrbitError;
using shapegcode::Path;
using shapegcode::Vector3;

namespace {

constexpr double pi = std::numbers::pi;

/// Speed profile in pieces of constant acceleration.
class Profile {
 public:
  void ramp(double seconds, double to) {
    pieces_.push_back({end_t_, end_s_, speed_, (to - speed_) / seconds});
    end_s_ += 0.5 * (speed_ + to) * seconds;
    end_t_ += seconds;
    speed_ = to;
  }
  void cruise_to(double s) {
    pieces_.push_back({end_t_, end_s_, speed_, 0.0});
    end_t_ += (s - end_s_) / speed_;
    end_s_ = s;
  }
  [[nodiscard]] double duration() const { return end_t_; }
  [[nodiscard]] double distance(double t) const {
    if (t <= 0.0) return 0.0;
    if (t >= end_t_) return end_s_;
    std::size_t i = pieces_.size() - 1;
    while (pieces_[i].t > t) --i;
    const double dt = t - pieces_[i].t;
    return pieces_[i].s + dt * (pieces_[i].v + 0.5 * dt * pieces_[i].a);
  }

 private:
  struct Piece {
    double t, s, v, a;
  };
  std::vector<Piece> pieces_;
  double end_t_ = 0.0, end_s_ = 0.0, speed_ = 0.0;
};

double percent_of_paper_path(double feed, double arc_feed, double period_s) {
  const double arc_length = 20.0 * pi / 2.0;
  const Path path({make_line({0, 0, 0}, {20, 0, 0}, feed),
                   make_arc({20, 0, 0}, {40, 20, 0}, {20, 20, 0}, pi / 2, 2, feed),
                   make_line({40, 20, 0}, {40, 40, 0}, feed)});
  constexpr double ramp_s = 0.05;
  const double change = 0.5 * (feed + arc_feed) * ramp_s;
  Profile profile;
  profile.ramp(ramp_s, feed);
  profile.cruise_to(20.0 - change);
  profile.ramp(ramp_s, arc_feed);
  profile.cruise_to(20.0 + arc_length);
  profile.ramp(ramp_s, feed);
  profile.cruise_to(40.0 + arc_length - 0.5 * feed * ramp_s);
  profile.ramp(ramp_s, 0.0);

  constexpr std::array<double, 3> delay_s{0.0, 6.514e-3, 11.326e-3};
  constexpr std::array<double, 3> amplitude{0.49156, 0.06297, 0.44547};
  ContourTracker tracker(path);
  OrbitError orbit(path);
  std::array<std::size_t, 3> cursor{};
  for (int i = 0; i * period_s <= profile.duration() + 0.02; ++i) {
    Vector3 p = Vector3::Zero();
    for (std::size_t k = 0; k < 3; ++k) {
      p += amplitude[k] * path.point(profile.distance(i * period_s - delay_s[k]), cursor[k]);
    }
    tracker.step(p);
    orbit.step(p, tracker.segment());
  }
  REQUIRE(orbit.percent().size() == 1);
  return orbit.percent()[0];
}

}  // namespace

TEST_CASE("orbit: the paper's arc after the minimal shaper (orbit errors of the model, zeta .02)") {
  struct Row {
    double feed, kept, percent;
  };
  for (const Row& row :
       {Row{100, 0.6, 0.0270}, Row{200, 0.6, 0.1074}, Row{100, 0.99, 0.0732}, Row{200, 0.99, 0.2908}}) {
    CAPTURE(row.feed);
    CAPTURE(row.kept);
    for (const double period_s : {1e-4, 1e-3}) {
      CAPTURE(period_s);
      CHECK(std::abs(percent_of_paper_path(row.feed, row.kept * row.feed, period_s) - row.percent) < 5e-4);
    }
  }
}

TEST_CASE("orbit: a concentric track has the area of the ring, whatever turns, plane, sense and step") {
  for (const int normal : {0, 1, 2}) {
    for (const double sense : {1.0, -1.0}) {
      for (const double turns : {0.1, 0.25, 1.0, 2.5}) {
        for (const double step : {0.01, 0.1}) {
          const int a = (normal + 1) % 3;
          const int b = (normal + 2) % 3;
          const double sweep = sense * 2.0 * pi * turns;
          const auto at = [&](double radius, double angle) {
            Vector3 p = Vector3::Zero();
            p[a] = 3.0 + radius * std::cos(angle);
            p[b] = 4.0 + radius * std::sin(angle);
            p[normal] = 1.0 + 0.2 * std::abs(angle - 0.7);
            return p;
          };
          Vector3 centre = Vector3::Zero();
          centre[a] = 3.0;
          centre[b] = 4.0;
          const Path path({make_arc(at(10, 0.7), at(10, 0.7 + sweep), centre, sweep, normal, 50.0)});
          OrbitError orbit(path);
          for (double u = -0.05; u < 2.0 * pi * turns + 0.15; u += step) orbit.step(at(9.9, 0.7 + sense * u), 0);
          CAPTURE(normal);
          CAPTURE(turns);
          CHECK(orbit.percent()[0] == doctest::Approx(100.0 * (1.0 - 0.99 * 0.99)).epsilon(1e-9));
        }
      }
    }
  }
}

TEST_CASE("orbit: inside and outside both count, a move back is taken off again") {
  const Path path({make_arc({10, 0, 0}, {-10, 0, 0}, Vector3::Zero(), pi, 2, 50.0)});
  const auto wave = [](double u) {
    const double radius2 = 100.0 * (1.0 + 0.01 * std::sin(10.0 * u));
    return Vector3(std::sqrt(radius2) * std::cos(u), std::sqrt(radius2) * std::sin(u), 0.0);
  };
  OrbitError straight(path);
  OrbitError hesitating(path);
  constexpr int n = 20000;
  for (int i = 0; i <= n; ++i) {
    straight.step(wave(pi * i / n), 0);
    hesitating.step(wave(pi * i / n), 0);
    if (i == n / 3) {
      for (int k = i; k > n / 4; --k) hesitating.step(wave(pi * k / n), 0);
      for (int k = n / 4; k < i; ++k) hesitating.step(wave(pi * k / n), 0);
    }
  }
  CHECK(straight.percent()[0] == doctest::Approx(100.0 * 0.01 * 2.0 / pi).epsilon(1e-6));
  CHECK(hesitating.percent()[0] == doctest::Approx(straight.percent()[0]).epsilon(1e-6));
}

TEST_CASE("orbit: every arc is counted by itself, those shorter than a step too") {
  std::vector<shapegcode::Segment> segments;
  segments.push_back(make_line({-5, -10, 0}, {0, -10, 0}, 50.0));
  constexpr int arcs = 300;
  const auto on_circle = [](double u) { return Vector3(10.0 * std::sin(u), -10.0 * std::cos(u), 0.0); };
  for (int i = 0; i < arcs; ++i) {
    const Vector3 end = on_circle(pi * (i + 1) / arcs);
    segments.push_back(make_arc(on_circle(pi * i / arcs), end, Vector3::Zero(), pi / arcs, 2, 50.0));
  }
  segments.push_back(make_line(on_circle(pi), on_circle(pi) - Vector3(5, 0, 0), 50.0));
  const Path path(segments);
  ContourTracker tracker(path);
  OrbitError orbit(path);
  for (double x = -5.0; x < 0.0; x += 0.1) {
    const Vector3 p(x, -9.99, 0);
    tracker.step(p);
    orbit.step(p, tracker.segment());
  }
  for (double u = 0.001; u < pi; u += 0.023) {  // 0.23 mm; an arc is 0.105 mm long
    const Vector3 p = 0.999 * on_circle(u);
    tracker.step(p);
    orbit.step(p, tracker.segment());
  }
  for (double x = 0.0; x < 5.0; x += 0.1) {
    const Vector3 p(-x, 9.99, 0);
    tracker.step(p);
    orbit.step(p, tracker.segment());
  }
  const std::vector<double> percent = orbit.percent();
  REQUIRE(percent.size() == arcs);
  for (const double value : percent) CHECK(value == doctest::Approx(100.0 * (1.0 - 0.999 * 0.999)).epsilon(0.01));
}

TEST_CASE("orbit: no arcs, no figures; nonsense is ignored") {
  OrbitError none(Path({make_line({0, 0, 0}, {1, 0, 0}, 50.0)}));
  none.step({0.5, 0, 0}, 0);
  none.step({0.6, 0, 0}, 7);
  CHECK(none.percent().empty());
  OrbitError orbit(Path({make_arc({10, 0, 0}, {0, 10, 0}, Vector3::Zero(), pi / 2, 2, 50.0)}));
  CHECK(orbit.percent() == std::vector<double>{0.0});
  orbit.step({10, 0, 0}, 0);
  orbit.step({std::nan(""), 0, 0}, 0);
  orbit.step({0, 10, 0}, 0);
  CHECK(orbit.percent()[0] < 1e-12);
}
