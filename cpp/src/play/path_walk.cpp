#include "play/path_walk.hpp"

#include <algorithm>

namespace shapegcode::detail {
namespace {

constexpr int most_moves = 16;  // of one point

}  // namespace

void PathWalk::take(std::size_t index, Piece& piece) const noexcept {
  piece = {index, path_.is_plain(index), path_.start_mm(index)};
  if (!piece.is_plain) {
    piece.length = path_[index].length_mm;
    return;
  }
  piece.direction = path_.start_mm(index + 1) - piece.start;
  piece.length = piece.direction.norm();
  if (piece.length > 0.0) {
    piece.direction /= piece.length;
  }
}

void PathWalk::begin_at(double s_mm) noexcept { here_ = path_.segment_at(s_mm); }

PathWalk::Found PathWalk::look_at_arc(const Piece& piece, const Vector3& p) const noexcept {
  const Nearest nearest = nearest_on(path_[piece.index], p);
  const double within = 1e-9 * piece.length;
  const double along = nearest.s_mm <= within                  ? -1.0
                       : nearest.s_mm >= piece.length - within ? 2.0 * piece.length + 1.0
                                                               : nearest.s_mm;
  return {nearest.distance_mm * nearest.distance_mm, beside(along, piece)};
}

double PathWalk::move(Found found, const Vector3& p) noexcept {
  for (int moves = 0; moves < most_moves && found.beside != Beside::piece; ++moves) {
    const bool on = found.beside == Beside::behind;
    if (on ? here_ + 1 >= path_.size() : here_ == 0) {
      break;
    }
    const std::size_t neighbour = on ? here_ + 1 : here_ - 1;
    const Found next = look(at(neighbour), p);
    // Outside of a corner both pieces say the corner, as does a piece without length.
    if (next.distance2 > found.distance2) {
      break;
    }
    const bool turned = next.beside != Beside::piece && next.beside != found.beside;
    here_ = neighbour;
    found = next;
    if (turned) {
      break;
    }
  }
  return found.distance2;
}

}  // namespace shapegcode::detail
