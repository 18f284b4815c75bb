// The queue of a control: segments, and what can be said of each before it is known how it will be run.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "motion/pieces.hpp"
#include "shapegcode/controller.hpp"

namespace shapegcode {

/// A segment in the queue, with what the planning thread finds out about it.
struct QueuedSegment {
  Segment segment;
  double feed = 0.0;                                   ///< programmed, with the ratio of arcs
  double hard_limit = 0.0;                             ///< speed whatever the override
  double following_acceleration = MotionLimits::none;  ///< along the path
  double corner = MotionLimits::none;                  ///< speed at which it is entered
  Zone jump;                                           ///< what jumps there, as far as it counts
  Zone open_end;                                       ///< the same of whatever may follow
  double passed = 0.0;                                 ///< highest speed at which it is ever entered
  double fastest = 0.0;                                ///< speed at which it can ever be run
  double beside_turn = MotionLimits::none;             ///< its speed beside a jump of direction
  std::array<double, 2> line_acceleration{};           ///< of a line, whatever its speed; and beside a jump

  // Of the thread that steps.
  double distance = 0.0;  ///< of its start, since the motion began
  ZoneSet behind{};       ///< at its start, of slow corners and segments before it, whatever the override
  // Of the planning thread again; last, as nothing but a set-point asks for them.
  std::array<double, max_following_axes> following_start{}, following_end{};
  std::array<double, max_following_axes> following_rate{};  ///< per mm of path
};

/// Acceleration along a segment that is run at most at `speed`; `reduced`: beside a jump.
[[nodiscard]] double acceleration_along(const QueuedSegment& entry, double speed, const MotionLimits& limits,
                                        bool reduced) noexcept;

/// A ring of segments: segment `index`, counted from the first ever pushed, is entry `index & mask`.
class SegmentRing {
 public:
  explicit SegmentRing(std::size_t capacity) : entries_(capacity) {}
  [[nodiscard]] QueuedSegment& operator[](std::uint64_t index) noexcept {
    return entries_[index & (entries_.size() - 1)];
  }
  [[nodiscard]] std::size_t capacity() const noexcept { return entries_.size(); }

 private:
  std::vector<QueuedSegment> entries_;
};

}  // namespace shapegcode
