// Generates the phases of a profile from the ramps of its pieces, one after another, and frees the completed ones.
#pragma once

#include <array>
#include <cstddef>
#include <vector>

#include "motion/pieces.hpp"
#include "shapegcode/motion.hpp"

namespace shapegcode {

/// Ramps in a row; one that goes on as its predecessor did is joined to it.
class RampJoin {
 public:
  /// True if a phase is complete: `done`.
  bool add(const Ramp& ramp, SpeedPhase& done);
  /// The last phase; false if there is none.
  bool end(SpeedPhase& done);
  [[nodiscard]] double length_mm() const noexcept { return length_; }

 private:
  SpeedPhase open_;
  bool is_open_ = false;
  double length_ = 0.0;
};

/// Phases under the constant-time law: a ramp that is shorter than the time constant is stretched into the steady
/// stretch at its fast end. A phase hangs on two to both sides.
class RampStretch {
 public:
  explicit RampStretch(double time_constant_s) : time_constant_s_(time_constant_s) {}
  /// The phases must come in a row, `add` of the next one giving the length of the one before; between two of them
  /// `next` must be asked until it is false.
  void add(const SpeedPhase& phase);
  void end(double length_mm);
  /// Next ramp; false if another phase is needed first, or behind the end none is left.
  bool next(Ramp& ramp);

 private:
  // Indices count phases from the start of the path; what is not there is steady and asks for nothing.
  [[nodiscard]] bool exists(std::size_t i) const noexcept { return i >= first_ && i < added_; }
  [[nodiscard]] const SpeedPhase& phase(std::size_t i) const noexcept { return phases_[i % phases_.size()]; }
  [[nodiscard]] bool steady(std::size_t i) const noexcept { return phase(i).acceleration_mm_per_s2 == 0.0; }
  [[nodiscard]] double end_speed(std::size_t i) const noexcept;
  [[nodiscard]] double distance(std::size_t i) const noexcept;
  /// The steady stretch that a ramp may be stretched into; the ramp itself if there is none.
  [[nodiscard]] std::size_t fast_neighbour(std::size_t i) const noexcept;
  /// Distance by which a ramp is too short; 0 for one that is not.
  [[nodiscard]] double wanted_by(std::size_t i) const noexcept;
  /// What a ramp takes from its steady neighbour, and what a steady stretch gives to both its own.
  [[nodiscard]] double taken_by(std::size_t i) const noexcept;
  [[nodiscard]] double given_by(std::size_t k) const noexcept;

  static constexpr std::size_t around = 3;  // phases to both sides that are asked

  double time_constant_s_;
  std::array<SpeedPhase, 8> phases_;  // a ring: those around the one that comes next
  std::size_t first_ = 0;             // index of the first of them
  std::size_t added_ = 0;             // one behind the last
  std::size_t at_ = 0;                // phase that comes next
  double length_ = 0.0;
  bool ended_ = false;
};

/// The phases of a plan from the ramps of its pieces. `take` gives those that are complete.
class PhaseMaker {
 public:
  explicit PhaseMaker(const MotionLimits& limits)
      : stretches_(limits.law == AccelerationLaw::constant_time), stretch_(limits.time_constant_s) {}

  void add(const Ramp& ramp);
  void end();
  /// Length of all ramps so far.
  [[nodiscard]] double length_mm() const noexcept { return join_.length_mm(); }
  /// Phases complete since it was asked last; what was given must be cleared by the caller. `start_s` is 0.
  [[nodiscard]] std::vector<SpeedPhase>& ready() noexcept { return ready_; }

 private:
  void pass(const SpeedPhase& phase);
  void stretch();

  bool stretches_;
  RampJoin join_;
  RampStretch stretch_;
  RampJoin join_again_;
  std::vector<SpeedPhase> ready_;
};

}  // namespace shapegcode
