#include "motion/linuxcnc_blend.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <optional>
#include <utility>

#include "limits/speed_limits.hpp"
#include "motion/feed_sections.hpp"
#include "motion/planner_rules.hpp"

namespace shapegcode::detail {
namespace {

constexpr double pi = std::numbers::pi;

// Constants of the planner.
constexpr double tangential_share = 0.5;         // of the acceleration on a blend arc, along it
constexpr double sharp_rad = pi / 90.0;          // an inner angle below this is a stop
constexpr double least_angle_rad = 1e-6;         // between which and none no plane is found
constexpr double least_arc_angle_rad = pi / 12;  // half of the inner angle between two arcs that is blended
constexpr double least_arc_mm = 1e-6;
constexpr double least_turn_rad = 1e-3;   // for which the tolerance limits an overlap
constexpr double tolerance_share = 0.25;  // of a segment's length, at most
constexpr double gap_cycles = 4.0;        // a shorter rest of a line becomes part of the blend behind it
constexpr double largest_kink_ratio = 0.7071;
constexpr double least_kink_ratio = 0.001;
constexpr std::size_t most_merged = 100;  // lines that its detector of naive CAM output makes one

constexpr double chord_turn_rad = 0.02;  // of the lines that stand for a blend arc here

double normal_share() noexcept { return std::sqrt(1.0 - tangential_share * tangential_share); }

// The largest vector in every direction of a plane that no axis' limit is below.
double limit_in_plane(const Vector3& normal, const Vector3& limit) noexcept {
  double least = MotionLimits::none;
  for (int i = 0; i < axis_count; ++i) {
    const double share = std::sqrt(std::max(1e-12, 1.0 - normal[i] * normal[i]));
    least = std::min(least, limit[i] / share);
  }
  return least;
}

double arc_limit(const Segment& arc, const Vector3& limit) noexcept {
  double least = MotionLimits::none;
  for (int i = 0; i < axis_count; ++i) {
    const bool moves = i != arc.normal || std::abs(arc.end_mm[i] - arc.start_mm[i]) > 1e-3;
    if (moves) least = std::min(least, limit[i]);
  }
  return least;
}

// No segment is shorter than a period; an arc leaves a share of the acceleration to the change of speed.
void finish_limits(QueuedSegment& queued, double period_s) noexcept {
  queued.max_speed_mm_per_s = std::min(queued.max_speed_mm_per_s, queued.length_mm / period_s);
  if (!queued.is_arc) return;
  const double bend = curvature(queued.geometry.front());
  const double most = queued.acceleration_mm_per_s2() / queued.tangential_ratio;
  const double across = bend * queued.max_speed_mm_per_s * queued.max_speed_mm_per_s;
  if (across > normal_share() * most) {
    queued.max_speed_mm_per_s = std::sqrt(normal_share() * most / bend);
    queued.tangential_ratio = tangential_share;
  } else {
    queued.tangential_ratio = std::sqrt(1.0 - across / most * (across / most));
  }
}

QueuedSegment queued_of(const Segment& segment, const MotionLimits& limits, double period_s) {
  QueuedSegment queued;
  queued.geometry = {segment};
  queued.length_mm = segment.length_mm;
  queued.nominal_length_mm = segment.length_mm;
  MotionLimits programmed = limits;
  programmed.feed_override = 1.0;
  queued.is_arc = segment.kind == SegmentKind::arc;
  if (queued.is_arc) {
    queued.max_speed_mm_per_s = arc_limit(segment, limits.max_feed_mm_per_s);
    queued.max_acceleration_mm_per_s2 = arc_limit(segment, limits.max_acceleration_mm_per_s2);
    // The acceleration across an arc is looked at before a blend may shorten it too.
    const double bend = curvature(segment);
    const double across = normal_share() * queued.max_acceleration_mm_per_s2;
    if (bend > 0.0) queued.max_speed_mm_per_s = std::min(queued.max_speed_mm_per_s, std::sqrt(across / bend));
  } else {
    const Vector3 along = tangent_at(segment, 0.0).cwiseAbs();
    queued.max_speed_mm_per_s = tangential_limit(along, limits.max_feed_mm_per_s);
    queued.max_acceleration_mm_per_s2 = tangential_limit(along, limits.max_acceleration_mm_per_s2);
  }
  queued.request_mm_per_s = planned_feed(segment, programmed, queued.max_speed_mm_per_s);
  queued.max_speed_mm_per_s = std::min(queued.max_speed_mm_per_s, queued.length_mm / period_s);
  return queued;
}

// Where two segments meet, before a blend.
struct Corner {
  Vector3 before, behind;  // unit tangents
  Vector3 point;
  double half_rad = 0.0;  // of the inner angle
  double turn_rad = 0.0;
  Vector3 binormal = Vector3::Zero();

