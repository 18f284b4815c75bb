#include "controller/contour_check.hpp"

#include <algorithm>
#include <cmath>
#include <span>

#include <Eigen/Geometry>

namespace shapegcode {
namespace {

// Three set-points are on a straight line if the middle one is within this distance of it.
constexpr double straight_mm = 1e-9;

double distance_to(const Vector3& point, const Vector3& begin, const Vector3& end) noexcept {
  const Vector3 along = end - begin;
  const double squared = along.squaredNorm();
  const double share = squared > 0.0 ? std::clamp((point - begin).dot(along) / squared, 0.0, 1.0) : 0.0;
  return (point - begin - share * along).norm();
}

}  // namespace

ContourCheck::ContourCheck(const std::vector<FilterStages>& chains, double allowed_mm, std::size_t capacity)
    : allowed_mm_(allowed_mm) {
  for (const FilterStages& stages : chains) {
    Chain& chain = chains_.emplace_back();
    double mean = 0.0;
    std::size_t duration = 0;
    for (const std::vector<Fir>& axes : stages) {
      bends_only_ = bends_only_ && axes.size() == 1;
      Stage& stage = chain.stages.emplace_back();
      double latest = 0.0;
      int longest = 0;
      for (std::size_t axis = 0; axis < std::min<std::size_t>(axes.size(), axis_count); ++axis) {
        stage.axes.emplace_back(axes[axis], axes.size() == 1 ? axis_count : 1);
        latest = std::max(latest, axes[axis].mean_samples());
        longest = std::max(longest, axes[axis].duration_samples());
      }
      mean += latest;
      duration += static_cast<std::size_t>(longest);
    }
    chain.mean = static_cast<std::size_t>(std::lround(mean));
    duration_ = std::max(duration_, duration);
  }
  points_.reserve(capacity + 2 * duration_ + 8);
}

void ContourCheck::begin(const std::vector<Vector3>& past) noexcept {
  points_.clear();
  bent_until_ = 0;
  if (!is_on() || past.empty()) return;
  for (Chain& chain : chains_) {
    chain.out = past.back();
    for (Stage& stage : chain.stages) {
      const std::span<const double> rest(past.back().data(), axis_count);
      for (std::size_t i = 0; i < stage.axes.size(); ++i) {
        stage.axes[i].reset(stage.axes.size() == 1 ? rest : rest.subspan(i, 1));
      }
    }
  }
  for (std::size_t i = past.size(); i-- > 0;) add(past[i]);
}

void ContourCheck::filter(Chain& chain, const Vector3& point) noexcept {
  chain.out = point;
  const std::span<double> values(chain.out.data(), axis_count);
  for (Stage& stage : chain.stages) {
    for (std::size_t i = 0; i < stage.axes.size(); ++i) {
      const std::span<double> part = stage.axes.size() == 1 ? values : values.subspan(i, 1);
      stage.axes[i].step(part, part);
    }
  }
}

// From what leaves the filters to the path around the place where it should be.
double ContourCheck::distance(const Vector3& from, std::size_t mean) const noexcept {
  const std::size_t last = points_.size() - 1;
  const std::size_t first = last - std::min(last, duration_);
  const std::size_t middle = last - std::min(last, mean);
  double nearest = (points_[middle] - from).norm();
  for (std::size_t away = 0; nearest > allowed_mm_ && away <= duration_; ++away) {
    if (middle + away + 1 <= last) {
      nearest = std::min(nearest, distance_to(from, points_[middle + away], points_[middle + away + 1]));
    }
    if (middle >= first + away + 1) {
      nearest = std::min(nearest, distance_to(from, points_[middle - away - 1], points_[middle - away]));
    }
  }
  return nearest > allowed_mm_ ? std::min({nearest, beyond(from, first, 1), beyond(from, last, -1)}) : nearest;
}

// To the path as it would go on straight from one end of it, `step` away from that: what swings beyond a stop along the
// path does not leave it sideways.
double ContourCheck::beyond(const Vector3& from, std::size_t end, std::ptrdiff_t step) const noexcept {
  std::size_t inside = end;
  for (std::size_t i = 0; i < duration_ && points_[inside] == points_[end]; ++i) {
    inside = static_cast<std::size_t>(static_cast<std::ptrdiff_t>(inside) + step);
  }
  const Vector3 outwards = points_[end] - points_[inside];
  const Vector3 away = from - points_[end];
  const double length = outwards.norm();
  if (length <= 0.0 || away.dot(outwards) <= 0.0) return away.norm();
  return away.cross(outwards).norm() / length;
}

double ContourCheck::add(const Vector3& point) noexcept {
  if (points_.size() == points_.capacity()) return 0.0;
  points_.push_back(point);
  for (Chain& chain : chains_) filter(chain, point);
  const std::size_t count = points_.size();
  if (count < 3) return 0.0;
  const Vector3& before = points_[count - 2];
  if (point != before && distance_to(before, points_[count - 3], point) > straight_mm) bent_until_ = count + duration_;
  if (count <= duration_ || (bends_only_ && count > bent_until_)) return 0.0;
  double farthest = 0.0;
  for (const Chain& chain : chains_) farthest = std::max(farthest, distance(chain.out, chain.mean));
  return farthest / allowed_mm_;
}

}  // namespace shapegcode
