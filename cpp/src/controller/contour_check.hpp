// Deviation from the path caused by the filters after the planned set-points.
#pragma once

#include <cstddef>
#include <vector>

#include "shapegcode/filter.hpp"
#include "shapegcode/path.hpp"

namespace shapegcode {

/// Filters one after another, each one for all axes or one for each axis.
using FilterStages = std::vector<std::vector<Fir>>;

/// The distance between what leaves the filters and the path of the set-points that go in. Where all axes have one
/// filter only bends within its duration are looked at: on a straight path there is none. Does not allocate after the
/// constructor.
class ContourCheck {
 public:
  /// Without a check.
  ContourCheck() = default;
  /// `chains`: of which each may be at work; `allowed_mm`: distance; `capacity`: set-points.
  ContourCheck(const std::vector<FilterStages>& chains, double allowed_mm, std::size_t capacity);

  [[nodiscard]] bool is_on() const noexcept { return !chains_.empty(); }
  /// Set-points before the first one that count.
  [[nodiscard]] std::size_t duration() const noexcept { return duration_; }

  /// `past`: the set-points before, newest first, duration() of them.
  void begin(const std::vector<Vector3>& past) noexcept;
  /// The distance of what leaves the filters with this set-point, as a share of what is allowed; a lower bound where
  /// that is below 1.
  double add(const Vector3& point) noexcept;

 private:
  struct Stage {
    std::vector<FirStream> axes;  // one for all, or one for each
  };
  struct Chain {
    std::vector<Stage> stages;
    std::size_t mean = 0;  // delay
    Vector3 out = Vector3::Zero();
  };

  void filter(Chain& chain, const Vector3& point) noexcept;
  [[nodiscard]] double distance(const Vector3& from, std::size_t mean) const noexcept;
  [[nodiscard]] double beyond(const Vector3& from, std::size_t end, std::ptrdiff_t step) const noexcept;

  std::vector<Chain> chains_;
  double allowed_mm_ = 0.0;
  std::size_t duration_ = 0;
  std::vector<Vector3> points_;
  bool bends_only_ = true;
  std::size_t bent_until_ = 0;  // set-points before that have a bend within the duration
};

}  // namespace shapegcode
