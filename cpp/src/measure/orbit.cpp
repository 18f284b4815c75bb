#include "path/arc_frame.hpp"
#include "shapegcode/measure/contour.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>

namespace shapegcode {
namespace {

/// Integral of |excess| over du, excess linear from (u0, e0) to (u1, e1), within [0, turn]; negative where u falls.
double clipped_area(double u0, double e0, double u1, double e1, double turn) noexcept {
  if (u0 > u1) return -clipped_area(u1, e1, u0, e0, turn);
  if (u1 <= 0.0 || u0 >= turn || u0 == u1) return 0.0;
  const double slope = (e1 - e0) / (u1 - u0);
  if (u1 > turn) {
    e1 = e0 + slope * (turn - u0);
    u1 = turn;
  }
  if (u0 < 0.0) {
    e0 -= slope * u0;
    u0 = 0.0;
  }
  const double width = u1 - u0;
  if (e0 * e1 >= 0.0) return 0.5 * width * std::abs(e0 + e1);
  return 0.5 * width * (e0 * e0 + e1 * e1) / (std::abs(e0) + std::abs(e1));
}

}  // namespace

OrbitError::OrbitError(const Path& path) {
  for (std::size_t i = 0; i < path.size(); ++i) {
    arc_of_.push_back(path.is_arc(i) ? static_cast<std::int32_t>(arcs_.size()) : -1);
    if (!path.is_arc(i)) continue;
    const Segment segment = path[i];
    Arc arc{};
    arc.a = ArcFrame(segment.normal).a;
    arc.b = ArcFrame(segment.normal).b;
    arc.centre_a = segment.centre_mm[arc.a];
    arc.centre_b = segment.centre_mm[arc.b];
    arc.cosine = std::cos(segment.start_angle_rad);
    arc.sine = std::sin(segment.start_angle_rad);
    arc.sense = segment.sweep_rad < 0.0 ? -1.0 : 1.0;
    arc.turn = std::abs(segment.sweep_rad);
    arc.start_radius = segment.start_radius_mm;
    arc.radius_rate = (segment.end_radius_mm - segment.start_radius_mm) / arc.turn;
    const double r0 = segment.start_radius_mm;
    const double r1 = segment.end_radius_mm;
    arc.sector_area = arc.turn * (r0 * r0 + r0 * r1 + r1 * r1) / 6.0;
    arcs_.push_back(arc);
  }
}

void OrbitError::add_move(Arc& arc, std::size_t index, const Vector3& to, std::size_t to_segment) noexcept {
  struct Polar {
    double x, y;  // along the arc's start direction and across it in the sense of turning
  };
  const auto polar = [&arc](const Vector3& p) -> Polar {
    const double x = p[arc.a] - arc.centre_a;
    const double y = p[arc.b] - arc.centre_b;
    return {x * arc.cosine + y * arc.sine, arc.sense * (y * arc.cosine - x * arc.sine)};
  };
  // Half a turn either way of the arc's start or end.
  const auto near_start = [](const Polar& q) { return std::atan2(q.y, q.x); };
  const auto near_end = [&arc, &near_start](const Polar& q) {
    return arc.turn + std::remainder(near_start(q) - arc.turn, 2.0 * std::numbers::pi);
  };
  const auto excess = [&arc](const Polar& q, double u) {
    const double radius = arc.start_radius + arc.radius_rate * std::clamp(u, 0.0, arc.turn);
    return radius * radius - (q.x * q.x + q.y * q.y);
  };
  const Polar from = polar(last_);
  const Polar now = polar(to);
  double u0 = arc.u;
  if (last_segment_ < index) u0 = near_start(from);
  if (last_segment_ > index) u0 = near_end(from);
  double u1 = u0 + std::atan2(from.x * now.y - from.y * now.x, from.x * now.x + from.y * now.y);
  // A step over the whole arc may turn by more than half a turn.
  if (last_segment_ < index && to_segment > index) u1 = near_end(now);
  if (last_segment_ > index && to_segment < index) u1 = near_start(now);
  arc.area += 0.5 * clipped_area(u0, excess(from, u0), u1, excess(now, u1), arc.turn);
  if (to_segment == index) arc.u = u1;
}

void OrbitError::step_arcs(const Vector3& p, std::size_t segment) noexcept {
  if (segment >= arc_of_.size() || !p.allFinite()) return;
  if (!has_last_) {
    // The move from rest at the first sample has no length: it only finds the sample's angle.
    has_last_ = true;
    last_ = p;
    last_segment_ = segment;
    if (arc_of_[segment] >= 0) {
      Arc& arc = arcs_[static_cast<std::size_t>(arc_of_[segment])];
      const double x = p[arc.a] - arc.centre_a;
      const double y = p[arc.b] - arc.centre_b;
      arc.u = std::atan2(arc.sense * (y * arc.cosine - x * arc.sine), x * arc.cosine + y * arc.sine);
    }
    return;
  }
  const std::size_t first = std::min(last_segment_, segment);
  const std::size_t last = std::max(last_segment_, segment);
  for (std::size_t i = first; i <= last; ++i) {
    if (arc_of_[i] >= 0) add_move(arcs_[static_cast<std::size_t>(arc_of_[i])], i, p, segment);
  }
  last_ = p;
  last_segment_ = segment;
}

std::vector<double> OrbitError::percent() const {
  std::vector<double> result;
  result.reserve(arcs_.size());
  for (const Arc& arc : arcs_) result.push_back(100.0 * std::abs(arc.area) / arc.sector_area);
  return result;
}

}  // namespace shapegcode
