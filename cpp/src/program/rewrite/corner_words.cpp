#include "program/rewrite/corner_words.hpp"

#include <fmt/format.h>

#include <cmath>
#include <numbers>
#include <string>

#include "program/rewrite/plane_geometry.hpp"
#include "shapegcode/error.hpp"

namespace shapegcode {
namespace {

using plane::Curve;
using plane::join_mm;
using plane::pi;
using plane::Vector2;

constexpr double tangent_rad = pi / 180.0;
// Sizes in words are rounded: a corner may use a whole block, to the last digit.
constexpr double used_up_by_corner_mm = 1e-6;

Error refusal(const CornerWord& word, int alarm, const std::string& why) {
  return alarm_error(alarm,
                     fmt::format("{}{:.4f}: {}", word.chamfer ? "chamfer ,C" : "corner rounding ,R", word.size_mm, why),
                     word.line, word.column);
}

// How much of a block the corner takes: mm on a line, rad on an arc.
struct Cut {
  Vector2 point = Vector2::Zero();
  double taken = 0.0;
};

double available(const Curve& curve) { return curve.arc ? std::abs(curve.sweep_rad) : curve.length_mm; }

double in_mm(const Curve& curve, double taken) { return curve.arc ? taken * curve.start_radius_mm : taken; }

void require_room(const Curve& curve, double taken, const char* which, const CornerWord& word) {
  if (in_mm(curve, available(curve) - taken) < -used_up_by_corner_mm) {
    throw refusal(word, 55,
                  fmt::format("the block {} the corner is {:.4f} mm long in the plane, the corner takes {:.4f} "
                              "mm of it",
                              which, in_mm(curve, available(curve)), in_mm(curve, taken)));
  }
}

// The point at straight distance `size` from the corner, back along `curve` (at_end) or on along it.
Cut chamfer_cut(const Curve& curve, bool at_end, const CornerWord& word) {
  const Vector2 corner = at_end ? curve.end : curve.start;
  const double back = at_end ? -1.0 : 1.0;
  const char* which = at_end ? "before" : "after";
  if (!curve.arc) {
    require_room(curve, word.size_mm, which, word);
    return {corner + back * word.size_mm * curve.start_direction, word.size_mm};
  }
  const double radius = at_end ? curve.end_radius_mm : curve.start_radius_mm;
  if (word.size_mm > 2.0 * radius) {
    throw refusal(word, 55,
                  fmt::format("the block {} the corner is an arc of radius {:.4f} mm, no point of it is so far "
                              "from the corner",
                              which, radius));
  }
  const double taken = 2.0 * std::asin(word.size_mm / (2.0 * radius));
  require_room(curve, taken, which, word);
  const double angle = plane::angle_of(corner - curve.centre) + back * curve.sense() * taken;
  return {curve.centre + radius * Vector2(std::cos(angle), std::sin(angle)), taken};
}

// Where the fillet about `centre` touches the block.
Vector2 foot(const Curve& curve, bool at_end, const Vector2& centre) {
  const Vector2 corner = at_end ? curve.end : curve.start;
  if (!curve.arc) {
    return corner + curve.start_direction * curve.start_direction.dot(centre - corner);
  }
  const double radius = at_end ? curve.end_radius_mm : curve.start_radius_mm;
  return curve.centre + (centre - curve.centre).normalized() * radius;
}

void require_fillet_arc(const Curve& curve, bool at_end, double left_mm, const CornerWord& word) {
  const double radius = at_end ? curve.end_radius_mm : curve.start_radius_mm;
  if (curve.arc && radius - curve.sense() * left_mm <= plane::touch_mm) {
    throw refusal(word, 55,
                  fmt::format("no arc of this radius fits inside the arc {} the corner, radius {:.4f} mm",
                              at_end ? "before" : "after", radius));
  }
}

// What lies between the two blocks.
struct Inserted {
  Cut from;
  Cut to;
  double length_mm = 0.0;
  Vector2 centre = Vector2::Zero();  // rounding only
  double sweep_rad = 0.0;            // rounding only
};

Inserted chamfer_of(const Curve& a, const Curve& b, const CornerWord& word) {
  Inserted chamfer;
  chamfer.from = chamfer_cut(a, true, word);
  chamfer.to = chamfer_cut(b, false, word);
  chamfer.length_mm = (chamfer.to.point - chamfer.from.point).norm();
  return chamfer;
}

Inserted rounding_of(const Curve& a, const Curve& b, double turn, const CornerWord& word) {
  const double left = turn > 0.0 ? word.size_mm : -word.size_mm;
  require_fillet_arc(a, true, left, word);
  require_fillet_arc(b, false, left, word);
  const auto no_arc = [&] {
    return refusal(
        word, 55,
        fmt::format("no arc of this radius touches both blocks, which turn by {:.3f} degrees", turn * 180.0 / pi));
  };
  const auto crossing = plane::inner_crossing(plane::offset_at_end(a, left), plane::offset_at_start(b, left));
  if (!crossing) {
    throw no_arc();
  }
  Inserted rounding;
  rounding.centre = crossing->point;
  rounding.from = {foot(a, true, rounding.centre), crossing->before};
  rounding.to = {foot(b, false, rounding.centre), crossing->after};
  require_room(a, rounding.from.taken, "before", word);
  require_room(b, rounding.to.taken, "after", word);
  // It turns by what the corner turns and by what the two blocks turn in the parts it replaces.
  const double about =
      turn + (a.arc ? a.sense() * rounding.from.taken : 0.0) + (b.arc ? b.sense() * rounding.to.taken : 0.0);
  const double between =
      plane::angle_of(rounding.to.point - rounding.centre) - plane::angle_of(rounding.from.point - rounding.centre);
  rounding.sweep_rad = about + std::remainder(between - about, 2.0 * pi);
  if (rounding.sweep_rad * turn < 0.0 || std::abs(rounding.sweep_rad) >= 2.0 * pi) {
    throw no_arc();
  }
  rounding.length_mm = std::abs(rounding.sweep_rad) * word.size_mm;
  return rounding;
}

Segment shortened(const Segment& segment, const Curve& curve, const Vector3& start, const Vector3& end, double taken) {
  Segment result;
  const double left = available(curve) - taken;
  if (segment.kind == SegmentKind::arc && left * curve.start_radius_mm > plane::coincident_mm) {
    result = make_arc(start, end, segment.centre_mm, curve.sense() * left, segment.normal, segment.feed_mm_per_s,
                      segment.line);
  } else {
    result = make_line(start, end, segment.feed_mm_per_s, segment.line);
  }
  result.stop_at_end = segment.stop_at_end;
  return result;
}

void check(const Segment& segment, const char* which, int normal, int alarm_without_motion, const CornerWord& word) {
  const bool finite =
      segment.start_mm.allFinite() && segment.end_mm.allFinite() &&
      (segment.kind != SegmentKind::arc || (segment.centre_mm.allFinite() && std::isfinite(segment.sweep_rad)));
  if (!finite) {
    throw Error(ErrorKind::argument, "a corner word needs finite values", word.line, word.column);
  }
  if (segment.kind == SegmentKind::rapid) {
    throw refusal(word, 52, fmt::format("the block {} the corner is a rapid, G01, G02 or G03 is expected", which));
  }
  const bool arc = segment.kind == SegmentKind::arc;
  const Curve curve = arc && segment.normal != normal ? Curve{} : plane::curve_of(segment, normal);
  const bool radius =
      !arc || (curve.start_radius_mm > plane::coincident_mm && curve.end_radius_mm > plane::coincident_mm);
  if (!curve.moves() || !radius) {
    throw refusal(word, alarm_without_motion,
                  fmt::format("the block {} the corner moves {:.4f} mm in the plane", which, curve.length_mm));
  }
}

}  // namespace

CornerResult insert_corner(const Segment& before, const Segment& after, const CornerWord& word, int plane_normal) {
  if (plane_normal < 0 || plane_normal > 2 || !std::isfinite(word.size_mm)) {
    throw Error(ErrorKind::argument, "a corner word needs a plane normal of 0, 1 or 2 and a finite size", word.line,
                word.column);
  }
  if (word.size_mm < 0.0) {
    throw refusal(word, 6, "a size below zero");
  }
  check(before, "before", plane_normal, 55, word);
  check(after, "after", plane_normal, 51, word);
  const double gap = (after.start_mm - before.end_mm).norm();
  if (gap > join_mm) {
    throw Error(ErrorKind::argument, fmt::format("block starts {:.6f} mm off the end of the one before", gap),
                after.line);
  }
  const Curve a = plane::curve_of(before, plane_normal);
  const Curve b = plane::curve_of(after, plane_normal);
  const double turn = plane::turn_at(a, b);
  if (word.size_mm == 0.0 || std::abs(turn) <= tangent_rad) {
    return {before, std::nullopt, after};
  }

  const Inserted corner = word.chamfer ? chamfer_of(a, b, word) : rounding_of(a, b, turn, word);
  const Vector3 corner_start = plane::in_space(corner.from.point, before.end_mm, plane_normal);
  Vector3 corner_end = plane::in_space(corner.to.point, before.end_mm, plane_normal);
  Segment inserted;  // not in an optional yet: GCC 12 would warn of its unset part
  const bool has_length = corner.length_mm > plane::coincident_mm;
  if (!has_length) {
    corner_end = corner_start;  // both blocks are shortened to one point
  } else if (word.chamfer) {
    inserted = make_line(corner_start, corner_end, before.feed_mm_per_s, before.line);
  } else {
    inserted = make_arc(corner_start, corner_end, plane::in_space(corner.centre, before.end_mm, plane_normal),
                        corner.sweep_rad, plane_normal, before.feed_mm_per_s, before.line);
  }
  return {shortened(before, a, before.start_mm, corner_start, corner.from.taken),
          has_length ? std::optional<Segment>(inserted) : std::nullopt,
          shortened(after, b, corner_end, after.end_mm, corner.to.taken)};
}

}  // namespace shapegcode
