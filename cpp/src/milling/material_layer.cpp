#include "milling/material_layer.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

namespace shapegcode {
namespace {

using Eigen::Vector2d;

constexpr std::int64_t edge = MaterialLayer::tile_nodes;
constexpr float min_change = 1e-5F;  // mm; less is rounding
constexpr std::size_t min_growth_tiles = 32;

double distance_to_edge(const Vector2d& point, const Vector2d& a, const Vector2d& b) noexcept {
  const Vector2d along = b - a;
  const double squared = along.squaredNorm();
  const double share = squared > 0.0 ? std::clamp((point - a).dot(along) / squared, 0.0, 1.0) : 0.0;
  return (point - a - share * along).norm();
}

/// The first index at or after a position on the grid, within 0 ... count.
std::int64_t first_at(double position, double count) noexcept {
  if (!(position > 0.0)) return 0;
  if (position >= count) return static_cast<std::int64_t>(count);
  const auto below = static_cast<std::int64_t>(position);
  return below + (static_cast<double>(below) < position ? 1 : 0);
}

/// Share of a node's cell that is material.
double coverage(double distance, double spacing) noexcept { return std::clamp(distance / spacing + 0.5, 0.0, 1.0); }

}  // namespace

/// A step and how far it reaches. Lengths and positions are in nodes of the grid but for the shape and the radius.
struct MaterialLayer::Sweep {
  Sweep(const ToolStep& step, double radius_mm, double band_mm, double spacing, const Vector2d& origin, bool goes_on)
      : shape(step),
        start_mm(step.from()),
        from((step.from() - origin) / spacing),
        middle((step.from() + 0.5 * step.chord() - origin) / spacing),
        ahead(step.start_tangent()),
        radius(static_cast<float>(radius_mm)),
        reach((radius_mm + band_mm + 0.5 * step.chord().norm()) / spacing),
        inner(std::max(0.0, radius_mm - band_mm) / spacing),
        continues(goes_on) {
    // Behind an arc's start its end may still be nearer, in a wedge of half the angle that the arc turns through.
    const double half_turn = std::asin(std::min(1.0, 0.5 * step.chord().norm() * std::abs(step.curvature())));
    behind = (radius_mm + band_mm) / spacing * std::tan(std::min(half_turn, 1.5));
    per_ahead_x = ahead.x() != 0.0 ? 1.0 / ahead.x() : 0.0;
  }

  ToolStep::Shape<float> shape;
  Vector2d start_mm;
  Vector2d from;
  Vector2d middle;
  Vector2d ahead;  // direction at the start
  double per_ahead_x = 0.0;
  float radius;         // mm
  double reach;         // nothing changes further from the middle
  double inner;         // within, the disc at the start has swept everything
  double behind = 0.0;  // nothing changes further behind the start
  bool continues;
};

MaterialLayer::MaterialLayer(std::span<const Ring> rings, double resolution_mm)
    : spacing_(resolution_mm), band_(band_nodes * resolution_mm) {
  Vector2d low = rings.front().front();
  Vector2d high = low;
  for (const Ring& ring : rings) {
    for (const Vector2d& point : ring) {
      low = low.cwiseMin(point);
      high = high.cwiseMax(point);
    }
  }
  // One more node than the band on every side, so that all beyond the grid is as far outside as the grid reaches.
  const double margin = band_ + spacing_;
  x0_ = low.x() - margin;
  y0_ = low.y() - margin;
  columns_ = static_cast<std::int64_t>((high.x() + margin - x0_) / spacing_ / edge) + 1;
  rows_ = static_cast<std::int64_t>((high.y() + margin - y0_) / spacing_ / edge) + 1;
  index_.assign(static_cast<std::size_t>(columns_ * rows_), empty);
  fill(rings);
}

/// The stock's boundary as the grid meets it.
struct MaterialLayer::Boundary {
  struct Edge {
    Vector2d a;
    Vector2d b;
  };
  std::vector<std::pair<std::int64_t, Edge>> near;  // to which tiles, ascending
  std::vector<std::vector<double>> crossings;       // per grid row, ascending

