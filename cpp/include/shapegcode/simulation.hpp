#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include "shapegcode/fanuc_model.hpp"
#include "shapegcode/filter.hpp"
#include "shapegcode/measure/contour.hpp"
#include "shapegcode/motion.hpp"
#include "shapegcode/path.hpp"
#include "shapegcode/plant/feed_drive.hpp"
#include "shapegcode/plant/modal.hpp"

namespace shapegcode {

/// What a run of set-points is measured with.
struct SimulationOptions {
  double period_s = 0.001;
  std::vector<Fir> axis_filters;  ///< after the set-points, in order (acceleration after interpolation)
  AxisModes modes;
  AxisModeTables mode_tables;  ///< how the modes vary with position; none: constant modes
  /// Feed drives of X, Y and Z with the modes of their own; none: modes alone. The modes and tables above are then
  /// excited by the drives' tables instead of the set-points. The figures hold the servo loop's lag, and are those at
  /// the set-points.
  std::vector<FeedDriveParameters> drives;
  /// A tracker of the path at its start, whose geometry several runs share; null: each run makes its own.
  std::shared_ptr<const ContourTracker> tracker;
  bool measure_contour = true;          ///< deviation of command and response and orbit errors
  bool measure_command = true;          ///< false: the response alone; no figures of the command, no orbit errors
  bool measure_response = true;         ///< false: the command alone; no figures of the response
  bool measure_response_orbit = false;  ///< orbit errors of the response too, where the contour is measured
  /// Largest speed against the programmed feed, over this time and four and sixteen times it; 0: not measured. Needs
  /// the deviation of the command.
  double feed_window_s = 0.0;
  double feed_slack_mm = 0.0;  ///< what rounding may add to the distance within such a time
  /// Blocks only: simulate no more than the last so many seconds (0: all). Enough for the residual where older
  /// vibration has decayed; peak and contour figures then speak of that part alone.
  double last_seconds = 0.0;
  /// Blocks only: what if the block buffer ran empty (buffer underrun) behind one of these blocks (ascending)? Each is
  /// tried by itself, beside the run without a stop.
  std::vector<std::size_t> starved_blocks;
  double starved_s = 0.0;  ///< how long the set-points then wait
  /// So much of the run behind such a wait is looked at (0: all): enough where older vibration has decayed.
  double starved_memory_s = 0.0;
  /// Blocks only: the largest deviations at these feed overrides too, beside the run at its own.
  std::vector<double> other_overrides;
  double settling_band_mm = 0.0;  ///< of the settling time; 0: not measured
  /// How long behind the stop the settling time is looked for; with drives the residual too.
  double settling_limit_s = 1.0;
  /// Drives: the residual is the amplitude of the table against its motor once the motor is as near to the command;
  /// 0: |response - command| from the stop on, the lag of the servo loop included.
  double arrived_mm = 0.0;
  /// Keep at most so many samples of command and response for pictures (0: none); longer runs keep their beginning.
  std::size_t record_samples = 0;
};

/// Where a motion is fastest against the programmed feed at the same position.
struct FeedExcess {
  double speed_mm_per_s = 0.0;
  double programmed_mm_per_s = 0.0;
  std::uint32_t line = 0;  ///< of the segment that is programmed there
  /// Speed over programmed feed; 0 where nothing was measured.
  [[nodiscard]] double ratio() const noexcept {
    return programmed_mm_per_s > 0.0 ? speed_mm_per_s / programmed_mm_per_s : 0.0;
  }
};

/// What a wait for the next block does to a run.
struct StarvedFigures {
  std::size_t block = 0;  ///< the set-points wait behind it
  /// Largest |response - command| while the set-points rest: in the wait, and at the end of the run where that was
  /// simulated. Zero in the wait if the filters are longer than it, so that the set-points never rest.
  Vector3 residual_mm = Vector3::Zero();
  DeviationStats command;  ///< of the run up to the end of what was looked at
  DeviationStats response;
};

/// The largest deviations of a run at another feed override.
struct OverrideFigures {
  double override_ratio = 1.0;
  double command_mm = 0.0;   ///< as DeviationStats::max_abs_mm of a run of its own, to 1e-9 of it
  double response_mm = 0.0;  ///< likewise
};

/// Figures of one run from rest to rest. Deviations in mm against the programmed path.
struct SimulationFigures {
  double duration_s = 0.0;                ///< until the set-points rest, after every filter
  Vector3 residual_mm = Vector3::Zero();  ///< largest |response - command| from that instant on
  /// From that instant until |response - command| stays within the band, in whole periods; infinite: the band
  /// is still left in the last fifth of the limit.
  Vector3 settling_s = Vector3::Zero();
  Vector3 peak_mm = Vector3::Zero();                      ///< largest |response - command| before it
  Vector3 peak_acceleration_mm_per_s2 = Vector3::Zero();  ///< of the command, second difference
  DeviationStats command;
  DeviationStats response;
  std::vector<double> orbit_error_percent;           ///< per arc of the path, of the command
  std::vector<double> response_orbit_error_percent;  ///< the same of the response, where asked for
  FeedExcess feed_excess;                            ///< of the command, where asked for
  Vector3 end_mm = Vector3::Zero();
  std::vector<StarvedFigures> starved;           ///< one per SimulationOptions::starved_blocks
  std::vector<OverrideFigures> other_overrides;  ///< one per SimulationOptions::other_overrides
  Samples recorded_command;
  Samples recorded_response;
};

/// Simulates a path under a speed profile (a controller with look-ahead) through filters and plant. Streams: memory
/// does not grow with the length of the run. Throws Error(argument) on a plant that cannot be, Error(numeric) where the
/// integrator of a drive fails.
[[nodiscard]] SimulationFigures simulate_path(const std::shared_ptr<const Path>& path,
                                              std::shared_ptr<const SpeedProfile> profile,
                                              const SimulationOptions& options);
/// The same, measured against another path: that of `programmed`, of which `path` is made.
[[nodiscard]] SimulationFigures simulate_path(const std::shared_ptr<const Path>& path,
                                              std::shared_ptr<const SpeedProfile> profile, const Path& programmed,
                                              const SimulationOptions& options);

/// The same with the profile that `plan_speed` gives under the limits, which is not kept where it need not be: of the
/// plan then stands in memory a number per segment.
[[nodiscard]] SimulationFigures simulate_planned(const std::shared_ptr<const Path>& path, const MotionLimits& limits,
                                                 const Path& programmed, const SimulationOptions& options);

/// Simulates blocks at their feed (a controller without look-ahead), measured against the programmed `path`. Throws
/// Error(argument) on starved blocks that do not ascend or do not exist, and together with `last_seconds`. Other
/// overrides cost little where blocks are lines, modes do not vary and nothing filters the set-points, else a run each.
[[nodiscard]] SimulationFigures simulate_blocks(const Segments& blocks, const Path& path, BlockEnd block_end,
                                                double override_ratio, const SimulationOptions& options);

/// Any set-points, (n, 3), measured against the programmed `path` (empty: no contour figures).
[[nodiscard]] SimulationFigures simulate_samples(const Samples& samples, const Path& path,
                                                 const SimulationOptions& options);

/// Where a stop between two blocks excites most: for each axis the block at whose end its speed is largest, the last
/// block (which ends in a stop) left out. Ascending, each once; an axis that never moves there has none.
[[nodiscard]] std::vector<std::size_t> fastest_block_ends(const Segments& blocks);

/// Blocks that a controller with look-ahead would run slower than programmed: per-axis speed step at a border over the
/// corner limit, feed over an axis limit.
struct LookAheadLimits {
  Vector3 corner_speed_difference_mm_per_s;
  Vector3 max_feed_mm_per_s;
};
[[nodiscard]] std::size_t count_slowed_blocks(const Segments& blocks, const LookAheadLimits& limits);

/// What a run is looked at with.
struct TravelOptions {
  double period_s = 0.001;
  std::vector<Fir> axis_filters;  ///< behind the set-points, in order
  /// Time over which the travel is taken; at least one period. With the time between two teeth, speed times that time
  /// is the feed per tooth which the machine really has.
  double window_s = 0.0;
};

/// How a path is really travelled, per section that ends at a station and begins at the one before it.
struct Travel {
  std::vector<double> highest_mm_per_s;  ///< largest travel within a window, over the window
  std::vector<double> time_s;            ///< spent on the section; 0 where one period passes over all of it
  double duration_s = 0.0;               ///< until the set-points rest
};

/// A path under a speed profile (a controller with look-ahead), its set-points behind the filters followed along
/// `along`: the same path, or one of which it is made. `stations_mm` ascend from above 0 to the length of `along`.
/// Throws Error(argument) on stations that do not, a period <= 0 or a window < 0.
[[nodiscard]] Travel travel_path(const std::shared_ptr<const Path>& path,
                                 const std::shared_ptr<const SpeedProfile>& profile, const Path& along,
                                 std::span<const double> stations_mm, const TravelOptions& options);

/// Blocks at their feed (a controller without look-ahead), followed along `along`, of which they are made.
[[nodiscard]] Travel travel_blocks(const Segments& blocks, const Path& along, BlockEnd block_end,
                                   std::span<const double> stations_mm, const TravelOptions& options);

}  // namespace shapegcode
