#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <functional>
#include <numbers>
#include <random>
#include <vector>

#include "shapegcode/write.hpp"

// Commands to be fitted, and fitted blocks as a controller sees them: shared by the tests of fitting and rounding.
namespace shapegcode::tests {

inline constexpr double pi = std::numbers::pi;

using Position = std::array<std::int64_t, 3>;

/// A command on the grid and half-way between.
struct Command {
  Eigen::MatrixXd grid, middle;
  std::vector<std::int8_t> normals;
};

/// Samples `at(period)`, a position for any real period number.
inline Command sampled(int periods, const std::function<Vector3(double)>& at, int normal = -1) {
  Command command;
  command.grid.resize(periods + 1, 3);
  command.middle.resize(periods, 3);
  for (int k = 0; k <= periods; ++k) command.grid.row(k) = at(k);
  for (int k = 0; k < periods; ++k) command.middle.row(k) = at(k + 0.5);
  command.normals.assign(static_cast<std::size_t>(periods), static_cast<std::int8_t>(normal));
  return command;
}

inline std::vector<FittedBlock> fit(const Command& command, const FitOptions& options = {},
                                    const std::vector<std::uint32_t>& breaks = {}) {
  return fit_blocks(command.grid, command.middle, command.normals, {breaks}, options);
}

inline Position rounded(const Command& command, Eigen::Index k, double increment) {
  Position p;
  for (Eigen::Index i = 0; i < 3; ++i) p[static_cast<std::size_t>(i)] = std::llround(command.grid(k, i) / increment);
  return p;
}

inline Vector3 to_mm(const Position& p, double increment) {
  return increment * Vector3(static_cast<double>(p[0]), static_cast<double>(p[1]), static_cast<double>(p[2]));
}

/// A block as a controller sees it: from its words alone.
struct Simulated {
  Vector3 start, end;
  FittedKind kind;
  int normal = 2;
  Vector3 centre = Vector3::Zero();
  double radius = 0.0, sweep = 0.0, length = 0.0;

