#include "planner/controllable_set.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

namespace shapegcode {
namespace {

// Smaller coefficients of c than this (of the tangent: per mm) count as zero.
constexpr double no_coefficient = 1e-9;
// Squares of speeds below this are rest, mm^2/s^2.
constexpr double at_rest = 1e-12;
// Where in an interval the jerk is looked at: so that its parabola passes by no more at the ends than in the middle.
constexpr std::array<double, 2> looked_at{0.15, 0.85};
// And the acceleration, beside both ends.
constexpr std::array<double, 2> accelerations_at{0.25, 0.75};
// Relative, of what bounds of c may leave too little.
constexpr double bound_rounding = 1e-10;
// Share of the acceleration that a valley may be passed with.
constexpr double valley_share = 0.02;
// Of the hardest braking, where the lower bound of the speed is laid.
constexpr std::array<double, 2> braking_tangents{0.6, 1.0};
// Share of the highest square of the speed that is expected at least.
constexpr double least_expected = 1e-4;
// Share of the jerk for the last interval before a stop: the rest is for landing in whole periods.
constexpr double stopping_share = 0.85;

// A polygon while it is cut.
class Polygon {
 public:
  Polygon() = default;
  Polygon(const Polygon&) = delete;
  Polygon& operator=(const Polygon&) = delete;

  void add(double b, double a) noexcept { corners_->add(b, a, false); }
  [[nodiscard]] std::size_t count() const noexcept { return corners_->count; }
  [[nodiscard]] PathState corner(std::size_t i) const noexcept { return {corners_->b[i], corners_->a[i]}; }
  // Of a corner, as long as it is one.
  [[nodiscard]] bool checked(std::size_t i) const noexcept { return corners_->checked[i]; }
  void check(std::size_t i) noexcept { corners_->checked[i] = true; }

  // Keeps what has on_b b + on_a a <= most; false: that is all of it.
  bool cut(double on_b, double on_a, double most) noexcept {
    const Corners& now = *corners_;
    std::array<double, room> beyond;
    double farthest = 0.0;
    for (std::size_t i = 0; i < now.count; ++i) {
      beyond[i] = on_b * now.b[i] + on_a * now.a[i] - most;
      farthest = std::max(farthest, beyond[i]);
    }
    if (!(farthest > 0.0)) return false;
    Corners& kept = *other_;
    kept.count = 0;
    for (std::size_t i = 0; i < now.count; ++i) {
      const std::size_t next = i + 1 == now.count ? 0 : i + 1;
      if (beyond[i] <= 0.0) kept.add(now.b[i], now.a[i], now.checked[i]);
      if ((beyond[i] < 0.0 && beyond[next] > 0.0) || (beyond[i] > 0.0 && beyond[next] < 0.0)) {
        const double share = beyond[i] / (beyond[i] - beyond[next]);
        kept.add(now.b[i] + share * (now.b[next] - now.b[i]), now.a[i] + share * (now.a[next] - now.a[i]), false);
      }
    }
    std::swap(corners_, other_);
    if (kept.count > limit) simplify(limit);
    return true;
  }

  // Corners are left out where that costs the least area: what remains lies within.
  void simplify(std::size_t most) noexcept {
    Corners& now = *corners_;
    auto& b = now.b;
    auto& a = now.a;
    while (now.count > most) {
      std::size_t fastest = 0;
      for (std::size_t i = 1; i < now.count; ++i) {
        if (b[i] > b[fastest] || (b[i] == b[fastest] && a[i] > a[fastest])) fastest = i;
      }
      std::size_t least_at = 0;
      double least = no_limit;
      for (std::size_t i = 0; i < now.count; ++i) {
        // Without these a motion could not begin, or not go on at its highest speed.
        if (b[i] <= at_rest || i == fastest) continue;
        const std::size_t before = i == 0 ? now.count - 1 : i - 1;
        const std::size_t after = i + 1 == now.count ? 0 : i + 1;
        const double area =
            std::abs((b[i] - b[before]) * (a[after] - a[before]) - (a[i] - a[before]) * (b[after] - b[before]));
        if (area < least) {
          least = area;
          least_at = i;
        }
      }
      for (std::size_t i = least_at; i + 1 < now.count; ++i) {
        b[i] = b[i + 1];
        a[i] = a[i + 1];
        now.checked[i] = now.checked[i + 1];
      }
      --now.count;
    }
  }

