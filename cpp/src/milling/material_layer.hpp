// Private to milling: one layer of a Material.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <deque>
#include <span>
#include <vector>

#include "milling/tool_step.hpp"
#include "shapegcode/milling/material.hpp"

namespace shapegcode {

/// Material between two heights: on a grid, how far each node lies from the nearest point without material (above 0: in
/// material, below 0: outside). Between the nodes the distance is interpolated bilinearly, so that a smooth boundary
/// is known much better than the grid: to h^2/(8 r) at a radius r; only at its kinks the error is of order h. Distances
/// are kept up to `band_mm`; square tiles that lie wholly beyond carry one flag instead of values.
class MaterialLayer {
 public:
  /// Nodes `resolution_mm` apart. Material inside an odd number of rings (even-odd rule). Nothing is checked here: see
  /// Material.
  MaterialLayer(std::span<const Ring> rings, double resolution_mm);

  /// Distance from the boundary, positive in material, mm; within +- band_mm.
  [[nodiscard]] double distance_mm(double x_mm, double y_mm) const noexcept;

  /// No node within `radius_mm` of a point lies in a tile with material.
  [[nodiscard]] bool is_empty_around(double x_mm, double y_mm, double radius_mm) const noexcept;

  /// Takes away what a tool of this radius sweeps on a step. `continues`: the disc at the step's start was swept
  /// before, so that only what lies ahead of it is looked at. Returns whether any distance changed by more than
  /// rounding.
  bool remove(const ToolStep& step, double tool_radius_mm, bool continues);

  /// Whether any node is in material.
  [[nodiscard]] bool has_material() const noexcept;

  /// Area of material, mm2.
  [[nodiscard]] double area_mm2() const noexcept;

  /// Area of material in a disc, mm2.
  [[nodiscard]] double area_in_disc_mm2(double x_mm, double y_mm, double radius_mm) const noexcept;

  /// Turns tiles without a boundary back into a flag; what stays known does not change.
  void compact();

  [[nodiscard]] double resolution_mm() const noexcept { return spacing_; }
  /// Distances are kept up to here, mm.
  [[nodiscard]] double band_mm() const noexcept { return band_; }
  /// Tiles that carry values.
  [[nodiscard]] std::size_t tiles() const noexcept { return pool_.size() - free_.size(); }
  [[nodiscard]] std::size_t bytes() const noexcept;

  static constexpr int tile_nodes = 32;  ///< along an edge
  static constexpr std::size_t tile_bytes = sizeof(float) * tile_nodes * tile_nodes;
  static constexpr double band_nodes = 2.0;  ///< a cell that the boundary crosses has all nodes within sqrt(2)

 private:
  using Tile = std::array<float, static_cast<std::size_t>(tile_nodes) * tile_nodes>;
  static constexpr std::int32_t full = -1;
  static constexpr std::int32_t empty = -2;

  struct Sweep;

  bool remove_in_row(const Sweep& sweep, std::int64_t j);
  bool remove_nodes(const Sweep& sweep, std::int64_t j, std::int64_t first, std::int64_t last);
  struct Boundary;
  [[nodiscard]] Boundary boundary_of(std::span<const Ring> rings) const;
  void fill(std::span<const Ring> rings);
  [[nodiscard]] double node(std::int64_t i, std::int64_t j) const noexcept;
  [[nodiscard]] double x_of(std::int64_t i) const noexcept { return x0_ + spacing_ * static_cast<double>(i); }
  [[nodiscard]] double y_of(std::int64_t j) const noexcept { return y0_ + spacing_ * static_cast<double>(j); }
  std::int32_t new_tile(float value);

  double spacing_;
  double band_;
  double x0_ = 0.0;
  double y0_ = 0.0;
  std::int64_t columns_ = 0;  // of tiles
  std::int64_t rows_ = 0;
  std::vector<std::int32_t> index_;  // into pool_, or a flag
  std::deque<Tile> pool_;
  std::vector<std::int32_t> free_;
  std::size_t compact_at_tiles_ = 0;
};

}  // namespace shapegcode
