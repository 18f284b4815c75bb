#include "shapegcode/motion.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

#include <fmt/format.h>

#include "base/checks.hpp"
#include "shapegcode/error.hpp"

namespace shapegcode {
namespace {

// A stretch of path with one speed limit and one acceleration.
struct Piece {
  double length = 0.0;
  double limit = 0.0;
  double acceleration = 0.0;
  double start_speed = 0.0;
};

// The planner wants a speed at every junction; this one is a stop to every purpose.
constexpr double standstill_mm_per_s = 1e-3;

// Infinity switches a limit off.
void require_limit(double value, const char* name, const char* unit) { require(value > 0.0, name, value, unit, "> 0"); }

void check_limits(const MotionLimits& limits, const FilterTolerance& filter) {
  require_limit(limits.time_constant_s, "acceleration time constant", "s");
  require_limit(limits.feed_override, "feed override", "");
  require_limit(limits.arc_feed_ratio, "arc feed ratio", "");
  require_not_below_zero(limits.jerk_time_s, "jerk time", "s");
  require_not_below_zero(limits.feed_spread_s, "spread of feeds", "s");
  require_not_below_zero(limits.feed_excess_ratio, "excess of feeds", "");
  require_limit(filter.contour_tolerance_mm, "contour tolerance", "mm");
  require_limit(limits.centripetal_acceleration_mm_per_s2, "centripetal acceleration", "mm/s2");
  require_limit(limits.polyline_acceleration_mm_per_s2, "acceleration along polylines", "mm/s2");
  require_limit(limits.junction_deviation_mm, "junction deviation", "mm");
  require_not_below_zero(limits.block_time_s, "block time", "s");
  require_limit(limits.corner_stop_angle_rad, "angle of corners that are stops", "rad");
  for (int i = 0; i < axis_count; ++i) {
    require_limit(limits.max_feed_mm_per_s[i], "axis feed limit", "mm/s");
    require_limit(limits.max_acceleration_mm_per_s2[i], "axis acceleration limit", "mm/s2");
    require_limit(limits.max_jerk_mm_per_s3[i], "axis jerk limit", "mm/s3");
    require_limit(limits.corner_speed_difference_mm_per_s[i], "corner speed difference", "mm/s");
    require_limit(limits.contour_acceleration_mm_per_s2[i], "contour acceleration", "mm/s2");
  }
}

// Largest share of each axis in the tangent; an arc may point along any direction of its plane.
Vector3 axis_share(const Segment& segment) noexcept {
  if (segment.kind != SegmentKind::arc) {
    return tangent_at(segment, 0.0).cwiseAbs();
  }
  Vector3 share = Vector3::Ones();
  share[segment.normal] =
      segment.length_mm > 0.0
          ? std::abs(segment.end_mm[segment.normal] - segment.start_mm[segment.normal]) / segment.length_mm
          : 0.0;
  return share;
}

double tangential_limit(const Vector3& share, const Vector3& limit) noexcept {
  double result = MotionLimits::none;
  for (int i = 0; i < axis_count; ++i) {
    if (share[i] > 0.0) {
      result = std::min(result, limit[i] / share[i]);
    }
  }
  return result;
}

// In-plane axes of an arc share their acceleration between the turn and the change of speed.
double arc_centripetal_limit(const Segment& segment, const MotionLimits& limits) noexcept {
  double limit = limits.centripetal_acceleration_mm_per_s2;
  for (int i = 0; i < axis_count; ++i) {
    if (i != segment.normal) {
      limit = std::min({limit, 0.9 * limits.max_acceleration_mm_per_s2[i], limits.contour_acceleration_mm_per_s2[i]});
    }
  }
  return limit;
}

// The acceleration of a circle turns with it: jerk v^3 / r^2.
double arc_jerk_speed(const Segment& segment, const MotionLimits& limits) noexcept {
  double jerk = MotionLimits::none;
  for (int i = 0; i < axis_count; ++i) {
    if (i != segment.normal) {
      jerk = std::min(jerk, limits.max_jerk_mm_per_s3[i]);
    }
  }
  const double bend = curvature(segment);
  return std::isfinite(jerk) && bend > 0.0 ? std::cbrt(jerk / (bend * bend)) : MotionLimits::none;
}

double segment_acceleration(const Segment& segment, double speed_limit, const MotionLimits& limits) noexcept {
  double axes = tangential_limit(axis_share(segment), limits.max_acceleration_mm_per_s2);
  if (segment.kind == SegmentKind::arc && std::isfinite(axes)) {
    const double turning = speed_limit * speed_limit * curvature(segment);
    axes = std::sqrt(std::max(0.19 * axes * axes, axes * axes - turning * turning));
  }
  if (limits.law == AccelerationLaw::constant_time) {
    return std::min(axes, segment.feed_mm_per_s * limits.feed_override / limits.time_constant_s);
  }
  return axes;
}

double polyline_reach(const Segment& before, const Segment& after) noexcept {
  return 0.5 * (before.length_mm + after.length_mm);
}

double polyline_curvature(const Segment& before, const Segment& after, double angle) noexcept {
  const double reach = polyline_reach(before, after);
  return reach > 0.0 ? angle / reach : 0.0;
}

// Speed at which the turn of the direction by `change`, spread over the way between the middles of both blocks, costs
// no axis more than its contour acceleration: a = |change| v^2 / reach.
double contour_speed(const Vector3& change, double reach, const MotionLimits& limits) noexcept {
  return std::sqrt(tangential_limit(change.cwiseAbs(), limits.contour_acceleration_mm_per_s2) * reach);
}

// Speed on the arc that is tangent to both sides of a corner and cuts it by the deviation: a d c / (1 - c), c the
// cosine of half the turn. (Sonny Jeon's rule of grbl, 2011.)
double junction_deviation_speed(double angle, double acceleration, double deviation_mm) noexcept {
  const double cosine = std::cos(0.5 * angle);
  return std::sqrt(acceleration * deviation_mm * cosine / (1.0 - cosine));
}

double curvature_speed(double curvature_per_mm, double centripetal, const FilterTolerance& filter,
                       double tolerance_mm) noexcept {
  if (curvature_per_mm <= 0.0) {
    return MotionLimits::none;
  }
  double speed = std::sqrt(centripetal / curvature_per_mm);
  if (filter.variance_s2 > 0.0) {
    // Radial error of a filter on an arc: variance * v^2 * curvature / 2.
    speed = std::min(speed, std::sqrt(2.0 * tolerance_mm / (filter.variance_s2 * curvature_per_mm)));
  }
  return speed;
}

double jerk_time(const MotionLimits& limits, double acceleration) {
  const double jerk = limits.max_jerk_mm_per_s3.minCoeff();
  // Twice, because acceleration may turn into deceleration at once.
  const double from_jerk = std::isfinite(jerk) && std::isfinite(acceleration) ? 2.0 * acceleration / jerk : 0.0;
  return std::max(limits.jerk_time_s, from_jerk);
}

// A slow stretch that reaches over a junction into the faster neighbour.
struct Zone {
  double limit = MotionLimits::none;
  double reach = 0.0;
};

void extend(Zone& zone, double limit, double reach) {
  if (zone.reach <= 0.0) {
    zone = {limit, reach};
  } else {
    zone = {std::min(zone.limit, limit), std::max(zone.reach, reach)};
  }
}

// Zones on both sides of every junction: `limits(from, into)` is the speed that reaches over it and the way it reaches.
template <class Limit>
void sweep_zones(const Path& path, Limit&& limit, std::vector<Zone>& at_start, std::vector<Zone>& at_end) {
  const std::size_t n = path.size();
  const auto sweep = [&](std::size_t from, std::size_t into, Zone carry, std::vector<Zone>& zones) {
    const Zone own = limit(from, into);
    if (own.limit < MotionLimits::none) {
      extend(carry, own.limit, own.reach);
    }
    zones[into] = carry;
    const double left = carry.reach - path[into].length_mm;
    return left > 0.0 ? Zone{carry.limit, left} : Zone{};
  };
  Zone carry;
  for (std::size_t i = 1; i < n; ++i) {
    carry = sweep(i - 1, i, carry, at_start);
  }
  carry = Zone{};
  for (std::size_t i = n - 1; i > 0; --i) {
    carry = sweep(i, i - 1, carry, at_end);
  }
}

// Slow stretches that reach over junctions: corners for the jerk time, programmed feeds for what a filter mixes.
class Zones {
 public:
  Zones(const Path& path, const MotionLimits& limits, const std::vector<double>& speed,
        const std::vector<double>& corner, double jerk_s)
      : n_(path.size()) {
    if (jerk_s > 0.0) {
      add(path, [&](std::size_t from, std::size_t into) {
        const double least = std::min(corner[std::max(from, into)], speed[from]);
        return least < speed[into] ? Zone{least, 0.5 * least * jerk_s} : Zone{};
      });
    }
    if (limits.feed_spread_s > 0.0) {
      add(path, [&](std::size_t from, std::size_t into) {
        const double feed = path[from].feed_mm_per_s * limits.feed_override;
        return feed * (1.0 + limits.feed_excess_ratio) < speed[into]
                   ? Zone{feed, feed * (limits.feed_spread_s + 0.5 * jerk_s)}
                   : Zone{};
      });
    }
  }

