#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <deque>
#include <functional>
#include <span>
#include <vector>

#include <Eigen/Core>

#include "shapegcode/milling/force.hpp"
#include "shapegcode/path.hpp"

namespace shapegcode {

/// A closed polygon in the XY plane, mm; the last point joins the first.
using Ring = std::vector<Eigen::Vector2d>;

/// A short way of the tool's axis in the XY plane, a line or an arc of less than half a turn, and the distance from it.
/// A line is an arc without curvature; coordinates count from the start, so that large arcs lose no digits.
class ToolStep {
 public:
  /// `curvature_per_mm` > 0 turns left, < 0 right, 0 is a line. Start and end may be the same point.
  ToolStep(const Eigen::Vector2d& from, const Eigen::Vector2d& to, double curvature_per_mm = 0.0)
      : from_(from), chord_(to - from), curvature_(curvature_per_mm) {
    const double length = chord_.norm();
    if (length > 0.0) {
      const Eigen::Vector2d along = chord_ / length;
      const double sine = std::clamp(0.5 * length * curvature_, -1.0, 1.0);
      const double cosine = std::sqrt(1.0 - sine * sine);
      const Eigen::Vector2d left(-along.y(), along.x());
      start_tangent_ = cosine * along - sine * left;
      end_tangent_ = cosine * along + sine * left;
    } else {
      curvature_ = 0.0;  // a line across the X axis without length: beside it only where this is the distance, too
      start_tangent_ = end_tangent_ = Eigen::Vector2d::UnitX();
    }
  }

  [[nodiscard]] const Eigen::Vector2d& from() const noexcept { return from_; }
  [[nodiscard]] const Eigen::Vector2d& chord() const noexcept { return chord_; }
  [[nodiscard]] double curvature() const noexcept { return curvature_; }
  [[nodiscard]] const Eigen::Vector2d& start_tangent() const noexcept { return start_tangent_; }

  /// What the distance is made of at a place (x, y) from the start. Beside the arc (weight 1) it is
  /// |offset / (1 + sqrt(square))|, where `square` is the squared ratio of the place's distance from the arc's centre
  /// to its radius; elsewhere (weight 0) it is the root of `end`, the squared distance of the nearer end. In between,
  /// for 1 nm, both are the same. A weight instead of a choice keeps rows of a grid free of branches.
  template <typename Scalar>
  struct Parts {
    Scalar offset;
    Scalar square;
    Scalar end;
    Scalar beside;

    /// The squared distance; `root` is that of `square`, 1 on a line.
    [[nodiscard]] Scalar squared(Scalar root) const noexcept {
      const Scalar aside = offset / (Scalar(1) + root);
      return end + beside * (aside * aside - end);
    }
  };

  /// The constants of a step as the kernels want them: double for single places, float for rows of a grid.
  template <typename Scalar>
  struct Shape {
    explicit Shape(const ToolStep& step)
        : curvature(static_cast<Scalar>(step.curvature_)),
          t0x(static_cast<Scalar>(step.start_tangent_.x())),
          t0y(static_cast<Scalar>(step.start_tangent_.y())),
          t1x(static_cast<Scalar>(step.end_tangent_.x())),
          t1y(static_cast<Scalar>(step.end_tangent_.y())),
          cx(static_cast<Scalar>(step.chord_.x())),
          cy(static_cast<Scalar>(step.chord_.y())) {}

    [[nodiscard]] Parts<Scalar> parts(Scalar x, Scalar y) const noexcept {
      const Scalar squared = x * x + y * y;
      const Scalar ex = x - cx;
      const Scalar ey = y - cy;
      const Scalar offset = curvature * squared - Scalar(2) * (y * t0x - x * t0y);
      const Scalar square = std::abs(Scalar(1) + curvature * offset);  // below 0 by rounding only
      const Scalar end = std::min(squared, ex * ex + ey * ey);
      const Scalar within = std::min(x * t0x + y * t0y, -(ex * t1x + ey * t1y));  // mm from the nearer end's normal
      const Scalar beside = std::min(std::max(within * Scalar(1e6), Scalar(0)), Scalar(1));
      return {offset, square, end, beside};
    }

    Scalar curvature, t0x, t0y, t1x, t1y, cx, cy;
  };

  /// Distance of a place from the step, mm.
  [[nodiscard]] double distance_mm(const Eigen::Vector2d& place) const noexcept {
    const Eigen::Vector2d v = place - from_;
    const Parts<double> p = Shape<double>(*this).parts(v.x(), v.y());
    return std::sqrt(p.squared(std::sqrt(p.square)));
  }

 private:
  Eigen::Vector2d from_;
  Eigen::Vector2d chord_;
  double curvature_;
  Eigen::Vector2d start_tangent_;
  Eigen::Vector2d end_tangent_;
};

/// Material between two heights: on a grid, how far each node lies from the nearest place without material (above 0: in
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

  /// No node within `radius_mm` of a place lies in a tile with material.
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

/// A work piece of horizontal layers, each a MaterialLayer from one border in Z to the next. A tool takes away whole
/// layers: those whose middle lies above its tip. Copies are independent of each other.
class Material {
 public:
  /// `rings`: outlines of the stock, holes included (even-odd rule); `borders_mm`: heights in Z between the layers,
  /// ascending, from the bottom of the stock to its top; `resolution_mm`: grid, a hundredth of the tool's diameter is
  /// a good choice. Throws Error(argument) if there is no ring, a ring has fewer than 3 points or encloses nothing
  /// at this resolution, a number is not finite, fewer than two borders or not ascending ones, a resolution that is not
  /// positive, or a grid that needs more than `memory_limit_bytes`.
  Material(std::span<const Ring> rings, std::span<const double> borders_mm, double resolution_mm,
           std::size_t memory_limit_bytes = default_memory_limit_bytes);

