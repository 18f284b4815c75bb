// Private: a path under the look-ahead, run once from start to end.
#pragma once

#include <cstddef>
#include <memory>
#include <vector>

#include "motion/phase_maker.hpp"
#include "shapegcode/motion.hpp"
#include "shapegcode/path.hpp"

namespace shapegcode {

/// The plan of a path without zones around its corners: of it stands in memory the speed at which each segment is
/// entered, and the phases are worked out in passing.
class PlainPlan {
 public:
  /// Whether a plan under these limits needs no zones.
  [[nodiscard]] static bool serves(const MotionLimits& limits) noexcept;
  /// Throws Error(argument) on a segment without feed. The limits are not checked.
  PlainPlan(Path path, const MotionLimits& limits, const FilterTolerance& filter);

  /// A time that the phases do not exceed, in s; infinite where the path stops underway.
  [[nodiscard]] double longest_s() const noexcept;

  /// Phases in a row from the start of the path on.
  class Phases {
   public:
    explicit Phases(std::shared_ptr<const PlainPlan> plan);
    /// False behind the last one.
    bool next(SpeedPhase& phase);

   private:
    std::shared_ptr<const PlainPlan> plan_;
    PhaseMaker maker_;
    std::size_t segment_ = 0;
    std::size_t given_ = 0;  // of those that are ready
    double start_s_ = 0.0;
  };

 private:
  [[nodiscard]] Piece piece_of(const Segment& segment) const noexcept;

  Path path_;
  MotionLimits limits_;
  FilterTolerance filter_;
  std::vector<double> start_speeds_;
};

/// The set-points of `plan_speed` and `Interpolator`, to the bit, without a profile.
class PlannedMotion {
 public:
  /// `path` must have a length, and PlainPlan serve the limits. Throws Error(argument) as `plan_speed` and
  /// `Interpolator` do.
  PlannedMotion(Path path, const MotionLimits& limits, double period_s);

  /// Next set-point; false once the last one was given.
  bool step(Vector3& position);

 private:
  /// Goes on to the phase at a time.
  void pass_to(double time_s);
  void take_segment() noexcept;
  /// No more than what is run in all, or Error(argument).
  void check_count() const;

  Path path_;
  double period_s_;
  std::shared_ptr<const PlainPlan> plan_;
  PlainPlan::Phases phases_;
  SpeedPhase now_;
  SpeedPhase next_;
  bool has_next_ = false;
  std::size_t index_ = 0;
  // The current segment, as in Interpolator.
  std::size_t cursor_ = 0;
  Segment on_;
  double on_begin_mm_ = 0.0;
  double on_end_mm_ = 0.0;
};

}  // namespace shapegcode