  [[nodiscard]] Vector3 at(double fraction) const {
    Vector3 p = start + fraction * (end - start);
    if (kind == FittedKind::line) return p;
    const int a = (normal + 1) % 3;
    const int b = (normal + 2) % 3;
    const double turn = sweep * fraction;
    const double da = start[a] - centre[a];
    const double db = start[b] - centre[b];
    p[a] = centre[a] + da * std::cos(turn) - db * std::sin(turn);
    p[b] = centre[b] + da * std::sin(turn) + db * std::cos(turn);
    return p;
  }
};

/// R > 0: the centre lies left of the chord for G03, right of it for G02; the sweep is below 180 degrees.
inline Simulated as_simulated(const Position& from, const FittedBlock& block, double increment) {
  Simulated simulated{to_mm(from, increment), to_mm(block.end, increment), block.kind, block.normal};
  const Vector3 move = simulated.end - simulated.start;
  simulated.length = move.norm();
  if (block.kind == FittedKind::line) return simulated;
  const int a = (simulated.normal + 1) % 3;
  const int b = (simulated.normal + 2) % 3;
  const double chord = std::hypot(move[a], move[b]);
  const double sense = block.kind == FittedKind::counter_clockwise ? 1.0 : -1.0;
  simulated.radius = static_cast<double>(block.radius) * increment;
  const double height = std::sqrt(std::max(0.0, simulated.radius * simulated.radius - 0.25 * chord * chord));
  simulated.centre = simulated.start;
  simulated.centre[a] += 0.5 * move[a] - sense * height * move[b] / chord;
  simulated.centre[b] += 0.5 * move[b] + sense * height * move[a] / chord;
  simulated.sweep = sense * 2.0 * std::asin(0.5 * chord / simulated.radius);
  simulated.length = std::hypot(simulated.radius * simulated.sweep, move[simulated.normal]);
  return simulated;
}

struct Findings {
  int wrong_end = 0;         // not the command's position, rounded once
  int wrong_ticks = 0;       // does not last its periods on a controller that starts blocks on ticks
  int late = 0;              // takes longer than its periods on one that carries remainders
  int out_of_tolerance = 0;  // a merged sample further off than the tolerance
  int empty = 0;             // no move
  int arcs = 0;
  int bad_sweep = 0;
  int reversals = 0;       // blocks that move an axis against the command
  double end_error = 0.0;  // largest of an end and of a sample within a block, increments
  double inside_error = 0.0;
  std::uint64_t periods = 0;
};

inline Findings judge(const Command& command, const std::vector<FittedBlock>& blocks, const FitOptions& options) {
  Findings found;
  const double ticks_per_period = std::round(options.block_period_s / options.interpolation_period_s);
  Position from = rounded(command, 0, options.increment_mm);
  for (std::size_t n = 0; n < blocks.size(); ++n) {
    const FittedBlock& block = blocks[n];
    const auto first = static_cast<Eigen::Index>(block.first_period);
    // The rest behind the last block is left out.
    const Eigen::Index last = n + 1 < blocks.size()
                                  ? static_cast<Eigen::Index>(blocks[n + 1].first_period)
                                  : std::min<Eigen::Index>(first + block.periods, command.grid.rows() - 1);
    // Half between two increments either is the nearest.
    bool nearest = true;
    for (Eigen::Index i = 0; i < 3; ++i) {
      const double exact = command.grid(last, i) / options.increment_mm;
      nearest = nearest && std::abs(static_cast<double>(block.end[static_cast<std::size_t>(i)]) - exact) <= 0.5 + 1e-6;
    }
    if (!nearest) ++found.wrong_end;
    if (block.end == from) ++found.empty;
    for (Eigen::Index i = 0; i < 3; ++i) {
      const auto axis = static_cast<std::size_t>(i);
      const double exact = command.grid(last, i) / options.increment_mm;
      found.end_error = std::max(found.end_error, std::abs(static_cast<double>(block.end[axis]) - exact));
      const double way = exact - command.grid(first, i) / options.increment_mm;
      const auto move = static_cast<double>(block.end[axis] - from[axis]);
      if (move * way < 0.0 || (move != 0.0 && std::abs(way) < 1e-9)) ++found.reversals;
    }
    const Simulated simulated = as_simulated(from, block, options.increment_mm);
    const double speed = static_cast<double>(block.feed) * options.feed_unit_mm_per_s;
    const double ticks = simulated.length / speed / options.interpolation_period_s;
    const double wanted = static_cast<double>(block.periods) * ticks_per_period;
    if (std::ceil(ticks - 1e-6) != wanted) ++found.wrong_ticks;
    if (ticks > wanted + 1e-6) ++found.late;
    // Samples between the ends; while nothing has moved there is nothing to follow.
    Eigen::Index moving = first;
    const Position begin = rounded(command, first, options.increment_mm);
    while (moving < last && rounded(command, moving, options.increment_mm) == begin) ++moving;
    // A straight command (within .05) is off by the rounding of the ends.
    const double slack = block.kind == FittedKind::line ? std::max(options.merge_tolerance_increments, 0.55) + 1e-3
                                                        : options.merge_tolerance_increments + 0.251;
    for (Eigen::Index k = first + 1; k < last && moving < last; ++k) {
      const Vector3 p = simulated.at(static_cast<double>(k - first) / static_cast<double>(last - first));
      const Vector3 off = (p - command.grid.row(k).transpose()).cwiseAbs() / options.increment_mm;
      if (off.maxCoeff() > slack) ++found.out_of_tolerance;
      found.inside_error = std::max(found.inside_error, off.maxCoeff());
    }
    if (block.kind != FittedKind::line) {
      ++found.arcs;
      if (!(std::abs(simulated.sweep) < pi / 2)) ++found.bad_sweep;
    }
    found.periods += block.periods;
    from = block.end;
  }
  return found;
}

/// A smooth random command: three moving averages over a random speed, at rest at both ends.
inline Command random_command(int periods, unsigned seed, double speed_mm_per_period, int steady_for) {
  std::mt19937_64 generator(seed);
  std::normal_distribution<double> speed(0.0, speed_mm_per_period);
  const int half_steps = 2 * periods + 1;
  Eigen::MatrixXd velocity = Eigen::MatrixXd::Zero(half_steps, 3);
  for (int i = 20; i < half_steps - 60; ++i) {
    if ((i - 20) % steady_for == 0) {
      velocity.row(i) = 0.5 * Vector3(speed(generator), speed(generator), 0.2 * speed(generator)).transpose();
    } else {
      velocity.row(i) = velocity.row(i - 1);
    }
  }
  for (const int length : {8, 11, 17}) {
    Eigen::MatrixXd smooth = Eigen::MatrixXd::Zero(half_steps, 3);
    for (int i = 0; i < half_steps; ++i) {
      for (int k = 0; k < length && k <= i; ++k) smooth.row(i) += velocity.row(i - k) / length;
    }
    velocity = smooth;
  }
  Command command = sampled(periods, [](double) { return Vector3::Zero(); });
  Vector3 at(12.3456789, -98.7654321, 5.5);
  for (int i = 0; i < half_steps; ++i) {
    at += velocity.row(i).transpose();
    if (i % 2 == 0) {
      command.grid.row(i / 2) = at;
    } else {
      command.middle.row(i / 2) = at;
    }
  }
  return command;
}

}  // namespace shapegcode::tests
