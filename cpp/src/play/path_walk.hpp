// Distance of a point from the piece of path beside it, without a search.
#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <limits>

#include "shapegcode/path.hpp"

namespace shapegcode::detail {

/// Goes from piece to piece with a point that moves along the path.
class PathWalk {
 public:
  explicit PathWalk(const Path& path) : path_(path) {}
  /// The point is near this distance from the path's start.
  void begin_at(double s_mm) noexcept;
  /// Square of the next point's distance from the piece beside it: no less than that from the path near by.
  [[nodiscard]] double distance2_mm2(const Vector3& p) noexcept {
    const Found found = look(at(here_), p);
    return found.beside == Beside::piece ? found.distance2 : move(found, p);
  }

 private:
  static constexpr std::size_t slots = 16;

  struct Piece {
    std::size_t index = std::numeric_limits<std::size_t>::max();
    bool is_plain = false;
    Vector3 start = Vector3::Zero();
    Vector3 direction = Vector3::Zero();
    double length = 0.0;
  };
  enum class Beside { before, piece, behind };
  struct Found {
    double distance2;
    Beside beside;
  };
  [[nodiscard]] const Piece& at(std::size_t index) noexcept {
    Piece& piece = pieces_[index % slots];
    if (piece.index != index) take(index, piece);
    return piece;
  }
  void take(std::size_t index, Piece& piece) const noexcept;
  [[nodiscard]] static Beside beside(double along, const Piece& piece) noexcept {
    return along < 0.0 ? Beside::before : along > piece.length ? Beside::behind : Beside::piece;
  }
  [[nodiscard]] Found look(const Piece& piece, const Vector3& p) const noexcept {
    if (!piece.is_plain) return look_at_arc(piece, p);
    const Vector3 from_start = p - piece.start;
    const double along = from_start.dot(piece.direction);
    const double clamped = std::clamp(along, 0.0, piece.length);
    return {(from_start - clamped * piece.direction).squaredNorm(), beside(along, piece)};
  }
  [[nodiscard]] Found look_at_arc(const Piece& piece, const Vector3& p) const noexcept;
  /// On to the neighbours, as long as these are nearer.
  [[nodiscard]] double move(Found found, const Vector3& p) noexcept;

  Path path_;
  std::size_t here_ = 0;
  std::array<Piece, slots> pieces_{};
};

}  // namespace shapegcode::detail
