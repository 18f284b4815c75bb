#include "shapegcode/motion.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

#include "base/refuse.hpp"
#include "limits/speed_limits.hpp"
#include "motion/feed_sections.hpp"
#include "motion/phase_maker.hpp"
#include "motion/pieces.hpp"
#include "motion/planned_motion.hpp"
#include "shapegcode/error.hpp"

namespace shapegcode {
namespace {

// Speed limits of the junctions and segments of a path.
struct PathSpeeds {
  std::vector<double> on_segment;
  std::vector<double> corner;  // [i]: where segment i is entered
  double jerk_s = 0.0;
  double corner_spread_s = 0.0;  // time around a corner in which its speed holds, beside that
};

PathSpeeds path_speeds(const Path& path, const MotionLimits& limits, const FilterTolerance& filter,
                       const SpeedCaps* caps) {
  const std::size_t n = path.size();
  PathSpeeds speeds;
  speeds.on_segment.resize(n);
  speeds.corner.assign(n + 1, MotionLimits::none);
  double steepest = 0.0;
  Segment before;
  for (std::size_t i = 0; i < n; ++i) {
    const Segment segment = path[i];
    double& speed = speeds.on_segment[i];
    double& corner = speeds.corner[i];
    speed = segment_speed_limit(segment, limits, filter);
    if (!(speed > 0.0) || !std::isfinite(speed)) {
      throw Error(ErrorKind::argument, "segment without a feed greater than zero", segment.line);
    }
    if (i > 0) {
      corner = corner_speed_limit(before, segment, limits, filter);
    }
    if (caps != nullptr) {
      speed = std::min(speed, static_cast<double>(caps->on_segment[i]));
      corner = std::min(corner, static_cast<double>(caps->at_junction[i]));
    }
    steepest = std::max(steepest, segment_acceleration(segment, speed, limits));
    before = segment;
  }
  speeds.jerk_s = jerk_time(limits, steepest);
  return speeds;
}

// The zones of every segment: they carry over those that are shorter than they reach.
class Zones {
 public:
  Zones(const Path& path, const MotionLimits& limits, const PathSpeeds& speeds) {
    if (speeds.jerk_s + speeds.corner_spread_s <= 0.0 && limits.feed_spread_s <= 0.0) return;
    const std::size_t n = path.size();
    const auto sweep = [&](std::size_t from, std::size_t into, ZoneSet carry, SteadyColumn<ZoneSet>& zones) {
      const std::size_t junction = std::max(from, into);
      const double corner = speeds.corner[junction];
      extend(carry, junction_zones({speeds.on_segment[from], path.feed_mm_per_s(from) * limits.feed_override,
                                    speeds.on_segment[into], corner},
                                   limits, speeds.jerk_s));
      if (speeds.corner_spread_s > 0.0 && corner < speeds.on_segment[into]) {
        extend(carry[corner_zone], {corner, slow_reach(corner, speeds.corner_spread_s)});
      }
      zones.push_back(carry);
      return beyond(carry, path[into].length_mm);
    };
    ZoneSet carry;
    at_start_.push_back(carry);
    at_end_.push_back(carry);
    for (std::size_t i = 1; i < n; ++i) {
      carry = sweep(i - 1, i, carry, at_start_);
    }
    carry = ZoneSet{};
    for (std::size_t i = n - 1; i > 0; --i) {
      carry = sweep(i, i - 1, carry, at_end_);
    }
  }

  [[nodiscard]] bool empty() const noexcept { return at_start_.size() == 0; }
  std::size_t split(std::size_t i, const Segment& segment, double limit,
                    std::array<Section, max_pieces>& out) const noexcept {
    return split_segment(at_start_[i], at_end_[at_end_.size() - 1 - i], segment.length_mm, limit, out);
  }

