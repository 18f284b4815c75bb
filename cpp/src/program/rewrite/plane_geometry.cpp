#include "program/rewrite/plane_geometry.hpp"
#include "path/arc_frame.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>

namespace shapegcode::plane {
namespace {

constexpr double two_pi = 2.0 * std::numbers::pi;

Locus offset_of(const Curve& curve, const Vector2& point, const Vector2& direction, double radius_mm, double left_mm) {
  Locus locus;
  locus.direction = direction;
  locus.circle = curve.arc;
  if (curve.arc) {
    // From the centre, not along the tangent: the anchor lies on the circle to the last bit.
    locus.centre = curve.centre;
    locus.sense = curve.sense();
    locus.radius_mm = radius_mm - locus.sense * left_mm;
    locus.anchor = curve.centre + (point - curve.centre) * (locus.radius_mm / radius_mm);
  } else {
    locus.anchor = point + left_mm * left_of(direction);
  }
  return locus;
}

void add_pair(std::vector<Vector2>& points, const Vector2& middle, const Vector2& along, double half) {
  points.push_back(middle - half * along);
  if (half > 0.0) {
    points.push_back(middle + half * along);
  }
}

// Half the chord of a circle at `distance` from its centre; none if the circle does not reach so far.
std::optional<double> half_chord(double radius, double distance) {
  const double gap = radius - std::abs(distance);
  if (gap < -touch_mm) {
    return std::nullopt;
  }
  return std::sqrt(std::max(0.0, gap) * (radius + std::abs(distance)));
}

std::vector<Vector2> line_circle(const Locus& line, const Locus& circle) {
  std::vector<Vector2> points;
  const Vector2 to_centre = circle.centre - line.anchor;
  const double distance = cross(line.direction, to_centre);
  if (const auto half = half_chord(std::abs(circle.radius_mm), distance)) {
    add_pair(points, circle.centre - distance * left_of(line.direction), line.direction, *half);
  }
  return points;
}

std::vector<Vector2> circle_circle(const Locus& a, const Locus& b) {
  std::vector<Vector2> points;
  const Vector2 between = b.centre - a.centre;
  const double distance = between.norm();
  if (distance < 1e-12) {
    return points;
  }
  const double ra = std::abs(a.radius_mm);
  const double rb = std::abs(b.radius_mm);
  if (distance > ra + rb + touch_mm || distance < std::abs(ra - rb) - touch_mm) {
    return points;
  }
  const double foot = std::clamp(0.5 * (distance + (ra - rb) * (ra + rb) / distance), -ra, ra);
  const Vector2 along = between / distance;
  add_pair(points, a.centre + foot * along, left_of(along), std::sqrt((ra - foot) * (ra + foot)));
  return points;
}

}  // namespace

Vector2 in_plane(const Vector3& p, int normal) { return ArcFrame(normal).project(p); }

Vector3 in_space(const Vector2& p, const Vector3& height, int normal) { return ArcFrame(normal).lift(p, height); }

Curve curve_of(const Segment& segment, int normal) {
  Curve curve;
  curve.start = in_plane(segment.start_mm, normal);
  curve.end = in_plane(segment.end_mm, normal);
  curve.arc = segment.kind == SegmentKind::arc;
  if (!curve.arc) {
    const Vector2 along = curve.end - curve.start;
    curve.length_mm = along.norm();
    if (curve.moves()) {
      curve.start_direction = curve.end_direction = along / curve.length_mm;
    }
    return curve;
  }
  curve.centre = in_plane(segment.centre_mm, normal);
  curve.sweep_rad = segment.sweep_rad;
  const Vector2 from = curve.start - curve.centre;
  const Vector2 to = curve.end - curve.centre;
  curve.start_radius_mm = from.norm();
  curve.end_radius_mm = to.norm();
  curve.length_mm = 0.5 * (curve.start_radius_mm + curve.end_radius_mm) * std::abs(curve.sweep_rad);
  if (curve.moves()) {
    curve.start_direction = curve.sense() * left_of(from) / curve.start_radius_mm;
    curve.end_direction = curve.sense() * left_of(to) / curve.end_radius_mm;
  }
  return curve;
}

Locus offset_at_end(const Curve& curve, double left_mm) {
  return offset_of(curve, curve.end, curve.end_direction, curve.end_radius_mm, left_mm);
}

Locus offset_at_start(const Curve& curve, double left_mm) {
  return offset_of(curve, curve.start, curve.start_direction, curve.start_radius_mm, left_mm);
}

std::vector<Vector2> intersections(const Locus& a, const Locus& b) {
  if (a.circle && b.circle) {
    return circle_circle(a, b);
  }
  if (a.circle || b.circle) {
    return a.circle ? line_circle(b, a) : line_circle(a, b);
  }
  const double sine = cross(a.direction, b.direction);
  if (std::abs(sine) < 1e-12) {
    return {};
  }
  return {a.anchor + a.direction * (cross(b.anchor - a.anchor, b.direction) / sine)};
}

double travel(const Locus& locus, const Vector2& p, double sense) {
  if (!locus.circle) {
    return sense * locus.direction.dot(p - locus.anchor);
  }
  const double angle = angle_of(p - locus.centre) - angle_of(locus.anchor - locus.centre);
  double turned = std::fmod(sense * locus.sense * angle, two_pi);
  if (turned < 0.0) {
    turned += two_pi;
  }
  const double hair = touch_mm / std::max(std::abs(locus.radius_mm), touch_mm);
  return turned > two_pi - hair ? turned - two_pi : turned;
}

std::optional<Crossing> inner_crossing(const Locus& a, const Locus& b) {
  const auto in_mm = [](const Locus& locus, double along) { return locus.circle ? along * locus.radius_mm : along; };
  std::optional<Crossing> best;
  double shortest = 0.0;
  for (const Vector2& point : intersections(a, b)) {
    const Crossing crossing{point, travel(a, point, -1.0), travel(b, point, 1.0)};
    const double before = in_mm(a, crossing.before);
    const double after = in_mm(b, crossing.after);
    if (before < -touch_mm || after < -touch_mm) {
      continue;
    }
    if (!best || before + after < shortest) {
      best = crossing;
      shortest = before + after;
    }
  }
  return best;
}

double turn_at(const Curve& a, const Curve& b) {
  return std::atan2(cross(a.end_direction, b.start_direction), a.end_direction.dot(b.start_direction));
}

}  // namespace shapegcode::plane