  Corner(const Segment& first, const Segment& second)
      : before(tangent_at(first, first.length_mm)), behind(tangent_at(second, 0.0)), point(second.start_mm) {
    half_rad = 0.5 * std::acos(std::clamp(-before.dot(behind), -1.0, 1.0));
    turn_rad = pi - 2.0 * half_rad;
    const Vector3 across = before.cross(behind);
    if (across.norm() > 0.0) binormal = across.normalized();
  }
};

// One side of a corner: how much a blend may take of it, and the line that stands for an arc.
struct Side {
  Vector3 along;          // of that line, in the direction of travel
  double room_mm = 0.0;   // that the blend may take
  double less_rad = 0.0;  // by which the line makes the half angle smaller
  bool is_arc = false;
  bool inside = false;  // the other side lies within the circle
  double radius_mm = 0.0;
  Vector3 centre = Vector3::Zero();
  double most_rad = 0.0;  // of an arc that the blend may take
};

Side side_of(const QueuedSegment& queued, const Corner& corner, bool at_end, bool other_is_line) {
  const Segment& segment = at_end ? queued.geometry.back() : queued.geometry.front();
  Side side;
  side.along = at_end ? corner.before : corner.behind;
  side.is_arc = queued.is_arc;
  if (!side.is_arc) {
    const double half = 0.5 * (at_end || !other_is_line ? queued.nominal_length_mm : queued.length_mm);
    side.room_mm = at_end ? std::min(queued.length_mm, half) : half;
    return side;
  }
  side.centre = segment.centre_mm;
  side.centre[segment.normal] = corner.point[segment.normal];
  side.radius_mm = at_end ? segment.end_radius_mm : segment.start_radius_mm;
  const double outward = (corner.point - side.centre).dot(at_end ? corner.behind : corner.before);
  side.inside = at_end ? outward < 0.0 : outward >= 0.0;
  const double share = at_end ? 2.0 / 3.0 : 1.0 / 3.0;
  side.most_rad = std::min(std::abs(segment.sweep_rad) * share, side.inside ? corner.half_rad : 0.5 * pi);
  if (side.inside) {
    const double arc_rad = std::abs(segment.sweep_rad);
    const double at = 0.5 * side.most_rad / arc_rad * segment.length_mm;
    const Vector3 on = point_at(segment, at_end ? segment.length_mm - at : at);
    const Vector3 secant = at_end ? Vector3(corner.point - on) : Vector3(on - corner.point);
    if (secant.norm() > 0.0) side.along = secant.normalized();
    side.less_rad = 0.25 * side.most_rad;
    side.room_mm = std::sin(0.25 * side.most_rad) * side.radius_mm;
  } else {
    side.room_mm = side.most_rad * side.radius_mm;
  }
  return side;
}

// A blend arc: radius, speed, and what it takes of both sides (of a line mm, of an arc rad).
struct Blend {
  double radius_mm = 0.0;
  double speed_mm_per_s = 0.0;
  double acceleration_mm_per_s2 = 0.0;
  double request_mm_per_s = 0.0;
  double length_mm = 0.0;
  Vector3 centre = Vector3::Zero();
  double trim_before = 0.0;
  double trim_behind = 0.0;
};

// Highest of the sum of both speeds' directions: the altitude of the triangle that they span, or what the axes give in
// the plane.
double corner_speed(const QueuedSegment& before, const QueuedSegment& behind, const Corner& corner, const Side& first,
                    const Side& second, const MotionLimits& limits) {
  const double in_plane = limit_in_plane(corner.binormal, limits.max_feed_mm_per_s);
  if (before.is_arc || behind.is_arc) return in_plane;
  const double cosine = std::cos(std::min(corner.turn_rad, 0.49 * pi));
  const double v1 = std::min(before.max_speed_mm_per_s, behind.max_speed_mm_per_s / cosine);
  const double v2 = std::min(behind.max_speed_mm_per_s, before.max_speed_mm_per_s / cosine);
  const double base = (v2 * second.along - v1 * first.along).norm();
  return std::max(in_plane, v1 * v2 * std::sin(corner.turn_rad) / base);
}

double target_speed(const QueuedSegment& queued, double scale) noexcept {
  return std::min(queued.request_mm_per_s * scale, queued.max_speed_mm_per_s);
}

double blend_tolerance(const QueuedSegment& before, const QueuedSegment& behind, const PlannerRules& rules) noexcept {
  const double most = tolerance_share * std::min(before.nominal_length_mm, behind.nominal_length_mm);
  return rules.blend_tolerance_mm > 0.0 ? std::min(rules.blend_tolerance_mm, most) : most;
}

// Centres of circles of a radius that touch a side are on its parallel: line or circle.
std::optional<Vector3> blend_centre(const Corner& corner, const Side& first, const Side& second, double radius_mm) {
  const auto parallel_radius = [&](const Side& side) {
    return side.inside ? side.radius_mm - radius_mm : side.radius_mm + radius_mm;
  };
  if (first.is_arc && second.is_arc) {
    const double r1 = parallel_radius(first);
    const double r2 = parallel_radius(second);
    const Vector3 between = second.centre - first.centre;
    const double distance = between.norm();
    if (!(distance > 0.0)) return std::nullopt;
    const double along = (r1 * r1 - r2 * r2 + distance * distance) / (2.0 * distance);
    const double square = r1 * r1 - along * along;
    if (square < 0.0) return std::nullopt;
    const Vector3 unit = between / distance;
    const Vector3 across = corner.binormal.cross(unit).normalized() * std::sqrt(square);
    const Vector3 middle = first.centre + along * unit;
    const Vector3 one = middle + across;
    const Vector3 other = middle - across;
    return (one - corner.point).norm() < (other - corner.point).norm() ? one : other;
  }
  if (!first.is_arc && !second.is_arc) {
    return corner.point + (corner.behind - corner.before).normalized() * radius_mm / std::sin(corner.half_rad);
  }
  const Side& line = first.is_arc ? second : first;
  const Side& arc = first.is_arc ? first : second;
  const Vector3 normal = corner.binormal.cross(line.along).normalized();
  const Vector3 from = arc.centre - corner.point;
  const double r = parallel_radius(arc);
  const double square = r * r - std::pow(radius_mm - from.dot(normal), 2);
  if (square < 0.0) return std::nullopt;
  const double one = from.dot(line.along) + std::sqrt(square);
  const double other = from.dot(line.along) - std::sqrt(square);
  const double nearest = std::min(std::abs(one), std::abs(other));
  return corner.point + (first.is_arc ? nearest : -nearest) * line.along + radius_mm * normal;
}

double trim_of(const Side& side, const Corner& corner, const Vector3& centre) {
  if (!side.is_arc) return std::abs((centre - corner.point).dot(side.along));
  const Vector3 to_corner = (corner.point - side.centre).normalized();
  const Vector3 to_centre = (centre - side.centre).normalized();
  return std::acos(std::clamp(to_corner.dot(to_centre), -1.0, 1.0));
}

// An arc is blended within its own plane.
bool is_in_plane(const QueuedSegment& queued, const Corner& corner) {
  const Segment& segment = queued.geometry.front();
  return segment.kind != SegmentKind::arc || 1.0 - std::abs(corner.binormal[segment.normal]) < 0.5e-12;
}

std::optional<Blend> blend_of(const QueuedSegment& before, const QueuedSegment& behind, const Corner& corner,
                              const MotionLimits& limits, const PlannerRules& rules) {
  if (0.5 * pi - corner.half_rad < least_angle_rad || corner.half_rad < least_angle_rad) return std::nullopt;
  if (before.is_blend || behind.is_blend) return std::nullopt;
  const bool both_arcs = before.is_arc && behind.is_arc;
  if (!both_arcs && !(is_in_plane(before, corner) && is_in_plane(behind, corner))) return std::nullopt;
  if (both_arcs && before.geometry.front().normal != behind.geometry.front().normal) return std::nullopt;
  const Side first = side_of(before, corner, true, !behind.is_arc);
  const Side second = side_of(behind, corner, false, !before.is_arc);
  const double half = corner.half_rad - std::max(first.less_rad, second.less_rad);
  if (both_arcs && half < least_arc_angle_rad) return std::nullopt;

  const double tolerance = blend_tolerance(before, behind, rules);
  const double most = limit_in_plane(corner.binormal, limits.max_acceleration_mm_per_s2);
  const double across = most * normal_share();
  const double goal =
      std::min(std::max(target_speed(before, rules.max_feed_override), target_speed(behind, rules.max_feed_override)),
               corner_speed(before, behind, corner, first, second, limits));
  const double reach = std::cos(half) * tolerance / (1.0 - std::sin(half));
  const double room = std::min({first.room_mm, second.room_mm, reach});
  const double largest = std::tan(half) * room;

  Blend blend;
  blend.speed_mm_per_s = std::min(std::sqrt(across * largest), goal);
  // As long as a parabola of half the acceleration would take, if that is longer than the acceleration wants.
  const double parabolic = 0.5 * most;
  const double time_s = std::min(std::sqrt(2.0 * parabolic * room), blend.speed_mm_per_s) / parabolic;
  const double turn = pi - 2.0 * half;
  const double wide = std::min(time_s * blend.speed_mm_per_s / turn, largest);
  blend.radius_mm = std::max(blend.speed_mm_per_s * blend.speed_mm_per_s / across, wide);
  blend.acceleration_mm_per_s2 = most;
  blend.request_mm_per_s = std::max(target_speed(before, 1.0), target_speed(behind, 1.0));
  blend.length_mm = blend.radius_mm * turn;
  if (!(blend.radius_mm > 1e-12) || blend.length_mm < least_arc_mm) return std::nullopt;

  const auto centre = blend_centre(corner, first, second, blend.radius_mm);
  if (!centre) return std::nullopt;
  const bool bends = first.is_arc || second.is_arc;
  if (bends && (*centre - corner.point).norm() - blend.radius_mm > tolerance) return std::nullopt;
  blend.centre = *centre;
  blend.trim_before = trim_of(first, corner, *centre);
  blend.trim_behind = trim_of(second, corner, *centre);
  if ((first.is_arc && blend.trim_before > first.most_rad) || (second.is_arc && blend.trim_behind > second.most_rad)) {
    return std::nullopt;
  }
  return blend;
}

double trim_length(const QueuedSegment& queued, const Segment& segment, double trim) noexcept {
  return queued.is_arc ? trim / std::abs(segment.sweep_rad) * segment.length_mm : trim;
}

// Lines from one point to another about a centre; short ones.
void add_turn(const Vector3& centre, const Vector3& end, const Segment& like, std::vector<Segment>& lines) {
  Vector3 at = lines.empty() ? like.end_mm : lines.back().end_mm;
  const Vector3 from = at - centre;
  const Vector3 to = end - centre;
  const double turn = std::acos(std::clamp(from.normalized().dot(to.normalized()), -1.0, 1.0));
  const double count = std::max(1.0, std::ceil(turn / chord_turn_rad));
  for (double k = 1.0; k <= count; ++k) {
    Vector3 next = end;
    if (k < count) {
      const double share = k / count;
      next = centre + (std::sin((1.0 - share) * turn) * from + std::sin(share * turn) * to) / std::sin(turn);
    }
    if ((next - at).norm() > 0.0) lines.push_back(make_line(at, next, like.feed_mm_per_s, like.line));
    at = next;
  }
}

// Whether so little is left of a line before a blend that it becomes part of it.
bool is_consumed(const QueuedSegment& before, const Blend& blend, double period_s) noexcept {
  return !before.is_arc && (before.length_mm - blend.trim_before) / blend.speed_mm_per_s < gap_cycles * period_s;
}

// No blend is shorter than a period.
double blend_speed(const QueuedSegment& before, const Blend& blend, double period_s) noexcept {
  const double lead_mm = is_consumed(before, blend, period_s) ? before.length_mm - blend.trim_before : 0.0;
  return std::min(blend.speed_mm_per_s, (blend.length_mm + lead_mm) / period_s);
}

// Puts a blend arc between the last segment of a queue and the next one, and cuts both short.
void insert_blend(const Blend& blend, std::vector<QueuedSegment>& queue, QueuedSegment& behind, double period_s) {
  QueuedSegment& before = queue.back();
  Segment& last = before.geometry.back();
  Segment& next = behind.geometry.front();
  const double cut_before = std::min(trim_length(before, last, blend.trim_before), last.length_mm);
  const double cut_behind = std::min(trim_length(behind, next, blend.trim_behind), next.length_mm);
  const Segment kept = section_of(last, 0.0, last.length_mm - cut_before);
  next = section_of(Segment(next), cut_behind, next.length_mm);
  behind.length_mm -= cut_behind;

  QueuedSegment arc;
  arc.is_blend = true;
  const bool consumes = is_consumed(before, blend, period_s);
  if (consumes && kept.length_mm > 0.0) arc.geometry.push_back(kept);
  add_turn(blend.centre, next.start_mm, kept, arc.geometry);
  for (const Segment& line : arc.geometry) arc.length_mm += line.length_mm;
  arc.nominal_length_mm = arc.length_mm;
  arc.request_mm_per_s = std::min(blend.request_mm_per_s, blend.speed_mm_per_s);
  arc.max_speed_mm_per_s = blend_speed(before, blend, period_s);
  arc.max_acceleration_mm_per_s2 = blend.acceleration_mm_per_s2;
  arc.tangential_ratio = tangential_share;
  arc.termination = Termination::tangent;
  if (consumes) {
    queue.pop_back();
  } else {
    last = kept;
    before.length_mm -= cut_before;
    before.termination = Termination::tangent;
    finish_limits(before, period_s);
  }
  if (arc.length_mm > 0.0) queue.push_back(std::move(arc));
}

// Speed of a blend without an arc: the next segment starts while the one before it still brakes, both with half of
// their acceleration.
double overlap_speed(const QueuedSegment& before, const QueuedSegment& behind, const Corner& corner,
                     const PlannerRules& rules) {
  const auto acceleration = [](const QueuedSegment& queued) { return 0.5 * queued.max_acceleration_mm_per_s2; };
  const auto reached = [&](const QueuedSegment& queued, double length_mm) {
    return std::min(std::sqrt(acceleration(queued) * length_mm), target_speed(queued, rules.max_feed_override));
  };
  const double v1 = reached(before, 0.5 * before.length_mm);
  const double v2 = reached(behind, 0.5 * behind.length_mm);
  const double longest_s = std::min(before.length_mm / v1, behind.length_mm / v2);
  const double time_s = std::min(longest_s, std::max(v1 / acceleration(before), v2 / acceleration(behind)));
  double speed = 0.5 * (std::min(v1, time_s * acceleration(before)) + std::min(v2, time_s * acceleration(behind)));
  if (rules.blend_tolerance_mm > 0.0 && std::cos(corner.half_rad) > std::sin(least_turn_rad)) {
    const double most = rules.blend_tolerance_mm / std::cos(corner.half_rad);
    speed = std::min(speed, 2.0 * std::sqrt(acceleration(before) * most));
  }
  return speed;
}

double kink_speed_of(const QueuedSegment& before, const QueuedSegment& behind, const PlannerRules& rules) {
  return std::min(target_speed(before, rules.max_feed_override), target_speed(behind, rules.max_feed_override));
}

// Share of the acceleration that the change of direction takes within a period, beside that of the axes.
double kink_share(const QueuedSegment& before, const QueuedSegment& behind, const Corner& corner,
                  const MotionLimits& limits, const PlannerRules& rules) {
  const double at_once = kink_speed_of(before, behind, rules) / rules.period_s + behind.max_acceleration_mm_per_s2;
  const Vector3 change = (corner.behind - corner.before).cwiseAbs() * at_once;
  const double share = (change.array() / limits.max_acceleration_mm_per_s2.array()).maxCoeff();
  return before.is_arc || behind.is_arc ? share / tangential_share : share;
}

void join(std::vector<QueuedSegment>& queue, QueuedSegment& behind, const MotionLimits& limits,
          const PlannerRules& rules) {
  QueuedSegment& before = queue.back();
  const Corner corner(before.geometry.back(), behind.geometry.front());
  const bool stops = before.geometry.back().stop_at_end || 2.0 * corner.half_rad < sharp_rad;
  if (stops) {
    finish_limits(before, rules.period_s);
    return;
  }
  const double speed = kink_speed_of(before, behind, rules);
  double scale = kink_share(before, behind, corner, limits, rules);
  const double ratio = std::clamp(rules.kink_ratio, least_kink_ratio, largest_kink_ratio);
  double kink_speed = speed;
  if (scale >= ratio) {
    kink_speed = speed * ratio / scale;
    // The fastest of three; an overlap costs half of the acceleration.
    const std::optional<Blend> blend = blend_of(before, behind, corner, limits, rules);
    const double blended = blend ? blend_speed(before, *blend, rules.period_s) : 0.0;
    const double overlap = overlap_speed(before, behind, corner, rules);
    const double worth = 0.5 * std::sin(corner.half_rad) * overlap;
    if (blended > std::max(kink_speed, worth)) {
      insert_blend(*blend, queue, behind, rules.period_s);
      return;
    }
    const bool overlaps = worth > kink_speed;
    if (overlaps) {
      // The sum of both speeds stays about what it is where the next one starts.
      before.overlaps = behind.overlaps = true;
      kink_speed = overlap;
    }
    scale = overlaps ? 0.0 : ratio;
  }
  before.termination = Termination::tangent;
  before.kink_speed_mm_per_s = kink_speed;
  before.kink_behind = std::max(before.kink_behind, scale);
  behind.kink_before = std::max(behind.kink_before, scale);
  finish_limits(before, rules.period_s);
}

// Lines of one feed whose ends lie within a tolerance of one line, put together.
class LineMerger {
 public:
  explicit LineMerger(double tolerance_mm) : tolerance_mm_(tolerance_mm) {}