  [[nodiscard]] std::size_t size() const noexcept { return layers_.size(); }
  [[nodiscard]] const MaterialLayer& layer(std::size_t i) const noexcept { return layers_[i]; }
  [[nodiscard]] const std::vector<double>& borders_mm() const noexcept { return borders_; }
  [[nodiscard]] double bottom_mm() const noexcept { return borders_.front(); }
  [[nodiscard]] double top_mm() const noexcept { return borders_.back(); }
  [[nodiscard]] double resolution_mm() const noexcept { return layers_.front().resolution_mm(); }
  /// Corners of the rectangle around the stock as it was.
  [[nodiscard]] const Eigen::Vector2d& low_mm() const noexcept { return low_; }
  [[nodiscard]] const Eigen::Vector2d& high_mm() const noexcept { return high_; }

  /// Index of the lowest layer that a tool with its tip at this height takes away: those whose middle lies above the
  /// tip; size() if it is above all of them.
  [[nodiscard]] std::size_t lowest_cut(double tip_mm) const noexcept;

  /// Whether there is material at a place; false outside of the stock.
  [[nodiscard]] bool is_material(double x_mm, double y_mm, double z_mm) const noexcept;

  /// What is left, mm3.
  [[nodiscard]] double volume_mm3() const noexcept;

  /// Material in an upright cylinder, mm3, such as a tool that stands at its start.
  [[nodiscard]] double volume_in_cylinder_mm3(double x_mm, double y_mm, double radius_mm, double bottom_mm,
                                              double top_mm) const noexcept;

  /// Top of the material over a rectangle, as `rows` rows of `columns` values from the low corner on, the outer ones on
  /// its edges; NaN where there is none. Throws Error(argument) on less than one row or column.
  [[nodiscard]] Eigen::MatrixXd heights_mm(const Eigen::Vector2d& low_mm, const Eigen::Vector2d& high_mm,
                                           std::ptrdiff_t rows, std::ptrdiff_t columns) const;

  /// Memory in use.
  [[nodiscard]] std::size_t bytes() const noexcept;

  /// Takes away what a tool sweeps on a step in one layer; see MaterialLayer::remove. What is taken from a layer must
  /// be taken from all above as well: `sweep` relies on it. Throws Error(argument) where that needs more memory than
  /// the limit.
  bool remove(std::size_t layer, const ToolStep& step, double tool_radius_mm, bool continues);

  /// From now on only whole layers are taken away: those whose bottom the tip reaches. What is then left is never less
  /// than what is really there, also under a ramp; what is met on the ramp itself is less.
  void take_whole_layers() noexcept { whole_layers_ = true; }

  /// Gives back the memory of what is uniform by now.
  void compact();

  static constexpr std::size_t default_memory_limit_bytes = std::size_t{2} << 30U;

 private:
  void check_memory(std::size_t needed) const;

  std::vector<double> borders_;
  std::vector<double> middles_;
  bool whole_layers_ = false;
  std::vector<MaterialLayer> layers_;
  Eigen::Vector2d low_ = Eigen::Vector2d::Zero();
  Eigen::Vector2d high_ = Eigen::Vector2d::Zero();
  std::size_t memory_limit_;
  std::size_t tiles_ = 0;  // that carry values, of all layers
};

/// Heights between layers for these paths in a stock from `bottom_mm` to `top_mm`: the heights at which the tool moves
/// on a level (taken as one within 1 um), the lowest points of ramps and plunges that cut, and steps of at most
/// `ramp_step_mm` wherever a ramp or helix passes. Throws Error(argument) unless bottom < top and the step is positive
/// and not below 1e-9 of the height.
[[nodiscard]] std::vector<double> layer_borders(std::span<const Path* const> paths, double bottom_mm, double top_mm,
                                                double ramp_step_mm);

/// How finely engagement is looked at along a path.
struct SweepOptions {
  double step_mm = 0.0;  ///< largest distance between samples; 0: a fortieth of the tool's diameter
  /// What is met less wide than this across the direction of feed is no contact: a second pass along a finished wall.
  double touch_mm = 0.002;
  std::function<void(double s_mm)> progress;  ///< called now and then with the distance travelled; may throw
};

/// Moves a cylindrical tool along a path through the material, takes away what it sweeps, and tells what it met.
/// A sample stands at the end of every segment and in between at most a step apart, closer behind a vertex. It tells
/// what the front half of the tool meets of the material that all of the path up to the sample has left, and so what
/// is cut there; on ramps the heights are those of the layers. What stands in the tool at the start of the path counts
/// as gone. A rapid is swept like any other move: a section above 0 is a collision. Layers with the same azimuths
/// (within 1e-4 rad) share an arc. Section times feed is the material removal rate, downward moves included.
/// Throws Error(argument) on a diameter, step or touch that is not a positive number (touch: below 0), a step below
/// 1e-9 of the path, an arc that is not in the XY plane, or if the material needs more memory than its limit; the
/// material is then cut up to there.
[[nodiscard]] EngagementTrack sweep(Material& material, const Path& path, double tool_diameter_mm,
                                    const SweepOptions& options = {});

}  // namespace shapegcode
