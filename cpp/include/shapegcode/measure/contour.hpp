#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <memory>
#include <vector>

#include "shapegcode/path.hpp"

namespace shapegcode {

/// Statistics of a signed deviation in mm.
struct DeviationStats {
  double max_abs_mm = 0.0;
  double most_positive_mm = 0.0;
  double most_negative_mm = 0.0;
  double sum_of_squares_mm2 = 0.0;
  std::size_t count = 0;
  void add(double deviation_mm) noexcept {
    max_abs_mm = std::max(max_abs_mm, std::abs(deviation_mm));
    most_positive_mm = std::max(most_positive_mm, deviation_mm);
    most_negative_mm = std::min(most_negative_mm, deviation_mm);
    sum_of_squares_mm2 += deviation_mm * deviation_mm;
    ++count;
  }
  /// Includes the distance by which the track missed a corner of the path (CornerReach) in the largest magnitude only.
  void include_missed(double distance_mm) noexcept;
  /// Includes the extremes of others, whose samples do not count in the root mean square.
  void include_extremes(const DeviationStats& others) noexcept;
  /// Root mean square; 0 without samples.
  [[nodiscard]] double rms_mm() const noexcept;
};

/// Side of the path on which a point lies, seen along the direction of travel.
enum class PathSide : std::uint8_t {
  none,  ///< on the path, or for travel along Z only
  left,
  right,
  above,  ///< the deviation is more along Z than across it
  below,
};

/// True distance of a moving point to the programmed path (not the tracking error in time), following the path forward.
/// Positive on the left of the direction of travel seen along the tool axis (+Z looking down), negative on the right; a
/// deviation along Z only, or from a travel along Z only, is negative if the point is below its foot, else positive.
/// Amortised O(1) per sample, no allocation after construction; a step examines the segments of the path that may be
/// nearest and skips others in groups, so that its work is bounded only by the number of equally near segments. Shares
/// the path's data: it stores no copy.
///
/// The foot point is searched within an arc length given by the last step and the last deviation, so that another pass
/// of the path nearby is not taken for the present one. On a path that reverses, the outward and the return leg are
/// equally near: the leg on which the point moves forward is taken. If the deviation keeps growing while the foot point
/// stays (the track was lost), the search widens until the track is found again.
class ContourTracker {
 public:
  /// The point is expected at the path's start. Throws Error(argument) on a path without segments.
  explicit ContourTracker(const Path& path);
  /// Continues as if the point had moved to `p`, with its foot at `s_mm` from the path's start.
  void begin_at(double s_mm, const Vector3& p) noexcept;
  /// Signed deviation in mm of the next sample; NaN, and no change of state, if `p` is not finite.
  double step(const Vector3& p) noexcept;
  /// The same for a point driven by the last point of another tracker of the path, whose foot bounds its own: a
  /// vibrating point moves backward and forward faster than it travels, and might otherwise skip to a later pass.
  double step(const Vector3& p, const ContourTracker& driver) noexcept;
  /// Segment index of the last foot point.
  [[nodiscard]] std::size_t segment() const noexcept { return cursor_; }
  /// Side on which the last sample lies.
  [[nodiscard]] PathSide side() const noexcept;
  /// Distance of the last foot point from the path's start in mm.
  [[nodiscard]] double s_mm() const noexcept { return s_; }

 private:
  static constexpr double reach_mm = 0.01;
  static constexpr std::size_t slots = 16;
  static constexpr std::size_t no_segment = std::numeric_limits<std::size_t>::max();

  /// Data of one segment for a search.
  struct NearSegment {
    Vector3 start;
    Vector3 direction;  // unit; of the neighbour if the segment has no length
    double length;
    double s;          // of the start, from the path's start
    double next_s;     // of the next segment's start
    std::int32_t arc;  // -1 for a line
    bool has_side;     // the direction is not along Z
    double across2;    // square of the direction's component perpendicular to Z
  };
  /// The last requested segment of those that share its slot.
  struct Slot {
    std::size_t index = no_segment;
    NearSegment of{};
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
    double along = 0.0;                 // distance from the segment's start
    Vector3 offset = Vector3::Zero();   // foot to point
    Vector3 tangent = Vector3::Zero();  // arcs only
  };
  struct Window {
    double begin, end;  // mm from the path's start
  };
  struct Turns {
    double first, last;  // rad from the arc's start, in the sense of its turning
  };
  struct Polar {
    double radius, angle;  // of a point about an arc's centre, from its start direction
  };
  struct Found {
    Foot foot;
    std::size_t index;
    double s;  // of the foot, from the path's start
  };
  /// Successive lines with nearly the direction of the segment in their middle.
  struct Straight {
    std::size_t about = no_segment;
    Vector3 direction = Vector3::Zero();              // of that segment
    std::size_t first = 0, last = 0;                  // segments
    double begin = 0.0, end = 0.0;                    // mm from the path's start; infinite where the path ends
    bool turns_before = false, turns_behind = false;  // the neighbours have another direction
  };

