#pragma once

#include <cstdint>
#include <limits>
#include <optional>
#include <span>
#include <vector>

#include "shapegcode/milling/force.hpp"
#include "shapegcode/path.hpp"

namespace shapegcode {

/// Limits of a feed over one revolution of the spindle; infinite: no limit.
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
  none,  ///< the highest requested feed is within all limits
  resultant,
  deflection,
  torque,
  power,
  chip_load,
};

struct LimitedFeed {
  double feed_mm_per_min = 0.0;
  FeedLimit limit = FeedLimit::none;  ///< the limit reached first
  bool within = true;                 ///< false: even the lowest feed exceeds the limit, and it is returned
};

/// The highest feed between `lowest` and `highest` (mm/min) that stays within all limits. Never above a limit, and
/// within 0.02 % of the limit reached. Throws Error(argument) on limits or an engagement that `check` or `figures`
/// refuse, or unless 0 < lowest <= highest.
[[nodiscard]] LimitedFeed largest_feed(MillingForce& force, std::span<const EngagedArc> arcs, const FeedLimits& limits,
                                       double lowest, double highest);

/// The same for every sample of a track, feeds along the path (the horizontal component makes the chip); without
/// engagement, or if the tool only plunges, the highest feed. Throws as largest_feed.
[[nodiscard]] std::vector<LimitedFeed> largest_feeds(MillingForce& force, const EngagementTrack& track,
                                                     const FeedLimits& limits, double lowest, double highest);

/// Highest feeds along a path: `feed_mm_per_min[i]` is valid on the section that ends at `s_mm[i]` and begins at the
/// previous station (at 0 for the first). Ascending; the last station is the path's end.
struct FeedStations {
  std::vector<double> s_mm;
  std::vector<double> feed_mm_per_min;
};

/// A block in the scheduler.
struct FeedBlock {
  double end_mm = 0.0;           ///< of the block, along the path
  double kept_mm_per_min = 0.0;  ///< fixed feed; 0: it may get another one
  bool divisible = false;        ///< may be divided into several blocks
};

struct FeedScheduleOptions {
  double least_length_mm = 0.6;  ///< minimum length of a section of one feed, and of a piece of a divided block
  /// Largest change from one feed to the next, as far as fixed feeds allow.
  double most_change_mm_per_min = std::numeric_limits<double>::infinity();
  double resolution_mm_per_min = 0.1;  ///< feeds are whole multiples, rounded down
};

/// A section of one feed.
struct FeedStretch {
  double begin_mm = 0.0;
  double end_mm = 0.0;
  double feed_mm_per_min = 0.0;
};

/// Feeds of a path for the shortest time within the stations' feeds: sections that begin and end at block ends or
/// within divisible blocks, none shorter than the minimum length (unless between blocks of fixed feed), each at the
/// lowest feed of its stations. All boundaries are chosen together (dynamic programming), with a cost for each of one
/// percent of the shortest section's time, which prevents useless boundaries. O(stations + length).
///
/// Throws Error(argument) on stations or blocks that do not ascend to one end above 0, a feed that is not above 0, or
/// options outside their range.
[[nodiscard]] std::vector<FeedStretch> schedule_feed(std::span<const FeedBlock> blocks, const FeedStations& stations,
                                                     const FeedScheduleOptions& options);

/// Whether sections begin at 0, each at the end of the one before, and end at a length (to 1e-6 mm).
[[nodiscard]] bool covers(std::span<const FeedStretch> sections, double length_mm);

/// The path with the feeds of sections that cover it: segments are divided where a section ends within one. Throws
/// Error(argument) if they do not cover it.
[[nodiscard]] Path with_feeds(const Path& path, std::span<const FeedStretch> sections);

/// Lowers the feeds around each station that is limited by its load, because the motion lags behind a change of feed. A
/// lower feed must be commanded earlier, by `before_s` times the feed that the load allows; a higher one later, by
/// `behind_s` times it. `load_mm_per_min`: the largest feed that the load at a station allows, which may be above the
/// desired one. One entry of each per station.
///
/// After a filter of mean delay m and length d, a change commanded at a position begins m times the slower feed before
/// it and ends d - m times the slower feed after it.
void look_ahead_on_load(FeedStations& stations, std::span<const double> load_mm_per_min,
                        std::span<const double> before_s, std::span<const double> behind_s);

}  // namespace shapegcode