  [[nodiscard]] ControllableSet set() const noexcept {
    ControllableSet set;
    set.count = corners_->count;
    std::copy_n(corners_->b.begin(), set.count, set.b.begin());
    std::copy_n(corners_->a.begin(), set.count, set.a.begin());
    return set;
  }

 private:
  // Convex: a cut adds one corner at most. Rounding may add some more.
  static constexpr std::size_t limit = 28;
  static constexpr std::size_t room = 2 * limit;
  struct Corners {
    std::size_t count = 0;
    std::array<double, room> b, a;
    std::array<bool, room> checked;
    void add(double b_here, double a_here, bool is_checked) noexcept {
      b[count] = b_here;
      a[count] = a_here;
      checked[count++] = is_checked;
    }
  };
  std::array<Corners, 2> room_;  // a cut writes to the one that is not in use
  Corners* corners_ = &room_[0];
  Corners* other_ = &room_[1];
};

// Bounds of c that are linear in the state.
class Bounds {
 public:
  // A row either bounds c or cuts the polygon itself.
  void add(const Row& row, double none, Polygon& polygon) noexcept {
    if (std::abs(row.on_c) <= none) {
      polygon.cut(row.on_b, row.on_a, row.most);
    } else {
      (row.on_c > 0.0 ? upper_ : lower_).add(row);
    }
  }

  // States for which some c is left: corner by corner with the two bounds that leave the least there.
  void cut(Polygon& polygon) const noexcept {
    if (upper_.count == 0 || lower_.count == 0) return;
    int cuts = 0;
    for (std::size_t i = 0; i < polygon.count();) {
      if (polygon.checked(i)) {
        ++i;
        continue;
      }
      const PathState corner = polygon.corner(i);
      const std::size_t u = upper_.least(corner, 1.0);
      const std::size_t l = lower_.least(corner, -1.0);
      if (leaves_some(corner, u, l) || !cut(polygon, u, l)) {
        polygon.check(i);
      } else if (++cuts < most_cuts) {
        i = 0;
      } else {
        // Whatever rounding does: all of them.
        for (std::size_t upper = 0; upper < upper_.count; ++upper) {
          for (std::size_t lower = 0; lower < lower_.count; ++lower) cut(polygon, upper, lower);
        }
        return;
      }
    }
  }

 private:
  static constexpr std::size_t most = Rows::most + ControllableSet::max_corners;
  static constexpr int most_cuts = 100;
  static constexpr std::size_t lanes = 4;

  struct Side {
    std::size_t count = 0;
    std::array<double, most> constant, on_b, on_a;

    void add(const Row& row) noexcept {
      constant[count] = row.most / row.on_c;
      on_b[count] = -row.on_b / row.on_c;
      on_a[count++] = -row.on_a / row.on_c;
    }
    // The bound that is least at a state, times `sign`.
    [[nodiscard]] std::size_t least(PathState state, double sign) const noexcept {
      std::array<double, most + lanes> bound;
      const double b = state.speed_squared;
      const double a = state.acceleration;
      for (std::size_t i = 0; i < count; ++i) bound[i] = sign * (constant[i] + on_b[i] * b + on_a[i] * a);
      std::fill_n(bound.begin() + static_cast<std::ptrdiff_t>(count), lanes, no_limit);
      // Some at once, which a search that keeps the place cannot do.
      std::array<double, lanes> lowest;
      lowest.fill(no_limit);
      for (std::size_t i = 0; i < count; i += lanes) {
        for (std::size_t lane = 0; lane < lanes; ++lane) lowest[lane] = std::min(lowest[lane], bound[i + lane]);
      }
      auto i = static_cast<std::size_t>(std::ranges::min_element(lowest) - lowest.begin());
      const double value = lowest[i];
      while (i + lanes < count && bound[i] != value) i += lanes;
      return i;
    }
  };

