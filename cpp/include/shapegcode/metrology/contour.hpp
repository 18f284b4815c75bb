#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <vector>

#include "shapegcode/path/path.hpp"

namespace shapegcode {

/// Statistics of a signed deviation in mm.
struct DeviationStats {
  double max_abs_mm = 0.0;
  double most_positive_mm = 0.0;
  double most_negative_mm = 0.0;
  double sum_of_squares_mm2 = 0.0;
  std::size_t count = 0;
  void add(double deviation_mm) noexcept;
  /// A distance by which the track missed a corner of the path (CornerReach): counts in the largest magnitude alone.
  void include_missed(double distance_mm) noexcept;
  /// The extremes of others, of samples that do not count in the root mean square.
  void include_extremes(const DeviationStats& others) noexcept;
  /// Root mean square; 0 without samples.
  [[nodiscard]] double rms_mm() const noexcept;
};

/// Where a point lies beside the path, seen along the direction of travel.
enum class PathSide : std::uint8_t {
  none,  ///< on the path, or beside a travel along Z only
  left,
  right,
  above,  ///< the deviation is more along Z than across it
  below,
};

/// True distance of a moving point to the programmed path (not the tracking error in time), following the path
/// forward. Positive on the left of the direction of travel seen along the tool axis (+Z looking down), negative on
/// the right; a deviation along Z only, or from a travel along Z only, is positive above. Amortised O(1) per sample, no
/// allocation after construction. Copies what it needs of the path.
///
/// The foot point is searched within an arc length that the last step and the last deviation allow, so that another
/// pass of the path nearby is not mistaken for the present one. On a path that turns back on itself the outward and the
/// return leg are equally near: the leg on which the point moves forward is taken. If the deviation keeps growing
/// while the foot point stays (the track was lost), the search widens until it is found again.
class ContourTracker {
 public:
  /// The point is expected at the path's start. Throws Error(argument) on a path without segments.
  explicit ContourTracker(const Path& path);
  /// Signed deviation in mm of the next sample; NaN, and no change of state, if `p` is not finite.
  double step(const Vector3& p) noexcept;
  /// Segment index of the last foot point.
  [[nodiscard]] std::size_t segment() const noexcept { return cursor_; }
  /// Side on which the last sample lies.
  [[nodiscard]] PathSide side() const noexcept;
  /// Distance of the last foot point from the path's start in mm.
  [[nodiscard]] double s_mm() const noexcept { return s_; }

 private:
  /// What a search needs of one segment: exactly one cache line.
  struct Piece {
    Vector3 start;
    Vector3 direction;  // unit; of the neighbour if the piece has no length
    double length;
    double s;  // of the start, from the path's start
  };
  struct Arc {
    Segment segment;
    int a, b, n;                 // plane axes and normal
    double cosine, sine, sense;  // start direction from the centre; +1 turns a towards b
    double turn;                 // |sweep|
    double radius_rate, pitch;   // mm/rad
    Vector3 start_tangent, end_tangent;
  };
  struct Foot {
    double distance2 = 0.0;
    double along = 0.0;                 // distance from the piece's start
    Vector3 offset = Vector3::Zero();   // foot to point
    Vector3 tangent = Vector3::Zero();  // arcs only
  };
  struct Window {
    double begin, end;  // mm from the path's start
  };
  struct Found {
    Foot foot;
    std::size_t piece;
    double s;  // of the foot, from the path's start
  };

  [[nodiscard]] Foot foot_on(std::size_t piece, const Vector3& p, const Window& window) const noexcept;
  [[nodiscard]] Foot foot_on_arc(std::size_t piece, const Vector3& p, const Window& window) const noexcept;
  [[nodiscard]] static Foot arc_point_foot(const Arc& arc, double u, const Vector3& p) noexcept;
  [[nodiscard]] Found search(const Vector3& p, double move, const Window& window) const noexcept;
  [[nodiscard]] double lateral_side(const Found& found, double distance) const noexcept;
  [[nodiscard]] Vector3 start_tangent(std::size_t piece) const noexcept;
  [[nodiscard]] Vector3 end_tangent(std::size_t piece) const noexcept;

  /// The path as a search wants it; constant, so that copies of a tracker share it.
  struct Geometry {
    std::vector<Piece> pieces;
    std::vector<std::int32_t> arc_of;  // -1 for a line
    std::vector<Arc> arcs;
  };
  [[nodiscard]] static std::shared_ptr<const Geometry> geometry_of(const Path& path);

  std::shared_ptr<const Geometry> geometry_;
  Vector3 last_ = Vector3::Zero();
  std::size_t cursor_ = 0;
  double s_ = 0.0;
  double furthest_ = 0.0;      // largest s_ of late: a point that moves back from there may be on the return leg
  double deviation_ = 0.0;     // unsigned, of the last sample
  double lateral_ = 0.0;       // of the last sample: 1 left, -1 right, 0 neither
  double height_ = 0.0;        // of the last sample above its foot
  std::uint32_t growing_ = 0;  // samples since the deviation began to grow
};

}  // namespace shapegcode
