#include "shapegcode/measure/contour.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

namespace shapegcode {
namespace {

double distance2(const Vector3& p, const Vector3& from, const Vector3& to) noexcept {
  const Vector3 along = to - from;
  const double length2 = along.squaredNorm();
  const double fraction = length2 > 0.0 ? std::clamp((p - from).dot(along) / length2, 0.0, 1.0) : 0.0;
  return (p - from - fraction * along).squaredNorm();
}

}  // namespace

CornerReach::CornerReach(const Path& path, double min_angle_rad) {
  const double straight = std::cos(min_angle_rad);
  Vector3 before = Vector3::Zero();  // direction at the end of the segment before
  for (std::size_t i = 0; i < path.size(); ++i) {
    const Segment segment = path[i];
    if (i > 0 && before.dot(tangent_at(segment, 0.0)) <= straight) {
      corners_.push_back({segment.start_mm, path.distance_mm(i), std::numeric_limits<double>::infinity()});
    }
    before = tangent_at(segment, segment.length_mm);
  }
  if (path.size() > 0) {
    corners_.push_back({path.end_mm(path.size() - 1), path.length_mm(), std::numeric_limits<double>::infinity()});
  }
}

void CornerReach::begin_at(double foot_mm, bool from_start) noexcept {
  const double before_mm = from_start ? -1.0 : foot_mm + 1.5 * window_mm;
  const auto first = std::upper_bound(corners_.begin(), corners_.end(), before_mm,
                                      [](double s_mm, const Corner& corner) { return s_mm < corner.s; });
  first_ = next_ = static_cast<std::size_t>(first - corners_.begin());
  idle_until_mm_ = 0.0;
  largest2_ = 0.0;
  started_ = false;
}

void CornerReach::step_corners(const Vector3& p, double foot_mm, std::uint32_t tag) noexcept {
  if (!started_) {
    last_ = p;
    started_ = true;
  }
  while (next_ < corners_.size() && corners_[next_].s <= foot_mm + window_mm) {
    corners_[next_++].best2 = std::numeric_limits<double>::infinity();
  }
  for (std::size_t i = first_; i < next_; ++i) {
    const double now2 = distance2(corners_[i].point, last_, p);
    if (now2 < corners_[i].best2) {
      corners_[i].best2 = now2;
      corners_[i].tag = tag;
    }
  }
  const auto passed = [foot_mm](const Corner& corner) {
    const bool met = corner.best2 <= missed_mm * missed_mm;
    return corner.s < foot_mm - (met ? window_mm : patience_mm);
  };
  while (first_ < next_ && passed(corners_[first_])) {
    largest2_ = std::max(largest2_, corners_[first_].best2);
    ++first_;
  }
  idle_until_mm_ = first_ < next_            ? 0.0
                   : next_ < corners_.size() ? corners_[next_].s - window_mm
                                             : std::numeric_limits<double>::infinity();
  last_ = p;
}

double CornerReach::largest_passed_mm() const noexcept { return std::sqrt(largest2_); }

double CornerReach::largest_mm() const noexcept {
  double largest2 = largest2_;
  for (std::size_t i = first_; i < next_; ++i) {
    largest2 = std::max(largest2, corners_[i].best2);
  }
  return std::sqrt(largest2);
}

}  // namespace shapegcode
