#include "shapegcode/simulation.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <optional>
#include <utility>

#include <fmt/format.h>

#include "base/checks.hpp"
#include "motion/planned_motion.hpp"
#include "shapegcode/error.hpp"
#include "shapegcode/measure/contour.hpp"
#include "shapegcode/motion.hpp"
#include "simulate/axis_plant.hpp"
#include "simulate/deviation_bounds.hpp"
#include "simulate/feed_meter.hpp"
#include "simulate/filter_chain.hpp"
#include "simulate/override_maxima.hpp"

namespace shapegcode {
namespace {

constexpr double recorded_decay_s = 0.25;

// A drive is at rest when no axis has moved by more than this in this time; waiting ends at the limit.
constexpr double resting_mm = 1e-6;
constexpr double resting_s = 0.05;
constexpr double longest_lag_s = 10.0;

// What the trackers are given where no contour is measured: they refuse a path without segments.
const Path& a_point() {
  static const Path point({make_line(Vector3::Zero(), Vector3::Zero(), 0.0)});
  return point;
}

ContourTracker tracker_of(const Path& path, const SimulationOptions& options) {
  return options.tracker ? *options.tracker : ContourTracker(path);
}

// Everything that hangs on one stream of set-points.
class Recorder {
 public:
  // `command_on_path`: the command follows the path exactly, so only the response can leave it.
  Recorder(const Path& path, const SimulationOptions& options, bool command_on_path)
      : options_(options),
        filters_(options.axis_filters),
        plant_(options),
        tracks_contour_(options.measure_contour && path.length_mm() > 0.0),
        tracks_command_(tracks_contour_ && options.measure_command && !command_on_path),
        tracks_response_(tracks_contour_ && options.measure_response),
        tracks_response_orbit_(tracks_response_ && options.measure_response_orbit),
        command_tracker_(tracks_contour_ ? tracker_of(path, options) : ContourTracker(a_point())),
        response_tracker_(command_tracker_),
        orbit_(tracks_contour_ ? path : a_point()),
        response_orbit_(tracks_response_orbit_ ? path : a_point()),
        feed_(path, options),
        command_reach_(tracks_contour_ ? path : a_point()),
        response_reach_(command_reach_) {}

  // `waiting`: the set-point is one of a wait for the next block.
  void add(Vector3 setpoint, bool waiting = false) {
    if (count_ == 0) {
      filters_.reset(setpoint);
      plant_.reset(setpoint);
      last_ = setpoint;
      before_last_ = setpoint;
    }
    filters_.step(setpoint);
    const Vector3& command = setpoint;
    const bool moves = (command - last_).cwiseAbs().maxCoeff() > 0.0;
    if (moves) {
      last_moving_ = count_;
      if (rests_in_wait_) {
        rests_in_wait_ = false;
        wait_residual_ = wait_residual_.cwiseMax(plant_.peak());
        peak_ = peak_.cwiseMax(wait_residual_);
      }
    } else if (last_moving_ + 1 == count_) {
      at_rest_plant_ = plant_;  // as it stood when the set-points came to rest; overwritten if they move on
      if (waiting) {
        rests_in_wait_ = true;
        peak_ = peak_.cwiseMax(plant_.peak());
        plant_.reset_peak();
      }
    }
    const Vector3 response = plant_.step(command);
    acceleration_ = acceleration_.cwiseMax((command - 2.0 * last_ + before_last_).cwiseAbs());
    before_last_ = last_;
    last_ = command;
    if (tracks_command_) {
      const double deviation = command_tracker_.step(command);
      command_deviation_mm_ = deviation;
      figures_.command.add(deviation);
      if (feed_.measures()) {
        feed_.step(command, command_tracker_, deviation);
      }
      orbit_.step(command, command_tracker_.segment());
      command_reach_.step(command, command_tracker_.s_mm());
    } else if (tracks_response_) {
      command_tracker_.step(command);  // says how far the response can be
    }
    if (tracks_response_) {
      figures_.response.add(follow(response));
    }
    record(command, response);
    ++count_;
  }

