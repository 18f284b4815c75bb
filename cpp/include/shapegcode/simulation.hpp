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

/// Options of a simulation and of its measurements.
struct SimulationOptions {
  double period_s = 0.001;
  std::vector<Fir> axis_filters;  ///< after the set-points, in order (acceleration after interpolation)
  AxisModes modes;
  AxisModeTables mode_tables;  ///< how the modes vary with position; none: constant modes
  /// Feed drives of X, Y and Z with their own modes; empty: modes alone. With drives, the modes and tables above are
  /// excited by the worktables instead of the set-points. The figures then include the lag of the servo loop, and are
  /// sampled at the set-points.
  std::vector<FeedDriveParameters> drives;
  /// A tracker of the path at its start, whose geometry several simulations share; null: each makes its own.
  std::shared_ptr<const ContourTracker> tracker;
  bool measure_contour = true;          ///< deviation of command and response and orbit errors
  bool measure_command = true;          ///< false: the response alone; no figures of the command, no orbit errors
  bool measure_response = true;         ///< false: the command alone; no figures of the response
  bool measure_response_orbit = false;  ///< also orbit errors of the response, if the contour is measured
  /// Averaging time of the speed for its largest ratio to the programmed feed; four and sixteen times it are used, too;
  /// 0: not measured. Requires the deviation of the command.
  double feed_window_s = 0.0;
  double feed_slack_mm = 0.0;  ///< distance that rounding may add within such a time
  /// Blocks only: simulate only this time before the end (0: all). Sufficient for the residual if older vibration has
  /// decayed; peak and contour figures are then those of this part.
  double last_seconds = 0.0;
  /// Blocks only: also simulate a buffer underrun after each of these blocks (ascending), one at a time.
  std::vector<std::size_t> starved_blocks;
  double starved_s = 0.0;  ///< duration of the wait
  /// Time simulated after such a wait (0: all); sufficient if older vibration has decayed by then.
  double starved_memory_s = 0.0;
  /// Blocks only: also compute the largest deviations at these feed overrides.
  std::vector<double> other_overrides;
  double settling_band_mm = 0.0;  ///< of the settling time; 0: not measured
  /// Time after the stop in which the settling time is determined; with drives also the residual.
  double settling_limit_s = 1.0;
  /// Drives: the residual is the amplitude of the worktable relative to its motor once the motor is within this
  /// distance of the command; 0: |response - command| from the stop on, including the lag of the servo loop.
  double arrived_mm = 0.0;
  /// Maximum number of samples of command and response stored for pictures, from the start (0: none).
  std::size_t record_samples = 0;
};

/// The largest ratio of the speed to the programmed feed at the same position.
struct FeedExcess {
  double speed_mm_per_s = 0.0;
  double programmed_mm_per_s = 0.0;
  std::uint32_t line = 0;  ///< of the programmed segment
  /// Speed over programmed feed; 0 if nothing was measured.
  [[nodiscard]] double ratio() const noexcept {
    return programmed_mm_per_s > 0.0 ? speed_mm_per_s / programmed_mm_per_s : 0.0;
  }
};

/// Effect of a buffer underrun.
struct StarvedFigures {
  std::size_t block = 0;  ///< after which the set-points wait
  /// Largest |response - command| while the set-points rest: during the wait, and at the end of the motion if that was
  /// simulated. Zero during a wait shorter than the filters, in which the set-points never rest.
  Vector3 residual_mm = Vector3::Zero();
  DeviationStats command;  ///< up to the end of the simulated part
  DeviationStats response;
};

/// The largest deviations at another feed override.
struct OverrideFigures {
  double override_ratio = 1.0;
  double command_mm = 0.0;   ///< as DeviationStats::max_abs_mm of a separate simulation, to 1e-9 of it
  double response_mm = 0.0;  ///< likewise
};

/// Figures of one motion from rest to rest. Deviations in mm from the programmed path.
struct SimulationFigures {
  double duration_s = 0.0;                ///< until the set-points rest, after every filter
  Vector3 residual_mm = Vector3::Zero();  ///< largest |response - command| from that instant on
  /// From that instant until |response - command| stays within the band, in whole periods; infinite: it leaves the band
  /// in the last fifth of the limit.
  Vector3 settling_s = Vector3::Zero();
  Vector3 peak_mm = Vector3::Zero();                      ///< largest |response - command| before it
  Vector3 peak_acceleration_mm_per_s2 = Vector3::Zero();  ///< of the command, second difference
  DeviationStats command;
  DeviationStats response;
  std::vector<double> orbit_error_percent;           ///< per arc of the path, of the command
  std::vector<double> response_orbit_error_percent;  ///< the same of the response, if requested
  FeedExcess feed_excess;                            ///< of the command, if requested
  Vector3 end_mm = Vector3::Zero();
  std::vector<StarvedFigures> starved;           ///< one per SimulationOptions::starved_blocks
  std::vector<OverrideFigures> other_overrides;  ///< one per SimulationOptions::other_overrides
  Samples recorded_command;
  Samples recorded_response;
};

