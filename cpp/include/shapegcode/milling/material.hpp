#pragma once

#include <cstddef>
#include <functional>
#include <span>
#include <vector>

#include <Eigen/Core>

#include "shapegcode/milling/force.hpp"
#include "shapegcode/path.hpp"

namespace shapegcode {

/// A closed polygon in the XY plane, mm; the last point joins the first.
using Ring = std::vector<Eigen::Vector2d>;

class MaterialLayer;
class ToolStep;

/// A workpiece of horizontal layers. Each is represented by the distance from its boundary on a grid, interpolated
/// bilinearly: a smooth boundary of radius r is accurate to h^2/(8 r), sharp edges to the grid spacing h. A tool
/// removes whole layers: those whose middle lies above its tip. Copies are independent.
class Material {
 public:
  /// `rings`: outlines of the stock, holes included (even-odd rule); `borders_mm`: heights in Z between the layers,
  /// ascending, from the bottom of the stock to its top; `resolution_mm`: grid spacing; a hundredth of the tool's
  /// diameter is a good choice. Throws Error(argument) if there is no ring, a ring has fewer than 3 points or encloses
  /// nothing at this resolution, a number is not finite, fewer than two borders or not ascending ones, a resolution
  /// that is not positive, or a grid that needs more than `memory_limit_bytes`.
  Material(std::span<const Ring> rings, std::span<const double> borders_mm, double resolution_mm,
           std::size_t memory_limit_bytes = default_memory_limit_bytes);
  ~Material();
  Material(const Material& other);
  Material(Material&& other) noexcept;
  Material& operator=(const Material& other);
  Material& operator=(Material&& other) noexcept;

  /// Number of layers.
  [[nodiscard]] std::size_t size() const noexcept { return middles_.size(); }
  [[nodiscard]] const MaterialLayer& layer(std::size_t i) const noexcept;
  /// Distance from the boundary of a layer, positive in material, limited to twice the grid spacing, mm.
  [[nodiscard]] double distance_mm(std::size_t layer, double x_mm, double y_mm) const noexcept;
  [[nodiscard]] const std::vector<double>& borders_mm() const noexcept { return borders_; }
  [[nodiscard]] double bottom_mm() const noexcept { return borders_.front(); }
  [[nodiscard]] double top_mm() const noexcept { return borders_.back(); }
  [[nodiscard]] double resolution_mm() const noexcept { return resolution_; }
  /// Corners of the rectangle around the original stock.
  [[nodiscard]] const Eigen::Vector2d& low_mm() const noexcept { return low_; }
  [[nodiscard]] const Eigen::Vector2d& high_mm() const noexcept { return high_; }

  /// Index of the lowest layer that a tool with its tip at this height removes; size() if the tip is above the middle
  /// of all layers.
  [[nodiscard]] std::size_t lowest_cut(double tip_mm) const noexcept;

  /// Whether there is material at a point; false outside of the stock.
  [[nodiscard]] bool is_material(double x_mm, double y_mm, double z_mm) const noexcept;

  /// Remaining volume, mm3.
  [[nodiscard]] double volume_mm3() const noexcept;

  /// Material in a vertical cylinder, mm3, such as a tool at its start position.
  [[nodiscard]] double volume_in_cylinder_mm3(double x_mm, double y_mm, double radius_mm, double bottom_mm,
                                              double top_mm) const noexcept;

  /// Top of the material over a rectangle, as `rows` rows along Y of `columns` values along X from the low corner on,
  /// the outer ones on its edges; NaN where there is no material. Throws Error(argument) on less than one row or
  /// column.
  [[nodiscard]] Eigen::MatrixXd heights_mm(const Eigen::Vector2d& low_mm, const Eigen::Vector2d& high_mm,
                                           std::ptrdiff_t rows, std::ptrdiff_t columns) const;

  /// Memory in use.
  [[nodiscard]] std::size_t bytes() const noexcept;

  /// Removes the material that a tool sweeps on a step in one layer; see MaterialLayer::remove. It must also be removed
  /// from all layers above: `sweep` relies on it. Throws Error(argument) if more memory than the limit is needed.
  bool remove(std::size_t layer, const ToolStep& step, double tool_radius_mm, bool continues);

  /// From now on removes a layer only if the tip reaches its bottom. The remaining material is then never
  /// underestimated, also under a ramp; the engagement on the ramp itself is underestimated.
  void take_whole_layers() noexcept { whole_layers_ = true; }

  /// Frees the memory of tiles that have become uniform.
  void compact();

  static constexpr std::size_t default_memory_limit_bytes = std::size_t{2} << 30U;

 private:
  void check_memory(std::size_t needed) const;

  std::vector<double> borders_;
  std::vector<double> middles_;
  double resolution_ = 0.0;
  bool whole_layers_ = false;
  std::vector<MaterialLayer> layers_;
  Eigen::Vector2d low_ = Eigen::Vector2d::Zero();
  Eigen::Vector2d high_ = Eigen::Vector2d::Zero();
  std::size_t memory_limit_;
  std::size_t tiles_ = 0;  // tiles with values, of all layers
};

/// Heights between layers for these paths in a stock from `bottom_mm` to `top_mm`: the heights of level moves (equal
/// within 1 um), the lowest points of ramps and plunges that cut, and steps of at most `ramp_step_mm` along ramps and
/// helices. Throws Error(argument) unless bottom < top and the step is positive and not below 1e-9 of the height.
[[nodiscard]] std::vector<double> layer_borders(std::span<const Path* const> paths, double bottom_mm, double top_mm,
                                                double ramp_step_mm);

/// Sampling of the engagement along a path.
struct SweepOptions {
  double step_mm = 0.0;  ///< largest distance between samples; 0: a fortieth of the tool's diameter
  /// Contacts less deep or less wide than this are ignored, as on a second pass along a finished wall.
  double touch_mm = 0.002;
  std::function<void(double s_mm)> progress;  ///< called from time to time with the distance travelled; may throw
};

/// Moves a cylindrical tool along a path through the material, removes the swept volume, and returns the engagement.
/// There is a sample at the end of every segment and at most one step apart in between, closer after a vertex. A sample
/// describes the contact of the tool's front half with the material left by the whole path before it; on ramps the
/// heights are those of the layers. Material inside the tool at the start of the path counts as removed. A rapid is
/// swept like any other move: a section above 0 is a collision. Layers with the same azimuths (within 1e-4 rad) share
/// an arc. Section times feed is the material removal rate, also for downward moves. Throws Error(argument) on a
/// diameter, step or touch that is not a positive number (touch: below 0), a step below 1e-9 of the path, an arc that
/// is not in the XY plane, or if the material needs more memory than its limit; the material is then cut up to that
/// point.
[[nodiscard]] EngagementTrack sweep(Material& material, const Path& path, double tool_diameter_mm,
                                    const SweepOptions& options = {});

}  // namespace shapegcode