  SimulationFigures finish(const Vector3& end) {
    for (int i = 0; i < filters_.tail(); ++i) {
      add(end);
    }
    if (last_moving_ + 1 == count_) {
      at_rest_plant_ = plant_;
    }
    figures_.duration_s = static_cast<double>(last_moving_) * options_.period_s;
    figures_.peak_mm = peak_.cwiseMax(at_rest_plant_.peak());
    const detail::AtRest rest = at_rest_plant_.at_rest(last_, options_.settling_band_mm, options_.settling_limit_s);
    figures_.residual_mm = rest.residual_mm;
    figures_.settling_s = rest.settling_s;
    figures_.peak_acceleration_mm_per_s2 = acceleration_ / (options_.period_s * options_.period_s);
    figures_.end_mm = last_;
    figures_.feed_excess = feed_.largest();
    if (tracks_contour_) {
      if (options_.measure_command) {
        figures_.orbit_error_percent = orbit_.percent();
      }
      count_command();
      figures_.command.include_missed(command_reach_.largest_mm());
    }
    if (tracks_response_) {
      follow_lag();
      figures_.response.include_missed(response_reach_.largest_mm());
      if (tracks_response_orbit_) {
        figures_.response_orbit_error_percent = response_orbit_.percent();
      }
    }
    // A picture of the decay needs what comes after the stop.
    const double decay = std::floor(recorded_decay_s / options_.period_s);
    for (double i = 0.0; commands_.size() < options_.record_samples && i < decay; ++i) {
      record(last_, plant_.step(last_));
    }
    figures_.recorded_command = pack(commands_);
    figures_.recorded_response = pack(responses_);
    return std::move(figures_);
  }

  /// Of the set-point last added, where its deviation is measured.
  [[nodiscard]] const ContourTracker& command_tracker() const noexcept { return command_tracker_; }
  [[nodiscard]] double command_deviation_mm() const noexcept { return command_deviation_mm_; }

  // The wait is over and what it excited has decayed: the rest of the run is that without a wait.
  StarvedFigures finish_wait() {
    if (tracks_contour_) {
      count_command();
      figures_.command.include_missed(command_reach_.largest_passed_mm());
    }
    if (tracks_response_) {
      figures_.response.include_missed(response_reach_.largest_passed_mm());
    }
    return {0, wait_residual_, figures_.command, figures_.response};
  }

  // The run was simulated to its end after a wait.
  StarvedFigures finish_wait(const Vector3& end) {
    const SimulationFigures whole = finish(end);
    return {0, wait_residual_.cwiseMax(whole.residual_mm), whole.command, whole.response};
  }

 private:
  // A command that is not followed lies on the path.
  void count_command() {
    if (!tracks_command_) {
      figures_.command.count = figures_.response.count;
    }
  }

  // Deviation of the response from the path, with all that hangs on where its foot is.
  double follow(const Vector3& response) {
    const double deviation = response_tracker_.step(response, command_tracker_);
    response_reach_.step(response, response_tracker_.s_mm());
    if (tracks_response_orbit_) {
      response_orbit_.step(response, response_tracker_.segment());
    }
    return deviation;
  }

  // A drive stands short of the path's end by its lag when the command gets there, and is measured until it has
  // arrived. Extremes count; the RMS stays that of the time in which the command moves.
  void follow_lag() {
    if (plant_.drives().empty()) {
      return;
    }
    detail::AxisPlant plant = plant_;
    DeviationStats arriving;
    const double resting_periods = whole_periods(resting_s / options_.period_s);
    const double most_periods = whole_periods(longest_lag_s / options_.period_s);
    double rested = 0.0;
    Vector3 stood = last_;
    for (double k = 1.0; k <= most_periods && rested < resting_periods; ++k) {
      const Vector3 response = plant.step(last_);
      arriving.add(follow(response));
      if ((response - stood).cwiseAbs().maxCoeff() > resting_mm) {
        stood = response;
        rested = 0.0;
      } else {
        ++rested;
      }
    }
    figures_.response.include_extremes(arriving);
  }