  [[nodiscard]] bool inside(std::size_t row, double x) const {
    const std::vector<double>& at = crossings[row];
    return (std::upper_bound(at.begin(), at.end(), x) - at.begin()) % 2 == 1;
  }
};

MaterialLayer::Boundary MaterialLayer::boundary_of(std::span<const Ring> rings) const {
  Boundary boundary;
  auto& [near, crossings] = boundary;
  crossings.resize(static_cast<std::size_t>(rows_ * edge));
  const double tile_mm = spacing_ * edge;
  const double tile_reach = tile_mm * std::sqrt(0.5) + band_;
  const auto tile_of = [&](double from_origin, std::int64_t count) {
    return std::clamp(static_cast<std::int64_t>(std::floor(from_origin / tile_mm)), std::int64_t{0}, count - 1);
  };
  for (const Ring& ring : rings) {
    for (std::size_t k = 0; k < ring.size(); ++k) {
      const Boundary::Edge e{ring[k], ring[(k + 1) % ring.size()]};
      const Vector2d low = e.a.cwiseMin(e.b) - Vector2d(x0_ + band_, y0_ + band_);
      const Vector2d high = e.a.cwiseMax(e.b) - Vector2d(x0_ - band_, y0_ - band_);
      for (std::int64_t row = tile_of(low.y(), rows_); row <= tile_of(high.y(), rows_); ++row) {
        for (std::int64_t column = tile_of(low.x(), columns_); column <= tile_of(high.x(), columns_); ++column) {
          const Vector2d centre(x_of(column * edge) + 0.5 * tile_mm, y_of(row * edge) + 0.5 * tile_mm);
          if (distance_to_edge(centre, e.a, e.b) <= tile_reach) {
            near.emplace_back(row * columns_ + column, e);
          }
        }
      }
      const auto [below, above] = std::minmax(e.a.y(), e.b.y());
      auto j = static_cast<std::int64_t>(std::ceil((below - y0_) / spacing_)) - 1;
      for (; y_of(j) < above; ++j) {
        if (y_of(j) >= below) {
          const double share = (y_of(j) - e.a.y()) / (e.b.y() - e.a.y());
          crossings[static_cast<std::size_t>(j)].push_back(e.a.x() + share * (e.b.x() - e.a.x()));
        }
      }
    }
  }
  for (std::vector<double>& row : crossings) std::sort(row.begin(), row.end());
  std::sort(near.begin(), near.end(), [](const auto& a, const auto& b) { return a.first < b.first; });
  return boundary;
}

void MaterialLayer::fill(std::span<const Ring> rings) {
  const Boundary boundary = boundary_of(rings);
  const auto& near = boundary.near;
  auto next = near.cbegin();
  const auto inside = [&](std::int64_t i, std::int64_t j) {
    return boundary.inside(static_cast<std::size_t>(j), x_of(i));
  };
  for (std::int64_t t = 0; t < columns_ * rows_; ++t) {
    const auto first = next;
    while (next != near.cend() && next->first == t) ++next;
    const std::int64_t i0 = t % columns_ * edge;
    const std::int64_t j0 = t / columns_ * edge;
    if (first == next) {
      index_[static_cast<std::size_t>(t)] = inside(i0, j0) ? full : empty;
      continue;
    }
    index_[static_cast<std::size_t>(t)] = new_tile(0.0F);
    Tile& tile = pool_[static_cast<std::size_t>(index_[static_cast<std::size_t>(t)])];
    for (std::int64_t n = 0; n < edge * edge; ++n) {
      const std::int64_t i = i0 + n % edge;
      const std::int64_t j = j0 + n / edge;
      const Vector2d point(x_of(i), y_of(j));
      double distance = band_;
      for (auto k = first; k != next; ++k) {
        distance = std::min(distance, distance_to_edge(point, k->second.a, k->second.b));
      }
      tile[static_cast<std::size_t>(n)] = static_cast<float>(inside(i, j) ? distance : -distance);
    }
  }
  compact();
}

std::int32_t MaterialLayer::new_tile(float value) {
  std::int32_t tile = 0;
  if (free_.empty()) {
    tile = static_cast<std::int32_t>(pool_.size());
    pool_.emplace_back();
  } else {
    tile = free_.back();
    free_.pop_back();
  }
  pool_[static_cast<std::size_t>(tile)].fill(value);
  return tile;
}

double MaterialLayer::node(std::int64_t i, std::int64_t j) const noexcept {
  if (i < 0 || j < 0 || i >= columns_ * edge || j >= rows_ * edge) return -band_;
  const std::int32_t tile = index_[static_cast<std::size_t>(j / edge * columns_ + i / edge)];
  if (tile < 0) return tile == full ? band_ : -band_;
  return static_cast<double>(
      pool_[static_cast<std::size_t>(tile)][static_cast<std::size_t>(j % edge * edge + i % edge)]);
}

double MaterialLayer::distance_mm(double x_mm, double y_mm) const noexcept {
  const double gx = (x_mm - x0_) / spacing_;
  const double gy = (y_mm - y0_) / spacing_;
  // Written so that values that are no number, or too large for an integer, are outside as well.
  if (!(gx >= 0.0 && gy >= 0.0 && gx < static_cast<double>(columns_ * edge) &&
        gy < static_cast<double>(rows_ * edge))) {
    return -band_;
  }
  const auto i = static_cast<std::int64_t>(gx);
  const auto j = static_cast<std::int64_t>(gy);
  const double fx = gx - static_cast<double>(i);
  const double fy = gy - static_cast<double>(j);
  const std::int64_t in_row = i % edge;
  const std::int64_t in_column = j % edge;
  double v00 = 0.0;
  double v10 = 0.0;
  double v01 = 0.0;
  double v11 = 0.0;
  if (in_row < edge - 1 && in_column < edge - 1) {
    const std::int32_t tile = index_[static_cast<std::size_t>(j / edge * columns_ + i / edge)];
    if (tile < 0) return tile == full ? band_ : -band_;
    const float* values = &pool_[static_cast<std::size_t>(tile)][static_cast<std::size_t>(in_column * edge + in_row)];
    v00 = static_cast<double>(values[0]);
    v10 = static_cast<double>(values[1]);
    v01 = static_cast<double>(values[edge]);
    v11 = static_cast<double>(values[edge + 1]);
  } else {
    v00 = node(i, j);
    v10 = node(i + 1, j);
    v01 = node(i, j + 1);
    v11 = node(i + 1, j + 1);
  }
  const double lower = v00 + fx * (v10 - v00);
  const double upper = v01 + fx * (v11 - v01);
  return lower + fy * (upper - lower);
}

bool MaterialLayer::is_empty_around(double x_mm, double y_mm, double radius_mm) const noexcept {
  if (!std::isfinite(x_mm + y_mm + radius_mm)) return true;
  const double tile_mm = spacing_ * edge;
  const auto clamped = [&](double from_origin, std::int64_t count) {
    return static_cast<std::int64_t>(std::clamp(std::floor(from_origin / tile_mm), -1.0, static_cast<double>(count)));
  };
  const std::int64_t first_column = std::max<std::int64_t>(0, clamped(x_mm - radius_mm - x0_, columns_));
  const std::int64_t last_column = std::min(columns_ - 1, clamped(x_mm + radius_mm - x0_, columns_));
  const std::int64_t first_row = std::max<std::int64_t>(0, clamped(y_mm - radius_mm - y0_, rows_));
  const std::int64_t last_row = std::min(rows_ - 1, clamped(y_mm + radius_mm - y0_, rows_));
  for (std::int64_t row = first_row; row <= last_row; ++row) {
    for (std::int64_t column = first_column; column <= last_column; ++column) {
      if (index_[static_cast<std::size_t>(row * columns_ + column)] != empty) return false;
    }
  }
  return true;
}

bool MaterialLayer::remove(const ToolStep& step, double tool_radius_mm, bool continues) {
  const Sweep sweep(step, tool_radius_mm, band_, spacing_, {x0_, y0_}, continues);
  const auto rows = static_cast<double>(rows_ * edge);
  const std::int64_t end = first_at(sweep.middle.y() + sweep.reach, rows);
  bool changed = false;
  for (std::int64_t j = first_at(sweep.middle.y() - sweep.reach, rows); j < end; ++j) {
    changed |= remove_in_row(sweep, j);
  }
  if (tiles() > compact_at_tiles_) compact();
  return changed;
}

/// Finds the nodes of a grid row whose distance may change: those near the step but not behind its start, nor deep in
/// the disc that was swept there.
bool MaterialLayer::remove_in_row(const Sweep& sweep, std::int64_t j) {
  const auto y = static_cast<double>(j);
  const auto nodes = static_cast<double>(columns_ * edge);
  const double from_middle = y - sweep.middle.y();
  const double half = std::sqrt(std::max(0.0, sweep.reach * sweep.reach - from_middle * from_middle));
  double low = sweep.middle.x() - half;
  double high = sweep.middle.x() + half;
  if (!sweep.continues) {
    return remove_nodes(sweep, j, first_at(low, nodes), first_at(high, nodes));
  }
  const double dy = y - sweep.from.y();
  const double rest = -sweep.behind - dy * sweep.ahead.y();  // ahead: (x - from.x) ahead.x > rest
  if (sweep.ahead.x() > 0.0) {
    low = std::max(low, sweep.from.x() + rest * sweep.per_ahead_x);
  } else if (sweep.ahead.x() < 0.0) {
    high = std::min(high, sweep.from.x() + rest * sweep.per_ahead_x);
  } else if (rest > 0.0) {
    return false;
  }
  const double inner = std::sqrt(std::max(0.0, sweep.inner * sweep.inner - dy * dy));
  const double gap_low = std::clamp(sweep.from.x() - inner, low, std::max(low, high));
  const double gap_high = std::clamp(sweep.from.x() + inner, low, std::max(low, high));
  bool changed = false;
  if (low < gap_low) changed = remove_nodes(sweep, j, first_at(low, nodes), first_at(gap_low, nodes));
  if (gap_high < high) changed |= remove_nodes(sweep, j, first_at(gap_high, nodes), first_at(high, nodes));
  return changed;
}

/// Lowers the distances of the nodes first ... last - 1 of a row, tile by tile, in whole packets: a neighbour whose
/// distance is taken as well only stays what it is.
bool MaterialLayer::remove_nodes(const Sweep& sweep, std::int64_t j, std::int64_t first, std::int64_t last) {
  constexpr std::int64_t packet = 4;
  const auto band = static_cast<float>(band_);
  const auto spacing = static_cast<float>(spacing_);
  const float radius = sweep.radius;
  const auto y = static_cast<float>(y_of(j) - sweep.start_mm.y());
  const ToolStep::Shape<float> shape = sweep.shape;
  std::int32_t* const tiles_of_row = index_.data() + j / edge * columns_;
  int changed = 0;
  while (first < last) {
    const std::int64_t column = first / edge;
    const std::int64_t left = column * edge;
    const std::int64_t begin = first - left;
    const std::int64_t end = std::min(last - left, edge);
    first = left + edge;
    std::int32_t& tile = tiles_of_row[column];
    if (tile == empty) continue;
    if (tile == full) tile = new_tile(band);
    const std::int64_t first_packet = begin / packet;
    const auto packets = static_cast<int>((end - 1) / packet - first_packet + 1);
    float* const values = pool_[static_cast<std::size_t>(tile)].data() + j % edge * edge + first_packet * packet;
    const auto x = static_cast<float>(x_of(left + first_packet * packet) - sweep.start_mm.x());
    if (shape.curvature == 0.0F) {
      for (int k = 0; k < packets * packet; ++k) {
        const float squared = shape.parts(x + spacing * static_cast<float>(k), y).squared(1.0F);
        const float value = std::min(values[k], std::max(std::sqrt(squared) - radius, -band));
        changed |= static_cast<int>(values[k] - value > min_change);
        values[k] = value;
      }
    } else {
      for (int k = 0; k < packets * packet; ++k) {
        const auto parts = shape.parts(x + spacing * static_cast<float>(k), y);
        const float squared = parts.squared(std::sqrt(parts.square));
        const float value = std::min(values[k], std::max(std::sqrt(squared) - radius, -band));
        changed |= static_cast<int>(values[k] - value > min_change);
        values[k] = value;
      }
    }
  }
  return changed != 0;
}

bool MaterialLayer::has_material() const noexcept {
  return std::any_of(index_.begin(), index_.end(), [&](std::int32_t tile) {
    if (tile < 0) return tile == full;
    const Tile& values = pool_[static_cast<std::size_t>(tile)];
    return std::any_of(values.begin(), values.end(), [](float value) { return value > 0.0F; });
  });
}

double MaterialLayer::area_mm2() const noexcept {
  double cells = 0.0;
  for (const std::int32_t tile : index_) {
    if (tile == full) cells += static_cast<double>(edge * edge);
    if (tile < 0) continue;
    for (const float value : pool_[static_cast<std::size_t>(tile)]) {
      cells += coverage(static_cast<double>(value), spacing_);
    }
  }
  return cells * spacing_ * spacing_;
}

double MaterialLayer::area_in_disc_mm2(double x_mm, double y_mm, double radius_mm) const noexcept {
  if (is_empty_around(x_mm, y_mm, radius_mm)) return 0.0;
  const double reach = radius_mm + spacing_;
  const auto limited = [](double value, std::int64_t count) {
    return static_cast<std::int64_t>(std::clamp(value, -1.0, static_cast<double>(count)));
  };
  const std::int64_t last_row = limited(std::floor((y_mm + reach - y0_) / spacing_), rows_ * edge);
  double cells = 0.0;
  for (std::int64_t j = limited(std::ceil((y_mm - reach - y0_) / spacing_), rows_ * edge); j <= last_row; ++j) {
    const double dy = y_of(j) - y_mm;
    const double half_squared = reach * reach - dy * dy;
    if (half_squared <= 0.0) continue;
    const double half = std::sqrt(half_squared);
    const std::int64_t last = limited(std::floor((x_mm + half - x0_) / spacing_), columns_ * edge);
    for (std::int64_t i = limited(std::ceil((x_mm - half - x0_) / spacing_), columns_ * edge); i <= last; ++i) {
      const double inside = radius_mm - std::hypot(x_of(i) - x_mm, dy);
      cells += coverage(std::min(node(i, j), inside), spacing_);
    }
  }
  return cells * spacing_ * spacing_;
}

void MaterialLayer::compact() {
  const auto limit = static_cast<float>(band_);
  for (std::int32_t& tile : index_) {
    if (tile < 0) continue;
    const Tile& values = pool_[static_cast<std::size_t>(tile)];
    const auto [low, high] = std::minmax_element(values.begin(), values.end());
    if (*low<limit&& * high> - limit) continue;
    free_.push_back(tile);
    tile = *high > -limit ? full : empty;
  }
  // Next time when those with values have grown by a quarter: uniform ones are passed over quickly, and the search
  // costs little beside what made them.
  compact_at_tiles_ = tiles() + tiles() / 4 + min_growth_tiles;
}

std::size_t MaterialLayer::bytes() const noexcept {
  return sizeof(MaterialLayer) + index_.size() * sizeof(std::int32_t) + pool_.size() * tile_bytes +
         free_.size() * sizeof(std::int32_t);
}

}  // namespace shapegcode