  [[nodiscard]] Foot foot_on(const NearSegment& part, const Vector3& p, const Window& window) const noexcept;
  [[nodiscard]] Foot foot_on_arc(const NearSegment& part, const Vector3& p, const Window& window) const noexcept;
  /// Newton on the derivative of half the squared distance from `u` on, kept within `turns`.
  [[nodiscard]] static double refined_foot(const Arc& arc, const Vector3& p, const Polar& polar, const Turns& turns,
                                           double u) noexcept;
  [[nodiscard]] static Foot arc_point_foot(const Arc& arc, double u, const Vector3& p) noexcept;
  /// Whether no point of `size` segments lies within the root of `limit2` of `p`.
  [[nodiscard]] bool is_beyond(std::size_t first, std::size_t size, const Vector3& p, double limit2) const noexcept;
  /// Number of segments from `first` on, or before `end`, that can be skipped as a group; 0: none.
  [[nodiscard]] std::size_t group_from(std::size_t first, const Vector3& p, double limit2) const noexcept;
  [[nodiscard]] std::size_t group_before(std::size_t end, const Vector3& p, double limit2) const noexcept;
  /// `bound`: returns the largest distance of the foot from the path's start; called only if needed.
  template <typename Bound>
  double follow(const Vector3& p, const Bound& bound) noexcept;
  double follow_any(const Vector3& p, double move, const Window& window, double bound) noexcept;
  /// Whether the path within the window and the next segment have nearly the present direction.
  [[nodiscard]] bool runs_straight(const Window& window) noexcept;
  void straighten() noexcept;
  [[nodiscard]] bool runs_along(std::size_t index) const noexcept;
  /// `bound`: no foot lies further from the path's start.
  [[nodiscard]] Found search(const Vector3& p, double move, const Window& window, double bound) const noexcept;
  [[nodiscard]] double lateral_side(const Found& found, double distance) const noexcept;
  [[nodiscard]] Vector3 start_tangent(std::size_t index) const noexcept;
  [[nodiscard]] Vector3 end_tangent(std::size_t index) const noexcept;

  /// The path prepared for searches; constant, so that copies of a tracker share it.
  struct Geometry {
    Path path;
    SteadyColumn<std::int32_t> arc_of;  // -1 for a line
    std::vector<Arc> arcs;
  };
  [[nodiscard]] static std::shared_ptr<const Geometry> geometry_of(const Path& path);
  [[nodiscard]] static Arc arc_of(const Segment& segment) noexcept;

  [[nodiscard]] std::size_t segments() const noexcept { return geometry_->path.size(); }
  [[nodiscard]] double begin_mm(std::size_t index) const noexcept { return geometry_->path.distance_mm(index); }
  [[nodiscard]] const NearSegment& at(std::size_t i) const noexcept {
    Slot& slot = slots_[i % slots];
    if (slot.index != i) slot = {i, near_segment_of(i)};
    return slot.of;
  }
  [[nodiscard]] NearSegment near_segment_of(std::size_t i) const noexcept;
  [[nodiscard]] NearSegment bare_segment_of(std::size_t i) const noexcept;

