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

/// A work piece of horizontal layers, each from one border in Z to the next and known by the distance from its boundary
/// on a grid, interpolated bilinearly: a smooth boundary of radius r is known to h^2/(8 r), kinks to the distance h of
/// the nodes. A tool takes away whole layers: those whose middle lies above its tip. Copies are independent of each
/// other.
class Material {
 public:
  /// `rings`: outlines of the stock, holes included (even-odd rule); `borders_mm`: heights in Z between the layers,
  /// ascending, from the bottom of the stock to its top; `resolution_mm`: grid, a hundredth of the tool's diameter is
  /// a good choice. Throws Error(argument) if there is no ring, a ring has fewer than 3 points or encloses nothing
  /// at this resolution, a number is not finite, fewer than two borders or not ascending ones, a resolution that is not
  /// positive, or a grid that needs more than `memory_limit_bytes`.
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
  /// Distance from the boundary of a layer, positive in material, limited to two nodes of the grid, mm.
  [[nodiscard]] double distance_mm(std::size_t layer, double x_mm, double y_mm) const noexcept;
  [[nodiscard]] const std::vector<double>& borders_mm() const noexcept { return borders_; }
  [[nodiscard]] double bottom_mm() const noexcept { return borders_.front(); }
  [[nodiscard]] double top_mm() const noexcept { return borders_.back(); }
  [[nodiscard]] double resolution_mm() const noexcept { return resolution_; }
  /// Corners of the rectangle around the stock as it was.
  [[nodiscard]] const Eigen::Vector2d& low_mm() const noexcept { return low_; }
  [[nodiscard]] const Eigen::Vector2d& high_mm() const noexcept { return high_; }

  /// Index of the lowest layer that a tool with its tip at this height takes away: those whose middle lies above the
  /// tip; size() if it is above all of them.
  [[nodiscard]] std::size_t lowest_cut(double tip_mm) const noexcept;

  /// Whether there is material at a point; false outside of the stock.
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
  double resolution_ = 0.0;
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
