#include "shapegcode/emission/shaped_command.hpp"

#include <algorithm>
#include <cmath>
#include <memory>
#include <string>
#include <utility>

#include "shapegcode/error.hpp"
#include "shapegcode/motion/interpolator.hpp"
#include "shapegcode/motion/look_ahead.hpp"

namespace shapegcode {
namespace {

// One run on the half grid: row 2k is the block border k, row 2k+1 the middle of period k.
struct Run {
  Samples half;
  std::vector<std::int8_t> arc_normal;  // per half sample, before shaping
  std::uint32_t periods = 0;            // after shaping
};

std::int8_t arc_normal_of(const Segment& segment) {
  return segment.kind == SegmentKind::arc ? static_cast<std::int8_t>(segment.normal) : std::int8_t{-1};
}

Fir on_half_grid(const Fir& shaper) {
  std::vector<int> delays = shaper.delays();
  for (int& delay : delays) {
    delay *= 2;
  }
  return Fir(std::move(delays), shaper.taps());
}

Run sample_run(const std::shared_ptr<const Path>& path, const std::shared_ptr<const SpeedProfile>& profile,
               const ShapingOptions& options) {
  const auto ticks = static_cast<std::size_t>(std::lround(options.block_period_s / options.interpolation_period_s));
  // The middle of an odd number of ticks lies between two of them.
  const std::size_t steps_per_half = ticks % 2 == 0 ? ticks / 2 : ticks;
  const double step_s = options.block_period_s / static_cast<double>(2 * steps_per_half);
  Interpolator interpolator(path, profile, step_s);
  const std::size_t steps_per_period = 2 * steps_per_half;
  const std::size_t periods = (interpolator.sample_count() - 1 + steps_per_period - 1) / steps_per_period;
  Run run;
  run.half.period_s = 0.5 * options.block_period_s;
  run.half.positions_mm.resize(static_cast<Eigen::Index>(2 * periods + 1), axis_count);
  run.arc_normal.resize(2 * periods + 1);
  Vector3 position;
  for (std::size_t row = 0; row < 2 * periods + 1; ++row) {
    interpolator.step(position);
    run.half.positions_mm.row(static_cast<Eigen::Index>(row)) = position;
    run.arc_normal[row] = arc_normal_of((*path)[interpolator.segment()]);
    for (std::size_t skip = 1; skip < steps_per_half; ++skip) {
      interpolator.step(position);
    }
  }
  return run;
}

std::shared_ptr<const Path> sub_path(const std::vector<Segment>& segments, std::size_t first, std::size_t last) {
  return std::make_shared<const Path>(std::vector<Segment>(segments.begin() + static_cast<std::ptrdiff_t>(first),
                                                           segments.begin() + static_cast<std::ptrdiff_t>(last)));
}

void shape_run(Run& run, const Fir& half_shaper) {
  run.half = half_shaper.apply(run.half);
  run.periods = static_cast<std::uint32_t>((run.half.positions_mm.rows() - 1) / 2);
}

// The plane in which a shaped period may bend: that of the arc last seen within the shaper's reach.
void append_arc_normals(const Run& run, int reach_half_steps, std::vector<std::int8_t>& normals) {
  const auto last_row = static_cast<std::int64_t>(run.arc_normal.size()) - 1;
  std::int64_t seen = -1;
  std::int64_t looked = 0;
  for (std::uint32_t k = 0; k < run.periods; ++k) {
    const std::int64_t end = std::min<std::int64_t>(2 * static_cast<std::int64_t>(k) + 2, last_row);
    for (; looked <= end; ++looked) {
      if (run.arc_normal[static_cast<std::size_t>(looked)] >= 0) {
        seen = looked;
      }
    }
    const bool within = seen >= 0 && 2 * static_cast<std::int64_t>(k) - reach_half_steps <= seen;
    normals.push_back(within ? run.arc_normal[static_cast<std::size_t>(seen)] : std::int8_t{-1});
  }
}

}  // namespace

ShapedCommand shape_path(const std::shared_ptr<const Path>& path, const Fir& shaper,
                         std::span<const std::uint32_t> marked_segments, const ShapingOptions& options) {
  const double ticks = options.block_period_s / options.interpolation_period_s;
  if (!(ticks >= 1.0 - 1e-9) || !(std::abs(ticks - std::round(ticks)) <= 1e-6)) {
    throw Error(ErrorKind::argument, "block period " + std::to_string(options.block_period_s) +
                                         " s is not a whole multiple of the interpolation period " +
                                         std::to_string(options.interpolation_period_s) + " s");
  }
  const Fir half_shaper = on_half_grid(shaper);
  const std::vector<Segment>& segments = path->segments();
  std::vector<std::size_t> borders =
      forced_stops(segments, options.plunge_axis_angle_rad, options.plunge_corner_angle_rad, options.limits);
  borders.push_back(segments.size());
  const auto rest = static_cast<std::uint32_t>(std::ceil(options.rest_at_stop_s / options.block_period_s - 1e-9));

  ShapedCommand command;
  std::vector<Run> runs;
  std::size_t first = 0;
  std::uint32_t start_period = 0;
  std::size_t mark = 0;
  for (const std::size_t border : borders) {
    const auto run_path = borders.size() == 1 ? path : sub_path(segments, first, border);
    const auto profile = std::make_shared<const SpeedProfile>(plan_speed(*run_path, options.limits));
    Run run = sample_run(run_path, profile, options);
    shape_run(run, half_shaper);
    append_arc_normals(run, half_shaper.duration_samples(), command.arc_normal);
    const double delay_s = 0.5 * profile->jerk_time_s() + shaper.mean_samples() * options.block_period_s;
    std::size_t cursor = 0;
    for (; mark < marked_segments.size() && marked_segments[mark] < border; ++mark) {
      const std::size_t local = marked_segments[mark] - first;
      const double time = local == 0 ? 0.0 : profile->time_s(run_path->distance_mm(local), cursor) + delay_s;
      const auto period = static_cast<std::uint32_t>(std::lround(time / options.block_period_s));
      command.segment_periods.push_back(start_period + std::min(period, run.periods));
    }
    const bool last = border == segments.size();
    for (std::uint32_t i = 0; i < (last ? 0U : rest); ++i) {
      command.arc_normal.push_back(std::int8_t{-1});
    }
    start_period += run.periods + (last ? 0U : rest);
    command.run_ends.push_back(start_period);
    runs.push_back(std::move(run));
    first = border;
  }
  command.segment_periods.resize(marked_segments.size(), start_period);

  command.grid_mm.resize(static_cast<Eigen::Index>(start_period) + 1, axis_count);
  command.middle_mm.resize(static_cast<Eigen::Index>(start_period), axis_count);
  Eigen::Index row = 0;
  for (Run& run : runs) {
    const auto& half = run.half.positions_mm;
    for (Eigen::Index k = 0; k < static_cast<Eigen::Index>(run.periods); ++k, ++row) {
      command.grid_mm.row(row) = half.row(2 * k);
      command.middle_mm.row(row) = half.row(2 * k + 1);
    }
    for (std::uint32_t i = 0; i < rest && &run != &runs.back(); ++i, ++row) {
      command.grid_mm.row(row) = half.row(half.rows() - 1);
      command.middle_mm.row(row) = half.row(half.rows() - 1);
    }
    command.grid_mm.row(row) = half.row(half.rows() - 1);
    run.half.positions_mm.resize(0, 0);
  }
  return command;
}

}  // namespace shapegcode
