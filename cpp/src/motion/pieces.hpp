// Sections of a path with one limit each, the speeds at their boundaries, and the phases of constant acceleration
// within them.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <vector>

#include "limits/speed_limits.hpp"
#include "shapegcode/motion.hpp"

namespace shapegcode {

/// A section of path with one speed limit and one acceleration.
struct Piece {
  double length = 0.0;
  double limit = 0.0;
  double acceleration = 0.0;
  double start_speed = 0.0;
};

/// A slow section that reaches over a junction into a neighbour.
struct Zone {
  double limit = MotionLimits::none;
  double reach = 0.0;

  friend bool operator==(const Zone&, const Zone&) = default;
};

inline void extend(Zone& zone, const Zone& other) noexcept {
  if (other.reach <= 0.0) return;
  zone = zone.reach <= 0.0 ? other : Zone{std::min(zone.limit, other.limit), std::max(zone.reach, other.reach)};
}

/// What of a zone reaches beyond a segment.
inline Zone beyond(const Zone& zone, double length) noexcept {
  const double left = zone.reach - length;
  return left > 0.0 ? Zone{zone.limit, left} : Zone{};
}

/// One side of a junction, seen from the other.
struct JunctionSpeeds {
  double from = 0.0;       ///< limit of the segment that the zone comes from
  double from_feed = 0.0;  ///< its programmed feed
  double into = 0.0;       ///< limit of the segment that it reaches into
  double corner = MotionLimits::none;
};

/// The zones of a junction: of its speed, or of a slower segment, which the smoothing by the jerk time mixes; and of a
/// lower programmed feed, for what a filter mixes.
enum ZoneKind : std::size_t { corner_zone, slow_zone, feed_zone, zone_kinds };
using ZoneSet = std::array<Zone, zone_kinds>;

/// How far before and behind a slow position the smoothing by the jerk time wants its speed.
inline double slow_reach(double speed, double jerk_s) noexcept { return 0.5 * speed * jerk_s; }

inline ZoneSet junction_zones(const JunctionSpeeds& at, const MotionLimits& limits, double jerk_s) noexcept {
  ZoneSet zones;
  const double least = std::min(at.corner, at.from);
  if (jerk_s > 0.0 && least < at.into) {
    zones[at.corner < at.from ? corner_zone : slow_zone] = {least, slow_reach(least, jerk_s)};
  }
  if (limits.feed_spread_s > 0.0 && at.from_feed * (1.0 + limits.feed_excess_ratio) < at.into) {
    zones[feed_zone] = {at.from_feed, at.from_feed * (limits.feed_spread_s + 0.5 * jerk_s)};
  }
  return zones;
}

inline void extend(ZoneSet& zones, const ZoneSet& others) noexcept {
  for (std::size_t kind = 0; kind < zone_kinds; ++kind) extend(zones[kind], others[kind]);
}

inline ZoneSet beyond(const ZoneSet& zones, double length) noexcept {
  ZoneSet left;
  for (std::size_t kind = 0; kind < zone_kinds; ++kind) left[kind] = beyond(zones[kind], length);
  return left;
}

/// Of a segment: a border on each side of each zone, at most.
inline constexpr std::size_t max_pieces = 2 * zone_kinds + 1;

struct Section {
  double length = 0.0;
  double limit = 0.0;
};

/// The sections between the borders of a segment's zones; their number is returned.
inline std::size_t split_segment(const ZoneSet& at_start, const ZoneSet& at_end, double length, double limit,
                                 std::array<Section, max_pieces>& sections) noexcept {
  std::array<double, max_pieces + 1> marks{0.0, length};
  std::size_t count = 2;
  const auto mark = [&](double at) {  // in their order
    std::size_t k = count++;
    for (; marks[k - 1] > at; --k) marks[k] = marks[k - 1];
    marks[k] = at;
  };
  for (std::size_t kind = 0; kind < zone_kinds; ++kind) {
    const double from_start = at_start[kind].reach;
    const double from_end = at_end[kind].reach;
    if (from_start > 0.0 && from_start < length) mark(from_start);
    if (from_end > 0.0 && from_end < length) mark(length - from_end);
  }
  std::size_t made = 0;
  for (std::size_t k = 0; k + 1 < count; ++k) {
    if (marks[k + 1] <= marks[k]) continue;
    const double middle = 0.5 * (marks[k] + marks[k + 1]);
    Section section{marks[k + 1] - marks[k], limit};
    for (std::size_t kind = 0; kind < zone_kinds; ++kind) {
      if (middle < at_start[kind].reach) section.limit = std::min(section.limit, at_start[kind].limit);
      if (middle > length - at_end[kind].reach) section.limit = std::min(section.limit, at_end[kind].limit);
    }
    sections[made++] = section;
  }
  return made;
}

/// Speed at the end of a piece that is entered at a speed and accelerated as much as it may be; the same backwards.
inline double speed_beyond(const Piece& piece, double speed) noexcept {
  return std::min(piece.limit, std::sqrt(speed * speed + 2.0 * piece.acceleration * piece.length));
}

/// Phases of a profile in a row; one that goes on as its predecessor did is joined to it.
struct PhaseJoin {
  /// Time of a ramp or a steady section from v0 to v1 over `distance`.
  static double duration_s(double v0, double v1, double distance) noexcept { return 2.0 * distance / (v0 + v1); }
  static bool joins(const SpeedPhase& last, double v0, double acceleration) noexcept {
    const double scale = std::max(std::abs(last.acceleration_mm_per_s2), std::abs(acceleration));
    const double end_speed = last.speed_mm_per_s + last.acceleration_mm_per_s2 * last.duration_s;
    // Without an acceleration limit the speed jumps from one steady section to the next.
    const bool goes_on = std::abs(end_speed - v0) <= 1e-6 * (end_speed + v0);
    return goes_on && (std::abs(last.acceleration_mm_per_s2 - acceleration) <= 1e-9 * scale || scale == 0.0);
  }
};

inline constexpr std::size_t max_phases = 3;  // of a piece: up, steady, down

/// A ramp or a steady section from v0 to v1.
struct Ramp {
  double v0 = 0.0;
  double v1 = 0.0;
  double distance = 0.0;
};

/// The ramps of a piece between two speeds, as short in time as its limits let them be. `behind`: length of all before
/// it, beside which round-off is no section of its own. Their number is returned.
inline std::size_t ramps_of(const Piece& piece, double v0, double v1, double behind,
                            std::array<Ramp, max_phases>& ramps) noexcept {
  const double a = piece.acceleration;
  if (!std::isfinite(a)) {
    ramps[0] = {piece.limit, piece.limit, piece.length};
    return 1;
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
  std::size_t count = 0;
  ramps[count++] = {v0, peak, up};
  const double steady = piece.length - up - down;
  if (steady > 1e-12 * (1.0 + behind + up)) {
    ramps[count++] = {peak, peak, steady};
  }
  ramps[count++] = {peak, v1, down};
  return count;
}

}  // namespace shapegcode
