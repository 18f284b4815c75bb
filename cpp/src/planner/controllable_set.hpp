// States of the motion from which it can stop within every limit.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>

#include "planner/stations.hpp"

namespace shapegcode {

/// State of the motion along the path: b = v^2 (mm^2/s^2) and a (mm/s^2). Over the distance, both are linear in what
/// is chosen: with c = da/ds, after h mm a is a + c h and b is b + 2 a h + c h^2.
struct PathState {
  double speed_squared = 0.0;
  double acceleration = 0.0;
  /// The square of the speed after so many mm without c; not next to nothing.
  [[nodiscard]] double squared_after(double length_mm) const noexcept {
    return std::max(0.1 * speed_squared, speed_squared + 2.0 * acceleration * length_mm);
  }
};

/// A convex polygon of states, its corners counter-clockwise (b to the right, a up).
struct ControllableSet {
  static constexpr std::size_t max_corners = 12;
  std::size_t count = 0;
  std::array<double, max_corners> b{}, a{};
};

/// on_c c + on_b b + on_a a <= most, where b and a are those at the begin of an interval.
struct Row {
  double on_c = 0.0, on_b = 0.0, on_a = 0.0, most = 0.0;
};

/// Everything that the limits ask of c within an interval.
struct Rows {
  // Of each axis and along the path: jerk and acceleration at two places each, both signs; and the feed.
  static constexpr std::size_t most = 8 * max_path_axes + 7;
  std::array<Row, most> rows;
  std::size_t count = 0;
  void add(const Row& row) noexcept { rows[count++] = row; }
};

/// Values of c.
struct Range {
  double low = -no_limit;
  double high = no_limit;
  /// Whether nothing is left, beyond rounding.
  [[nodiscard]] bool empty() const noexcept { return low > high + 1e-6 * (std::abs(low) + std::abs(high)); }
};

/// A part of an interval: it begins `x` mm behind the station, is `length` mm long, and is run at most at the square of
/// speed `cap`, near `b_begin` and `b_end`.
struct Stretch {
  double x = 0.0, length = 0.0, b_begin = 0.0, b_end = 0.0, cap = 0.0;
};

/// What a set is made with: the highest square of the speed, what is expected of it at both ends of the interval (below
/// 0: nothing), and the least acceleration.
struct Making {
  double cap = 0.0, b_begin = 0.0, b_end = 0.0;
  double least_acceleration = -no_limit;
  std::size_t corners = ControllableSet::max_corners;  ///< that it keeps
};

class ControllableSets {
 public:
  explicit ControllableSets(const AxisLimits& limits) : limits_(limits) {}

  /// What the limits ask of a part of an interval.
  void rows_of(const Station& station, const PlannedSegment& segment, const Stretch& stretch,
               Rows& rows) const noexcept;
  /// Those of c that lead from a state to `next`, `length` mm on.
  [[nodiscard]] static Range leading_to(const ControllableSet& next, PathState state, double length) noexcept;
  /// Those of a range that the rows allow as well.
  [[nodiscard]] static Range within(const Rows& rows, PathState state, Range range) noexcept;

  /// The state at the begin of an interval that brakes hardest and ends in a state.
  [[nodiscard]] PathState hardest_before(const Station& station, const PlannedSegment& segment, double cap,
                                         PathState end) const noexcept;
  /// Highest square of the speed of a set without acceleration.
  [[nodiscard]] static double steady(const ControllableSet& set) noexcept;

  /// The set at the begin of an interval: states from which some c leads to `next`.
  [[nodiscard]] ControllableSet before(const Station& station, const PlannedSegment& segment, const Making& making,
                                       const ControllableSet& next) const noexcept;
  /// The set at the begin of an interval that ends in a stop.
  [[nodiscard]] ControllableSet before_stop(const Station& station, const PlannedSegment& segment,
                                            double cap) const noexcept;

  /// What is planned on an interval.
  [[nodiscard]] AxisLimits limits_at(const Station& station) const noexcept { return limits_.share(station.share); }
  [[nodiscard]] std::size_t axes() const noexcept { return limits_.axes; }

 private:
  AxisLimits limits_;
};

}  // namespace shapegcode
