// Lines and arcs of any size, run by a control, and how far what leaves it is from them.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>
#include <random>
#include <vector>

#include "shapegcode/controller.hpp"

namespace shapegcode::tests {

// Beyond the ends of the path only sideways: a correction overshoots there along it.
inline double distance_to_line(const Vector3& point, const Vector3& begin, const Vector3& end, bool is_first,
                               bool is_last) {
  const Vector3 along = end - begin;
  const double share =
      std::clamp((point - begin).dot(along) / along.squaredNorm(), is_first ? -1e9 : 0.0, is_last ? 1e9 : 1.0);
  return (point - begin - share * along).norm();
}

// Lines and arcs of any size one after another; the last one is short, so that the motion brakes out of a corner.
inline std::vector<Segment> winding_path(std::mt19937_64& random) {
  const auto between = [&](double low, double high) { return std::uniform_real_distribution(low, high)(random); };
  std::vector<Segment> path;
  Vector3 at = Vector3::Zero();
  const double size = std::pow(10.0, between(-1.0, 1.0));
  const int count = 2 + static_cast<int>(between(0.0, 6.0));
  double heading = between(0.0, 6.28);
  for (int i = 0; i < count; ++i) {
    heading += between(-2.5, 2.5) * between(0.0, 1.0);
    const double feed = between(20.0, 150.0);
    if (between(0.0, 1.0) < 0.4) {
      const double sweep = between(0.3, 4.0) * (between(0.0, 1.0) < 0.5 ? 1.0 : -1.0);
      const double radius = size * between(0.3, 1.5) * (sweep > 0.0 ? 1.0 : -1.0);
      const Vector3 centre = at + radius * Vector3(-std::sin(heading), std::cos(heading), 0.0);
      const Vector3 from = at - centre;
      const Vector3 end = centre + Vector3(from.x() * std::cos(sweep) - from.y() * std::sin(sweep),
                                           from.x() * std::sin(sweep) + from.y() * std::cos(sweep), 0.0);
      path.push_back(make_arc(at, end, centre, sweep, 2, feed));
      heading += sweep;
    } else {
      const double length = size * (i + 1 < count ? between(0.2, 1.5) : between(0.05, 0.3));
      path.push_back(make_line(at, at + length * Vector3(std::cos(heading), std::sin(heading), 0.0), feed));
    }
    at = path.back().end_mm;
  }
  path.back().stop_at_end = true;
  return path;
}

struct WindingRun {
  bool ended = false;
  double time_s = 0.0;
  double farthest_mm = 0.0;
};

// From rest to rest; all of it is pushed before.
inline WindingRun run_winding_path(const ControllerSettings& settings, std::uint64_t seed) {
  std::mt19937_64 random(seed);
  MotionController control(settings);
  std::vector<Vector3> programmed{Vector3::Zero()};
  WindingRun run;
  for (const Segment& segment : winding_path(random)) {
    if (control.push(segment) != PushResult::accepted) return run;
    const int parts = segment.kind == SegmentKind::arc ? 200 : 1;
    for (int k = 1; k <= parts; ++k) programmed.push_back(point_at(segment, segment.length_mm * k / parts));
  }
  for (int step = 0; step < 100'000 && !run.ended; ++step) {
    Vector3 point;
    run.ended = control.step({point.data(), 3}) == Activity::idle;
    run.time_s += settings.period_s;
    double nearest = std::numeric_limits<double>::infinity();
    for (std::size_t i = 1; i < programmed.size(); ++i) {
      const double off = distance_to_line(point, programmed[i - 1], programmed[i], i == 1, i + 1 == programmed.size());
      nearest = std::min(nearest, off);
    }
    run.farthest_mm = std::max(run.farthest_mm, nearest);
  }
  return run;
}

}  // namespace shapegcode::tests
