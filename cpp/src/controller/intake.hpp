// The part of a control for the pushing thread: acceptance of segments, and the limits of a segment and its junction.
#pragma once

#include <span>

#include "planner/junction.hpp"
#include "planner/segments.hpp"
#include "shapegcode/controller.hpp"

namespace shapegcode {

class Intake {
 public:
  /// `tolerance_mm`: what rounding may take of the contour tolerance; `corner_time_s`: of what the filters behind cut
  /// off a corner that is passed at a speed, the time; 0: nothing.
  Intake(const ControllerSettings& settings, double tolerance_mm, double corner_time_s);

  /// The next segment starts at this position, whatever came before.
  void restart(std::span<const double> position) noexcept;
  /// Rest before the next segment.
  void dwell(std::uint32_t periods) noexcept {
    dwell_ += periods;
    rests_ = true;
  }
  /// The next segment rests until so many stops are over.
  void wait(std::uint64_t stops) noexcept {
    waits_ = stops;
    rests_ = true;
  }
  /// Fills an entry of the queue; unless it says `accepted`, nothing has happened.
  PushResult take(const Segment& segment, std::span<const double> following_end, const SegmentRules& rules,
                  PlannedSegment& entry) noexcept;

 private:
  PushResult copy(const Segment& segment, std::span<const double> following_end, PlannedSegment& entry) const noexcept;
  void set_feed(const Segment& segment, const SegmentRules& rules, PlannedSegment& entry) const noexcept;
  void look_at(PlannedSegment& entry) const noexcept;

  MotionLimits rules_;  // without those of the axes
  MotionLimits corners_;
  std::size_t n_following_;
  PathTolerance tolerance_;
  double corner_time_s_;
  PlannedSegment last_;
  bool has_last_ = false;
  std::uint32_t dwell_ = 0;  // before the next one
  bool rests_ = false;
  std::uint64_t waits_ = 0;
};

}  // namespace shapegcode