/// Simulates a path under a speed profile (a controller with look-ahead) through filters and plant. Memory does not
/// grow with the length of the motion. Throws Error(argument) on an invalid plant, Error(numeric) if the integrator of
/// a drive fails.
[[nodiscard]] SimulationFigures simulate_path(const std::shared_ptr<const Path>& path,
                                              std::shared_ptr<const SpeedProfile> profile,
                                              const SimulationOptions& options);
/// The same, measured against another path: `programmed`, from which `path` was made.
[[nodiscard]] SimulationFigures simulate_path(const std::shared_ptr<const Path>& path,
                                              std::shared_ptr<const SpeedProfile> profile, const Path& programmed,
                                              const SimulationOptions& options);

/// The same with the profile of `plan_speed` under the limits, without storing the profile if possible: the plan then
/// needs one number per segment.
[[nodiscard]] SimulationFigures simulate_planned(const std::shared_ptr<const Path>& path, const MotionLimits& limits,
                                                 const Path& programmed, const SimulationOptions& options);

/// Simulates blocks at their feed (a controller without look-ahead), measured against the programmed `path`. Throws
/// Error(argument) on `starved_blocks` that do not ascend or do not exist, or together with `last_seconds`. Other
/// overrides cost little if all blocks are lines, modes do not vary and no filter follows; otherwise each is a full
/// simulation.
[[nodiscard]] SimulationFigures simulate_blocks(const Segments& blocks, const Path& path, BlockEnd block_end,
                                                double override_ratio, const SimulationOptions& options);

/// Simulates any set-points, (n, 3), measured against the programmed `path` (empty: no contour figures).
[[nodiscard]] SimulationFigures simulate_samples(const Samples& samples, const Path& path,
                                                 const SimulationOptions& options);

/// Blocks after which a stop excites most: for each axis the block with the highest speed at its end, except the last
/// block (which ends in a stop). Ascending, without repetition; none for an axis that never moves.
[[nodiscard]] std::vector<std::size_t> fastest_block_ends(const Segments& blocks);

/// Limits for counting the blocks that a controller with look-ahead would slow: per-axis speed step at a block
/// boundary, axis feed.
struct LookAheadLimits {
  Vector3 corner_speed_difference_mm_per_s;
  Vector3 max_feed_mm_per_s;
};
[[nodiscard]] std::size_t count_slowed_blocks(const Segments& blocks, const LookAheadLimits& limits);

/// Options of `travel_path` and `travel_blocks`.
struct TravelOptions {
  double period_s = 0.001;
  std::vector<Fir> axis_filters;  ///< after the set-points, in order
  /// Time over which the speed is averaged; at least one period. With the time between two teeth, speed times that time
  /// is the actual feed per tooth.
  double window_s = 0.0;
};

/// Actual speeds along a path, per section from one station to the next. Except in plunges, only travel in XY in the
/// present direction counts, converted to travel along the path.
struct Travel {
  std::vector<double> highest_mm_per_s;  ///< largest distance within a window, divided by the window
  std::vector<double> time_s;            ///< spent on the section; 0 if one period passes over all of it
  double duration_s = 0.0;               ///< until the set-points rest
};

/// Speeds of a path under a speed profile (a controller with look-ahead): its set-points after the filters are followed
/// along `along`, the same path or the one from which it was made. `stations_mm` ascend from 0 or above to the length
/// of `along`; two may be equal, as at a corner. Throws Error(argument) on others, a period <= 0 or a window < 0.
[[nodiscard]] Travel travel_path(const std::shared_ptr<const Path>& path,
                                 const std::shared_ptr<const SpeedProfile>& profile, const Path& along,
                                 std::span<const double> stations_mm, const TravelOptions& options);

/// The same for blocks at their feed (a controller without look-ahead), followed along `along`, from which they were
/// made.
[[nodiscard]] Travel travel_blocks(const Segments& blocks, const Path& along, BlockEnd block_end,
                                   std::span<const double> stations_mm, const TravelOptions& options);

}  // namespace shapegcode