  // Up to rounding.
  [[nodiscard]] bool leaves_some(PathState state, std::size_t u, std::size_t l) const noexcept {
    const double on_b = (upper_.on_b[u] - lower_.on_b[l]) * state.speed_squared;
    const double on_a = (upper_.on_a[u] - lower_.on_a[l]) * state.acceleration;
    const double constant = upper_.constant[u] - lower_.constant[l];
    return constant + on_b + on_a >= -bound_rounding * (std::abs(constant) + std::abs(on_b) + std::abs(on_a));
  }
  bool cut(Polygon& polygon, std::size_t u, std::size_t l) const noexcept {
    return polygon.cut(lower_.on_b[l] - upper_.on_b[u], lower_.on_a[l] - upper_.on_a[u],
                       upper_.constant[u] - lower_.constant[l]);
  }

  Side upper_, lower_;
};

// An edge of a set as a row at the begin of an interval of this length.
Row edge_row(const ControllableSet& set, std::size_t i, double length) noexcept {
  const std::size_t next = i + 1 == set.count ? 0 : i + 1;
  const double on_b = set.a[next] - set.a[i];
  const double on_a = set.b[i] - set.b[next];
  return {on_b * length * length + on_a * length, on_b, 2.0 * length * on_b + on_a, on_b * set.b[i] + on_a * set.a[i]};
}

// What acceleration and jerk along the path may be at a station, as far as the path does not turn.
struct AlongLimits {
  double acceleration, jerk;
};
AlongLimits limits_along(const Station& station, const PlannedSegment& segment, const AxisLimits& limits) noexcept {
  // Where an axis turns back and no other moves there is no direction: that of the end.
  for (const double x : {0.0, station.length}) {
    const Derivatives path = derivatives_at(station, segment, x, limits.axes);
    const AlongLimits found{steepest(station, path, limits), highest_jerk(station, path, limits)};
    if (std::isfinite(found.acceleration) && std::isfinite(found.jerk)) return found;
  }
  return {limits.acceleration[0], limits.jerk[0]};
}

// 1 / sqrt(b) is above its tangent: a bound of the jerk that is linear in b, and safe wherever it is laid.
struct Tangent {
  double constant, on_b;
  explicit Tangent(double b) noexcept {
    const double inverse = 1.0 / std::sqrt(std::max(b, at_rest));
    constant = 1.5 * inverse;
    on_b = 0.5 * inverse * inverse * inverse;
  }
};

// |first c + 3 second a + third b| <= jerk / v, at x mm behind the begin.
struct Bend {
  double first, second, third;
};
void add_jerk(const Bend& path, double jerk, const Tangent& tangent, double x, Rows& rows) noexcept {
  for (const double sign : {-1.0, 1.0}) {
    const double on_b = sign * path.third + jerk * tangent.on_b;
    const double on_a = sign * 3.0 * path.second;
    rows.add({sign * path.first + x * (on_a + x * on_b), on_b, on_a + 2.0 * x * on_b, jerk * tangent.constant});
  }
}

}  // namespace

void ControllableSets::rows_of(const Station& station, const PlannedSegment& segment, const Stretch& stretch,
                               Rows& rows) const noexcept {
  const auto& [x, length, b_begin, b_end, cap] = stretch;
  const AxisLimits limits = limits_at(station);
  rows.count = 0;
  for (const double share : looked_at) {
    const double at = share * length;
    const Tangent tangent(b_begin + share * (b_end - b_begin));
    if (station.max_jerk < no_limit) add_jerk({1.0, 0.0, 0.0}, station.max_jerk, tangent, at, rows);
    if (station.straight) continue;
    const Derivatives path = derivatives_at(station, segment, x + at, limits.axes);
    for (std::size_t i = 0; i < limits.axes; ++i) {
      if (path.first[i] == 0.0 && path.second[i] == 0.0 && path.third[i] == 0.0) continue;
      add_jerk({path.first[i], path.second[i], path.third[i]}, limits.jerk[i], tangent, at, rows);
    }
  }
  const double middle = 0.5 * length;
  rows.add({middle * middle, 1.0, 2.0 * middle, cap});
  if (station.straight) return;
  for (const double share : accelerations_at) {
    const double at = share * length;
    if (station.max_acceleration < no_limit) {
      for (const double sign : {-1.0, 1.0}) rows.add({sign * at, 0.0, sign, station.max_acceleration});
    }
    const Derivatives path = derivatives_at(station, segment, x + at, limits.axes);
    for (std::size_t i = 0; i < limits.axes; ++i) {
      if (path.first[i] == 0.0 && path.second[i] == 0.0) continue;
      for (const double sign : {-1.0, 1.0}) {
        const double on_b = sign * path.second[i];
        const double on_a = sign * path.first[i];
        rows.add({at * (on_a + at * on_b), on_b, on_a + 2.0 * at * on_b, limits.acceleration[i]});
      }
    }
  }
}

namespace {

// Narrows a range of c by a row; what the row leaves where it does not bound c.
double narrow(const Row& row, PathState state, double none, Range& range) noexcept {
  const double left = row.most - row.on_b * state.speed_squared - row.on_a * state.acceleration;
  if (row.on_c > none) {
    range.high = std::min(range.high, left / row.on_c);
  } else if (row.on_c < -none) {
    range.low = std::max(range.low, left / row.on_c);
  } else {
    return left;
  }
  return 0.0;
}

}  // namespace

Range ControllableSets::leading_to(const ControllableSet& next, PathState state, double length) noexcept {
  Range range;
  for (std::size_t i = 0; i < next.count; ++i) narrow(edge_row(next, i, length), state, 0.0, range);
  return range;
}

Range ControllableSets::within(const Rows& rows, PathState state, Range range) noexcept {
  for (std::size_t i = 0; i < rows.count; ++i) {
    if (narrow(rows.rows[i], state, no_coefficient, range) < 0.0) range.low = no_limit;
  }
  return range;
}

PathState ControllableSets::hardest_before(const Station& station, const PlannedSegment& segment, double cap,
                                           PathState end) const noexcept {
  const double h = station.length;
  const double b = end.speed_squared - 2.0 * end.acceleration * h;  // with c = 0
  Rows rows;
  rows_of(station, segment, {0.0, h, b, end.speed_squared, std::max(cap, b)}, rows);
  double c = no_limit;
  for (std::size_t i = 0; i < rows.count; ++i) {
    const Row& row = rows.rows[i];
    const double on_c = row.on_c + h * (h * row.on_b - row.on_a);
    if (on_c > no_coefficient) c = std::min(c, (row.most - row.on_b * b - row.on_a * end.acceleration) / on_c);
  }
  if (!std::isfinite(c)) c = 0.0;
  c = std::max(c, 0.0);
  return {b + c * h * h, end.acceleration - c * h};
}

double ControllableSets::steady(const ControllableSet& set) noexcept {
  double most = 0.0;
  for (std::size_t i = 0; i < set.count; ++i) {
    const std::size_t next = i + 1 == set.count ? 0 : i + 1;
    if (set.a[i] == 0.0) most = std::max(most, set.b[i]);
    if ((set.a[i] < 0.0 && set.a[next] > 0.0) || (set.a[i] > 0.0 && set.a[next] < 0.0)) {
      const double share = set.a[i] / (set.a[i] - set.a[next]);
      most = std::max(most, set.b[i] + share * (set.b[next] - set.b[i]));
    }
  }
  return most;
}

namespace {

// What is expected, if it is known, but not next to nothing.
double near(double expected, double most) noexcept {
  return expected >= 0.0 ? std::max(expected, least_expected * most) : most;
}

}  // namespace

ControllableSet ControllableSets::before(const Station& station, const PlannedSegment& segment, const Making& making,
                                         const ControllableSet& next) const noexcept {
  const AxisLimits limits = limits_at(station);
  const double cap = making.cap;
  const double length = station.length;
  const Derivatives path = derivatives_at(station, segment, 0.0, limits.axes);
  double b_most = 0.0;   // at the begin, with c = 0
  double b_after = 0.0;  // at the end
  for (std::size_t i = 0; i < next.count; ++i) {
    b_most = std::max(b_most, next.b[i] - 2.0 * next.a[i] * length);
    b_after = std::max(b_after, next.b[i]);
  }
  b_most = std::min(b_most, cap);
  Polygon polygon;
  const auto [steepest, jerk] = limits_along(station, segment, limits);
  // On a curve what turns the path may leave more; the cuts below say how much.
  const double widest = station.straight ? steepest : std::min(station.max_acceleration, 4.0 * steepest);
  polygon.add(0.0, -widest);
  polygon.add(cap, -widest);
  polygon.add(cap, widest);
  polygon.add(0.0, widest);
  // Acceleration ends within the interval: the motion would rise and fall in each otherwise.
  if (station.coarse) polygon.cut(1.0, length, cap);
  if (std::isfinite(making.least_acceleration)) polygon.cut(0.0, -1.0, -making.least_acceleration);
  if (station.valley) polygon.cut(0.0, 1.0, valley_share * steepest);
  if (!station.straight) {
    for (std::size_t i = 0; i < limits.axes; ++i) {
      if (path.first[i] == 0.0 && path.second[i] == 0.0) continue;
      polygon.cut(path.second[i], path.first[i], limits.acceleration[i]);
      polygon.cut(-path.second[i], -path.first[i], limits.acceleration[i]);
    }
  }
  // Braking must end before the motion does: v >= a^2 / 2 j, so b >= a^4 / 4 j^2, by its tangents.
  for (const double share : braking_tangents) {
    const double a = -share * steepest;
    const double v = a * a / (2.0 * jerk);
    const double slope = 2.0 * v * a / jerk;
    polygon.cut(-1.0, slope, slope * a - v * v);
  }
  Rows rows;
  const Stretch whole{0.0, length, near(making.b_begin, b_most), near(making.b_end, b_after), cap};
  rows_of(station, segment, whole, rows);
  Bounds bounds;
  for (std::size_t i = 0; i < rows.count; ++i) bounds.add(rows.rows[i], no_coefficient, polygon);
  for (std::size_t i = 0; i < next.count; ++i) bounds.add(edge_row(next, i, length), 0.0, polygon);
  bounds.cut(polygon);
  polygon.simplify(making.corners);
  return polygon.set();
}

// A stop by constant jerk, and what is slower: v = j t^2 / 2, a = -j t, length = j t^3 / 6.
ControllableSet ControllableSets::before_stop(const Station& station, const PlannedSegment& segment,
                                              double cap) const noexcept {
  const AxisLimits limits = limits_at(station);
  const double length = station.length;
  const Derivatives path = derivatives_at(station, segment, 0.0, limits.axes);
  const auto [steepest, most_jerk] = limits_along(station, segment, limits);
  double jerk = stopping_share * most_jerk;
  // No steeper and no faster than may be: a^3 = 6 length j^2, v^3 = 4.5 j length^2.
  jerk = std::min(jerk, std::sqrt(std::pow(stopping_share * steepest, 3.0) / (6.0 * length)));
  jerk = std::min(jerk, std::pow(cap, 1.5) / (4.5 * length * length));
  double b = 0.0;
  double a = 0.0;
  for (int n = 0; n < 40; ++n, jerk *= 0.8) {
    b = std::pow(4.5 * jerk * length * length, 2.0 / 3.0);
    a = -std::cbrt(6.0 * length * jerk * jerk);
    if (station.straight || keeps(limits.share(stopping_share), path, {std::sqrt(b), a}, jerk)) break;
  }
  Polygon polygon;
  polygon.add(0.0, 0.0);
  polygon.add(b, a);
  // From rest, and to rest again: a^3 = 1.45 length j^2 at most.
  polygon.add(0.0, 0.8 * std::cbrt(length * jerk * jerk));
  return polygon.set();
}

}  // namespace shapegcode
