#include "command/junctions.hpp"

namespace shapegcode {

double junction_change(const Segment& before, const Segment& after) noexcept {
  return (tangent_at(after, 0.0) - tangent_at(before, before.length_mm)).norm();
}

Corners::Corners(const Path& path) : at_(path.size(), false) {
  if (path.size() == 0) return;
  Segment before = path[0];
  for (std::size_t i = 1; i < path.size(); ++i) {
    const Segment after = path[i];
    at_[i] = junction_change(before, after) >= corner_change;
    before = after;
  }
}

bool Corners::passed(std::size_t before, std::size_t after) const noexcept {
  for (std::size_t i = before + 1; i <= after; ++i) {
    if (at_[i]) {
      return true;
    }
  }
  return false;
}

}  // namespace shapegcode
