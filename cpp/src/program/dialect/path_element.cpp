#include "program/dialect/path_element.hpp"

#include <fmt/format.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <string>

#include "shapegcode/error.hpp"

namespace shapegcode::dialect {
namespace {

constexpr double straight = 1e-9;  // sine of an angle below which a direction is one
constexpr double full_turn_rad = 1e-9;
constexpr double one_point_mm = 1e-9;
constexpr double pi = std::numbers::pi;

[[noreturn]] void refuse(const std::string& message) { throw Error(ErrorKind::program, message); }

/// The point at a height on the left of the middle of a chord.
Complex beside_chord(Complex start, Complex end, double height) {
  return 0.5 * (start + end) + Complex(0.0, height) * (end - start) / std::abs(end - start);
}

PathElement arc_about(const Vector3& start, const Vector3& end, Complex centre, int plane, int turn) {
  const double sweep = sweep_of(in_plane(start, plane), in_plane(end, plane), centre, turn);
  return {.start = start, .end = end, .centre = moved_to(start, plane, centre), .plane = plane, .sweep_rad = sweep};
}

}  // namespace

Complex in_plane(const Vector3& point, int plane) {
  const PlaneAxes axes = axes_of(plane);
  return {point[static_cast<Eigen::Index>(axes.first)], point[static_cast<Eigen::Index>(axes.second)]};
}

Vector3 moved_to(Vector3 point, int plane, Complex to) {
  const PlaneAxes axes = axes_of(plane);
  point[static_cast<Eigen::Index>(axes.first)] = to.real();
  point[static_cast<Eigen::Index>(axes.second)] = to.imag();
  return point;
}

double sweep_of(Complex start, Complex end, Complex centre, int turn) {
  double sweep = std::fmod(turn * (std::arg(end - centre) - std::arg(start - centre)), 2.0 * pi);
  if (sweep < 0.0) sweep += 2.0 * pi;
  return turn * (sweep < full_turn_rad ? 2.0 * pi : sweep);
}

Complex centre_by_radius(Complex start, Complex end, double radius, int turn) {
  const double half = 0.5 * std::abs(end - start);
  const double height = std::copysign(std::sqrt(std::max(0.0, radius * radius - half * half)), radius) * turn;
  return beside_chord(start, end, height);
}

double PathElement::length_mm() const {
  if (!centre) return (end - start).norm();
  const auto normal = static_cast<Eigen::Index>(axes_of(plane).normal);
  return std::hypot(std::abs(in_plane(start - *centre, plane)) * sweep_rad, end[normal] - start[normal]);
}

Vector3 PathElement::point_at(double share) const {
  Vector3 point = start + share * (end - start);
  if (!centre || share == 0.0 || share == 1.0) return point;
  const Complex first = in_plane(start - *centre, plane);
  const Complex last = in_plane(end - *centre, plane);
  // Start and end radius differ by round-off, and by what the control allows.
  const double radius = std::abs(first) + share * (std::abs(last) - std::abs(first));
  const double angle = std::arg(first) + share * sweep_rad;
  const Complex spoke(radius * std::cos(angle), radius * std::sin(angle));
  return moved_to(point, plane, in_plane(*centre, plane) + spoke);
}

PathElement PathElement::part(double begin, double end_share) const {
  PathElement found = *this;
  if (begin != 0.0) found.start = point_at(begin);
  if (end_share != 1.0) found.end = point_at(end_share);
  found.sweep_rad = sweep_rad * (end_share - begin);
  return found;
}

Vector3 PathElement::direction_at(double share) const {
  Vector3 step = end - start;
  if (centre) {
    const Complex spoke = in_plane(point_at(share) - *centre, plane);
    step = moved_to(step, plane, Complex(0.0, sweep_rad) * spoke);
  }
  const double length = step.norm();
  return length > 0.0 ? Vector3(step / length) : step;
}

PathElement arc_by_centre(const Vector3& start, const Vector3& end, Complex centre, int plane, int turn,
                          double tolerance_mm) {
  const double first = std::abs(in_plane(start, plane) - centre);
  const double last = std::abs(in_plane(end, plane) - centre);
  if (first < one_point_mm) {
    refuse("the centre is the start: I, J, K would have to be the distance from the start to the centre");
  }
  if (std::abs(first - last) > tolerance_mm) {
    refuse(fmt::format("the end is {:.3f} mm off the radius: start radius {:.3f}, end radius {:.3f}, tolerance {:.3f}",
                       std::abs(first - last), first, last, tolerance_mm));
  }
  return arc_about(start, end, centre, plane, turn);
}

PathElement arc_by_radius(const Vector3& start, const Vector3& end, double radius, int plane, int turn,
                          double tolerance_mm) {
  const Complex a = in_plane(start, plane);
  const Complex b = in_plane(end, plane);
  const double half = 0.5 * std::abs(b - a);
  if (half < one_point_mm) refuse("CR= to the start: a whole circle would have to be given by I, J, K");
  if (half - std::abs(radius) > tolerance_mm) {
    refuse(fmt::format("CR={:g}: the end is {:.3f} mm away, so it would have to be {:.3f} or more", radius, 2.0 * half,
                       half));
  }
  return arc_about(start, end, centre_by_radius(a, b, radius, turn), plane, turn);
}

PathElement arc_by_angle(const Vector3& start, const Vector3& end, double angle_deg, int plane, int turn) {
  const Complex a = in_plane(start, plane);
  const Complex b = in_plane(end, plane);
  const double half = 0.5 * std::abs(b - a);
  if (half < one_point_mm) refuse("AR= with the start as end: a whole circle would have to be given by I, J, K");
  const double height = half / std::tan(angle_deg * (pi / 180.0) / 2.0) * turn;
  return arc_about(start, end, beside_chord(a, b, height), plane, turn);
}

PathElement arc_through(const Vector3& start, const Vector3& middle, const Vector3& end) {
  const Vector3 normal = (middle - start).cross(end - middle);
  const double size = normal.norm();
  const double reach = (middle - start).norm() * (end - middle).norm();
  if (size <= straight * reach || reach == 0.0) {
    refuse("start, intermediate point and end lie on a line: the circle would have to have three points");
  }
  Eigen::Index axis = 0;
  if (normal.cwiseAbs().maxCoeff(&axis) / size < 1.0 - 1e-9) {
    refuse("a circle through these points lies oblique in space: it would have to lie in a plane of two axes");
  }
  constexpr std::array<int, 3> plane_of = {19, 18, 17};
  const int plane = plane_of[static_cast<std::size_t>(axis)];
  const Complex a = in_plane(start, plane);
  const Complex b = in_plane(middle, plane);
  const Complex ratio = (in_plane(end, plane) - a) / (b - a);
  const double size_of_ratio = std::abs(ratio);
  const Complex centre = a + (b - a) * (ratio - size_of_ratio * size_of_ratio) / Complex(0.0, 2.0 * ratio.imag());
  return arc_about(start, end, centre, plane, ratio.imag() > 0.0 ? 1 : -1);
}

PathElement tangential_arc(const Vector3& start, const Vector3& end, const Vector3& direction, int plane) {
  const Complex ahead = in_plane(direction, plane);
  const Complex chord = in_plane(end - start, plane);
  if (std::abs(ahead) < 1e-9 || std::abs(chord) < one_point_mm) {
    refuse("CT needs the direction of a move before it in the plane, and an end elsewhere than its start");
  }
  const Complex seen = chord * std::conj(ahead) / std::abs(ahead);  // along the direction, and to its left
  if (std::abs(seen.imag()) <= 1e-9 * std::abs(chord)) {
    if (seen.real() < 0.0) refuse("CT to a point directly opposite to the direction: no circle leads there");
    return {.start = start, .end = end, .centre = {}, .plane = 17, .sweep_rad = 0.0};
  }
  const double chord_size = std::abs(chord);
  const Complex centre = in_plane(start, plane) +
                         Complex(0.0, 1.0) * ahead / std::abs(ahead) * (chord_size * chord_size) / (2.0 * seen.imag());
  return arc_about(start, end, centre, plane, seen.imag() > 0.0 ? 1 : -1);
}

}  // namespace shapegcode::dialect
