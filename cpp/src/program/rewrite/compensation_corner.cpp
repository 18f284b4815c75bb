#include "program/rewrite/compensation_corner.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <numbers>
#include <string>

#include "shapegcode/error.hpp"

namespace shapegcode::plane {
namespace {

// Rounding words to 1 um makes small corners where the drawing has none. If the offset vectors of both blocks are
// closer than this, one vector on their bisector is used for both, provided that it is this near to both offset curves.
constexpr double tangent_gap_mm = 2e-3;
constexpr double tangent_turn_rad = 0.02;
constexpr double tangent_off_curve_mm = 1e-7;
// A turn this close to half a circle is a reversal: which side is the inner one then depends on the curvatures.
constexpr double reversal_rad = 1e-6;

struct Ends {
  Locus before;
  Locus after;
  double turn = 0.0;
  double left_mm = 0.0;  // offset of the corner
};

Ends ends_of(const OffsetCurve& before, const OffsetCurve& after) {
  return {offset_at_end(before.curve, before.left_mm), offset_at_start(after.curve, after.left_mm),
          turn_at(before.curve, after.curve), after.left_mm};
}

bool tangent(const Ends& ends) {
  const double shift = 0.5 * std::abs(ends.left_mm * ends.turn);
  const double sharpest = std::max(std::abs(ends.before.curvature()), std::abs(ends.after.curvature()));
  return std::abs(ends.turn) <= tangent_turn_rad && 2.0 * shift <= tangent_gap_mm &&
         0.5 * sharpest * shift * shift <= tangent_off_curve_mm;
}

double programmed_curvature(const Curve& curve, double radius_mm) {
  return curve.arc ? curve.sense() / radius_mm : 0.0;
}

bool inside(const OffsetCurve& before, const OffsetCurve& after, const Ends& ends) {
  const double side = ends.left_mm < 0.0 ? -1.0 : 1.0;
  if (pi - std::abs(ends.turn) > reversal_rad) {
    return side * ends.turn >= 0.0;
  }
  // Back along the same tangent: inside is where the second block lies on the tool's side of the first.
  const double spread = programmed_curvature(before.curve, before.curve.end_radius_mm) +
                        programmed_curvature(after.curve, after.curve.start_radius_mm);
  return side * spread < -1e-12;
}

Vector2 bisector_point(const Vector2& corner, const Ends& ends) {
  const Vector2 sum = left_of(ends.before.direction) + left_of(ends.after.direction);
  return corner + (2.0 * ends.left_mm / sum.squaredNorm()) * sum;
}

// Corner points outside: the tangents at the vectors, up to their intersection or by the radius each.
void add_outer_points(std::vector<Vector2>& points, const Vector2& corner, const Ends& ends) {
  if (std::abs(ends.turn) <= 0.5 * pi) {
    points.push_back(bisector_point(corner, ends));
    return;
  }
  const double radius = std::abs(ends.left_mm);
  points.push_back(ends.before.anchor + radius * ends.before.direction);
  points.push_back(ends.after.anchor - radius * ends.after.direction);
}

std::string turned_in_degrees(double turn) { return fmt::format("{:.3f} degrees", turn * 180.0 / pi); }

Corner inner_corner(const OffsetCurve& before, const OffsetCurve& after, const Ends& ends) {
  const auto crossing = inner_crossing(ends.before, ends.after);
  if (!crossing) {
    throw alarm_error(33,
                      fmt::format("cutter radius {:.4f} mm: the centre paths of this block and the one on line {} do "
                                  "not meet inside their corner of ",
                                  std::abs(ends.left_mm), static_cast<unsigned>(after.line)) +
                          turned_in_degrees(ends.turn),
                      before.line, 0);
  }
  return {{crossing->point}, ends.before.circle ? crossing->before : 0.0, ends.after.circle ? crossing->after : 0.0};
}

// The tool changes sides: through the intersection nearest to the corner that leaves both blocks their direction. A
// line may be prolonged, by no more than the other block is long; an arc ends where it ends.
Corner crossover(const OffsetCurve& before, const OffsetCurve& after, const Ends& ends) {
  const auto allowed = [](const Locus& locus, const Curve& curve, const Curve& other, double along) {
    return locus.circle ? along <= std::abs(curve.sweep_rad) : along <= curve.length_mm && along >= -other.length_mm;
  };
  Corner best;
  double nearest = 0.0;
  for (const Vector2& point : intersections(ends.before, ends.after)) {
    const double back = travel(ends.before, point, -1.0);
    const double on = travel(ends.after, point, 1.0);
    if (!allowed(ends.before, before.curve, after.curve, back) || !allowed(ends.after, after.curve, before.curve, on)) {
      continue;
    }
    const double distance = (point - before.curve.end).norm();
    if (best.points.empty() || distance < nearest) {
      best = {{point}, ends.before.circle ? back : 0.0, ends.after.circle ? on : 0.0};
      nearest = distance;
    }
  }
  return best.points.empty() ? Corner{{ends.before.anchor, ends.after.anchor}} : best;
}

}  // namespace

void require_offset_arc(const OffsetCurve& block, bool at_end) {
  const Curve& curve = block.curve;
  if (!curve.arc) {
    return;
  }
  const double radius = at_end ? curve.end_radius_mm : curve.start_radius_mm;
  const double left = radius - curve.sense() * block.left_mm;
  if (left > touch_mm) {
    return;
  }
  const double cutter = std::abs(block.left_mm);
  if (left > -touch_mm) {
    throw alarm_error(
        38,
        fmt::format("arc radius {:.4f} mm equals the cutter radius {:.4f} mm: the tool centre would stand "
                    "still in the arc's centre",
                    radius, cutter),
        block.line, 0);
  }
  throw alarm_error(41, fmt::format("arc radius {:.4f} mm is smaller than the cutter radius {:.4f} mm", radius, cutter),
                    block.line, 0);
}

Vector2 across_end(const OffsetCurve& block) { return offset_at_end(block.curve, block.left_mm).anchor; }

Vector2 across_start(const OffsetCurve& block) { return offset_at_start(block.curve, block.left_mm).anchor; }

Corner offset_corner(const OffsetCurve& before, const OffsetCurve& after) {
  require_offset_arc(before, true);
  require_offset_arc(after, false);
  const Ends ends = ends_of(before, after);
  if ((before.left_mm < 0.0) != (after.left_mm < 0.0)) {
    return crossover(before, after, ends);
  }
  if (tangent(ends)) {
    return {{bisector_point(before.curve.end, ends)}};
  }
  if (inside(before, after, ends)) {
    return inner_corner(before, after, ends);
  }
  Corner corner;
  if (before.curve.arc) {
    corner.points.push_back(ends.before.anchor);
  }
  add_outer_points(corner.points, before.curve.end, ends);
  if (after.curve.arc) {
    corner.points.push_back(ends.after.anchor);
  }
  return corner;
}

Corner start_up_corner(const OffsetCurve& before, const OffsetCurve& after, char type) {
  require_offset_arc(after, false);
  const Ends ends = ends_of(before, after);
  Corner corner;
  const bool one_side = (before.left_mm < 0.0) == (after.left_mm < 0.0);
  const bool outer = one_side && type == 'B' && !tangent(ends) && !inside(before, after, ends);
  if (outer) {
    corner.points.push_back(ends.before.anchor);
    add_outer_points(corner.points, before.curve.end, ends);
  }
  if (!outer || after.curve.arc) {
    corner.points.push_back(ends.after.anchor);
  }
  return corner;
}

Corner cancel_corner(const OffsetCurve& before, const OffsetCurve& after, char type) {
  require_offset_arc(before, true);
  const Ends ends = ends_of(before, after);
  Corner corner;
  const bool outer = type == 'B' && !tangent(ends) && !inside(before, after, ends);
  if (!outer || before.curve.arc) {
    corner.points.push_back(ends.before.anchor);
  }
  if (outer) {
    add_outer_points(corner.points, before.curve.end, ends);
    corner.points.push_back(ends.after.anchor);
  }
  return corner;
}

void drop_minute_moves(Corner& corner, bool arc_before, bool arc_after, double limit_mm) {
  if (limit_mm <= 0.0) {
    return;
  }
  auto& points = corner.points;
  const auto close = [&](std::size_t a, std::size_t b) {
    return (points[a] - points[b]).cwiseAbs().maxCoeff() <= limit_mm;
  };
  for (std::size_t i = 0; i + 1 < points.size();) {
    const bool keep_later = arc_after && i + 2 == points.size();
    const bool keep_earlier = arc_before && i == 0;
    if (!close(i, i + 1) || (keep_later && keep_earlier)) {
      ++i;
      continue;
    }
    points.erase(points.begin() + static_cast<std::ptrdiff_t>(keep_later ? i : i + 1));
    if (keep_later) {
      break;
    }
  }
}

}  // namespace shapegcode::plane