  [[nodiscard]] bool empty() const noexcept { return sides_.empty(); }

  // The borders of a segment's stretches, and the limit between two of them.
  void split(std::size_t i, double length, double limit, std::vector<std::pair<double, double>>& stretches) const {
    std::vector<double> marks{0.0, length};
    for (const auto& [at_start, at_end] : sides_) {
      marks.push_back(std::min(at_start[i].reach, length));
      marks.push_back(std::max(length - at_end[i].reach, 0.0));
    }
    std::ranges::sort(marks);
    for (std::size_t k = 0; k + 1 < marks.size(); ++k) {
      const double middle = 0.5 * (marks[k] + marks[k + 1]);
      if (marks[k + 1] <= marks[k]) {
        continue;
      }
      double least = limit;
      for (const auto& [at_start, at_end] : sides_) {
        if (middle < at_start[i].reach) {
          least = std::min(least, at_start[i].limit);
        }
        if (middle > length - at_end[i].reach) {
          least = std::min(least, at_end[i].limit);
        }
      }
      stretches.emplace_back(marks[k + 1] - marks[k], least);
    }
  }

 private:
  template <class Limit>
  void add(const Path& path, Limit&& limit) {
    auto& [at_start, at_end] = sides_.emplace_back(std::vector<Zone>(n_), std::vector<Zone>(n_));
    sweep_zones(path, limit, at_start, at_end);
  }

