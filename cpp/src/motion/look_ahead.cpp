#include "shapegcode/motion.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

#include <fmt/format.h>

#include "motion/pieces.hpp"
#include "motion/speed_limits.hpp"
#include "shapegcode/error.hpp"

namespace shapegcode {
namespace {

// What the junctions and segments of a path allow.
struct PathSpeeds {
  std::vector<double> on_segment;
  std::vector<double> corner;   // [i]: where segment i is entered
  std::vector<Jump> jump;       // the same
  std::vector<double> fastest;  // of each segment, ever; these are empty if nobody looks at jumps
  std::vector<double> passed;   // [i]: highest speed at which segment i is ever entered
  double jerk_s = 0.0;
};

PathSpeeds path_speeds(const Path& path, const MotionLimits& limits, const FilterTolerance& filter,
                       const SpeedCaps* caps) {
  const std::size_t n = path.size();
  PathSpeeds speeds;
  speeds.on_segment.resize(n);
  speeds.corner.assign(n + 1, MotionLimits::none);
  if (looks_at_jumps(limits)) {
    speeds.jump.assign(n, Jump::none);
    speeds.fastest.resize(n);
    speeds.passed.resize(n);
  }
  double steepest = 0.0;
  for (std::size_t i = 0; i < n; ++i) {
    double& speed = speeds.on_segment[i];
    double& corner = speeds.corner[i];
    speed = segment_speed_limit(path[i], limits, filter);
    if (!(speed > 0.0) || !std::isfinite(speed)) {
      throw Error(ErrorKind::argument, "segment without a feed greater than zero", path[i].line);
    }
    if (i > 0) {
      corner = corner_speed_limit(path[i - 1], path[i], limits, filter);
    }
    if (looks_at_jumps(limits)) {
      speeds.fastest[i] = fastest_speed(path[i], limits, filter);
    }
    if (i > 0 && looks_at_jumps(limits)) {
      const JunctionJumps jumps = junction_jumps(path[i - 1], path[i]);
      const double fastest = std::min(speeds.fastest[i - 1], speeds.fastest[i]);
      speeds.jump[i] = jumps.kind;
      corner = std::min(corner, junction_jump_speed(path[i - 1], path[i], limits, jumps, fastest));
      speeds.passed[i] =
          std::min({corner, fastest, attainable(speeds.passed[i - 1], path[i - 1].length_mm, steepest_of(limits))});
    }
    if (caps != nullptr) {
      speed = std::min(speed, static_cast<double>(caps->on_segment[i]));
      corner = std::min(corner, static_cast<double>(caps->at_junction[i]));
    }
    steepest = std::max(steepest, segment_acceleration(path[i], speed, limits));
  }
  speeds.jerk_s = jerk_time(limits, steepest);
  return speeds;
}

// The zones of every segment: they carry over those that are shorter than they reach.
class Zones {
 public:
  Zones(const Path& path, const MotionLimits& limits, const PathSpeeds& speeds) {
    if (speeds.jerk_s <= 0.0 && limits.feed_spread_s <= 0.0 && speeds.jump.empty()) {
      return;
    }
    const std::size_t n = path.size();
    at_start_.resize(n);
    at_end_.resize(n);
    const auto sweep = [&](std::size_t from, std::size_t into, ZoneSet carry, std::vector<ZoneSet>& zones) {
      const std::size_t junction = std::max(from, into);
      const bool looks = !speeds.jump.empty();
      Zone jump;
      if (looks && speeds.jump[junction] != Jump::none) {
        jump = zone_of_jump(speeds.jump[junction], speeds.passed[junction], steepest_of(limits),
                            jump_time_s(limits, speeds.jerk_s));
      }
      extend(carry, junction_zones({speeds.on_segment[from], path[from].feed_mm_per_s * limits.feed_override,
                                    speeds.on_segment[into], speeds.corner[junction], jump},
                                   limits, speeds.jerk_s));
      if (looks) {
        cut_to(carry, speeds.fastest[into], jump_time_s(limits, speeds.jerk_s));
      }
      zones[into] = carry;
      return beyond(carry, path[into].length_mm);
    };
    ZoneSet carry;
    for (std::size_t i = 1; i < n; ++i) {
      carry = sweep(i - 1, i, carry, at_start_);
    }
    carry = ZoneSet{};
    for (std::size_t i = n - 1; i > 0; --i) {
      carry = sweep(i, i - 1, carry, at_end_);
    }
  }

