#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "shapegcode/path.hpp"
#include "shapegcode/plant/modal.hpp"

// Blocks of constant feed as fewer blocks whose feed is linear along their path (FLIN of a SINUMERIK). The control
// approaches F linearly over the path of a block, from the F before it to its own (easymanua.ls 662833 p. 458, 32519
// p. 1606), so a block of length L from v0 to v1 lasts L ln(v1 / v0) / (v1 - v0).
namespace shapegcode {

/// A block that replaces blocks of constant feed.
struct LinearBlock {
  std::uint32_t first = 0;           ///< index of the first block that it replaces
  std::uint32_t last = 0;            ///< index of the last one
  Vector3 end_mm = Vector3::Zero();  ///< where it ends
  double radius_mm = 0.0;            ///< of an arc; 0: a line
  double sweep_rad = 0.0;            ///< of an arc
  double length_mm = 0.0;            ///< of its path
  int normal = 2;                    ///< axis perpendicular to the plane of an arc
  double start_feed_mm_per_min = 0.0;
  double feed_mm_per_min = 0.0;  ///< at its end
  bool sets_feed = false;  ///< its start feed differs from the feed of the block before: a line before it sets the feed
  bool is_linear = true;   ///< false: its feed is constant

  [[nodiscard]] double duration_s() const noexcept;
};

/// Time of a block whose speed is linear along its path.
[[nodiscard]] double linear_duration_s(double length_mm, double start_mm_per_s, double end_mm_per_s) noexcept;

/// Speed at one end of a block of a given duration from the speed at its other end; none: there is no such speed.
[[nodiscard]] std::optional<double> linear_end_speed(double length_mm, double start_mm_per_s, double time_s) noexcept;

/// Distance along a block whose speed is linear along its path, at a time since its start.
[[nodiscard]] double linear_distance_mm(double length_mm, double start_mm_per_s, double end_mm_per_s,
                                        double time_s) noexcept;

/// Where the motion of blocks is at ascending times; after the last block its end. There must be a block.
[[nodiscard]] std::vector<Vector3> linear_positions_mm(const Vector3& start_mm, std::span<const LinearBlock> blocks,
                                                       std::span<const double> times_s);

/// Joins blocks of constant feed, each of whole periods, into blocks of linear feed. At the ends of the periods the
/// motion stays within a tolerance of the original motion. `joints`: ascending indices of blocks at which a joined
/// block must begin; speeds at the end of the path are chosen so that `modes` are at rest there.
[[nodiscard]] std::vector<LinearBlock> linear_blocks(const Path& path, double period_s, double tolerance_mm,
                                                     std::span<const std::uint32_t> joints, const AxisModes& modes);

/// Largest distance between the motions of the joined blocks and of the blocks of constant feed, at the ends of the
/// periods, mm.
[[nodiscard]] double largest_difference_mm(const Path& path, std::span<const LinearBlock> blocks, double period_s);

}  // namespace shapegcode
