#include "command/junctions.hpp"

namespace shapegcode {

double junction_change(const Path& path, std::size_t i) noexcept {
  const Segment& before = path[i - 1];
  return (tangent_at(path[i], 0.0) - tangent_at(before, before.length_mm)).norm();
}

bool passes_corner(const Path& path, std::size_t before, std::size_t after) noexcept {
  for (std::size_t i = before + 1; i <= after; ++i) {
    if (junction_change(path, i) >= corner_change) {
      return true;
    }
  }
  return false;
}

}  // namespace shapegcode