  std::shared_ptr<const Geometry> geometry_;
  mutable std::array<Slot, slots> slots_{};  // segments around the point, computed once
  Vector3 last_ = Vector3::Zero();
  std::size_t cursor_ = 0;
  double s_ = 0.0;
  double furthest_ = 0.0;      // largest recent s_: a point that moves back from there may be on the return leg
  double deviation_ = 0.0;     // unsigned, of the last sample
  double lateral_ = 0.0;       // of the last sample: 1 left, -1 right, 0 neither
  double height_ = 0.0;        // of the last sample above its foot
  std::uint32_t growing_ = 0;  // samples since the deviation began to grow
  Straight straight_;
  Window near_{std::numeric_limits<double>::infinity(),
               0.0};  // in which the path is straight around the present segment
};

/// Orbit error of every arc of a path: area between the moving point's track and the programmed arc, divided by the
/// area of the programmed sector (paper 000; for a quarter arc the sector is the quarter disc). The area is the
/// integral of |R^2 - r^2|/2 over the arc's own angular range, in the arc's plane, with r^2 linear in the angle between
/// samples; the angle is unwrapped, so that arcs of several turns and helices count every turn. A backward move
/// subtracts the area that the forward move added.
class OrbitError {
 public:
  explicit OrbitError(const Path& path);
  /// Next sample, and the segment index on which its foot point lies (ContourTracker::segment()). Samples that are not
  /// finite or lie on no segment are ignored. No allocation.
  void step(const Vector3& p, std::size_t segment) noexcept {
    if (!arcs_.empty()) step_arcs(p, segment);
  }
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
  void step_arcs(const Vector3& p, std::size_t segment) noexcept;
  void add_move(Arc& arc, std::size_t index, const Vector3& to, std::size_t to_segment) noexcept;

  SteadyColumn<std::int32_t> arc_of_;  // -1 for a line
  std::vector<Arc> arcs_;
  bool has_last_ = false;
  Vector3 last_ = Vector3::Zero();
  std::size_t last_segment_ = 0;
};

/// Distance of a moving point's track from the corners of a path. The distance from point to path does not show a
/// corner that is cut short along the path itself (a reversal, a narrow V); the distance from corner to track does.
class CornerReach {
 public:
  /// Search range for the nearest track point, along the path on both sides of a corner.
  static constexpr double window_mm = 1.0;
  /// On a reversal, or where the path overlaps itself, the foot may be on a later pass while the point is still before
  /// the corner. If a corner seems missed by more than `missed_mm`, it is searched until `patience_mm` after it.
  static constexpr double missed_mm = 0.02;
  static constexpr double patience_mm = 20.0;

  struct Corner {
    Vector3 point;
    double s = 0.0;         // from the path's start
    double best2 = 0.0;     // squared distance to the track; infinite until the point has been near
    std::uint32_t tag = 0;  // of the sample at the end of the nearest segment of track
  };

  /// Corners are junctions at which the direction changes by `min_angle_rad` or more, and the path's end.
  explicit CornerReach(const Path& path, double min_angle_rad = 0.1745);
  /// Discards the track; the next sample has its foot near `foot_mm`. Unless it is the path's start, corners up to 1.5
  /// windows after the foot no longer count.
  void begin_at(double foot_mm, bool from_start) noexcept;
  /// Next sample, and the distance of its foot point along the path (ContourTracker::s_mm()). No allocation.
  void step(const Vector3& p, double foot_mm, std::uint32_t tag = 0) noexcept {
    if (foot_mm < idle_until_mm_) {
      last_ = p;
    } else {
      step_corners(p, foot_mm, tag);
    }
  }
  /// Whether the point has completely passed every corner up to `s_mm` from the path's start.
  [[nodiscard]] bool has_passed(double s_mm) const noexcept {
    return first_ >= corners_.size() || corners_[first_].s > s_mm;
  }
  /// Whether the last sample is near enough to a corner to be compared with it.
  [[nodiscard]] bool is_near() const noexcept { return first_ < next_; }
  [[nodiscard]] const std::vector<Corner>& corners() const noexcept { return corners_; }
  /// Largest distance of a corner from the track so far, mm.
  [[nodiscard]] double largest_mm() const noexcept;
  /// The same for completely passed corners: for a track that ends before the path.
  [[nodiscard]] double largest_passed_mm() const noexcept;

 private:
  void step_corners(const Vector3& p, double foot_mm, std::uint32_t tag) noexcept;

  std::vector<Corner> corners_;
  double idle_until_mm_ = 0.0;  // no corner is near before the foot is this far from the path's start
  std::size_t first_ = 0;       // corners [first_, next_) are near enough to be examined
  std::size_t next_ = 0;
  double largest2_ = 0.0;
  Vector3 last_ = Vector3::Zero();
  bool started_ = false;
};

}  // namespace shapegcode
