#include "shapegcode/milling/corner.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <optional>
#include <utility>
#include <vector>

#include "milling/checks.hpp"
#include "milling/tool_step.hpp"
#include "shapegcode/milling/force.hpp"

namespace shapegcode {
namespace {

using detail::check_positive;
using detail::refuse;

using Eigen::Vector2d;

constexpr double pi = std::numbers::pi;
constexpr double degree = pi / 180.0;
constexpr double chord_error_mm = 5e-5;
constexpr double position_tolerance_mm = 1e-9;  // so far an s may lie outside, as sums of lengths do

/// The corner as if it turned left, with the finished walls' meeting point at the origin.
struct Geometry {
  explicit Geometry(const CornerCut& cut)
      : along{Vector2d::UnitX(), Vector2d(std::cos(cut.turn_rad), std::sin(cut.turn_rad))},
        inward{left_of(along[0]), left_of(along[1])},
        path_radius(cut.finish_radius_mm - cut.tool_radius_mm),
        finish_tangent(cut.finish_radius_mm * std::tan(0.5 * cut.turn_rad)),
        path_centre(at_both_walls(cut.finish_radius_mm, cut.turn_rad)),
        rough_centre(at_both_walls(cut.allowance_mm + cut.rough_radius_mm, cut.turn_rad)),
        arc_length(path_radius * cut.turn_rad) {}

  static Vector2d left_of(const Vector2d& v) { return {-v.y(), v.x()}; }

  /// The point at a distance inward from both walls.
  static Vector2d at_both_walls(double distance, double turn) { return {-distance * std::tan(0.5 * turn), distance}; }