 private:
  // Most are alike, none at all. Those at the ends stand in the order in which they were found: the last one first.
  SteadyColumn<ZoneSet> at_start_, at_end_;
};

std::vector<Piece> make_pieces(const Path& path, const MotionLimits& limits, const PathSpeeds& speeds,
                               const Zones& zones) {
  std::vector<Piece> pieces;
  pieces.reserve(path.size());
  std::array<Section, max_pieces> sections;
  for (std::size_t i = 0; i < path.size(); ++i) {
    std::size_t count = 1;
    const Segment segment = path[i];
    sections[0] = {segment.length_mm, speeds.on_segment[i]};
    if (!zones.empty()) {
      count = zones.split(i, segment, speeds.on_segment[i], sections);
    }
    for (std::size_t k = 0; k < count; ++k) {
      const auto& [length, limit] = sections[k];
      pieces.push_back({length, limit, segment_acceleration(segment, limit, limits), MotionLimits::none});
    }
  }
  return pieces;
}

// Highest speeds where pieces meet, as the speeds at which they begin. With a jerk time the corner limits are already
// limits of the pieces around the corner.
void put_boundaries(const Path& path, const std::vector<double>& corner, const Zones& zones,
                    std::vector<Piece>& pieces) {
  if (zones.empty()) {
    for (std::size_t i = 0; i < pieces.size(); ++i) pieces[i].start_speed = corner[i];
    return;
  }
  std::size_t k = 0;
  double distance = 0.0;
  for (std::size_t i = 1; i < path.size(); ++i) {
    while (k < pieces.size() && distance + 0.5 * pieces[k].length < path.distance_mm(i)) {
      distance += pieces[k].length;
      ++k;
    }
    if (k < pieces.size()) {
      pieces[k].start_speed = std::min(pieces[k].start_speed, corner[i]);
    }
  }
}

// Boundary speeds by a forward and a backward pass in v^2.
void pass_speeds(std::vector<Piece>& pieces) {
  const std::size_t n = pieces.size();
  double speed = 0.0;
  for (std::size_t i = 0; i < n; ++i) {
    speed = std::min({speed, pieces[i].start_speed, pieces[i].limit});
    pieces[i].start_speed = speed;
    speed = speed_beyond(pieces[i], speed);
  }
  speed = 0.0;
  for (std::size_t i = n; i-- > 0;) {
    pieces[i].start_speed = std::min(pieces[i].start_speed, speed_beyond(pieces[i], speed));
    speed = pieces[i].start_speed;
  }
}

std::vector<Piece> planned_pieces(const Path& path, const MotionLimits& limits, const FilterTolerance& filter,
                                  const SpeedCaps* caps, double& jerk_s) {
  const PathSpeeds speeds = path_speeds(path, limits, filter, caps);
  jerk_s = speeds.jerk_s;
  const Zones zones(path, limits, speeds);
  std::vector<Piece> pieces = make_pieces(path, limits, speeds, zones);
  put_boundaries(path, speeds.corner, zones, pieces);
  pass_speeds(pieces);
  return pieces;
}

void check_plan(const Path& path, const MotionLimits& limits, const FilterTolerance& filter, const SpeedCaps* caps) {
  check_limits(limits, filter);
  const std::size_t n = path.size();
  if (caps != nullptr && (caps->on_segment.size() != n || caps->at_junction.size() != n)) {
    detail::refuse("speed caps of a path of {} segments: one per segment", n);
  }
}

// Sections of one speed are one; one that is shorter than this goes with its neighbour, at the lower speed.
constexpr double shortest_section_mm = 1e-3;

// So long beside its ends a section is one by itself: what a planner lowers for a junction holds there alone.
constexpr double beside_s = 0.15;

std::size_t joined(std::array<Section, max_pieces>& sections, std::size_t count) noexcept {
  std::size_t last = 0;
  for (std::size_t k = 1; k < count; ++k) {
    Section& before = sections[last];
    const bool is_short = std::min(before.length, sections[k].length) < shortest_section_mm;
    if (is_short || before.limit == sections[k].limit) {
      before = {before.length + sections[k].length, std::min(before.limit, sections[k].limit)};
    } else {
      sections[++last] = sections[k];
    }
  }
  return last + 1;
}

}  // namespace

Segment section_of(const Segment& segment, double begin_mm, double end_mm) noexcept {
  if (begin_mm <= 0.0 && end_mm >= segment.length_mm) return segment;
  Segment section = segment;
  section.start_mm = point_at(segment, begin_mm);
  section.end_mm = point_at(segment, end_mm);
  section.length_mm = end_mm - begin_mm;
  section.stop_at_end = segment.stop_at_end && end_mm >= segment.length_mm;
  if (segment.kind == SegmentKind::arc) {
    const double first = begin_mm / segment.length_mm;
    const double last = end_mm / segment.length_mm;
    const double widens = segment.end_radius_mm - segment.start_radius_mm;
    section.start_radius_mm = segment.start_radius_mm + widens * first;
    section.end_radius_mm = segment.start_radius_mm + widens * last;
    section.start_angle_rad = segment.start_angle_rad + segment.sweep_rad * first;
    section.sweep_rad = segment.sweep_rad * (last - first);
  }
  return section;
}

FeedSections feed_sections(const Path& path, const MotionLimits& limits, const FilterTolerance& filter,
                           const SpeedCaps* caps, double corner_spread_s) {
  check_plan(path, limits, filter, caps);
  MotionLimits unaccelerated = limits;
  unaccelerated.law = AccelerationLaw::jerk_limited;
  unaccelerated.jerk_time_s = 0.0;
  unaccelerated.max_acceleration_mm_per_s2.setConstant(MotionLimits::none);
  unaccelerated.max_jerk_mm_per_s3.setConstant(MotionLimits::none);
  PathSpeeds speeds = path_speeds(path, unaccelerated, filter, caps);
  speeds.corner_spread_s = corner_spread_s;
  // The turn of a polyline is that of its lines, as an arc's.
  for (std::size_t i = 1; i < path.size(); ++i) {
    const double turning = corner_speed_limit(path[i - 1], path[i], unaccelerated);
    for (double* speed : {&speeds.on_segment[i - 1], &speeds.on_segment[i]}) *speed = std::min(*speed, turning);
  }
  const Zones zones(path, unaccelerated, speeds);
  FeedSections found;
  PathBuilder builder;
  std::array<Section, max_pieces> sections;
  for (std::size_t i = 0; i < path.size(); ++i) {
    const Segment segment = path[i];
    std::size_t count = 1;
    sections[0] = {segment.length_mm, speeds.on_segment[i]};
    if (!zones.empty() && segment.length_mm > 0.0) {
      count = zones.split(i, segment, speeds.on_segment[i], sections);
      count = joined(sections, count);
    }
    double begin = 0.0;
    const auto add_to = [&](double end, double limit) {
      Segment section = section_of(segment, begin, end);
      section.feed_mm_per_s = limit;
      builder.add(section);
      found.segments.push_back(static_cast<std::uint32_t>(i));
      begin = end;
    };
    for (std::size_t k = 0; k < count; ++k) {
      const double limit = sections[k].limit;
      const double end = k + 1 == count ? segment.length_mm : begin + sections[k].length;
      const double beside_mm = beside_s * limit;
      if (end - begin > 4.0 * beside_mm) {
        add_to(begin + beside_mm, limit);
        add_to(end - beside_mm, limit);
      }
      add_to(end, limit);
    }
  }
  found.path = builder.path();
  return found;
}

SpeedProfile plan_speed(const Path& path, const MotionLimits& limits, const FilterTolerance& filter,
                        const SpeedCaps* caps) {
  check_plan(path, limits, filter, caps);
  const std::size_t n = path.size();
  if (n == 0 || path.length_mm() <= 0.0) {
    return SpeedProfile({}, path.length_mm(), 0.0);
  }
  if (caps == nullptr && PlainPlan::serves(limits)) {
    PlainPlan::Phases phases(std::make_shared<const PlainPlan>(path, limits, filter));
    std::vector<SpeedPhase> all;
    for (SpeedPhase phase; phases.next(phase);) all.push_back(phase);
    return SpeedProfile(std::move(all), path.length_mm(), 0.0);
  }
  double jerk_s = 0.0;
  const std::vector<Piece> pieces = planned_pieces(path, limits, filter, caps, jerk_s);
  PhaseMaker maker(limits);
  // Room that is not used is no memory; a list that grows is copied while both stand.
  maker.ready().reserve(max_phases * pieces.size());
  std::array<Ramp, max_phases> ramps;
  for (std::size_t i = 0; i < pieces.size(); ++i) {
    const double end_speed = i + 1 < pieces.size() ? pieces[i + 1].start_speed : 0.0;
    const std::size_t count = ramps_of(pieces[i], pieces[i].start_speed, end_speed, maker.length_mm(), ramps);
    for (std::size_t k = 0; k < count; ++k) {
      maker.add(ramps[k]);
    }
  }
  maker.end();
  return SpeedProfile(std::move(maker.ready()), path.length_mm(), jerk_s);
}

}  // namespace shapegcode
