#include "simulate/path_walk.hpp"

#include <algorithm>

namespace shapegcode::detail {
namespace {

constexpr int max_moves = 16;  // of one point

}  // namespace

void PathWalk::take(std::size_t index, NearSegment& segment) const noexcept {
  segment = {index, path_.is_plain(index), path_.start_mm(index)};
  if (!segment.is_plain) {
    segment.length = path_[index].length_mm;
    return;
  }
  segment.direction = path_.start_mm(index + 1) - segment.start;
  segment.length = segment.direction.norm();
  if (segment.length > 0.0) {
    segment.direction /= segment.length;
  }
}

void PathWalk::begin_at(double s_mm) noexcept { here_ = path_.segment_at(s_mm); }

PathWalk::Found PathWalk::look_at_arc(const NearSegment& segment, const Vector3& p) const noexcept {
  const Nearest nearest = nearest_on(path_[segment.index], p);
  const double within = 1e-9 * segment.length;
  const double along = nearest.s_mm <= within                    ? -1.0
                       : nearest.s_mm >= segment.length - within ? 2.0 * segment.length + 1.0
                                                                 : nearest.s_mm;
  return {nearest.distance_mm * nearest.distance_mm, beside(along, segment)};
}

double PathWalk::move(Found found, const Vector3& p) noexcept {
  for (int moves = 0; moves < max_moves && found.beside != Beside::segment; ++moves) {
    const bool on = found.beside == Beside::behind;
    if (on ? here_ + 1 >= path_.size() : here_ == 0) {
      break;
    }
    const std::size_t neighbour = on ? here_ + 1 : here_ - 1;
    const Found next = look(at(neighbour), p);
    // Outside of a corner both segments give the corner as nearest point, as does a segment without length.
    if (next.distance2 > found.distance2) {
      break;
    }
    const bool turned = next.beside != Beside::segment && next.beside != found.beside;
    here_ = neighbour;
    found = next;
    if (turned) {
      break;
    }
  }
  return found.distance2;
}

}  // namespace shapegcode::detail
