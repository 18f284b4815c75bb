// Distance of a point from the adjacent segment of the path, without a search.
#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <limits>

#include "shapegcode/path.hpp"

namespace shapegcode::detail {

/// Goes from segment to segment with a point that moves along the path.
class PathWalk {
 public:
  explicit PathWalk(const Path& path) : path_(path) {}
  /// The point is near this distance from the path's start.
  void begin_at(double s_mm) noexcept;
  /// Square of the next point's distance from the segment beside it: no less than that from the path near by.
  [[nodiscard]] double distance2_mm2(const Vector3& p) noexcept {
    const Found found = look(at(here_), p);
    return found.beside == Beside::segment ? found.distance2 : move(found, p);
  }

 private:
  static constexpr std::size_t slots = 16;

  struct NearSegment {
    std::size_t index = std::numeric_limits<std::size_t>::max();
    bool is_plain = false;
    Vector3 start = Vector3::Zero();
    Vector3 direction = Vector3::Zero();
    double length = 0.0;
  };
  enum class Beside { before, segment, behind };
  struct Found {
    double distance2;
    Beside beside;
  };
  [[nodiscard]] const NearSegment& at(std::size_t index) noexcept {
    NearSegment& segment = segments_[index % slots];
    if (segment.index != index) take(index, segment);
    return segment;
  }
  void take(std::size_t index, NearSegment& segment) const noexcept;
  [[nodiscard]] static Beside beside(double along, const NearSegment& segment) noexcept {
    return along < 0.0 ? Beside::before : along > segment.length ? Beside::behind : Beside::segment;
  }
  [[nodiscard]] Found look(const NearSegment& segment, const Vector3& p) const noexcept {
    if (!segment.is_plain) return look_at_arc(segment, p);
    const Vector3 from_start = p - segment.start;
    const double along = from_start.dot(segment.direction);
    const double clamped = std::clamp(along, 0.0, segment.length);
    return {(from_start - clamped * segment.direction).squaredNorm(), beside(along, segment)};
  }
  [[nodiscard]] Found look_at_arc(const NearSegment& segment, const Vector3& p) const noexcept;
  /// On to the neighbours, as long as these are nearer.
  [[nodiscard]] double move(Found found, const Vector3& p) noexcept;

  Path path_;
  std::size_t here_ = 0;
  std::array<NearSegment, slots> segments_{};
};

}  // namespace shapegcode::detail
