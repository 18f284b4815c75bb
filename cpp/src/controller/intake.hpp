// The planning thread's side of a control: what is taken, and what a segment and its junction allow.
#pragma once

#include <array>
#include <span>
#include <vector>

#include "controller/segment_ring.hpp"
#include "shapegcode/controller.hpp"

namespace shapegcode {

class Intake {
 public:
  Intake(const MotionLimits& limits, const std::vector<FollowingLimits>& following, const FilterTolerance& tolerance)
      : limits_(limits),
        following_(following),
        tolerance_(tolerance),  // A segment of following axes alone knows no limit of X, Y and Z.
        steepest_(following.empty() ? steepest_of(limits) : MotionLimits::none),
        jump_time_s_(jump_time_s(limits, limits.jerk_time_s)) {}

  /// The next segment starts at this position, whatever came before.
  void restart(std::span<const double> position) noexcept;
  /// Fills an entry of the queue; unless it says `accepted`, nothing has happened.
  PushResult take(const Segment& segment, std::span<const double> following_end, QueuedSegment& entry) noexcept;

 private:
  PushResult copy(const Segment& segment, std::span<const double> following_end, QueuedSegment& entry) const noexcept;
  void look_at(QueuedSegment& entry) const noexcept;
  void look_at_jumps(QueuedSegment& entry) const noexcept;

  MotionLimits limits_;
  std::vector<FollowingLimits> following_;
  FilterTolerance tolerance_;
  double steepest_;
  double jump_time_s_;
  Segment last_segment_;
  std::array<double, max_following_axes> last_following_{}, last_rate_{};
  double last_fastest_ = MotionLimits::none;
  double last_passed_ = 0.0;
  bool has_last_ = false;
};

}  // namespace shapegcode
