// The motion along the planned path: one state a period, always such that a stop is certain.
#pragma once

#include <array>
#include <cstddef>
#include <limits>

#include "planner/path_plan.hpp"

namespace shapegcode {

class PathMotion {
 public:
  /// At rest at the start. The plan must outlive it.
  PathMotion(const PathPlan& plan, double period_s) : plan_(&plan), period_s_(period_s) {}

  /// One period on, as fast as the plan allows.
  void advance() noexcept;
  [[nodiscard]] bool at_end() const noexcept { return station_ == plan_->end(); }
  /// The segment that it is in.
  [[nodiscard]] std::size_t segment() const noexcept {
    return plan_->station(at_end() ? station_ - 1 : station_).segment;
  }
  /// Position of every axis.
  [[nodiscard]] AxisValues position() const noexcept;

 private:
  // Three constant jerks, each for whole periods, that end at rest.
  struct Landing {
    std::array<double, 3> jerk{};
    std::array<int, 3> periods{};
    [[nodiscard]] bool runs() const noexcept { return periods[0] + periods[1] + periods[2] > 0; }
  };
  struct Jerks {
    double low, high;
  };
  struct Place {
    std::size_t station;
    double offset;
    bool planned;
  };

  [[nodiscard]] Place place_at(double travel) const noexcept;
  [[nodiscard]] double to_stop(double most) const noexcept;
  [[nodiscard]] Derivatives derivatives_after(double time_s) const noexcept;
  [[nodiscard]] Jerks allowed() const noexcept;
  [[nodiscard]] bool controllable(double jerk, double time_s, const Derivatives& path) const noexcept;
  [[nodiscard]] bool controllable(double jerk) const noexcept;
  [[nodiscard]] bool choose(double& jerk) const noexcept;
  [[nodiscard]] bool keeps_limits(const Landing& landing, double excess) const noexcept;
  bool land(double travel, double excess) noexcept;
  void fly_on() noexcept;
  void move(double jerk, double time_s) noexcept;
  void pass(double travel) noexcept;
  void come_to_standstill() noexcept;
  void come_to_rest() noexcept;
  void follow() noexcept;
  [[nodiscard]] double course(double left, PathState state) noexcept;

  const PathPlan* plan_;
  double period_s_;
  std::size_t station_ = 0;
  double offset_ = 0.0;
  AlongPath state_;
  double jerk_ = 0.0;  // of the last period
  Landing landing_;
  double course_ = 0.0;  // the last choice of c, and the interval that it was made for
  std::size_t course_station_ = std::numeric_limits<std::size_t>::max();
  // Of this period.
  Derivatives after_period_{}, after_two_{};
  Jerks jerks_{};
};

}  // namespace shapegcode
