// Random paths of lines and arcs, tangent or not, and how fast set-points go, for tests of what a control is given.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <numbers>
#include <random>
#include <span>
#include <vector>

#include "shapegcode/path.hpp"

namespace shapegcode::tests {

/// Lines and arcs in the plane and in space; with `smooth` most of them go on where the one before led.
inline std::vector<Segment> random_segments(std::mt19937& random, std::size_t count, double feed_mm_per_s,
                                            bool smooth) {
  std::uniform_real_distribution<double> uniform(0.0, 1.0);
  std::vector<Segment> segments;
  Vector3 at = Vector3::Zero();
  double heading = 0.0;
  while (segments.size() < count) {
    const double feed = feed_mm_per_s * (0.2 + 0.8 * uniform(random));
    const double length = std::pow(10.0, -0.5 + 2.0 * uniform(random));
    if (!smooth || uniform(random) < 0.2) heading += (uniform(random) - 0.5) * (uniform(random) < 0.5 ? 0.2 : 6.0);
    if (uniform(random) < 0.5) {
      const Vector3 end =
          at + length * Vector3(std::cos(heading), std::sin(heading), smooth ? 0.0 : 0.3 * (uniform(random) - 0.5));
      segments.push_back(make_line(at, end, feed, static_cast<std::uint32_t>(segments.size() + 1)));
      at = end;
    } else {
      const double radius = 0.5 + 20.0 * uniform(random) * uniform(random);
      const double sweep = (uniform(random) < 0.5 ? -1.0 : 1.0) * std::clamp(length / radius, 0.02, 5.0);
      const double side = sweep > 0.0 ? 1.0 : -1.0;
      const Vector3 centre = at + side * radius * Vector3(-std::sin(heading), std::cos(heading), 0.0);
      heading += sweep;
      Vector3 end = centre + side * radius * Vector3(std::sin(heading), -std::cos(heading), 0.0);
      end[2] = at[2];
      segments.push_back(make_arc(at, end, centre, sweep, 2, feed, static_cast<std::uint32_t>(segments.size() + 1)));
      at = end;
    }
  }
  segments.back().stop_at_end = true;
  return segments;
}

/// Largest first, second and third finite difference of any axis so far.
class Differences {
 public:
  Differences(std::size_t axes, double period_s) : axes_(axes), period_s_(period_s) {}

  void add(std::span<const double> position) {
    for (std::size_t axis = 0; axis < axes_; ++axis) {
      std::array<double, 4>& last = last_[axis];
      last = {position[axis], last[0], last[1], last[2]};
      if (seen_ >= 1) note(0, (last[0] - last[1]) / period_s_);
      if (seen_ >= 2) note(1, (last[0] - 2.0 * last[1] + last[2]) / (period_s_ * period_s_));
      if (seen_ >= 3) {
        note(2, (last[0] - 3.0 * last[1] + 3.0 * last[2] - last[3]) / (period_s_ * period_s_ * period_s_));
      }
    }
    ++seen_;
  }
  [[nodiscard]] double speed() const { return largest_[0]; }
  [[nodiscard]] double acceleration() const { return largest_[1]; }
  [[nodiscard]] double jerk() const { return largest_[2]; }

 private:
  void note(std::size_t order, double value) { largest_[order] = std::max(largest_[order], std::abs(value)); }

  std::size_t axes_;
  double period_s_;
  std::size_t seen_ = 0;
  std::array<std::array<double, 4>, 9> last_{};
  std::array<double, 3> largest_{};
};

}  // namespace shapegcode::tests
