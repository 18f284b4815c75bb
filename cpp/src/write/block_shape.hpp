#pragma once

#include <array>
#include <cstdint>
#include <optional>

#include "shapegcode/write.hpp"

namespace shapegcode {

using BlockPosition = std::array<std::int64_t, axis_count>;  // in increments

/// The same as a vector, still in increments.
[[nodiscard]] inline Vector3 in_increments(const BlockPosition& p) {
  return {static_cast<double>(p[0]), static_cast<double>(p[1]), static_cast<double>(p[2])};
}

// An arc through two end points with a radius, as a controller builds it from R.
struct ChordArc {
  double chord = 0.0;
  double radius = 0.0;
  double sweep = 0.0;  // > 0
  Eigen::Vector2d along;
  Eigen::Vector2d left;  // unit, left of the chord
  Eigen::Vector2d start;
  double bulge_side = 0.0;  // +1: the arc bulges to the left of the chord

  [[nodiscard]] Eigen::Vector2d at(double fraction) const;
};

// What a block between two rounded positions is: its F, and its R if it is an arc. `options` must outlive it.
class BlockShape {
 public:
  BlockShape(const Eigen::Ref<const Eigen::MatrixXd>& grid, const Eigen::Ref<const Eigen::MatrixXd>& middle,
             const FitOptions& options);

  [[nodiscard]] BlockPosition rounded(std::uint32_t k) const;
  [[nodiscard]] Vector3 to_mm(const BlockPosition& p) const;

  // F, rounded up, that makes the block end just before its last tick, so that a controller that starts blocks on ticks
  // takes exactly the intended number of them, whatever its own rounding. What it then stands still may be no more than
  // half an increment of travel; a longer steady block may have an F that is exact. nullopt if no F of this resolution
  // will do.
  [[nodiscard]] std::optional<std::int64_t> feed(double length_mm, std::uint32_t periods) const;

  // The feeds from a block's own F up that it may as well have: it stands still a little longer at its end, far below
  // what counts.
  struct FeedRange {
    std::int64_t least, most;
  };
  [[nodiscard]] FeedRange feeds_like(const FittedBlock& block, double length_mm) const;

  // Length of a block from where it begins, as the controller runs it.
  [[nodiscard]] double length_mm(const BlockPosition& from, const FittedBlock& block) const;

  // Gives a block its F for the periods that it has. One too slow for the resolution of F is run a little faster, in
  // fewer whole periods.
  void set_feed(FittedBlock& block, double length_mm) const;

  // The arc that a controller makes of a block's words; `from`: where the block begins.
  [[nodiscard]] ChordArc arc_of(const BlockPosition& from, const FittedBlock& block) const;

  // An arc over some periods between two rounded positions, to last `periods`, if it follows every sample between
  // within a tolerance in increments; a single period needs no such check.
  struct Over {
    std::uint32_t first, end;
  };
  [[nodiscard]] std::optional<FittedBlock> arc(const BlockPosition& from, const BlockPosition& end, Over over,
                                               int normal, std::uint32_t periods, double tolerance_increments) const;

 private:
  [[nodiscard]] std::int64_t short_radius(double radius_increments, double chord_increments) const;
  [[nodiscard]] std::int64_t nearest_feed(double length_mm, std::uint32_t periods) const;
  [[nodiscard]] std::optional<ChordArc> chord_arc(const BlockPosition& from, const BlockPosition& to, int normal,
                                                  const Eigen::Vector2d& middle) const;

  Eigen::Ref<const Eigen::MatrixXd> grid_;
  Eigen::Ref<const Eigen::MatrixXd> middle_;
  const FitOptions& options_;
  std::int64_t ticks_per_period_;
};

}  // namespace shapegcode
