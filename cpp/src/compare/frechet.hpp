// Private: whether two polylines can be traversed in parallel, both forwards, within a given distance of each other.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <utility>
#include <vector>

#include "shapegcode/path.hpp"

namespace shapegcode::detail {

/// The decision of Alt and Godau (Computing the Frechet distance between two polygonal curves, 1995), of which only
/// the cells that can be reached are looked at. A doubled, missing or reversed part does not pass, whatever the
/// lengths.
class FrechetDecision {
 public:
  FrechetDecision(const std::vector<Vector3>& ours, const std::vector<Vector3>& theirs, double distance_mm)
      : ours_(ours), theirs_(theirs), distance_mm_(distance_mm) {}

  bool within() {
    if (ours_.size() < 2 || theirs_.size() < 2 || !near(ours_.front(), theirs_.front()) ||
        !near(ours_.back(), theirs_.back())) {
      return false;
    }
    start();
    for (std::size_t i = 0; i + 1 < ours_.size(); ++i) {
      if (!row(i)) {
        return false;
      }
    }
    return !reached_.empty() && reached_.back().cell + 2 == theirs_.size() && reached_.back().part.high >= 1.0;
  }

 private:
  static constexpr std::size_t max_cells = 40'000'000;  // beyond: not known to be within

  // Share of a segment; empty where low is above high.
  struct Part {
    double low = 1.0;
    double high = 0.0;
    [[nodiscard]] bool empty() const noexcept { return low > high; }
  };
  struct Reached {
    std::size_t cell = 0;  // segment of theirs
    Part part;
  };

  [[nodiscard]] bool near(const Vector3& a, const Vector3& b) const { return (a - b).norm() <= distance_mm_; }

  // The part of a segment that is near to a point. Exactly 0 and 1 where its ends are: neighbours agree on them.
  [[nodiscard]] Part free(const Vector3& point, const Vector3& from, const Vector3& to) const {
    const bool from_near = near(point, from);
    const bool to_near = near(point, to);
    if (from_near && to_near) {
      return {0.0, 1.0};
    }
    const Vector3 along = to - from;
    const double square = along.squaredNorm();
    const double middle = square > 0.0 ? (point - from).dot(along) / square : 0.0;
    const double off = (from + middle * along - point).squaredNorm();
    const double rest = distance_mm_ * distance_mm_ - off;
    if (square <= 0.0 || (rest < 0.0 && !from_near && !to_near)) {
      return {};
    }
    const double half = std::sqrt(std::max(0.0, rest) / square);
    return {from_near ? 0.0 : std::max(0.0, middle - half), to_near ? 1.0 : std::min(1.0, middle + half)};
  }

  // From both starts along theirs.
  void start() {
    column_ = true;
    for (std::size_t j = 0; j + 1 < theirs_.size(); ++j) {
      const Part part = free(ours_.front(), theirs_[j], theirs_[j + 1]);
      if (part.empty() || part.low > 0.0) {
        return;
      }
      reached_.push_back({j, part});
      if (part.high < 1.0) {
        return;
      }
    }
  }

  // The cells of a segment of ours, from what is reached at its start to what is reached at its end.
  bool row(std::size_t i) {
    std::vector<Reached> next;
    Part left;
    if (column_) {
      left = free(theirs_.front(), ours_[i], ours_[i + 1]);
      left = left.low > 0.0 ? Part{} : left;
      column_ = !left.empty() && left.high >= 1.0;
    }
    auto below = reached_.begin();
    for (std::size_t j = 0; j + 1 < theirs_.size(); ++j) {
      if (left.empty()) {
        if (below == reached_.end()) break;
        j = below->cell;
      }
      if (++cells_ > max_cells) {
        return false;
      }
      Part bottom;
      if (below != reached_.end() && below->cell == j) {
        bottom = below->part;
        ++below;
      }
      Part right = free(theirs_[j + 1], ours_[i], ours_[i + 1]);
      Part top = free(ours_[i + 1], theirs_[j], theirs_[j + 1]);
      if (bottom.empty()) right.low = std::max(right.low, left.low);
      if (left.empty()) top.low = std::max(top.low, bottom.low);
      if (!top.empty()) next.push_back({j, top});
      left = right;
    }
    reached_ = std::move(next);
    return !reached_.empty() || column_;
  }

  const std::vector<Vector3>& ours_;
  const std::vector<Vector3>& theirs_;
  double distance_mm_;
  bool column_ = false;           // the start of theirs is near all of ours so far
  std::vector<Reached> reached_;  // ascending
  std::size_t cells_ = 0;
};

}  // namespace shapegcode::detail