  void add(const Segment& segment) {
    if (segment.length_mm > 0.0 && !link(segment)) {
      merged_.push_back(segment);
      passed_.clear();
    }
    if (segment.kind == SegmentKind::line && !segment.stop_at_end) {
      passed_.push_back(segment.end_mm);
    } else {
      passed_.clear();
    }
  }
  [[nodiscard]] std::vector<Segment>& segments() noexcept { return merged_; }

 private:
  bool link(const Segment& segment) {
    if (!(tolerance_mm_ > 0.0) || passed_.empty() || passed_.size() > most_merged) return false;
    Segment& last = merged_.back();
    if (segment.kind != SegmentKind::line || segment.feed_mm_per_s != last.feed_mm_per_s) return false;
    Segment whole = make_line(last.start_mm, segment.end_mm, segment.feed_mm_per_s, segment.line);
    whole.stop_at_end = segment.stop_at_end;
    const bool links = whole.length_mm > 0.0 && std::all_of(passed_.begin(), passed_.end(), [&](const Vector3& point) {
                         return nearest_on(whole, point).distance_mm <= tolerance_mm_;
                       });
    if (links) last = whole;
    return links;
  }

  double tolerance_mm_;
  std::vector<Segment> merged_;
  std::vector<Vector3> passed_;  // ends of the lines that the last one stands for
};

// What LinuxCNC's detector of naive CAM output leaves of a path: lines within its tolerance are one, and an arc in XY
// that is no further from its chord is two lines.
std::vector<Segment> merged_lines(const Path& path, double tolerance_mm) {
  LineMerger merger(tolerance_mm);
  for (const Segment& segment : path.segments()) {
    const double sagitta = segment.start_radius_mm * (1.0 - std::cos(0.5 * segment.sweep_rad));
    if (segment.kind == SegmentKind::arc && segment.normal == 2 && sagitta < tolerance_mm) {
      const Vector3 middle = point_at(segment, 0.5 * segment.length_mm);
      merger.add(make_line(segment.start_mm, middle, segment.feed_mm_per_s, segment.line));
      Segment rest = make_line(middle, segment.end_mm, segment.feed_mm_per_s, segment.line);
      rest.stop_at_end = segment.stop_at_end;
      merger.add(rest);
    } else {
      merger.add(segment);
    }
  }
  return std::move(merger.segments());
}

}  // namespace

std::vector<QueuedSegment> linuxcnc_queue(const Path& path, const MotionLimits& limits, const PlannerRules& rules) {
  std::vector<QueuedSegment> queue;
  queue.reserve(path.size());
  for (const Segment& segment : merged_lines(path, rules.naive_cam_tolerance_mm)) {
    QueuedSegment next = queued_of(segment, limits, rules.period_s);
    if (!queue.empty()) join(queue, next, limits, rules);
    queue.push_back(std::move(next));
  }
  if (!queue.empty()) {
    queue.back().overlaps = queue.back().overlaps || !rules.rapid_follows;
    finish_limits(queue.back(), rules.period_s);
  }
  return queue;
}

}  // namespace shapegcode::detail