  std::size_t n_;
  std::vector<std::pair<std::vector<Zone>, std::vector<Zone>>> sides_;  // at the start and at the end of each segment
};

std::vector<Piece> make_pieces(const Path& path, const MotionLimits& limits, const std::vector<double>& speed,
                               const Zones& zones) {
  std::vector<Piece> pieces;
  pieces.reserve(path.size());
  std::vector<std::pair<double, double>> stretches;
  for (std::size_t i = 0; i < path.size(); ++i) {
    stretches.clear();
    if (zones.empty()) {
      stretches.emplace_back(path[i].length_mm, speed[i]);
    } else {
      zones.split(i, path[i].length_mm, speed[i], stretches);
    }
    for (const auto& [length, limit] : stretches) {
      pieces.push_back({length, limit, segment_acceleration(path[i], limit, limits), 0.0});
    }
  }
  return pieces;
}

// Highest speeds where pieces meet. With a jerk time the corner limits are already limits of the pieces around the
// corner.
std::vector<double> piece_boundaries(const Path& path, const std::vector<Piece>& pieces,
                                     const std::vector<double>& corner, const Zones& zones) {
  if (zones.empty()) {
    return corner;
  }
  std::vector<double> boundary(pieces.size() + 1, MotionLimits::none);
  std::size_t k = 0;
  double distance = 0.0;
  for (std::size_t i = 1; i < path.size(); ++i) {
    while (k < pieces.size() && distance + 0.5 * pieces[k].length < path.distance_mm(i)) {
      distance += pieces[k].length;
      ++k;
    }
    if (k < pieces.size()) {
      boundary[k] = std::min(boundary[k], corner[i]);
    }
  }
  return boundary;
}

// Boundary speeds by a forward and a backward pass in v^2.
void pass_speeds(std::vector<Piece>& pieces, const std::vector<double>& boundary) {
  const std::size_t n = pieces.size();
  double speed = 0.0;
  for (std::size_t i = 0; i < n; ++i) {
    speed = std::min({speed, boundary[i], pieces[i].limit});
    pieces[i].start_speed = speed;
    speed = std::min(pieces[i].limit, std::sqrt(speed * speed + 2.0 * pieces[i].acceleration * pieces[i].length));
  }
  speed = 0.0;
  for (std::size_t i = n; i-- > 0;) {
    speed = std::min(pieces[i].limit, std::sqrt(speed * speed + 2.0 * pieces[i].acceleration * pieces[i].length));
    pieces[i].start_speed = std::min(pieces[i].start_speed, speed);
    speed = pieces[i].start_speed;
  }
}

class PhaseList {
 public:
  // A ramp or a steady stretch from v0 to v1 over `distance`; joined to its predecessor where nothing changes.
  void add(double v0, double v1, double distance) {
    if (distance <= 0.0 || v0 + v1 <= 0.0) {
      return;
    }
    const double duration = 2.0 * distance / (v0 + v1);
    const double acceleration = (v1 - v0) / duration;
    if (!phases.empty()) {
      SpeedPhase& last = phases.back();
      const double scale = std::max(std::abs(last.acceleration_mm_per_s2), std::abs(acceleration));
      const double end_speed = last.speed_mm_per_s + last.acceleration_mm_per_s2 * last.duration_s;
      // Without an acceleration limit the speed jumps from one steady stretch to the next.
      const bool joins = std::abs(end_speed - v0) <= 1e-6 * (end_speed + v0);
      if (joins && (std::abs(last.acceleration_mm_per_s2 - acceleration) <= 1e-9 * scale || scale == 0.0)) {
        last.duration_s += duration;
        length += distance;
        return;
      }
    }
    phases.push_back({0.0, duration, length, v0, acceleration});
    length += distance;
  }
  std::vector<SpeedPhase> phases;
  double length = 0.0;
};

constexpr std::size_t most_phases = 3;  // of a piece: up, steady, down

void piece_phases(const Piece& piece, double end_speed, PhaseList& list) {
  const double v0 = piece.start_speed;
  const double v1 = end_speed;
  const double a = piece.acceleration;
  if (!std::isfinite(a)) {
    list.add(piece.limit, piece.limit, piece.length);
    return;
  }
  const double peak_squared = a * piece.length + 0.5 * (v0 * v0 + v1 * v1);
  const double peak = std::max({v0, v1, std::min(piece.limit, std::sqrt(peak_squared))});
  double up = (peak * peak - v0 * v0) / (2.0 * a);
  double down = (peak * peak - v1 * v1) / (2.0 * a);
  if (up + down > piece.length) {  // rounding only
    const double scale = piece.length / (up + down);
    up *= scale;
    down *= scale;
  }
  list.add(v0, peak, up);
  const double steady = piece.length - up - down;
  // Dust of rounding would become a phase of its own.
  if (steady > 1e-12 * (1.0 + list.length)) {
    list.add(peak, peak, steady);
  }
  list.add(peak, v1, down);
}

// Constant-time law: a ramp that is shorter than the time constant is stretched into the steady stretch at its fast
// end.
std::vector<SpeedPhase> stretch_ramps(const std::vector<SpeedPhase>& phases, double length, double time_constant_s) {
  const std::size_t n = phases.size();
  const auto end_speed = [&](std::size_t i) {
    return phases[i].speed_mm_per_s + phases[i].acceleration_mm_per_s2 * phases[i].duration_s;
  };
  const auto distance = [&](std::size_t i) {
    return (i + 1 < n ? phases[i + 1].distance_mm : length) - phases[i].distance_mm;
  };
  std::vector<double> extra(n, 0.0);   // distance a ramp takes from its steady neighbour
  std::vector<double> wanted(n, 0.0);  // what the ramps on both sides ask of a steady stretch
  const auto steady = [&](std::size_t i) { return phases[i].acceleration_mm_per_s2 == 0.0; };
  const auto fast_neighbour = [&](std::size_t i) {
    const std::size_t k = phases[i].acceleration_mm_per_s2 > 0.0 ? i + 1 : i - 1;
    return k < n && steady(k) ? k : n;
  };
  for (std::size_t i = 0; i < n; ++i) {
    if (steady(i) || phases[i].duration_s >= time_constant_s || fast_neighbour(i) == n) {
      continue;
    }
    const double mean = 0.5 * (phases[i].speed_mm_per_s + end_speed(i));
    extra[i] = mean * (time_constant_s - phases[i].duration_s);
    wanted[fast_neighbour(i)] += extra[i];
  }
  PhaseList list;
  list.phases.reserve(n);
  std::vector<double> granted(n, 0.0);
  for (std::size_t i = 0; i < n; ++i) {
    if (extra[i] > 0.0) {
      const std::size_t k = fast_neighbour(i);
      const double share = std::min(1.0, distance(k) / wanted[k]);
      extra[i] *= share;
      granted[k] += extra[i];
    }
  }
  for (std::size_t i = 0; i < n; ++i) {
    const double d = steady(i) ? distance(i) - granted[i] : distance(i) + extra[i];
    list.add(phases[i].speed_mm_per_s, steady(i) ? phases[i].speed_mm_per_s : end_speed(i), d);
  }
  return std::move(list.phases);
}

}  // namespace

double axis_feed_limit(const Segment& segment, const MotionLimits& limits) noexcept {
  return tangential_limit(axis_share(segment), limits.max_feed_mm_per_s);
}

double segment_speed_limit(const Segment& segment, const MotionLimits& limits, const FilterTolerance& filter) noexcept {
  double speed = segment.feed_mm_per_s * limits.feed_override;
  if (segment.kind == SegmentKind::arc) {
    speed *= limits.arc_feed_ratio;
    speed = std::min(speed, curvature_speed(curvature(segment), arc_centripetal_limit(segment, limits), filter,
                                            filter.contour_tolerance_mm));
    speed = std::min(speed, arc_jerk_speed(segment, limits));
  }
  if (limits.block_time_s > 0.0 && segment.length_mm > 0.0) {
    speed = std::min(speed, segment.length_mm / limits.block_time_s);
  }
  return std::min(speed, axis_feed_limit(segment, limits));
}

double corner_speed_limit(const Segment& before, const Segment& after, const MotionLimits& limits,
                          const FilterTolerance& filter) noexcept {
  const Vector3 change = tangent_at(after, 0.0) - tangent_at(before, before.length_mm);
  const double size = change.norm();
  // A tangent junction to within what the least increment lets a program say (1 um over 1 mm).
  if (size < 1e-6) {
    return MotionLimits::none;
  }
  double speed = tangential_limit(change.cwiseAbs(), limits.corner_speed_difference_mm_per_s);
  const double angle = 2.0 * std::asin(std::min(1.0, 0.5 * size));
  const double tolerance = filter.corner_share * filter.contour_tolerance_mm;
  speed = std::min(speed, curvature_speed(polyline_curvature(before, after, angle),
                                          limits.polyline_acceleration_mm_per_s2, filter, tolerance));
  if (angle >= limits.corner_stop_angle_rad) {
    speed = std::min(speed, standstill_mm_per_s);
  }
  if (limits.junction_deviation_mm < MotionLimits::none) {
    const double acceleration = tangential_limit(change.cwiseAbs() / size, limits.max_acceleration_mm_per_s2);
    speed = std::min(speed, std::max(standstill_mm_per_s,
                                     junction_deviation_speed(angle, acceleration, limits.junction_deviation_mm)));
  }
  speed = std::min(speed, contour_speed(change, polyline_reach(before, after), limits));
  if (filter.mean_deviation_s > 0.0) {
    // A filter of symmetric spread passes the corner at |change| * (v*E|t| + a*E[t^2]/2) / 2: what the speed at the
    // corner and the ramps on both sides of it cost.
    const double acceleration =
        std::max(segment_acceleration(before, segment_speed_limit(before, limits, filter), limits),
                 segment_acceleration(after, segment_speed_limit(after, limits, filter), limits));
    const double ramps = std::isfinite(acceleration) ? 0.5 * acceleration * filter.variance_s2 : 0.0;
    const double room = 2.0 * tolerance / size - ramps;
    speed = std::min(speed, std::max(0.0, room / filter.mean_deviation_s));
  }
  return speed;
}

namespace {

// Ramps as steep as the limits let them be, of a path with a length; and the jerk time.
std::pair<PhaseList, double> shortest_ramps(const Path& path, const MotionLimits& limits, const FilterTolerance& filter,
                                            const SpeedCaps* caps) {
  const std::size_t n = path.size();
  std::vector<double> speed(n);
  std::vector<double> corner(n + 1, MotionLimits::none);
  double fastest_acceleration = 0.0;
  for (std::size_t i = 0; i < n; ++i) {
    speed[i] = segment_speed_limit(path[i], limits, filter);
    if (!(speed[i] > 0.0) || !std::isfinite(speed[i])) {
      throw Error(ErrorKind::argument, "segment without a feed greater than zero", path[i].line);
    }
    if (i > 0) {
      corner[i] = corner_speed_limit(path[i - 1], path[i], limits, filter);
    }
    if (caps != nullptr) {
      speed[i] = std::min(speed[i], static_cast<double>(caps->on_segment[i]));
      corner[i] = std::min(corner[i], static_cast<double>(caps->at_junction[i]));
    }
    fastest_acceleration = std::max(fastest_acceleration, segment_acceleration(path[i], speed[i], limits));
  }
  const double jerk_s = jerk_time(limits, fastest_acceleration);
  const Zones zones(path, limits, speed, corner, jerk_s);
  std::vector<Piece> pieces = make_pieces(path, limits, speed, zones);
  const std::vector<double> boundary = piece_boundaries(path, pieces, corner, zones);
  pass_speeds(pieces, boundary);
  PhaseList list;
  // Room that is not used is no memory; a list that grows is copied while both stand.
  list.phases.reserve(most_phases * pieces.size());
  for (std::size_t i = 0; i < pieces.size(); ++i) {
    piece_phases(pieces[i], i + 1 < pieces.size() ? pieces[i + 1].start_speed : 0.0, list);
  }
  return {std::move(list), jerk_s};
}

}  // namespace

SpeedProfile plan_speed(const Path& path, const MotionLimits& limits, const FilterTolerance& filter,
                        const SpeedCaps* caps) {
  check_limits(limits, filter);
  const std::size_t n = path.size();
  if (caps != nullptr && (caps->on_segment.size() != n || caps->at_junction.size() != n)) {
    throw Error(ErrorKind::argument, fmt::format("speed caps of a path of {} segments: one per segment", n));
  }
  if (n == 0 || path.length_mm() <= 0.0) {
    return SpeedProfile({}, path.length_mm(), 0.0);
  }
  auto [list, jerk_s] = shortest_ramps(path, limits, filter, caps);
  if (limits.law == AccelerationLaw::constant_time) {
    list.phases = stretch_ramps(list.phases, list.length, limits.time_constant_s);
  }
  return SpeedProfile(std::move(list.phases), path.length_mm(), jerk_s);
}

std::vector<std::size_t> forced_stops(const std::vector<Segment>& segments, double axis_angle_rad,
                                      double corner_angle_rad, const MotionLimits& limits,
                                      const FilterTolerance& filter) {
  const double along = std::cos(axis_angle_rad);
  const double turned = std::cos(corner_angle_rad);
  std::vector<std::size_t> stops;
  for (std::size_t i = 1; i < segments.size(); ++i) {
    const Vector3 before = tangent_at(segments[i - 1], segments[i - 1].length_mm);
    const Vector3 after = tangent_at(segments[i], 0.0);
    const bool plunges = std::abs(before[2]) >= along || std::abs(after[2]) >= along;
    if (segments[i - 1].stop_at_end || (plunges && before.dot(after) <= turned) ||
        corner_speed_limit(segments[i - 1], segments[i], limits, filter) <= 0.0) {
      stops.push_back(i);
    }
  }
  return stops;
}

}  // namespace shapegcode
