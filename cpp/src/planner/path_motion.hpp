// The motion along the planned path: one state per period, from which it can always stop within the limits.
#pragma once

#include <cstddef>
#include <cstdint>

#include "planner/landing.hpp"
#include "planner/path_plan.hpp"

namespace shapegcode {

/// Where a motion is: so many mm behind the start of a segment.
struct PathPoint {
  std::uint64_t segment = 0;
  double offset = 0.0;
  AlongPath state;
};

class PathMotion {
 public:
  /// In a state so many mm behind the first station of the plan, which must outlive it.
  PathMotion(const PathPlan& plan, double period_s, const AlongPath& state = {}, double in_station = 0.0)
      : plan_(&plan), period_s_(period_s), offset_(in_station), state_(state), is_beside_(state.speed > 0.0) {}

  /// One period on: as fast as the plan allows, or, below `max_speed`, slowed down to that as soon as the limits allow;
  /// 0: to rest, wherever that is.
  void advance(double max_speed = no_limit) noexcept;
  /// It takes no more than a share of the limits from here on, but for what the sets ask of it.
  void limit_to(double share) noexcept { share_ = share; }
  [[nodiscard]] bool at_end() const noexcept { return station_ == plan_->end(); }
  [[nodiscard]] bool at_rest() const noexcept {
    return state_.speed <= 0.0 && state_.acceleration == 0.0 && !landing_.runs();
  }
  /// At rest where the path has a stop.
  [[nodiscard]] bool at_stop() const noexcept {
    return at_rest() && (at_end() || (offset_ <= 0.0 && plan_->station(station_).stop));
  }
  /// At rest between two stops: it did not follow the plan, which knows no way from there.
  [[nodiscard]] bool has_strayed() const noexcept { return at_rest() && !at_stop() && (station_ > 0 || offset_ > 0.0); }
  [[nodiscard]] PathPoint point() const noexcept;
  /// How far behind a station of the plan.
  [[nodiscard]] double in_station() const noexcept { return offset_; }
  /// Stations of the plan that are behind it.
  [[nodiscard]] std::size_t passed() const noexcept { return station_; }
  [[nodiscard]] const AlongPath& state() const noexcept { return state_; }
  /// Whether the plan ends within so many mm.
  [[nodiscard]] bool is_near_end(double length_mm) const noexcept;
  /// Position of every axis.
  [[nodiscard]] AxisValues position() const noexcept;
  /// Its first and second derivative by time.
  void rates(AxisValues& velocity, AxisValues& acceleration) const noexcept;

 private:
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
  [[nodiscard]] Derivatives path_here() const noexcept { return plan_->derivatives(plan_->station(station_), offset_); }
  [[nodiscard]] Derivatives derivatives_after(double time_s) const noexcept;
  [[nodiscard]] Jerks allowed() const noexcept;
  [[nodiscard]] bool controllable(double jerk, double time_s, const Derivatives& path) const noexcept;
  [[nodiscard]] bool controllable(double jerk) const noexcept;
  [[nodiscard]] bool choose(double wish, double end, double& jerk) const noexcept;
  [[nodiscard]] const ControllableSet& set(std::size_t index) const noexcept {
    return is_slow_ ? plan_->slow_set(index) : plan_->set(index);
  }
  [[nodiscard]] double wished(double max_speed) const noexcept;
  [[nodiscard]] bool keeps_limits(const Landing& landing, double excess) const noexcept;
  [[nodiscard]] bool holds(const Landing& landing, double most_jerk, double steepest, double excess) const noexcept;
  [[nodiscard]] double stop_from_here() const noexcept;
  bool land(double travel, double excess) noexcept;
  bool land_anywhere() noexcept;
  void fly_on() noexcept;
  void move(double jerk, double time_s) noexcept;
  void pass(double travel) noexcept;
  void come_to_rest() noexcept;
  void keep_to(double jerk) noexcept;
  bool returns() noexcept;
  void follow() noexcept;
  [[nodiscard]] double course(double left, PathState state) noexcept;

  const PathPlan* plan_;
  double period_s_;
  std::size_t station_ = 0;
  double offset_ = 0.0;
  AlongPath state_;
  double share_ = 1.0;  // of the limits
  bool is_beside_;      // has not been within the sets yet
  double jerk_ = 0.0;   // of the last period
  Landing landing_;
  double course_ = 0.0;  // the last choice of c, and the interval that it was made for
  std::size_t course_station_ = static_cast<std::size_t>(-1);
  // Of this period.
  Derivatives after_period_{}, after_two_{};
  Jerks jerks_{};
  double wish_ = 0.0;  // the jerk that would be best
  bool stops_ = false;
  bool is_slow_ = false;  // keeps to the sets of slow motions
};

}  // namespace shapegcode