  std::array<Vector2d, 2> along;   // both walls, in the direction of travel
  std::array<Vector2d, 2> inward;  // to the left
  double path_radius;
  double finish_tangent;  // from the walls' meeting point to where the finished corner begins
  Vector2d path_centre;
  Vector2d rough_centre;
  double arc_length;
};

/// Where the tool stands and where it goes, as if the corner turned left.
struct ToolPosition {
  Vector2d centre;
  Vector2d direction;
  double turned;
  int leg;  // 0 before the arc, 1 on it, 2 behind
};

ToolPosition position_at(const CornerCut& cut, const Geometry& g, double s, bool behind_vertex) {
  const bool before = s < cut.before_mm || (s == cut.before_mm && !(behind_vertex && g.arc_length == 0.0));
  if (before) {
    const Vector2d tangent_point = -g.finish_tangent * g.along[0] + cut.tool_radius_mm * g.inward[0];
    return {tangent_point - (cut.before_mm - s) * g.along[0], g.along[0], 0.0, 0};
  }
  const double on_arc = s - cut.before_mm;
  if (on_arc < g.arc_length) {
    const double turned = on_arc / g.path_radius;
    const Vector2d direction(std::cos(turned), std::sin(turned));
    return {g.path_centre - g.path_radius * Geometry::left_of(direction), direction, turned, 1};
  }
  const Vector2d tangent_point = g.finish_tangent * g.along[1] + cut.tool_radius_mm * g.inward[1];
  return {tangent_point + (on_arc - g.arc_length) * g.along[1], g.along[1], cut.turn_rad,
          on_arc == g.arc_length && g.arc_length > 0.0 ? 1 : 2};
}

struct Entry {
  Vector2d point;
  bool in_corner;
};

/// Where the front of the tool, looked along from the finished wall, first crosses the rough boundary, if it does. (At
/// a narrow corner the other wall may lie further on; there the tool has been.)
std::optional<Entry> entry_of(const CornerCut& cut, const Geometry& g, const ToolPosition& tool) {
  const double radius = cut.tool_radius_mm;
  std::optional<Entry> best;
  double lowest = 2.0;  // sine of the azimuth
  const auto consider = [&](const Vector2d& point, bool in_corner) {
    const Vector2d arm = (point - tool.centre) / radius;
    const double sine = arm.dot(Geometry::left_of(tool.direction));
    if (arm.dot(tool.direction) > -1e-12 && sine < lowest) {
      lowest = sine;
      best = Entry{point, in_corner};
    }
  };
  for (std::size_t wall = 0; wall < 2; ++wall) {
    const double height = cut.allowance_mm - tool.centre.dot(g.inward[wall]);  // of the rough wall above the axis
    const double half_squared = radius * radius - height * height;
    if (half_squared < 0.0) continue;
    for (const double sign : {-1.0, 1.0}) {
      const Vector2d point = tool.centre + height * g.inward[wall] + sign * std::sqrt(half_squared) * g.along[wall];
      const double beyond = (point - g.rough_centre).dot(g.along[wall]);  // of where the rough corner is tangent
      if (wall == 0 ? beyond <= 0.0 : beyond >= 0.0) consider(point, false);
    }
  }
  const Vector2d between = g.rough_centre - tool.centre;
  const double distance = between.norm();
  if (distance > 0.0) {
    const double share =
        (distance * distance + radius * radius - cut.rough_radius_mm * cut.rough_radius_mm) / (2.0 * distance);
    const double half_squared = radius * radius - share * share;
    if (half_squared >= 0.0) {
      const Vector2d unit = between / distance;
      for (const double sign : {-1.0, 1.0}) {
        const Vector2d point = tool.centre + share * unit + sign * std::sqrt(half_squared) * Geometry::left_of(unit);
        const Vector2d arm = point - g.rough_centre;
        if (arm.dot(g.along[0]) >= 0.0 && arm.dot(g.along[1]) <= 0.0) consider(point, true);
      }
    }
  }
  return best;
}

/// How far a point lies from where the tool's axis has been before.
double distance_from_path(const CornerCut& cut, const Geometry& g, const ToolPosition& tool, const Vector2d& point) {
  if (tool.leg == 0) return cut.tool_radius_mm;  // on a straight nothing in front has been swept
  const Vector2d start = position_at(cut, g, 0.0, false).centre;
  const Vector2d corner = position_at(cut, g, cut.before_mm, false).centre;
  double distance = ToolStep(start, corner).distance_mm(point);
  if (g.arc_length > 0.0) {
    const Vector2d end = tool.leg == 1 ? tool.centre : position_at(cut, g, cut.before_mm + g.arc_length, false).centre;
    distance = std::min(distance, ToolStep(corner, end, 1.0 / g.path_radius).distance_mm(point));
  }
  return distance;
}

Vector2d turned_over(const CornerCut& cut, const Vector2d& v) { return cut.mirrored ? Vector2d(v.x(), -v.y()) : v; }

Vector3 at_height(const Vector2d& v, double z) { return {v.x(), v.y(), z}; }

}  // namespace

void check(const CornerCut& cut) {
  check_positive(cut.tool_radius_mm, "tool radius", "mm");
  if (!(cut.allowance_mm > 0.0 && cut.allowance_mm <= cut.tool_radius_mm)) {
    refuse("allowance is {} mm, must be above 0 and at most the tool radius, {} mm", cut.allowance_mm,
           cut.tool_radius_mm);
  }
  for (const auto& [name, radius] : {std::pair{"rough", cut.rough_radius_mm}, {"finish", cut.finish_radius_mm}}) {
    if (!(radius >= cut.tool_radius_mm) || !std::isfinite(radius)) {
      refuse("{} corner radius is {} mm, must be at least the tool radius, {} mm", name, radius, cut.tool_radius_mm);
    }
  }
  if (!(cut.turn_rad >= degree && cut.turn_rad <= 179.0 * degree)) {
    refuse("the corner turns by {:g} degrees, must be 1 to 179", cut.turn_rad / degree);
  }
  // Left between both boundaries on the bisector, times cos(turn / 2).
  const double cosine = std::cos(0.5 * cut.turn_rad);
  const double left = cut.allowance_mm + (cut.rough_radius_mm - cut.finish_radius_mm) * (1.0 - cosine);
  if (!(left > 0.0)) {
    refuse("a rough corner radius of {} mm cuts into the finished corner of {} mm by {:g} mm", cut.rough_radius_mm,
           cut.finish_radius_mm, -left / cosine);
  }
  for (const double straight : {cut.before_mm, cut.after_mm}) {
    if (!(straight >= 0.0) || !std::isfinite(straight)) {
      refuse("a straight at the corner is {} mm, must be at least 0", straight);
    }
  }
}

double corner_length_mm(const CornerCut& cut) {
  check(cut);
  return cut.before_mm + Geometry(cut).arc_length + cut.after_mm;
}

CornerEngagement corner_engagement(const CornerCut& cut, double s_mm, bool behind_vertex) {
  const double length = corner_length_mm(cut);
  if (!(s_mm >= -position_tolerance_mm && s_mm <= length + position_tolerance_mm)) {
    refuse("position on the corner's path is {} mm, must be 0 to {}", s_mm, length);
  }
  const Geometry g(cut);
  const ToolPosition tool = position_at(cut, g, std::clamp(s_mm, 0.0, length), behind_vertex);
  const std::optional<Entry> met = entry_of(cut, g, tool);
  if (!met || distance_from_path(cut, g, tool, met->point) < cut.tool_radius_mm - position_tolerance_mm) {
    refuse(
        "at {} mm the tool meets the rough pocket only where it has been itself: no closed form for a turn of {:g} "
        "degrees from a rough radius of {} mm to {} mm",
        s_mm, cut.turn_rad / degree, cut.rough_radius_mm, cut.finish_radius_mm);
  }
  const Entry& entry = *met;
  const Vector2d arm = entry.point - tool.centre;
  const double across = arm.dot(Geometry::left_of(tool.direction));
  const double azimuth = std::atan2(across, std::max(arm.dot(tool.direction), 0.0));

  CornerEngagement result;
  const Vector2d centre = turned_over(cut, tool.centre);
  const Vector2d direction = turned_over(cut, tool.direction);
  const bool on_straight_wall = !entry.in_corner && (entry.point - g.rough_centre).dot(g.along[0]) <= 0.0;
  result.section = tool.leg == 1   ? CornerSection::s3
                   : tool.leg == 2 ? CornerSection::s4
                                   : (on_straight_wall ? CornerSection::s1 : CornerSection::s2);
  result.x_mm = centre.x();
  result.y_mm = centre.y();
  result.direction_rad = std::atan2(direction.y(), direction.x());
  result.turned_rad = tool.turned;
  result.from_rad = cut.mirrored ? -azimuth : -0.5 * pi;
  result.to_rad = cut.mirrored ? 0.5 * pi : azimuth;
  result.radial_depth_mm = cut.tool_radius_mm + across;
  return result;
}

Path corner_path(const CornerCut& cut, double feed_mm_per_s, double z_mm) {
  const double length = corner_length_mm(cut);
  const Geometry g(cut);
  const auto point = [&](double s) { return at_height(turned_over(cut, position_at(cut, g, s, true).centre), z_mm); };
  const double arc_end = cut.before_mm + g.arc_length;
  std::vector<Segment> segments;
  if (cut.before_mm > 0.0) segments.push_back(make_line(point(0.0), point(cut.before_mm), feed_mm_per_s));
  if (g.arc_length > 0.0) {
    segments.push_back(make_arc(point(cut.before_mm), point(arc_end), at_height(turned_over(cut, g.path_centre), z_mm),
                                cut.mirrored ? -cut.turn_rad : cut.turn_rad, 2, feed_mm_per_s));
  }
  if (cut.after_mm > 0.0) segments.push_back(make_line(point(arc_end), point(length), feed_mm_per_s));
  return Path(segments);
}

Ring corner_stock(const CornerCut& cut, double beyond_mm) {
  check(cut);
  if (!(beyond_mm > 0.0) || !std::isfinite(beyond_mm)) {
    refuse("the stock reaches {} mm beyond the walls, must be above 0", beyond_mm);
  }
  const Geometry g(cut);
  const double before = g.finish_tangent + cut.before_mm + beyond_mm;
  const double after = g.finish_tangent + cut.after_mm + beyond_mm;
  Ring ring;
  ring.emplace_back(-before * g.along[0] + cut.allowance_mm * g.inward[0]);
  const double step = std::sqrt(8.0 * chord_error_mm / cut.rough_radius_mm);
  detail::check_pieces(cut.turn_rad * cut.rough_radius_mm, step * cut.rough_radius_mm, "a chord");
  const double pieces = std::ceil(cut.turn_rad / step);
  for (double k = 0.0; k <= pieces; ++k) {
    const double angle = cut.turn_rad * k / pieces - 0.5 * pi;
    ring.emplace_back(g.rough_centre + cut.rough_radius_mm * Vector2d(std::cos(angle), std::sin(angle)));
  }
  ring.emplace_back(after * g.along[1] + cut.allowance_mm * g.inward[1]);
  ring.emplace_back(after * g.along[1] - beyond_mm * g.inward[1]);
  ring.emplace_back(Geometry::at_both_walls(-beyond_mm, cut.turn_rad));
  ring.emplace_back(-before * g.along[0] - beyond_mm * g.inward[0]);
  for (Vector2d& point : ring) point = turned_over(cut, point);
  return ring;
}

EngagementTrack corner_track(const CornerCut& cut, double axial_depth_mm, double step_mm) {
  check_positive(axial_depth_mm, "axial depth", "mm");
  if (!(step_mm > 0.0)) refuse("step is {} mm, must be above 0", step_mm);
  detail::check_pieces(corner_length_mm(cut), step_mm, "a step");
  const Geometry g(cut);
  EngagementTrack track;
  track.first_arc.push_back(0);
  std::uint32_t segment = 0;
  const auto add = [&](double s, bool behind_vertex) {
    const CornerEngagement at = corner_engagement(cut, s, behind_vertex);
    track.s_mm.push_back(s);
    track.x_mm.push_back(at.x_mm);
    track.y_mm.push_back(at.y_mm);
    track.direction_rad.push_back(at.direction_rad);
    track.horizontal.push_back(1.0);
    track.segment.push_back(segment);
    track.radial_depth_mm.push_back(at.radial_depth_mm);
    track.section_mm2.push_back(at.radial_depth_mm * axial_depth_mm);
    track.plunged_mm2.push_back(0.0);
    track.arcs.push_back({at.from_rad, at.to_rad, 0.0, axial_depth_mm});
    track.first_arc.push_back(static_cast<std::uint32_t>(track.arcs.size()));
  };
  double begin = 0.0;
  for (const double leg : {cut.before_mm, g.arc_length, cut.after_mm}) {
    if (!(leg > 0.0)) continue;
    const double pieces = std::ceil(leg / step_mm * (1.0 - 1e-12));
    // The sample at the start shows what the leg begins with: at a sharp vertex something else than the end before.
    if (track.size() == 0 || (g.arc_length == 0.0 && begin > 0.0)) add(begin, true);
    for (double k = 1.0; k <= pieces; ++k) add(begin + leg * k / pieces, false);
    begin += leg;
    ++segment;
  }
  return track;
}

}  // namespace shapegcode
