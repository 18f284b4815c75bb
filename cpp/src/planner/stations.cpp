#include "planner/stations.hpp"

#include <algorithm>
#include <cmath>

#include "path/arc_frame.hpp"

namespace shapegcode {
namespace {

// For an axis that does not move.
constexpr double no_share = 1e-9;

// What an arc adds to the cubic: in its plane the tangent turns by the same angle for every mm.
void add_arc(const Segment& arc, double s_mm, Derivatives& derivatives) noexcept {
  const ArcFrame frame(arc.normal);
  const Vector3 tangent = tangent_at(arc, s_mm);
  const double turning = arc.sweep_rad / arc.length_mm;
  for (std::size_t i = 0; i < axis_count; ++i) derivatives.first[i] += tangent[static_cast<Eigen::Index>(i)];
  const auto a = static_cast<std::size_t>(frame.a);
  const auto b = static_cast<std::size_t>(frame.b);
  derivatives.second[a] -= turning * tangent[frame.b];
  derivatives.second[b] += turning * tangent[frame.a];
  derivatives.third[a] -= turning * turning * tangent[frame.a];
  derivatives.third[b] -= turning * turning * tangent[frame.b];
}

}  // namespace

double along(const AxisValues& direction, const AxisValues& limits, std::size_t axes) noexcept {
  double least = no_limit;
  for (std::size_t i = 0; i < axes; ++i) {
    const double share = std::abs(direction[i]);
    if (share > no_share) least = std::min(least, limits[i] / share);
  }
  return least;
}

bool keeps(const AxisLimits& limits, const Derivatives& path, const AlongPath& state, double jerk) noexcept {
  const double a = state.acceleration;
  const double v = state.speed;
  for (std::size_t i = 0; i < limits.axes; ++i) {
    const double acceleration = path.first[i] * a + path.second[i] * v * v;
    const double axis_jerk = path.first[i] * jerk + v * (3.0 * path.second[i] * a + path.third[i] * v * v);
    if (std::abs(acceleration) > limits.acceleration[i] || std::abs(axis_jerk) > limits.jerk[i]) return false;
  }
  return true;
}

Derivatives derivatives_at(const Station& station, const PlannedSegment& segment, double x, std::size_t axes) noexcept {
  Derivatives derivatives;
  for (std::size_t i = 0; i < axes; ++i) {
    derivatives.first[i] = station.first[i] + x * (station.second[i] + 0.5 * x * station.third[i]);
    derivatives.second[i] = station.second[i] + x * station.third[i];
    derivatives.third[i] = station.third[i];
  }
  if (station.arc) add_arc(segment.segment, station.offset + x, derivatives);
  return derivatives;
}

AxisValues position_at(const Station& station, const PlannedSegment& segment, double x, std::size_t axes) noexcept {
  AxisValues position{};
  for (std::size_t i = 0; i < axes; ++i) {
    position[i] = station.position[i] +
                  x * (station.first[i] + x * (0.5 * station.second[i] + x * station.third[i] * (1.0 / 6.0)));
  }
  if (station.arc) {
    const Vector3 point = point_at(segment.segment, station.offset + x);
    for (std::size_t i = 0; i < axis_count; ++i) position[i] += point[static_cast<Eigen::Index>(i)];
  }
  return position;
}

}  // namespace shapegcode
