// Motion back along the completed path, and forward again.
#pragma once

#include <atomic>
#include <cmath>
#include <cstddef>
#include <limits>
#include <vector>

#include "controller/axis_tracker.hpp"
#include "controller/beside_path.hpp"
#include "controller/sections.hpp"

namespace shapegcode {

/// Plays the set-points of the last periods, backwards and at half their speed at the most: what they kept of the
/// limits leaves enough for the change of the pace, whose second and third differences are bounded for it.
class Retrace {
 public:
  /// `periods`: that are kept; 0: none. `limits`: of the axes.
  Retrace(std::size_t periods, const AxisLimits& limits, double period_s);

  /// From any thread: so many mm back from where the path rests.
  JogResult ask(double distance_mm) noexcept;
  /// Nothing is taken until the next step says so again.
  void close() noexcept { is_open_.store(false, std::memory_order_relaxed); }

  // Of the thread that steps.

  /// A period of the path.
  void note(const PlannedPoint& point) noexcept;
  /// One period on.
  void step(Jog::Mode mode) noexcept;
  /// To rest, wherever that is.
  void stop() noexcept {
    stops_ = true;
    asked_.store(std::numeric_limits<double>::quiet_NaN(), std::memory_order_relaxed);
  }
  [[nodiscard]] bool is_asked() const noexcept { return !std::isnan(asked_.load(std::memory_order_relaxed)); }
  void restart() noexcept;
  void add_to(AxisValues& position, AxisValues& velocity, AxisValues& acceleration) const noexcept;
  [[nodiscard]] bool at_rest() const noexcept { return pace_.at_rest() && pace_.position() == goal_; }
  [[nodiscard]] bool is_beside() const noexcept { return pace_.position() != 0.0 || !pace_.at_rest(); }

 private:
  struct Record {
    AxisValues position{}, velocity{};
    double travelled = 0.0;
  };
  // So many periods before the newest.
  [[nodiscard]] const Record& back(std::size_t periods) const noexcept {
    return records_[(count_ - 1 - periods) % records_.size()];
  }
  [[nodiscard]] double periods_back(double distance_mm) const noexcept;

  AxisLimits limits_;
  double period_s_;
  std::vector<Record> records_;
  std::size_t count_ = 0;  // ever
  std::size_t kept_ = 0;   // of them, since the restart
  double travelled_ = 0.0, last_distance_ = 0.0;
  AxisValues fastest_{};  // that was noted
  TrackerLimits pace_limits_;
  AxisTracker pace_;  // periods, before 0
  double goal_ = 0.0;
  bool stops_ = false;
  std::atomic<double> asked_{std::numeric_limits<double>::quiet_NaN()};
  std::atomic<bool> is_open_{false};
};

}  // namespace shapegcode
