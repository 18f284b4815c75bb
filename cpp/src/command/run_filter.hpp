#pragma once

#include <array>
#include <optional>
#include <span>
#include <vector>

#include "shapegcode/command.hpp"
#include "shapegcode/filter.hpp"
#include "shapegcode/mode.hpp"
#include "shapegcode/motion.hpp"

namespace shapegcode {

/// Filters after the look-ahead of a motion from rest to rest, on half the block grid, and the contour target.
struct RunFilter {
  /// A set of shapers along an axis, used instead of constant ones; the contour is then kept with the modes at each of
  /// its positions, by the tables.
  struct Followed {
    std::optional<FollowingFir> shapers;
    AxisModeTables tables;
  };
  /// `shapers`: taps in whole block periods, one common to all axes or one for each, of one mean delay. Throws as
  /// `contour_kernel` and ContourSolver do.
  RunFilter(std::span<const Fir> shapers, ContourTarget target, const AxisModes& modes, double block_period_s,
            double smoothness, const Followed& along = {{}, {}});

  /// Half block periods by which the shaped command moves longer.
  [[nodiscard]] int shaper_rows() const noexcept { return following ? following->fir().duration_samples() : longest_; }

  std::vector<Fir> half_shapers;          ///< one per axis, taps in half block periods
  std::optional<FollowingFir> following;  ///< likewise, instead of it
  ContourTarget target;
  AxisModes modes;
  double half_period_s;
  double mean_delay_s;  ///< of the shaper
  /// By shaper that is followed, axis that follows the path and axis that is commanded; empty where one does not move
  /// the other.
  std::vector<std::array<std::array<std::vector<double>, axis_count>, axis_count>> kernels;
  bool crosses = false;  ///< whether any axis moves another one
  double smoothness;
  double feed_excess_ratio = MotionLimits::none;  ///< see ShapingOptions

 private:
  int longest_ = 0;
};

}  // namespace shapegcode
