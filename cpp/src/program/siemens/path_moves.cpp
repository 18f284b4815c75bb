// Lines, moves from a position that is not known, and arcs.
#include <fmt/format.h>

#include <cmath>
#include <numbers>

#include "program/siemens/path.hpp"
#include "program/siemens/value.hpp"

namespace shapegcode::siemens {
namespace {

using dialect::PathElement;

constexpr double smallest_share = 1e-12;  // of a programmed axis in one of the work offset

Eigen::Index row_of(std::size_t axis) { return static_cast<Eigen::Index>(axis); }

Vector3 without_unknown(const Vector3& point) {
  return point.unaryExpr([](double value) { return std::isnan(value) ? 0.0 : value; });
}

}  // namespace

void SiemensPath::straight(const Given& given, const Vector3& target) {
  const Vector3 end = modes.frame.apply(target);
  Axes moved{};
  bool is_known = true;
  for (std::size_t k = 0; k < 3; ++k) {
    for (std::size_t axis = 0; axis < 3; ++axis) {
      if (given.axes.find(axis) == nullptr) continue;
      moved[k] = moved[k] || std::abs(modes.frame.linear()(row_of(k), row_of(axis))) > smallest_share;
    }
    is_known = is_known && !(moved[k] && std::isnan(end[row_of(k)]));
  }
  if (!is_known) {
    by_distance(given, end, moved);
    return;
  }
  PathElement element{.start = without_unknown(at_), .end = without_unknown(at_), .centre = {}};
  for (std::size_t k = 0; k < 3; ++k) {
    if (!moved[k]) continue;
    element.start[row_of(k)] = at_[row_of(k)];
    element.end[row_of(k)] = end[row_of(k)];
  }
  write_element(element, given, moved);
}

double SiemensPath::distance_of(const Given& given, const Vector3& end, std::size_t axis) {
  const Eigen::Index k = row_of(axis);
  if (std::isnan(end[k])) {
    std::size_t count = 0;
    std::size_t source = 0;
    for (std::size_t each = 3; each-- > 0;) {
      if (std::abs(modes.frame.linear()(k, row_of(each))) <= smallest_share) continue;
      source = each;
      ++count;
    }
    const Coordinate* word = given.axes.find(source);
    if (count != 1 || word == nullptr) {
      throw given.error(fmt::format("the position of {} is not known here: it must be programmed before", "XYZ"[axis]));
    }
    return modes.frame.linear()(k, row_of(source)) * word->value;
  }
  if (std::isnan(at_[k])) {
    throw given.error(
        fmt::format("{} absolute with an axis whose position is not known: a separate block is needed", "XYZ"[axis]));
  }
  const double step = on_grid(end)[k] - on_grid(at_)[k];
  at_[k] = end[k];
  return step;
}

void SiemensPath::by_distance(const Given& given, const Vector3& end, const Axes& moved) {
  std::string words;
  for (std::size_t axis = 0; axis < 3; ++axis) {
    if (!moved[axis]) continue;
    words += "XYZ"[axis];
    append_length(words, distance_of(given, end, axis));
  }
  const bool is_rapid = modes.motion == Motion::g0;
  if (!is_rapid) words += feed_word(constant_feed(given, std::nan("")));
  put("G91");
  put((is_rapid ? "G00" : "G01") + words);
  put("G90");
  step_.reset();
  ++moves_;
}

void SiemensPath::round(const Given& given, Vector3 here, Vector3 target) {
  const dialect::PlaneAxes axes = dialect::axes_of(modes.plane);
  bool is_known = std::isfinite(here[row_of(axes.first)]) && std::isfinite(here[row_of(axes.second)]);
  if (modes.motion == Motion::cip || given.axes.find(axes.normal) != nullptr) {
    is_known = is_known && std::isfinite(here[row_of(axes.normal)]);
  }
  if (!is_known) {
    throw error_at(given.column, "an arc whose start is not known: its axes must be programmed before");
  }
  here = without_unknown(here);
  target = without_unknown(target);
  PathElement element;
  try {
    element = arc(given, here, target);
  } catch (const Error& error) {
    if (error.column() != 0) throw;
    throw error_at(given.column, error.what());
  }
  if (given.turns != 0) {
    if (!element.centre) throw error_at(given.column, "TURN= of a line: it must be an arc");
    element.sweep_rad +=
        static_cast<double>(given.turns) * 2.0 * std::numbers::pi * std::copysign(1.0, element.sweep_rad);
  }
  const dialect::PlaneAxes own = dialect::axes_of(element.plane);
  Axes moved{};
  for (std::size_t k = 0; k < 3; ++k) moved[k] = k != own.normal || given.axes.find(k) != nullptr;
  write_element(in_offset(element, given.column), given, moved);
}

PathElement SiemensPath::arc(const Given& given, const Vector3& here, const Vector3& target) const {
  if (modes.motion == Motion::cip) {
    Vector3 middle = here;
    for (std::size_t k = 0; k < given.middle.size(); ++k) {
      const Eigen::Index axis = given.middle.axis(k);
      const Coordinate& word = given.middle.coordinate(k);
      middle[axis] = word.from_start ? here[axis] + word.value : word.value;
    }
    if (given.middle.size() < 2) {
      throw given.error("CIP: the intermediate point must be given by two or three of I1=, J1=, K1=");
    }
    return dialect::arc_through(here, middle, target);
  }
  if (modes.motion == Motion::ct) {
    const std::optional<Vector3> ahead = direction();
    if (!ahead) throw given.error("CT needs the direction of a move before it, whose start is known");
    return dialect::tangential_arc(here, target, modes.frame.linear().transpose() * *ahead, modes.plane);
  }
  return arc_in_plane(given, here, target);
}

PathElement SiemensPath::arc_in_plane(const Given& given, const Vector3& here, const Vector3& target) const {
  const int turn = modes.motion == Motion::g3 ? 1 : -1;
  const dialect::PlaneAxes axes = dialect::axes_of(modes.plane);
  const double tolerance = options_.arc_radius_tolerance_mm;
  Vector3 about = here;
  for (std::size_t k = 0; k < given.centre.size(); ++k) {
    const int axis = given.centre.axis(k);
    const Coordinate& word = given.centre.coordinate(k);
    if (static_cast<std::size_t>(axis) == axes.normal) {
      throw error_at(word.column, fmt::format("{} is perpendicular to the plane G{}: it must be left out",
                                              "IJK"[static_cast<std::size_t>(axis)], modes.plane));
    }
    about[axis] = word.from_start ? here[axis] + word.value : word.value;
  }
  const dialect::Complex start = dialect::in_plane(here, modes.plane);
  const dialect::Complex centre = dialect::in_plane(about, modes.plane);
  if (given.radius) return dialect::arc_by_radius(here, target, *given.radius, modes.plane, turn, tolerance);
  if (given.angle) {
    const double angle = *given.angle;
    if (!(angle > 0.0 && angle < 360.0)) {
      throw given.error(fmt::format("AR={:g}: it must lie between 0 and 360 degrees", angle));
    }
    if (given.centre.empty()) return dialect::arc_by_angle(here, target, angle, modes.plane, turn);
    const double radians = turn * (angle * to_radians);
    const dialect::Complex end = centre + (start - centre) * dialect::Complex(std::cos(radians), std::sin(radians));
    const Vector3 moved = dialect::moved_to(target, modes.plane, end);
    return dialect::arc_by_centre(here, moved, centre, modes.plane, turn, tolerance);
  }
  if (given.centre.empty()) {
    throw given.error(fmt::format("{} without I, J, K, CR= or AR=: one of them must be given", name_of(modes.motion)));
  }
  return dialect::arc_by_centre(here, target, centre, modes.plane, turn, tolerance);
}

PathElement SiemensPath::in_offset(const PathElement& element, std::uint32_t column) const {
  Vector3 start = modes.frame.apply(element.start);
  for (Eigen::Index k = 0; k < 3; ++k) {
    if (!std::isnan(at_[k])) start[k] = at_[k];
  }
  const Vector3 end = modes.frame.apply(element.end);
  if (!element.centre) return {.start = start, .end = end, .centre = {}};
  const dialect::PlaneAxes axes = dialect::axes_of(element.plane);
  const Eigen::Index first = row_of(axes.first);
  const Eigen::Index second = row_of(axes.second);
  const Eigen::Index normal = row_of(axes.normal);
  const Eigen::Matrix3d& linear = modes.frame.linear();
  Eigen::Matrix2d inner;
  inner << linear(first, first), linear(first, second), linear(second, first), linear(second, second);
  const double turned = inner(0, 0) * inner(1, 1) - inner(0, 1) * inner(1, 0);  // its determinant
  const Eigen::Vector4d across(linear(normal, first), linear(normal, second), linear(first, normal),
                               linear(second, normal));
  const Eigen::Matrix2d off = inner * inner.transpose() - std::abs(turned) * Eigen::Matrix2d::Identity();
  if (across.cwiseAbs().maxCoeff() > 1e-9 || off.cwiseAbs().maxCoeff() > 1e-9) {
    throw error_at(column, fmt::format("an arc in G{} under a frame that tilts its plane or makes it an ellipse (ROT, "
                                       "SCALE): it is not read",
                                       element.plane));
  }
  return {.start = start,
          .end = end,
          .centre = modes.frame.apply(*element.centre),
          .plane = element.plane,
          .sweep_rad = element.sweep_rad * std::copysign(1.0, turned)};
}

}  // namespace shapegcode::siemens