  [[nodiscard]] bool empty() const noexcept { return at_start_.empty(); }
  std::size_t split(std::size_t i, const Segment& segment, double limit, double beside_turn,
                    std::array<Stretch, most_pieces>& out) const noexcept {
    return split_segment(at_start_[i], at_end_[i], segment.length_mm, limit, beside_turn, out);
  }

 private:
  std::vector<ZoneSet> at_start_, at_end_;
};

std::vector<Piece> make_pieces(const Path& path, const MotionLimits& limits, const PathSpeeds& speeds,
                               const Zones& zones) {
  std::vector<Piece> pieces;
  pieces.reserve(path.size());
  std::array<Stretch, most_pieces> stretches;
  for (std::size_t i = 0; i < path.size(); ++i) {
    std::size_t count = 1;
    stretches[0] = {path[i].length_mm, speeds.on_segment[i], false};
    if (!zones.empty()) {
      const double beside_turn = speeds.jump.empty() ? MotionLimits::none : limit_beside_turn(path[i], limits);
      count = zones.split(i, path[i], speeds.on_segment[i], beside_turn, stretches);
    }
    for (std::size_t k = 0; k < count; ++k) {
      const auto& [length, limit, eased] = stretches[k];
      pieces.push_back({length, limit, segment_acceleration(path[i], limit, limits, eased), 0.0});
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
    speed = speed_beyond(pieces[i], speed);
  }
  speed = 0.0;
  for (std::size_t i = n; i-- > 0;) {
    pieces[i].start_speed = std::min(pieces[i].start_speed, speed_beyond(pieces[i], speed));
    speed = pieces[i].start_speed;
  }
}

class PhaseList {
 public:
  void add(const Ramp& ramp) {
    if (ramp.distance <= 0.0 || ramp.v0 + ramp.v1 <= 0.0) {
      return;
    }
    const double duration = PhaseJoin::duration_s(ramp.v0, ramp.v1, ramp.distance);
    const double acceleration = (ramp.v1 - ramp.v0) / duration;
    if (!phases.empty() && PhaseJoin::joins(phases.back(), ramp.v0, acceleration)) {
      phases.back().duration_s += duration;
    } else {
      phases.push_back({0.0, duration, length, ramp.v0, acceleration});
    }
    length += ramp.distance;
  }
  std::vector<SpeedPhase> phases;
  double length = 0.0;
};

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
    list.add({phases[i].speed_mm_per_s, steady(i) ? phases[i].speed_mm_per_s : end_speed(i), d});
  }
  return std::move(list.phases);
}

// Ramps as steep as the limits let them be, of a path with a length.
PhaseList shortest_ramps(const Path& path, const MotionLimits& limits, const PathSpeeds& speeds) {
  const Zones zones(path, limits, speeds);
  std::vector<Piece> pieces = make_pieces(path, limits, speeds, zones);
  const std::vector<double> boundary = piece_boundaries(path, pieces, speeds.corner, zones);
  pass_speeds(pieces, boundary);
  PhaseList list;
  // Room that is not used is no memory; a list that grows is copied while both stand.
  list.phases.reserve(most_phases * pieces.size());
  std::array<Ramp, most_phases> ramps;
  for (std::size_t i = 0; i < pieces.size(); ++i) {
    const double end_speed = i + 1 < pieces.size() ? pieces[i + 1].start_speed : 0.0;
    const std::size_t count = ramps_of(pieces[i], pieces[i].start_speed, end_speed, list.length, ramps);
    for (std::size_t k = 0; k < count; ++k) {
      list.add(ramps[k]);
    }
  }
  return list;
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
  const PathSpeeds speeds = path_speeds(path, limits, filter, caps);
  PhaseList list = shortest_ramps(path, limits, speeds);
  if (limits.law == AccelerationLaw::constant_time) {
    list.phases = stretch_ramps(list.phases, list.length, limits.time_constant_s);
  }
  return SpeedProfile(std::move(list.phases), path.length_mm(), speeds.jerk_s);
}

}  // namespace shapegcode
