#pragma once

#include <memory>
#include <span>
#include <vector>

#include "shapegcode/filter/fir.hpp"
#include "shapegcode/motion/block_player.hpp"
#include "shapegcode/motion/speed_profile.hpp"
#include "shapegcode/path/path.hpp"

namespace shapegcode {

/// What a run is looked at with.
struct TravelOptions {
  double period_s = 0.001;
  std::vector<Fir> axis_filters;  ///< behind the set-points, in order
  /// Time over which the travel is taken; at least one period. With the time between two teeth, speed times that time
  /// is the feed per tooth which the machine really has.
  double window_s = 0.0;
};

/// How a path is really travelled, per stretch that ends at a station and begins at the one before it.
struct Travel {
  std::vector<double> highest_mm_per_s;  ///< largest travel within a window, over the window
  std::vector<double> time_s;            ///< spent on the stretch; 0 where one period passes over all of it
  double duration_s = 0.0;               ///< until the set-points rest
};

/// A path under a speed profile (a controller with look-ahead), its set-points behind the filters followed along
/// `along`: the same path, or one of which it is made. `stations_mm` ascend from above 0 to the length of `along`.
/// Throws Error(argument) on stations that do not, a period <= 0 or a window < 0.
[[nodiscard]] Travel travel_path(const std::shared_ptr<const Path>& path,
                                 const std::shared_ptr<const SpeedProfile>& profile, const Path& along,
                                 std::span<const double> stations_mm, const TravelOptions& options);

/// Blocks at their feed (a controller without look-ahead), followed along `along`, of which they are made.
[[nodiscard]] Travel travel_blocks(std::span<const Segment> blocks, const Path& along, BlockEnd block_end,
                                   std::span<const double> stations_mm, const TravelOptions& options);

}  // namespace shapegcode
