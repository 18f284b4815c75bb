// The path in the planner: intervals between stations, with all derivatives with respect to the path parameter.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>

#include "planner/segments.hpp"

namespace shapegcode {

/// Limits of every axis; those of acceleration and jerk are finite.
struct AxisLimits {
  AxisValues speed{}, acceleration{}, jerk{};
  std::size_t axes = axis_count;
  /// So much of acceleration and jerk.
  [[nodiscard]] AxisLimits share(double share) const noexcept {
    AxisLimits less = *this;
    for (std::size_t i = 0; i < axes; ++i) {
      less.acceleration[i] *= share;
      less.jerk[i] *= share;
    }
    return less;
  }
};

/// The limit of a motion along a direction.
[[nodiscard]] double along(const AxisValues& direction, const AxisValues& limits, std::size_t axes) noexcept;

/// First to third derivative of the positions by the path parameter, which is the length of the programmed path.
struct Derivatives {
  AxisValues first{}, second{}, third{};
};

/// Speed and acceleration along the path.
struct AlongPath {
  double speed = 0.0, acceleration = 0.0;
  /// Distance that a time with a constant jerk takes it.
  [[nodiscard]] double travel(double jerk, double time_s) const noexcept {
    return time_s * (speed + time_s * (0.5 * acceleration + jerk * time_s * (1.0 / 6.0)));
  }
  /// Then.
  [[nodiscard]] AlongPath after(double jerk, double time_s) const noexcept {
    return {speed + time_s * (acceleration + 0.5 * jerk * time_s), acceleration + jerk * time_s};
  }
};

/// Whether every axis keeps the limits of acceleration and jerk.
[[nodiscard]] bool keeps(const AxisLimits& limits, const Derivatives& path, const AlongPath& state,
                         double jerk) noexcept;

/// A place of the path and the interval from there to the next one, on which the position of every axis is a cubic: of
/// an arc, what is added to the arc.
struct Station {
  double distance = 0.0;  ///< since the last stop
  double length = 0.0;    ///< of the interval
  double offset = 0.0;    ///< from the start of the segment
  std::uint64_t segment = 0;
  bool stop = false;  ///< the motion comes to rest here
  bool arc = false;
  bool valley = false;                                ///< the slowest place around: braking is over here
  bool slower_feed = false;                           ///< a valley because a slower segment begins
  bool straight = false;                              ///< a line that no rounding reaches
  bool coarse = false;                                ///< so long that a jerk turns the acceleration within it
  double speed_limit = 0.0;                           ///< of the interval: feed and axes
  double share = 1.0;                                 ///< of acceleration and jerk that is planned here
  double max_acceleration = 0.0, max_jerk = 0.0;      ///< along the path: of a straight one, or of its segment
  AxisValues position{}, first{}, second{}, third{};  ///< at its begin

  bool operator==(const Station&) const = default;
  [[nodiscard]] double squared_limit() const noexcept { return speed_limit * speed_limit; }
};

/// Acceleration and jerk of a motion along a station's direction.
[[nodiscard]] inline double steepest(const Station& station, const Derivatives& path,
                                     const AxisLimits& limits) noexcept {
  return std::min(station.max_acceleration, along(path.first, limits.acceleration, limits.axes));
}
[[nodiscard]] inline double highest_jerk(const Station& station, const Derivatives& path,
                                         const AxisLimits& limits) noexcept {
  return std::min(station.max_jerk, along(path.first, limits.jerk, limits.axes));
}

/// The longest time of a stop: as if the acceleration were reached at once, plus the time to build it up and down.
[[nodiscard]] inline double stopping_time(double speed, double acceleration, double jerk) noexcept {
  return speed / acceleration + std::min(2.0 * std::sqrt(speed / jerk), 2.0 * acceleration / jerk);
}

/// The time of braking from a steady speed.
[[nodiscard]] inline double braking_time(double speed, double acceleration, double jerk) noexcept {
  const double build_up = acceleration / jerk;
  return speed > acceleration * build_up ? speed / acceleration + build_up : 2.0 * std::sqrt(speed / jerk);
}

/// Derivatives of so many axes at `x` mm behind a station.
[[nodiscard]] Derivatives derivatives_at(const Station& station, const PlannedSegment& segment, double x,
                                         std::size_t axes) noexcept;
/// Position there.
[[nodiscard]] AxisValues position_at(const Station& station, const PlannedSegment& segment, double x,
                                     std::size_t axes) noexcept;

}  // namespace shapegcode
