// The command of a motion from rest to rest before shaping: a speed profile along its path, or planned set-points.
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>

#include "shapegcode/command.hpp"
#include "shapegcode/motion.hpp"
#include "shapegcode/path.hpp"

namespace shapegcode {

/// A motion read row by row, one every half block period.
class RunRowsReader {
 public:
  RunRowsReader() = default;
  RunRowsReader(const RunRowsReader&) = delete;
  RunRowsReader& operator=(const RunRowsReader&) = delete;
  virtual ~RunRowsReader() = default;

  /// Position of the next row, the start first; behind the end it stays there.
  virtual void next(Vector3& position) = 0;
  // Of the row last given.
  [[nodiscard]] virtual std::size_t segment() const noexcept = 0;
  [[nodiscard]] virtual const Segment& on() const noexcept = 0;
  [[nodiscard]] virtual Vector3 tangent() const noexcept = 0;
};

/// A run from rest to rest in time.
class RunMotion {
 public:
  RunMotion() = default;
  RunMotion(const RunMotion&) = delete;
  RunMotion& operator=(const RunMotion&) = delete;
  virtual ~RunMotion() = default;

  [[nodiscard]] virtual double duration_s() const noexcept = 0;
  /// Whole block periods until it rests.
  [[nodiscard]] virtual std::size_t block_periods(double half_period_s) const = 0;
  /// `delay_s`: rest at the start before the motion begins.
  [[nodiscard]] virtual std::unique_ptr<RunRowsReader> read(double half_period_s, double delay_s) const = 0;
  /// Time at which a segment is entered; `cursor`: 0, or that of the last call for a segment before it.
  [[nodiscard]] virtual double entered_s(std::size_t segment, std::size_t& cursor) const = 0;
  /// By how much it leaves the path where junctions are rounded; 0: it keeps to the path.
  [[nodiscard]] virtual double rounding_mm() const noexcept { return 0.0; }
  /// Speeds at which it passes segments and junctions; null: as their limits say.
  [[nodiscard]] virtual const SpeedCaps* passed() const noexcept { return nullptr; }
};

/// A profile run along its path; `steps_per_half`: set-points in half a block period.
[[nodiscard]] std::shared_ptr<const RunMotion> motion_of(std::shared_ptr<const Path> path,
                                                         std::shared_ptr<const SpeedProfile> profile,
                                                         std::size_t steps_per_half);

/// Plans runs as the options of a region say.
class RunPlanner {
 public:
  /// Throws Error(argument) if the block period is not a whole multiple of the interpolation period, or, for the
  /// time-optimal planner, an axis has no limit of feed, acceleration or jerk.
  /// `spread_s`: how far the shaper mixes the motion to one side of its mean delay.
  RunPlanner(const ShapingOptions& options, double spread_s);

  /// Rules for segments and corners that the planner looks at beside the axes' own limits.
  [[nodiscard]] const MotionLimits& rules() const noexcept { return rules_; }
  /// What of the contour tolerance is left for the filter behind.
  [[nodiscard]] FilterTolerance left_to_filter() const noexcept;
  /// With a target the search for the feed keeps the tolerance, else `left_to_filter`. Throws as plan_speed does.
  [[nodiscard]] std::shared_ptr<const RunMotion> plan(const std::shared_ptr<const Path>& path,
                                                      const SpeedCaps* caps = nullptr) const;

 private:
  [[nodiscard]] std::shared_ptr<const RunMotion> along_path(const std::shared_ptr<const Path>& path,
                                                            const SpeedCaps* caps) const;
  [[nodiscard]] std::shared_ptr<const RunMotion> time_optimal(const std::shared_ptr<const Path>& path,
                                                              const SpeedCaps* caps) const;

  CommandPlanner kind_;
  MotionLimits limits_, rules_;
  FilterTolerance tolerance_;
  ContourTarget target_;
  double half_period_s_;
  double spread_s_;
  double rounding_mm_ = 0.0;
  std::size_t steps_per_half_ = 1;
};

}  // namespace shapegcode
