#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "shapegcode/samples.hpp"

namespace shapegcode {

enum class SegmentKind : std::uint8_t { rapid, line, arc };

/// One canonical move in mm. An arc turns about the axis `normal` (0 = X, 1 = Y, 2 = Z) and may climb along it; a start
/// and end radius that differ within the controller's tolerance are joined by a linear change of radius over the sweep.
struct Segment {
  Vector3 start_mm = Vector3::Zero();
  Vector3 end_mm = Vector3::Zero();
  Vector3 centre_mm = Vector3::Zero();  ///< arc only; its component along `normal` is not used
  double start_radius_mm = 0.0;         ///< arc only
  double end_radius_mm = 0.0;           ///< arc only
  double start_angle_rad = 0.0;         ///< arc only, in the plane's own axes (normal+1, normal+2)
  double sweep_rad = 0.0;               ///< arc only, signed: positive turns normal+1 towards normal+2
  double length_mm = 0.0;
  double feed_mm_per_s = 0.0;  ///< programmed tangential feed; 0 for a rapid
  std::uint32_t line = 0;      ///< source line, from 1
  SegmentKind kind = SegmentKind::line;
  std::uint8_t normal = 2;
  bool stop_at_end = false;  ///< exact stop (G09, G61) or forced stop
};

/// A straight move.
[[nodiscard]] Segment make_line(const Vector3& start, const Vector3& end, double feed_mm_per_s, std::uint32_t line = 0);

/// An arc or helix about `centre`; `sweep_rad` signed (see Segment). Throws Error(argument) on a zero radius.
[[nodiscard]] Segment make_arc(const Vector3& start, const Vector3& end, const Vector3& centre, double sweep_rad,
                               int normal, double feed_mm_per_s, std::uint32_t line = 0);

/// Position at distance `s_mm` from the segment's start, 0 <= s <= length.
[[nodiscard]] Vector3 point_at(const Segment& segment, double s_mm) noexcept;

/// Unit tangent at distance `s_mm`; zero vector for a segment without length.
[[nodiscard]] Vector3 tangent_at(const Segment& segment, double s_mm) noexcept;

/// Curvature 1/mm: 0 for a line, R/(R^2+p^2) for a helix with pitch p mm/rad.
[[nodiscard]] double curvature(const Segment& segment) noexcept;

/// Nearest point of a segment to `p`.
struct Nearest {
  double distance_mm = 0.0;
  double s_mm = 0.0;  ///< distance of the foot from the segment's start
};
[[nodiscard]] Nearest nearest_on(const Segment& segment, const Vector3& p) noexcept;

/// A connected run of segments with the distance of each from the start. Constant after construction.
class Path {
 public:
  Path() = default;
  /// Throws Error(argument) if a segment does not start where its predecessor ends (1e-6 mm) or a number is not finite.
  explicit Path(std::vector<Segment> segments);

  [[nodiscard]] const std::vector<Segment>& segments() const noexcept { return segments_; }
  [[nodiscard]] std::size_t size() const noexcept { return segments_.size(); }
  [[nodiscard]] const Segment& operator[](std::size_t i) const noexcept { return segments_[i]; }
  /// Distance of segment i's start from the path's start; `distance(size())` is the whole length.
  [[nodiscard]] double distance_mm(std::size_t i) const noexcept { return distance_mm_[i]; }
  [[nodiscard]] double length_mm() const noexcept { return distance_mm_.empty() ? 0.0 : distance_mm_.back(); }

  /// Position at `s_mm` from the start. `cursor` is the segment index of the previous call: amortised O(1) on a
  /// monotonous walk, and real-time safe.
  [[nodiscard]] Vector3 point(double s_mm, std::size_t& cursor) const noexcept;

 private:
  std::vector<Segment> segments_;
  std::vector<double> distance_mm_;  // size()+1 entries
};

}  // namespace shapegcode
