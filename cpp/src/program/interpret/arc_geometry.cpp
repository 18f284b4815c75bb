#include "program/interpret/arc_geometry.hpp"

#include <fmt/format.h>

#include <cmath>
#include <numbers>
#include <string>

#include "path/arc_frame.hpp"
#include "shapegcode/error.hpp"

namespace shapegcode {
namespace {

constexpr double two_pi = 2.0 * std::numbers::pi;
// Programmed points closer than this are identical: far below any least increment, far above double round-off.
constexpr double coincident_mm = 1e-7;

}  // namespace

Segment resolve_arc(const ArcWords& words, double feed_mm_per_s, std::uint32_t line, std::uint32_t column) {
  const ArcFrame frame(words.normal);
  const int a = frame.a;
  const int b = frame.b;
  const double sense = words.clockwise ? -1.0 : 1.0;
  const double chord_a = words.end_mm[a] - words.start_mm[a];
  const double chord_b = words.end_mm[b] - words.start_mm[b];
  const double chord = std::hypot(chord_a, chord_b);
  Vector3 centre = words.centre_mm;

  if (words.radius_mm) {
    const double radius = *words.radius_mm;
    if (chord <= coincident_mm) {
      throw Error(ErrorKind::program, "arc by R without a move in its plane: a full circle needs I J K", line, column);
    }
    const double half = 0.5 * chord;
    const double excess = half - std::abs(radius);
    if (radius == 0.0 || excess > 0.5 * words.tolerance_mm) {
      throw alarm_error(
          20,
          fmt::format(
              "arc radius R{:.4f} cannot span its chord of {:.4f} mm: half the chord is {:.4f} mm, tolerance {:.4f}",
              radius, chord, half, words.tolerance_mm),
          line, column);
    }
    const double height = std::sqrt(std::max(0.0, radius * radius - half * half));
    // Counter-clockwise with R > 0 has its centre on the left of the chord; each sign change swaps the side.
    const double side = sense * (radius > 0.0 ? 1.0 : -1.0) * height / chord;
    centre[a] = words.start_mm[a] + 0.5 * chord_a - side * chord_b;
    centre[b] = words.start_mm[b] + 0.5 * chord_b + side * chord_a;
  }

  const double start_radius = frame.radius(words.start_mm, centre);
  const double end_radius = frame.radius(words.end_mm, centre);
  const double difference = std::abs(start_radius - end_radius);
  if (start_radius <= coincident_mm || end_radius <= coincident_mm || difference > words.tolerance_mm) {
    constexpr char names[] = "XYZ";
    throw alarm_error(
        20,
        fmt::format(
            "arc end is {:.4f} mm off its radius: start ({}{:.4f} {}{:.4f}), end ({}{:.4f} {}{:.4f}), centre ({}{:.4f} "
            "{}{:.4f}), start radius {:.4f}, end radius {:.4f}, tolerance {:.4f} mm",
            difference, names[a], words.start_mm[a], names[b], words.start_mm[b], names[a], words.end_mm[a], names[b],
            words.end_mm[b], names[a], centre[a], names[b], centre[b], start_radius, end_radius, words.tolerance_mm),
        line, column);
  }

  double sweep = two_pi;
  if (chord > coincident_mm) {
    const double start_angle = frame.angle_rad(words.start_mm, centre);
    const double end_angle = frame.angle_rad(words.end_mm, centre);
    sweep = std::fmod(sense * (end_angle - start_angle), two_pi);
    if (sweep <= 0.0) {
      sweep += two_pi;
    }
  }
  return make_arc(words.start_mm, words.end_mm, centre, sense * sweep, words.normal, feed_mm_per_s, line);
}

}  // namespace shapegcode
