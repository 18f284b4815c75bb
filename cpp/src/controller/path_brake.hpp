// Deceleration along the planned path, harder than planned.
#pragma once

#include "controller/sections.hpp"
#include "planner/stations.hpp"

namespace shapegcode {

/// Between the points of the section that is being run: as much of each axis' acceleration as the curve leaves. At the
/// latest it rests where the section does.
class PathBrake {
 public:
  PathBrake(const AxisValues& acceleration, std::size_t axes, double period_s) noexcept
      : acceleration_(acceleration), axes_(axes), period_s_(period_s) {}

  /// From the point that was given last.
  void begin(const Section& section, std::size_t index) noexcept;
  /// One period on.
  const PlannedPoint& step() noexcept;
  [[nodiscard]] bool at_rest() const noexcept { return point_.point.state.speed <= 0.0; }
  [[nodiscard]] const PlannedPoint& point() const noexcept { return point_; }

 private:
  [[nodiscard]] double hardest() const noexcept;
  [[nodiscard]] double planned_speed(double distance) const noexcept;
  void go_to(double distance, double speed, double deceleration) noexcept;

  AxisValues acceleration_;
  std::size_t axes_;
  double period_s_;
  const Section* section_ = nullptr;
  std::size_t index_ = 0;  // the point behind is the next one
  PlannedPoint point_;
};

}  // namespace shapegcode
