#pragma once

#include <cstdint>
#include <limits>
#include <optional>
#include <span>
#include <vector>

#include "shapegcode/milling/cutting_force.hpp"
#include "shapegcode/milling/deflection.hpp"
#include "shapegcode/milling/engagement.hpp"

namespace shapegcode {

/// What bounds a feed over one revolution of the spindle; infinite: no limit.
struct FeedLimits {
  static constexpr double none = std::numeric_limits<double>::infinity();

  double mean_resultant_n = none;    ///< mean of the magnitude of the XY force
  double peak_resultant_n = none;    ///< largest magnitude
  double peak_deflection_um = none;  ///< of the tip; needs `beam`
  double peak_torque_nm = none;
  double mean_power_w = none;
  double feed_per_tooth_mm = none;  ///< chip load as tool makers state it
  double peak_chip_mm = none;       ///< thickest chip, which a light radial cut makes thinner than the feed per tooth
  std::optional<ToolBeam> beam = {};
};

/// Throws Error(argument) on a limit that is not positive, a beam that `check` refuses, or a limit of deflection
/// without a beam.
void check(const FeedLimits& limits);

enum class FeedLimit : std::uint8_t {
  none,  ///< the highest feed asked for is within all limits
  resultant,
  deflection,
  torque,
  power,
  chip_load,
};

struct LimitedFeed {
  double feed_mm_per_min = 0.0;
  FeedLimit limit = FeedLimit::none;  ///< the one that is reached first
  bool within = true;                 ///< false: even the lowest feed is beyond the limit, and it is returned
};

/// The highest feed between `lowest` and `highest` (mm/min) that stays within all limits. Never above a limit, and
/// where a limit binds within 0.02 % of it. Throws Error(argument) on limits or an engagement that `check` or `figures`
/// refuse, or unless 0 < lowest <= highest.
[[nodiscard]] LimitedFeed largest_feed(MillingForce& force, std::span<const EngagedArc> arcs, const FeedLimits& limits,
                                       double lowest, double highest);

/// The same for every sample of a track, feeds along the path (its horizontal part makes the chip); where nothing is
/// met or the tool only plunges: the highest. Throws as largest_feed.
[[nodiscard]] std::vector<LimitedFeed> largest_feeds(MillingForce& force, const EngagementTrack& track,
                                                     const FeedLimits& limits, double lowest, double highest);

}  // namespace shapegcode
