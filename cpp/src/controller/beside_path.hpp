// Motion in addition to the path: jogging while the path rests, offsets during motion, backlash compensation, and
// travel limits.
#pragma once

#include <array>
#include <atomic>
#include <cstddef>
#include <limits>
#include <span>
#include <vector>

#include "controller/axis_tracker.hpp"
#include "shapegcode/controller.hpp"

namespace shapegcode {

class SetPointFilters;

/// What an axis may be at, as any thread sets it.
class SoftLimits {
 public:
  explicit SoftLimits(const ControllerSettings& settings) noexcept;
  bool set(std::size_t axis, const AxisTravel& travel) noexcept;
  [[nodiscard]] AxisTravel of(std::size_t axis) const noexcept {
    return {low_[axis].load(std::memory_order_relaxed), high_[axis].load(std::memory_order_relaxed)};
  }
  /// Whether all of a segment is within.
  [[nodiscard]] bool hold(const Segment& segment, std::span<const double> following_end) const noexcept;
  /// Whether a box is; where an axis is beyond already, no further.
  [[nodiscard]] bool hold(const AxisValues& low, const AxisValues& high, const AxisValues& here) const noexcept;

 private:
  std::size_t axes_;
  double slack_mm_;  // of a rounded path
  std::array<std::atomic<double>, max_path_axes> low_, high_;
};

/// Axes that are moved by hand, one by one: away from where the path rests, and back.
class Jog {
 public:
  Jog(const ControllerSettings& settings, const AxisLimits& limits, const SoftLimits& travel);

  // Of any thread, one for each axis.

  JogResult jog(std::size_t axis, double speed) noexcept;
  JogResult jog_by(std::size_t axis, double distance, double speed) noexcept;
  /// Nothing is taken until the next step says so again.
  void close() noexcept { is_open_.store(false, std::memory_order_relaxed); }

  // Of the thread that steps.

  enum class Mode : std::uint8_t { closed, open, returns };
  /// Whether a command waits.
  [[nodiscard]] bool is_asked() const noexcept;
  /// One period on from where the path rests.
  void step(Mode mode, const AxisValues& base) noexcept;
  /// To rest, whatever was asked for.
  void stop() noexcept;
  /// The path begins where the axes are.
  void restart() noexcept;
  void add_to(AxisValues& position, AxisValues& velocity, AxisValues& acceleration) const noexcept;
  [[nodiscard]] bool at_rest() const noexcept { return !moves_; }
  /// Away from the path, or on the way.
  [[nodiscard]] bool is_beside() const noexcept { return is_beside_; }

 private:
  static constexpr double nothing = std::numeric_limits<double>::quiet_NaN();
  struct Axis {
    AxisTracker tracker;
    TrackerLimits limits;  // their speed: of the last command
    double highest_speed = 0.0;
    double fastest = 0.0;  // since it left the path
    double goal = 0.0;
    bool goes = false;
  };
  struct Command {
    std::atomic<double> velocity{nothing};
    std::atomic<double> distance{0.0}, speed{0.0};
    std::atomic<double> from{0.0};  // where the next distance begins
  };
  void take(Axis& axis, Command& command, double here) noexcept;
  [[nodiscard]] JogResult closed_to(std::size_t axis, double number, double speed) const noexcept;

  const SoftLimits* travel_;
  std::vector<Axis> axes_;
  std::array<Command, max_path_axes> commands_;
  std::atomic<bool> is_open_{false};
  bool moves_ = false, is_beside_ = false;
};

/// An offset of each axis with limits of its own, which are not the path's any more; backlash is part of it.
class ExternalOffset {
 public:
  /// `filters`: behind it, which keep some of the limits for themselves.
  ExternalOffset(const ControllerSettings& settings, const SetPointFilters& filters);
  [[nodiscard]] bool is_none() const noexcept { return axes_.empty(); }
  bool set(std::size_t axis, double value) noexcept;
  /// One period on; `position` is that of the path and the jog.
  void step(const AxisValues& position) noexcept;
  void restart() noexcept;
  void add_to(AxisValues& position, AxisValues& velocity, AxisValues& acceleration) const noexcept;
  [[nodiscard]] double of(std::size_t axis) const noexcept {
    return axis < axes_.size() ? axes_[axis].tracker.position() : 0.0;
  }

 private:
  struct Axis {
    AxisTracker tracker;
    TrackerLimits limits;
    double backlash = 0.0;
    bool goes_down = false, has_moved = false;
    double furthest = 0.0;  // in its direction
  };
  std::vector<Axis> axes_;
  std::array<std::atomic<double>, max_path_axes> goals_{};
};

}  // namespace shapegcode