  void record(const Vector3& command, const Vector3& response) {
    if (commands_.size() < options_.record_samples) {
      commands_.push_back(command);
      responses_.push_back(response);
    }
  }

  [[nodiscard]] Samples pack(const std::vector<Vector3>& rows) const {
    Samples samples;
    samples.period_s = options_.period_s;
    samples.positions_mm.resize(static_cast<Eigen::Index>(rows.size()), axis_count);
    for (std::size_t i = 0; i < rows.size(); ++i) {
      samples.positions_mm.row(static_cast<Eigen::Index>(i)) = rows[i];
    }
    return samples;
  }

  const SimulationOptions& options_;
  detail::FilterChain filters_;
  detail::AxisPlant plant_;
  detail::AxisPlant at_rest_plant_ = plant_;
  bool tracks_contour_;
  bool tracks_command_;
  bool tracks_response_;
  bool tracks_response_orbit_;
  ContourTracker command_tracker_;
  ContourTracker response_tracker_;
  OrbitError orbit_;
  OrbitError response_orbit_;
  detail::FeedMeter feed_;
  CornerReach command_reach_;
  CornerReach response_reach_;
  SimulationFigures figures_;
  double command_deviation_mm_ = 0.0;
  Vector3 last_ = Vector3::Zero();
  Vector3 before_last_ = Vector3::Zero();
  Vector3 acceleration_ = Vector3::Zero();
  Vector3 peak_ = Vector3::Zero();           // before the set-points rested in a wait, and in it
  Vector3 wait_residual_ = Vector3::Zero();  // largest |response - command| at rest in a wait
  bool rests_in_wait_ = false;
  std::vector<Vector3> commands_;
  std::vector<Vector3> responses_;
  std::size_t count_ = 0;
  std::size_t last_moving_ = 0;
};

template <class Step>
SimulationFigures simulate(const Path& path, const SimulationOptions& options, bool command_on_path, Step&& step) {
  Recorder recorder(path, options, command_on_path);
  Vector3 position = Vector3::Zero();
  while (step(position)) {
    recorder.add(position);
  }
  return recorder.finish(position);
}

// The run goes on from here in a copy of everything, with a wait behind the block on which it stands.
StarvedFigures starve(Recorder recorder, BlockInterpolator interpolator, const SimulationOptions& options) {
  const std::size_t block = interpolator.block();
  interpolator.pause_after(block, options.starved_s);
  const auto memory = static_cast<std::size_t>(require_count(whole_periods(options.starved_memory_s / options.period_s),
                                                             max_set_points, "memory of a wait", "set-points"));
  std::size_t behind = 0;  // samples since the wait was over
  Vector3 position = Vector3::Zero();
  while ((memory == 0 || behind < memory) && interpolator.step(position)) {
    recorder.add(position, interpolator.pausing());
    behind += interpolator.block() > block ? 1U : 0U;
  }
  const bool ended = memory == 0 || behind < memory;
  StarvedFigures figures = ended ? recorder.finish_wait(position) : recorder.finish_wait();
  figures.block = block;
  return figures;
}

void check_starved(const Segments& blocks, const SimulationOptions& options) {
  const std::vector<std::size_t>& starved = options.starved_blocks;
  if (starved.empty()) {
    return;
  }
  if (options.last_seconds > 0.0) {
    throw Error(ErrorKind::argument, "starved blocks need the whole run: last_seconds must be 0");
  }
  const bool usable = options.starved_s >= 0.0 && options.starved_memory_s >= 0.0 && std::isfinite(options.starved_s) &&
                      std::isfinite(options.starved_memory_s);
  if (!usable) {
    throw Error(ErrorKind::argument, fmt::format("wait of {} s and memory of {} s must be finite and >= 0",
                                                 options.starved_s, options.starved_memory_s));
  }
  if (starved.back() >= blocks.size() || !std::is_sorted(starved.begin(), starved.end())) {
    throw Error(ErrorKind::argument,
                fmt::format("starved blocks must ascend and lie below the {} blocks given", blocks.size()));
  }
}

void check_other_overrides(const SimulationOptions& options) {
  if (options.other_overrides.empty()) {
    return;
  }
  if (options.last_seconds > 0.0) {
    throw Error(ErrorKind::argument, "other overrides need the whole run: last_seconds must be 0");
  }
  for (const double ratio : options.other_overrides) {
    require_above_zero(ratio, "override", "");
  }
}

// Whether the bounds of DeviationBounds hold and the modes move in closed form.
bool has_bounds(const Path& path, const SimulationOptions& options) {
  const bool varies =
      std::any_of(options.mode_tables.begin(), options.mode_tables.end(), [](const std::vector<ModeTable>& tables) {
        return std::any_of(tables.begin(), tables.end(), [](const ModeTable& table) { return !table.empty(); });
      });
  const bool measures = options.measure_contour && options.measure_command && options.measure_response;
  return measures && !varies && options.drives.empty() && options.axis_filters.empty() && path.length_mm() > 0.0;
}

OverrideFigures simulate_in_full(const Segments& blocks, const Path& path, BlockEnd block_end, double override_ratio,
                                 const SimulationOptions& options) {
  SimulationOptions alone = options;
  alone.other_overrides.clear();
  alone.starved_blocks.clear();
  alone.record_samples = 0;
  alone.feed_window_s = 0.0;
  const SimulationFigures figures = simulate_blocks(blocks, path, block_end, override_ratio, alone);
  return {override_ratio, figures.command.max_abs_mm, figures.response.max_abs_mm};
}

Segments last_blocks(const Segments& blocks, double seconds) {
  std::size_t first = blocks.size();
  while (first > 0 && seconds > 0.0) {
    --first;
    const Segment block = blocks[first];
    seconds -= block.length_mm / block.feed_mm_per_s;
  }
  return blocks.part(first, blocks.size() - first);
}

}  // namespace

SimulationFigures simulate_path(const std::shared_ptr<const Path>& path, std::shared_ptr<const SpeedProfile> profile,
                                const SimulationOptions& options) {
  Interpolator interpolator(path, std::move(profile), options.period_s);
  return simulate(*path, options, options.axis_filters.empty(),
                  [&](Vector3& position) { return interpolator.step(position); });
}

SimulationFigures simulate_path(const std::shared_ptr<const Path>& path, std::shared_ptr<const SpeedProfile> profile,
                                const Path& programmed, const SimulationOptions& options) {
  Interpolator interpolator(path, std::move(profile), options.period_s);
  return simulate(programmed, options, false, [&](Vector3& position) { return interpolator.step(position); });
}

SimulationFigures simulate_planned(const std::shared_ptr<const Path>& path, const MotionLimits& limits,
                                   const Path& programmed, const SimulationOptions& options) {
  if (!PlainPlan::serves(limits) || !(path->length_mm() > 0.0)) {
    return simulate_path(path, std::make_shared<const SpeedProfile>(plan_speed(*path, limits)), programmed, options);
  }
  PlannedMotion motion(*path, limits, options.period_s);
  return simulate(programmed, options, false, [&](Vector3& position) { return motion.step(position); });
}

SimulationFigures simulate_blocks(const Segments& blocks, const Path& path, BlockEnd block_end, double override_ratio,
                                  const SimulationOptions& options) {
  check_starved(blocks, options);
  check_other_overrides(options);
  const double last_s = options.last_seconds * override_ratio;
  const bool is_bounded = !options.other_overrides.empty() && override_ratio == 1.0 && has_bounds(path, options);
  BlockInterpolator interpolator(last_s > 0.0 ? last_blocks(blocks, last_s) : blocks, options.period_s, block_end,
                                 override_ratio);
  Recorder recorder(path, options, false);
  std::vector<StarvedFigures> starved;
  std::optional<detail::DeviationBounds> bounds;
  if (is_bounded) {
    bounds.emplace(path, blocks, block_end,
                   *std::max_element(options.other_overrides.begin(), options.other_overrides.end()));
  }
  Vector3 position = Vector3::Zero();
  while (interpolator.step(position)) {
    recorder.add(position);
    if (bounds) {
      bounds->add(interpolator, position, recorder.command_deviation_mm(), recorder.command_tracker());
    }
    while (starved.size() < options.starved_blocks.size() &&
           interpolator.block() >= options.starved_blocks[starved.size()]) {
      starved.push_back(starve(recorder, interpolator, options));
    }
  }
  SimulationFigures figures = recorder.finish(position);
  figures.starved = std::move(starved);
  if (bounds) {
    const std::vector<detail::BlockGroup>& groups = bounds->finish();
    detail::OverrideMaxima maxima(path, blocks, groups, bounds->corners(), tracker_of(path, options), block_end,
                                  options);
    for (const double ratio : options.other_overrides) {
      figures.other_overrides.push_back(maxima.at(ratio));
    }
  } else {
    for (const double ratio : options.other_overrides) {
      figures.other_overrides.push_back(simulate_in_full(blocks, path, block_end, ratio, options));
    }
  }
  return figures;
}

SimulationFigures simulate_samples(const Samples& samples, const Path& path, const SimulationOptions& options) {
  Eigen::Index row = 0;
  return simulate(path, options, false, [&](Vector3& position) {
    if (samples.positions_mm.rows() > 0) {
      position = samples.positions_mm.row(std::min(row, samples.positions_mm.rows() - 1));
    }
    return row++ < samples.positions_mm.rows();
  });
}

std::vector<std::size_t> fastest_block_ends(const Segments& blocks) {
  std::vector<std::size_t> ends;
  Vector3 fastest = Vector3::Zero();
  std::array<std::size_t, axis_count> where{};
  std::size_t last = blocks.size();
  while (last > 0 && blocks[last - 1].length_mm <= 0.0) {
    --last;
  }
  for (std::size_t i = 0; i + 1 < last; ++i) {
    const Segment block = blocks[i];
    if (block.length_mm <= 0.0) {
      continue;
    }
    const Vector3 speed = (tangent_at(block, block.length_mm) * block.feed_mm_per_s).cwiseAbs();
    for (Eigen::Index axis = 0; axis < axis_count; ++axis) {
      if (speed[axis] > fastest[axis]) {
        fastest[axis] = speed[axis];
        where[static_cast<std::size_t>(axis)] = i;
      }
    }
  }
  for (Eigen::Index axis = 0; axis < axis_count; ++axis) {
    if (fastest[axis] > 0.0) {
      ends.push_back(where[static_cast<std::size_t>(axis)]);
    }
  }
  std::sort(ends.begin(), ends.end());
  ends.erase(std::unique(ends.begin(), ends.end()), ends.end());
  return ends;
}

std::size_t count_slowed_blocks(const Segments& blocks, const LookAheadLimits& limits) {
  std::size_t slowed = 0;
  Vector3 speed_before = Vector3::Zero();
  for (const Segment& block : blocks) {
    if (block.length_mm <= 0.0) {
      continue;
    }
    const Vector3 speed_in = tangent_at(block, 0.0) * block.feed_mm_per_s;
    const Vector3 step = (speed_in - speed_before).cwiseAbs();
    const bool over = ((step.array() > limits.corner_speed_difference_mm_per_s.array()) ||
                       (speed_in.cwiseAbs().array() > limits.max_feed_mm_per_s.array()))
                          .any();
    slowed += over ? 1U : 0U;
    speed_before = tangent_at(block, block.length_mm) * block.feed_mm_per_s;
  }
  return slowed;
}

}  // namespace shapegcode
