#include "program/rewrite/coordinate_modes.hpp"

#include <cmath>

#include "path/arc_frame.hpp"
#include "shapegcode/error.hpp"

namespace shapegcode::detail {

double CoordinateModes::factor(int axis) const noexcept {
  return (mirror[static_cast<std::size_t>(axis)] ? -1.0 : 1.0) * (scaling ? scale[axis] : 1.0);
}

bool CoordinateModes::acts_on(int axis) const noexcept {
  return mixes(axis) || mirror[static_cast<std::size_t>(axis)] || (scaling && scale[axis] != 1.0);
}

Vector3 CoordinateModes::scaled_and_mirrored(const Vector3& programmed) const noexcept {
  Vector3 point = programmed;
  for (int axis = 0; axis < axis_count; ++axis) {
    if (mirror[static_cast<std::size_t>(axis)]) {
      point[axis] = 2.0 * mirror_at[axis] - point[axis];
    }
    if (scaling) {
      point[axis] = scale_centre[axis] + scale[axis] * (point[axis] - scale_centre[axis]);
    }
  }
  return point;
}

Vector3 CoordinateModes::rotate(const Vector3& point, double sense) const noexcept {
  if (!rotation) {
    return point;
  }
  const ArcFrame plane(rotation_normal);
  const double c = std::cos(rotation_rad);
  // In a mirrored plane clockwise and counter-clockwise are exchanged, for angles and arcs.
  const double s = (flips(rotation_normal) ? -sense : sense) * std::sin(rotation_rad);
  const Eigen::Vector2d arm = plane.offset(rotation_centre, point);
  Vector3 turned = point;
  turned[plane.a] = rotation_centre[plane.a] + c * arm.x() - s * arm.y();
  turned[plane.b] = rotation_centre[plane.b] + s * arm.x() + c * arm.y();
  return turned;
}

Vector3 CoordinateModes::undo(const Vector3& work) const noexcept {
  Vector3 point = rotate(work, -1.0);
  for (int axis = 0; axis < axis_count; ++axis) {
    if (scaling) {
      point[axis] = scale_centre[axis] + (point[axis] - scale_centre[axis]) / scale[axis];
    }
    if (mirror[static_cast<std::size_t>(axis)]) {
      point[axis] = 2.0 * mirror_at[axis] - point[axis];
    }
  }
  return point;
}

bool CoordinateModes::flips(int normal) const noexcept {
  const ArcFrame plane(normal);
  return factor(plane.a) * factor(plane.b) < 0.0;
}

Segment CoordinateModes::apply(const Segment& programmed, std::uint32_t line) const {
  Segment segment;
  if (programmed.kind == SegmentKind::arc) {
    const ArcFrame frame(programmed.normal);
    if (std::abs(std::abs(factor(frame.a)) - std::abs(factor(frame.b))) > 1e-9) {
      throw Error(ErrorKind::program,
                  "an arc under scaling G51 with different factors of its two axes is no arc any more", line, 1);
    }
    if (rotation && programmed.normal != rotation_normal) {
      throw Error(ErrorKind::program, "an arc of another plane than that of the rotation G68 is not supported", line,
                  1);
    }
    segment = make_arc(apply(programmed.start_mm), apply(programmed.end_mm), apply(programmed.centre_mm),
                       flips(programmed.normal) ? -programmed.sweep_rad : programmed.sweep_rad, programmed.normal,
                       programmed.feed_mm_per_s, programmed.line);
  } else {
    segment =
        make_line(apply(programmed.start_mm), apply(programmed.end_mm), programmed.feed_mm_per_s, programmed.line);
    segment.kind = programmed.kind;
  }
  segment.stop_at_end = programmed.stop_at_end;
  return segment;
}

}  // namespace shapegcode::detail
