#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "shapegcode/path/path.hpp"

namespace shapegcode {

/// Orbit error of every arc of a path: area between the moving point's track and the programmed arc, divided by the
/// area of the programmed sector (spec section 3; for a quarter arc the sector is the quarter disc). The area is
/// the integral of |R^2 - r^2|/2 over the arc's own angular range, in the arc's plane, with r^2 linear in the angle
/// between samples; the angle is unwrapped, so that arcs of several turns and helices count every turn. A move back
/// takes off what the move forward added.
class OrbitError {
 public:
  explicit OrbitError(const Path& path);
  /// Next sample, and the segment index on which its foot point lies (ContourTracker::segment()). Samples that are not
  /// finite or lie on no segment are ignored. No allocation.
  void step(const Vector3& p, std::size_t segment) noexcept;
  /// Percent, one entry per arc of the path in order.
  [[nodiscard]] std::vector<double> percent() const;

 private:
  struct Arc {
    int a, b;  // plane axes
    double centre_a, centre_b;
    double cosine, sine, sense;  // start direction from the centre; +1 turns a towards b
    double turn;                 // |sweep|
    double start_radius, radius_rate;
    double sector_area;  // mm^2
    double area = 0.0;   // mm^2, so far
    double u = 0.0;      // unwrapped angle of the last sample on this arc, from the arc's start
  };
  void add_move(Arc& arc, std::size_t index, const Vector3& to, std::size_t to_segment) noexcept;

  std::vector<std::int32_t> arc_of_;  // -1 for a line
  std::vector<Arc> arcs_;
  bool has_last_ = false;
  Vector3 last_ = Vector3::Zero();
  std::size_t last_segment_ = 0;
};

}  // namespace shapegcode
