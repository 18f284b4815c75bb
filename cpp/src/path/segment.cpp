#include "shapegcode/path.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <string>

#include "base/refuse.hpp"
#include "path/arc_end.hpp"
#include "path/arc_frame.hpp"
#include "shapegcode/error.hpp"

namespace shapegcode {
namespace {

constexpr double two_pi = 2.0 * std::numbers::pi;

std::string shown(const Vector3& p) { return detail::message("({} {} {})", p[0], p[1], p[2]); }

double pitch_mm_per_rad(const Segment& segment) noexcept {
  const int n = segment.normal;
  return (segment.end_mm[n] - segment.start_mm[n]) / std::abs(segment.sweep_rad);
}

double mean_radius(const Segment& segment) noexcept { return 0.5 * (segment.start_radius_mm + segment.end_radius_mm); }

Vector3 arc_point(const Segment& segment, double fraction) noexcept {
  const ArcFrame frame(segment.normal);
  const double radius = segment.start_radius_mm + (segment.end_radius_mm - segment.start_radius_mm) * fraction;
  const double angle = segment.start_angle_rad + segment.sweep_rad * fraction;
  Vector3 p = frame.lift(frame.at_angle(segment.centre_mm, radius, angle), segment.start_mm);
  p[frame.normal] += (segment.end_mm[frame.normal] - segment.start_mm[frame.normal]) * fraction;
  return p;
}

Nearest nearest_on_line(const Segment& segment, const Vector3& p) noexcept {
  if (segment.length_mm <= 0.0) {
    return {(p - segment.start_mm).norm(), 0.0};
  }
  const Vector3 along = segment.end_mm - segment.start_mm;
  const double fraction = std::clamp((p - segment.start_mm).dot(along) / along.squaredNorm(), 0.0, 1.0);
  const Vector3 foot = segment.start_mm + fraction * along;
  return {(p - foot).norm(), fraction * segment.length_mm};
}

// The in-plane angle gives the foot on a flat arc; on a helix the turn is chosen by height, then one Newton step on the
// true distance corrects for the pitch.
Nearest nearest_on_arc(const Segment& segment, const Vector3& p) noexcept {
  const int n = segment.normal;
  const double angle = ArcFrame(n).angle_rad(p, segment.centre_mm);
  const double sense = segment.sweep_rad < 0.0 ? -1.0 : 1.0;
  const double sweep = std::abs(segment.sweep_rad);
  double turn = std::remainder(sense * (angle - segment.start_angle_rad), two_pi);  // in [-pi, pi]
  const double pitch = pitch_mm_per_rad(segment);
  const double radius = mean_radius(segment);
  Nearest best{std::numeric_limits<double>::infinity(), 0.0};
  const auto consider = [&](double theta) {
    const double fraction = std::clamp(theta / sweep, 0.0, 1.0);
    const double distance = (p - arc_point(segment, fraction)).norm();
    if (distance < best.distance_mm) {
      best = {distance, fraction * segment.length_mm};
    }
  };
  const auto corrected = [&](double theta) {
    // d/dtheta of the squared distance, linearised at theta.
    const double height_gap = p[n] - (segment.start_mm[n] + pitch * theta);
    return theta + height_gap * pitch / (radius * radius + pitch * pitch);
  };
  const double turns = std::floor(sweep / two_pi) + 1.0;
  if (pitch == 0.0 || turns <= 1.0) {
    for (double theta : {turn, turn + two_pi}) {
      consider(corrected(theta));
    }
  } else {
    const double by_height = (p[n] - segment.start_mm[n]) / pitch;
    const double base = turn + two_pi * std::round((by_height - turn) / two_pi);
    for (double theta : {base - two_pi, base, base + two_pi}) {
      consider(corrected(theta));
    }
  }
  consider(0.0);
  consider(sweep);
  return best;
}

}  // namespace

// Each is one of the arc's own numbers.  NOLINTNEXTLINE(readability-function-size)
Segment make_arc(const Vector3& start, const Vector3& end, const Vector3& centre, double sweep_rad, int normal,
                 double feed_mm_per_s, std::uint32_t line) {
  if (normal < 0 || normal > 2) {
    throw Error(ErrorKind::argument, detail::message("an arc turns about axis 0, 1 or 2, not {}", normal), line);
  }
  const ArcFrame frame(normal);
  // The height of the centre has no say.
  if (!start.allFinite() || !end.allFinite() || !frame.project(centre).allFinite() || !std::isfinite(sweep_rad) ||
      !std::isfinite(feed_mm_per_s)) {
    throw Error(ErrorKind::argument,
                detail::message("an arc needs finite numbers: start {}, end {}, centre {}, sweep {} rad, feed {} mm/s",
                                shown(start), shown(end), shown(centre), sweep_rad, feed_mm_per_s),
                line);
  }
  Segment segment = make_line(start, end, feed_mm_per_s, line);
  segment.kind = SegmentKind::arc;
  segment.normal = static_cast<std::uint8_t>(normal);
  segment.centre_mm = centre;
  segment.sweep_rad = sweep_rad;
  segment.start_radius_mm = frame.radius(start, centre);
  segment.end_radius_mm = frame.radius(end, centre);
  if (!(segment.start_radius_mm > 0.0) || !(segment.end_radius_mm > 0.0) || sweep_rad == 0.0) {
    throw Error(ErrorKind::argument, "an arc needs a radius and a sweep greater than zero", line);
  }
  segment.start_angle_rad = frame.angle_rad(start, centre);
  const double travel = std::abs(sweep_rad) * mean_radius(segment);
  segment.length_mm = std::hypot(travel, end[normal] - start[normal]);
  return segment;
}

Segment begun_at(const Segment& segment, const Vector3& start) noexcept {
  Segment begun = segment;
  begun.start_mm = start;
  begun.length_mm = (segment.end_mm - start).norm();
  if (segment.kind != SegmentKind::arc) return begun;
  const ArcFrame frame(segment.normal);
  begun.start_radius_mm = frame.radius(start, segment.centre_mm);
  begun.start_angle_rad = frame.angle_rad(start, segment.centre_mm);
  begun.sweep_rad += std::remainder(segment.start_angle_rad - begun.start_angle_rad, 2.0 * std::numbers::pi);
  begun.sweep_rad += missing_sweep_rad(begun);
  const double travel = std::abs(begun.sweep_rad) * mean_radius(begun);
  begun.length_mm = std::hypot(travel, segment.end_mm[segment.normal] - start[segment.normal]);
  return begun;
}

Vector3 point_at(const Segment& segment, double s_mm) noexcept {
  if (segment.length_mm <= 0.0) {
    return segment.start_mm;
  }
  // Both ends are returned to the last bit: no rounding of cosines may move a programmed point.
  if (s_mm >= segment.length_mm) {
    return segment.end_mm;
  }
  if (s_mm <= 0.0) {
    return segment.start_mm;
  }
  const double fraction = s_mm / segment.length_mm;
  if (segment.kind == SegmentKind::arc) {
    return arc_point(segment, fraction);
  }
  return segment.start_mm + fraction * (segment.end_mm - segment.start_mm);
}

Vector3 tangent_at(const Segment& segment, double s_mm) noexcept {
  if (segment.length_mm <= 0.0) {
    return Vector3::Zero();
  }
  if (segment.kind != SegmentKind::arc) {
    return (segment.end_mm - segment.start_mm) / segment.length_mm;
  }
  const double fraction = std::clamp(s_mm / segment.length_mm, 0.0, 1.0);
  const double angle = segment.start_angle_rad + segment.sweep_rad * fraction;
  const double radial_step = segment.end_radius_mm - segment.start_radius_mm;
  const double radius = segment.start_radius_mm + radial_step * fraction;
  const double climb = segment.end_mm[segment.normal] - segment.start_mm[segment.normal];
  return ArcFrame(segment.normal).direction(angle, radius * segment.sweep_rad, radial_step, climb).normalized();
}

double chords_within(const Segment& segment, double tolerance_mm) noexcept {
  if (segment.kind != SegmentKind::arc) return 1.0;
  const double radius = std::max(segment.start_radius_mm, segment.end_radius_mm);
  const double half_rad = std::acos(std::max(0.0, 1.0 - tolerance_mm / radius));
  return std::max(1.0, std::ceil(std::abs(segment.sweep_rad) / (2.0 * half_rad)));
}

double curvature(const Segment& segment) noexcept {
  if (segment.kind != SegmentKind::arc) {
    return 0.0;
  }
  const double radius = mean_radius(segment);
  const double pitch = pitch_mm_per_rad(segment);
  return radius / (radius * radius + pitch * pitch);
}

Vector3 bend_at(const Segment& segment, double s_mm) noexcept {
  if (segment.kind != SegmentKind::arc) {
    return Vector3::Zero();
  }
  Vector3 inwards = segment.centre_mm - point_at(segment, s_mm);
  inwards[segment.normal] = 0.0;
  const double size = inwards.norm();
  return size > 0.0 ? Vector3(inwards * (curvature(segment) / size)) : Vector3(Vector3::Zero());
}

Nearest nearest_on(const Segment& segment, const Vector3& p) noexcept {
  return segment.kind == SegmentKind::arc ? nearest_on_arc(segment, p) : nearest_on_line(segment, p);
}

}  // namespace shapegcode