namespace shapegcode {

LinuxcncSlowing linuxcnc_slowing(const Path& path, const MotionLimits& limits, const PlannerRules& rules,
                                 double corner_rad) {
  LinuxcncSlowing slowing;
  std::optional<detail::QueuedSegment> before;
  for (const Segment& segment : path.segments()) {
    if (!(segment.length_mm > 0.0)) continue;
    const detail::QueuedSegment now = detail::queued_of(segment, limits, rules.period_s);
    ++slowing.segments;
    const double speed = now.request_mm_per_s;
    if (before) {
      const detail::Corner corner(before->geometry.back(), segment);
      const double share = detail::kink_share(*before, now, corner, limits, rules);
      if (corner.turn_rad <= corner_rad) {
        if (share >= rules.kink_ratio) ++slowing.kinks;
        if (share > slowing.largest_ratio) {
          slowing.largest_ratio = share;
          slowing.speed_mm_per_s = detail::kink_speed_of(*before, now, rules);
          slowing.angle_rad = corner.turn_rad;
          slowing.line = segment.line;
        }
      }
      const bool is_short = segment.length_mm < speed / rules.ramp_frequency_hz;
      if (is_short && std::abs(speed - before->request_mm_per_s) > 1e-3 * speed) ++slowing.ramps;
    }
    before = now;
  }
  return slowing;
}

}  // namespace shapegcode
