#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <utility>
#include <vector>

#include "command/run_corrector.hpp"
#include "command/run_deviation.hpp"
#include "command/run_filter.hpp"
#include "command/run_motion.hpp"
#include "command/run_shaper.hpp"
#include "shapegcode/motion.hpp"
#include "shapegcode/path.hpp"

namespace shapegcode {

/// Limits of the axes during contour correction.
[[nodiscard]] RunLimits run_limits(const MotionLimits& limits);

/// A shaped run as `RunShaper` gives it out.
struct RunRows {
  Column<Vector3> positions;              ///< one per row
  SteadyColumn<std::int8_t> arc_normals;  ///< one per block period
};

/// A run with the speed at which it keeps the contour tolerance.
struct PlannedRun {
  std::shared_ptr<const Path> path;
  std::shared_ptr<const RunMotion> motion;
  double largest_deviation_mm = 0.0;  ///< of what follows the path, as far as the plan tells
  /// Segments before which the run must come to rest, because no speed into them keeps the tolerance. The motion is
  /// then of no use: plan the pieces between.
  std::vector<std::size_t> stops;
  /// The run itself, shaped while it was measured; empty where it is longer than what is kept.
  RunRows rows;
};

/// Looks for it: see `plan_within_tolerance`. The rows of the first round may be asked for one by one, by one who
/// cannot wait until all are measured.
class FeedSearch {
 public:
  /// `filter` and `planner` stay the caller's. `limits`: of the corrections.
  FeedSearch(std::shared_ptr<const Path> path, const RunLimits& limits, const RunFilter& filter,
             const RunPlanner& planner, double tolerance_mm, double least_feed_mm_per_s);

  /// To be called before the first round: starts from these speeds, one per segment, of the same path.
  void start_from(SpeedCaps caps) noexcept { caps_ = std::move(caps); }
  /// To be called before the first round: the run itself is not wanted, only its plan.
  void keep_no_rows() noexcept { keeps_rows_ = false; }
  /// Plans the next round.
  void begin_round();
  /// Of the round that was begun.
  [[nodiscard]] const PlannedRun& plan() const noexcept { return plan_; }
  [[nodiscard]] RunShaper& shaper() noexcept { return *shaper_; }
  [[nodiscard]] double largest_deviation_mm() const noexcept { return deviation_.largest; }
  /// Whether the first round left the tolerance; to be asked behind run().
  [[nodiscard]] bool is_slowed() const noexcept { return is_slowed_; }
  /// Speeds of the last round that was planned.
  [[nodiscard]] const SpeedCaps& caps() const noexcept { return caps_; }
  /// Its next row, of 2*periods()+1; false if the run has left the tolerance: it is then not the one looked for. One
  /// that never leaves it is.
  bool next(Vector3& position);
  /// The run looked for; goes on with the round that was begun.
  [[nodiscard]] PlannedRun run();

 private:
  PlannedRun measured();
  bool adjust(const RunMotion& motion, bool raise);
  [[nodiscard]] double next_speed(double speed, double deviation, bool curve, double own_mm) const noexcept;
  [[nodiscard]] double slowest(double speed) const noexcept;
  bool slow_lines();

  std::shared_ptr<const Path> path_;
  RunLimits limits_;
  const RunFilter& filter_;
  const RunPlanner& planner_;
  double tolerance_;
  double min_feed_;
  SpeedCaps caps_;
  RunDeviation deviation_;
  std::vector<std::size_t> stops_;
  PlannedRun plan_;  // of the current round, with its shaper
  std::unique_ptr<RunShaper> shaper_;
  std::size_t row_ = 0;  // rows of it that were measured
  bool keeps_rows_ = true;
  bool is_slowed_ = false;
};

/// The highest feed at which a run keeps the contour tolerance: planned at full speed, shaped, measured, and slowed
/// only on the arcs and at the corners that leave the tolerance, until all keep it; what was slowed too far is raised
/// again. `tolerance_mm` is of what the filter's target says shall follow the path. A corner that would have to be
/// crept through is a stop; nothing else is slowed below `least_feed_mm_per_s`, which a controller may not run.
[[nodiscard]] PlannedRun plan_within_tolerance(std::shared_ptr<const Path> path, const RunLimits& limits,
                                               const RunFilter& filter, const RunPlanner& planner, double tolerance_mm,
                                               double least_feed_mm_per_s = 0.0);

}  // namespace shapegcode
