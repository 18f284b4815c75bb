#include "shapegcode/linear_feed.hpp"

#include <algorithm>
#include <cmath>
#include <complex>

#include "base/refuse.hpp"
#include "write/linear_fit.hpp"

namespace shapegcode {
namespace {

constexpr double max_ratio = 6.0;  // logarithm of the speeds at both ends
constexpr int max_steps = 50;      // of Newton's method

// A point of a block that starts at `start`.
Vector3 on_block(const Vector3& start, const LinearBlock& block, double share) {
  Vector3 point = start + share * (block.end_mm - start);
  if (block.sweep_rad == 0.0) return point;
  const int first = (block.normal + 1) % 3;
  const int second = (block.normal + 2) % 3;
  const std::complex<double> a(start[first], start[second]);
  const std::complex<double> b(block.end_mm[first], block.end_mm[second]);
  // The chord is the spoke at its start, turned by the sweep, less that spoke.
  const std::complex<double> spoke = (b - a) / (std::polar(1.0, block.sweep_rad) - 1.0);
  const std::complex<double> flat = a - spoke + spoke * std::polar(1.0, block.sweep_rad * share);
  point[first] = flat.real();
  point[second] = flat.imag();
  return point;
}

}  // namespace

double LinearBlock::duration_s() const noexcept {
  return linear_duration_s(length_mm, start_feed_mm_per_min / 60.0, feed_mm_per_min / 60.0);
}

double linear_duration_s(double length_mm, double start_mm_per_s, double end_mm_per_s) noexcept {
  const double ratio = end_mm_per_s / start_mm_per_s - 1.0;
  return length_mm / start_mm_per_s * (std::abs(ratio) > 1e-9 ? std::log1p(ratio) / ratio : 1.0);
}

std::optional<double> linear_end_speed(double length_mm, double start_mm_per_s, double time_s) noexcept {
  if (!(length_mm > 0.0) || !(time_s > 0.0) || !(start_mm_per_s > 0.0)) return std::nullopt;
  // Of log1p(x) / x, which is e^(-y / 2) and little else.
  const double wanted = std::log(time_s * start_mm_per_s / length_mm);
  double y = -2.0 * wanted;
  for (int n = 0; n < max_steps; ++n) {
    y = std::clamp(y, -max_ratio - 1.0, max_ratio + 1.0);
    double value = -0.5 * y;
    double slope = -0.5;
    if (std::abs(y) >= 1e-6) {
      value = std::log(y / std::expm1(y));
      slope = 1.0 / y + 1.0 / std::expm1(-y);
    }
    const double step = (value - wanted) / slope;
    y -= step;
    if (std::abs(step) < 1e-13) break;
  }
  if (std::abs(y) > max_ratio) return std::nullopt;
  return start_mm_per_s * std::exp(y);
}

double linear_distance_mm(double length_mm, double start_mm_per_s, double end_mm_per_s, double time_s) noexcept {
  const double slope = (end_mm_per_s - start_mm_per_s) / length_mm;
  if (std::abs(slope * length_mm) < 1e-9 * start_mm_per_s) return start_mm_per_s * time_s;
  return start_mm_per_s * std::expm1(slope * time_s) / slope;
}

std::vector<Vector3> linear_positions_mm(const Vector3& start_mm, std::span<const LinearBlock> blocks,
                                         std::span<const double> times_s) {
  if (blocks.empty()) detail::refuse("positions of no blocks: there must be one");
  std::vector<Vector3> found;
  found.reserve(times_s.size());
  Vector3 start = start_mm;
  double begin_s = 0.0;
  std::size_t k = 0;
  double end_s = blocks[0].duration_s();
  for (const double time_s : times_s) {
    while (k < blocks.size() && time_s >= end_s) {
      begin_s = end_s;
      start = blocks[k].end_mm;
      if (++k < blocks.size()) end_s += blocks[k].duration_s();
    }
    if (k == blocks.size()) {
      found.push_back(blocks.back().end_mm);
      continue;
    }
    const LinearBlock& block = blocks[k];
    const double along_mm = linear_distance_mm(block.length_mm, block.start_feed_mm_per_min / 60.0,
                                               block.feed_mm_per_min / 60.0, time_s - begin_s);
    found.push_back(on_block(start, block, along_mm / block.length_mm));
  }
  return found;
}

std::vector<LinearBlock> linear_blocks(const Path& path, double period_s, double tolerance_mm,
                                       std::span<const std::uint32_t> joints, const AxisModes& modes) {
  if (path.size() == 0) detail::refuse("linear feeds of a path without blocks: there must be one");
  LinearFit fit(path, period_s, tolerance_mm, joints);
  std::vector<LinearBlock> blocks = fit.blocks();
  const bool has_mode = std::ranges::any_of(modes, [](const auto& axis) { return !axis.empty(); });
  return has_mode ? at_rest(std::move(blocks), fit, modes) : blocks;
}

double largest_difference_mm(const Path& path, std::span<const LinearBlock> blocks, double period_s) {
  const CommandPoints command(path, period_s);
  std::vector<double> times_s;
  for (std::size_t k = 1; k < command.points.size(); ++k) times_s.push_back(static_cast<double>(k) * period_s);
  const std::vector<Vector3> moved = linear_positions_mm(command.points[0], blocks, times_s);
  double largest = 0.0;
  for (std::size_t k = 0; k < moved.size(); ++k) {
    largest = std::max(largest, (moved[k] - command.points[k + 1]).norm());
  }
  return largest;
}

}  // namespace shapegcode
