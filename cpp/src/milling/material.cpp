#include "shapegcode/milling/material.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include "milling/checks.hpp"
#include "milling/material_layer.hpp"

namespace shapegcode {
namespace {

using detail::check_positive;
using detail::refuse;

using Eigen::Vector2d;

constexpr double level_mm = 1e-6;  // a move that climbs by less stays on its level
constexpr double same_height_mm = 1e-3;
constexpr double min_slope = 1e-3;  // horizontal share below which a move is a plunge
constexpr double megabyte = 1e6;
constexpr double largest_mm = 1e9;       // resolution
constexpr double max_nodes_away = 1e12;  // so far from the origin three digits of a position within its cell are left

double cross(const Vector2d& a, const Vector2d& b) noexcept { return a.x() * b.y() - a.y() * b.x(); }

void check_rings(std::span<const Ring> rings) {
  if (rings.empty()) refuse("the stock has no outline");
  for (std::size_t r = 0; r < rings.size(); ++r) {
    const Ring& ring = rings[r];
    if (ring.size() < 3) {
      refuse("ring {} of the stock has {} points, must have at least 3", r, ring.size());
    }
    double doubled_area = 0.0;
    for (std::size_t k = 0; k < ring.size(); ++k) {
      if (!ring[k].allFinite()) {
        refuse("point {} of ring {} of the stock is not finite", k, r);
      }
      doubled_area += cross(ring[k] - ring[0], ring[(k + 1) % ring.size()] - ring[0]);
    }
    if (doubled_area == 0.0) refuse("ring {} of the stock encloses no area", r);
  }
}

void check_borders(std::span<const double> borders) {
  if (borders.size() < 2) {
    refuse("the stock has {} heights between layers, must have at least 2", borders.size());
  }
  for (std::size_t i = 0; i < borders.size(); ++i) {
    if (!std::isfinite(borders[i])) refuse("height {} between layers is not finite", i);
    if (i > 0 && !(borders[i] > borders[i - 1])) {
      refuse("height {} mm between layers must lie above its predecessor, {} mm", borders[i], borders[i - 1]);
    }
  }
}

}  // namespace

Material::Material(std::span<const Ring> rings, std::span<const double> borders_mm, double resolution_mm,
                   std::size_t memory_limit_bytes)
    : borders_(borders_mm.begin(), borders_mm.end()), resolution_(resolution_mm), memory_limit_(memory_limit_bytes) {
  check_rings(rings);
  check_borders(borders_mm);
  check_positive(resolution_mm, "resolution", "mm");
  if (resolution_mm > largest_mm) refuse("resolution is {} mm, limit {:g} mm", resolution_mm, largest_mm);
  double outline_mm = 0.0;
  low_ = high_ = rings[0][0];
  for (const Ring& ring : rings) {
    for (std::size_t k = 0; k < ring.size(); ++k) {
      low_ = low_.cwiseMin(ring[k]);
      high_ = high_.cwiseMax(ring[k]);
      outline_mm += (ring[(k + 1) % ring.size()] - ring[k]).norm();
    }
  }
  const double furthest_mm = std::max(low_.cwiseAbs().maxCoeff(), high_.cwiseAbs().maxCoeff());
  if (!(furthest_mm <= resolution_mm * max_nodes_away)) {
    refuse("the stock reaches to {} mm from the origin, limit {:g} mm at a resolution of {} mm", furthest_mm,
           resolution_mm * max_nodes_away, resolution_mm);
  }
  // The flags of all tiles, and the tiles along the outline: an estimate before anything is allocated.
  const double tile_mm = resolution_mm * MaterialLayer::tile_nodes;
  const Vector2d size = (high_ - low_) / tile_mm;
  const double all_tiles = (size.x() + 1.0) * (size.y() + 1.0);
  const double needed = static_cast<double>(borders_.size() - 1) *
                        (all_tiles * sizeof(std::int32_t) +
                         std::min(all_tiles, outline_mm / tile_mm) * static_cast<double>(MaterialLayer::tile_bytes));
  if (!(needed < static_cast<double>(memory_limit_))) {
    refuse("the stock needs at least {:g} MB in {} layers at a resolution of {} mm, limit {:g} MB", needed / megabyte,
           borders_.size() - 1, resolution_mm, static_cast<double>(memory_limit_) / megabyte);
  }
  for (std::size_t i = 1; i < borders_.size(); ++i) middles_.push_back(0.5 * (borders_[i - 1] + borders_[i]));
  layers_.assign(middles_.size(), MaterialLayer(rings, resolution_mm));
  for (const MaterialLayer& layer : layers_) tiles_ += layer.tiles();
  if (!layers_.front().has_material()) {
    refuse("the outlines of the stock enclose no material at a resolution of {} mm", resolution_mm);
  }
}

Material::~Material() = default;
Material::Material(const Material& other) = default;
Material::Material(Material&& other) noexcept = default;
Material& Material::operator=(const Material& other) = default;
Material& Material::operator=(Material&& other) noexcept = default;

const MaterialLayer& Material::layer(std::size_t i) const noexcept { return layers_[i]; }

double Material::distance_mm(std::size_t layer, double x_mm, double y_mm) const noexcept {
  return layers_[layer].distance_mm(x_mm, y_mm);
}

std::size_t Material::lowest_cut(double tip_mm) const noexcept {
  if (whole_layers_) {
    const auto reached = std::lower_bound(borders_.begin(), borders_.end() - 1, tip_mm - same_height_mm);
    return static_cast<std::size_t>(reached - borders_.begin());
  }
  return static_cast<std::size_t>(std::upper_bound(middles_.begin(), middles_.end(), tip_mm) - middles_.begin());
}

bool Material::is_material(double x_mm, double y_mm, double z_mm) const noexcept {
  if (!(z_mm >= bottom_mm() && z_mm <= top_mm())) return false;
  const auto above = std::upper_bound(borders_.begin() + 1, borders_.end() - 1, z_mm);
  return layers_[static_cast<std::size_t>(above - borders_.begin()) - 1].distance_mm(x_mm, y_mm) > 0.0;
}

double Material::volume_mm3() const noexcept {
  double volume = 0.0;
  for (std::size_t i = 0; i < size(); ++i) volume += layers_[i].area_mm2() * (borders_[i + 1] - borders_[i]);
  return volume;
}

double Material::volume_in_cylinder_mm3(double x_mm, double y_mm, double radius_mm, double bottom_mm,
                                        double top_mm) const noexcept {
  double volume = 0.0;
  for (std::size_t i = 0; i < size(); ++i) {
    const double height = std::min(borders_[i + 1], top_mm) - std::max(borders_[i], bottom_mm);
    if (height > 0.0) volume += height * layers_[i].area_in_disc_mm2(x_mm, y_mm, radius_mm);
  }
  return volume;
}

Eigen::MatrixXd Material::heights_mm(const Vector2d& low_mm, const Vector2d& high_mm, std::ptrdiff_t rows,
                                     std::ptrdiff_t columns) const {
  if (rows < 1 || columns < 1) {
    refuse("a picture of {} x {} points, must have at least one row and column", rows, columns);
  }
  const auto share = [](std::ptrdiff_t k, std::ptrdiff_t count) {
    return count > 1 ? static_cast<double>(k) / static_cast<double>(count - 1) : 0.5;
  };
  Eigen::MatrixXd heights = Eigen::MatrixXd::Constant(rows, columns, std::numeric_limits<double>::quiet_NaN());
  for (std::ptrdiff_t row = 0; row < rows; ++row) {
    const double y = low_mm.y() + (high_mm.y() - low_mm.y()) * share(row, rows);
    for (std::ptrdiff_t column = 0; column < columns; ++column) {
      const double x = low_mm.x() + (high_mm.x() - low_mm.x()) * share(column, columns);
      for (std::size_t i = size(); i-- > 0;) {
        if (layers_[i].distance_mm(x, y) > 0.0) {
          heights(row, column) = borders_[i + 1];
          break;
        }
      }
    }
  }
  return heights;
}

std::size_t Material::bytes() const noexcept {
  std::size_t sum = sizeof(Material);
  for (const MaterialLayer& layer : layers_) sum += layer.bytes();
  return sum;
}

bool Material::remove(std::size_t layer, const ToolStep& step, double tool_radius_mm, bool continues) {
  tiles_ -= layers_[layer].tiles();
  const bool changed = layers_[layer].remove(step, tool_radius_mm, continues);
  tiles_ += layers_[layer].tiles();
  if (tiles_ * MaterialLayer::tile_bytes > memory_limit_) compact();
  return changed;
}

void Material::compact() {
  tiles_ = 0;
  for (MaterialLayer& layer : layers_) {
    layer.compact();
    tiles_ += layer.tiles();
  }
  check_memory(tiles_ * MaterialLayer::tile_bytes);
}

void Material::check_memory(std::size_t needed) const {
  if (needed <= memory_limit_) return;
  refuse("what is left of the stock needs {:g} MB at a resolution of {} mm, limit {:g} MB",
         static_cast<double>(needed) / megabyte, resolution_mm(), static_cast<double>(memory_limit_) / megabyte);
}

std::vector<double> layer_borders(std::span<const Path* const> paths, double bottom_mm, double top_mm,
                                  double ramp_step_mm) {
  if (!(bottom_mm < top_mm) || !std::isfinite(bottom_mm) || !std::isfinite(top_mm)) {
    refuse("the stock reaches from {} to {} mm, its bottom must lie below its top", bottom_mm, top_mm);
  }
  if (!(ramp_step_mm > 0.0)) {
    refuse("layers of ramps are {} mm thick, must be above 0", ramp_step_mm);
  }
  detail::check_pieces(top_mm - bottom_mm, ramp_step_mm, "a layer");
  std::vector<double> levels{bottom_mm, top_mm};
  std::vector<std::pair<double, double>> ramps;
  for (const Path* path : paths) {
    bool falls = false;
    for (const Segment& segment : path->segments()) {
      const bool cuts = segment.kind != SegmentKind::rapid;
      const double climb = segment.end_mm.z() - segment.start_mm.z();
      if (falls && !(cuts && climb < -level_mm)) levels.push_back(segment.start_mm.z());
      falls = cuts && climb < -level_mm;
      if (std::abs(climb) <= level_mm) {
        levels.push_back(segment.start_mm.z());
      } else if (cuts && std::abs(climb) < segment.length_mm * std::sqrt(1.0 - min_slope * min_slope)) {
        ramps.push_back(std::minmax(segment.start_mm.z(), segment.end_mm.z()));
      }
    }
    if (falls) levels.push_back(path->segments().back().end_mm.z());
  }
  std::sort(levels.begin(), levels.end());
  std::sort(ramps.begin(), ramps.end());
  std::vector<double> borders{bottom_mm};
  for (const double level : levels) {
    if (level > borders.back() + same_height_mm && level < top_mm - same_height_mm) borders.push_back(level);
  }
  borders.push_back(top_mm);
  // Heights that ramps pass, as intervals that do not overlap.
  std::vector<std::pair<double, double>> passed;
  for (const auto& ramp : ramps) {
    if (!passed.empty() && ramp.first <= passed.back().second) {
      passed.back().second = std::max(passed.back().second, ramp.second);
    } else {
      passed.push_back(ramp);
    }
  }
  std::vector<double> fine{borders.front()};
  for (std::size_t i = 1; i < borders.size(); ++i) {
    const double low = borders[i - 1];
    const double high = borders[i];
    const bool ramped = std::any_of(passed.begin(), passed.end(), [&](const auto& ramp) {
      return ramp.first < high - same_height_mm && ramp.second > low + same_height_mm;
    });
    const double pieces = ramped ? std::max(1.0, std::ceil((high - low) / ramp_step_mm - 1e-9)) : 1.0;
    for (double k = 1.0; k < pieces; ++k) fine.push_back(low + (high - low) * k / pieces);
    fine.push_back(high);
  }
  return fine;
}

}  // namespace shapegcode
