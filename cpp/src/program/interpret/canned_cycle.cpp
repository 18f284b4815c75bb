#include "program/interpret/canned_cycle.hpp"
#include "path/arc_frame.hpp"

#include <algorithm>
#include <cmath>
#include <cstdint>

namespace shapegcode {
namespace {

bool cuts_in_steps(const CannedCycle& cycle) noexcept {
  return (cycle.code == 73 || cycle.code == 83) && cycle.peck_mm > 0.0;
}

double depth_mm(const CannedCycle& cycle) noexcept { return std::abs(cycle.r_mm - cycle.bottom_mm); }

// The tool over and in one hole.
class Hole {
 public:
  Hole(const CannedCycle& cycle, const Vector3& position, int axis, double feed_mm_per_s, std::uint32_t line,
       std::vector<OtherMove>& moves)
      : cycle_(cycle),
        centre_(position),
        position_(position),
        axis_(axis),
        feed_mm_per_s_(feed_mm_per_s),
        line_(line),
        moves_(moves) {}

  Vector3 drill() {
    if (cycle_.code == 87 && cycle_.has_bottom) {
      bore_back();
      return position_;
    }
    rapid(cycle_.r_mm);
    if (!cycle_.has_bottom) {
      rapid(cycle_.return_to_r ? cycle_.r_mm : cycle_.initial_mm);
      return position_;
    }
    if (cuts_in_steps(cycle_)) {
      peck();
    } else {
      feed(cycle_.bottom_mm);
    }
    // P has no meaning in G81, G85 and G86; tapping waits at both ends.
    const bool taps = cycle_.code == 74 || cycle_.code == 84;
    if (cycle_.code != 81 && cycle_.code != 85 && cycle_.code != 86) {
      wait();
    }
    if (taps || cycle_.code == 85 || cycle_.code == 89) {
      feed(cycle_.r_mm);
    }
    if (taps) {
      wait();
    }
    if (cycle_.code == 88) {
      rapid(cycle_.r_mm);  // the operator retracts to R by hand
    }
    if (cycle_.code == 76) {
      shift(cycle_.peck_mm);
    }
    rapid(cycle_.return_to_r ? cycle_.r_mm : cycle_.initial_mm);
    if (cycle_.code == 76) {
      unshift();
    }
    return position_;
  }

 private:
  // Goes down beside the bore and cuts upwards.
  void bore_back() {
    shift(cycle_.peck_mm);
    rapid(cycle_.r_mm);
    unshift();
    feed(cycle_.bottom_mm);
    wait();
    shift(cycle_.peck_mm);
    rapid(cycle_.initial_mm);
    unshift();
  }

  void peck() {
    const double depth = depth_mm(cycle_);
    const double down = cycle_.bottom_mm < cycle_.r_mm ? -1.0 : 1.0;
    const auto count = static_cast<std::int64_t>(cuts_per_hole(cycle_));
    for (std::int64_t i = 1; i <= count; ++i) {
      const double reached = std::min(depth, static_cast<double>(i) * cycle_.peck_mm);
      feed(cycle_.r_mm + down * reached);
      if (i < count) {
        const double back = cycle_.code == 83 ? 0.0 : std::max(0.0, reached - cycle_.clearance_mm);
        rapid(cycle_.r_mm + down * back);
        rapid(cycle_.r_mm + down * std::max(0.0, reached - cycle_.clearance_mm));
      }
    }
  }

  void move_to(const Vector3& target, bool is_rapid) {
    OtherMove move{make_line(position_, target, is_rapid ? 0.0 : feed_mm_per_s_, line_), 0.0};
    if (is_rapid) {
      move.segment.kind = SegmentKind::rapid;
    }
    if (move.segment.length_mm > 0.0) {
      moves_.push_back(move);
    }
    position_ = target;
  }

  void go(double level, bool is_rapid) {
    Vector3 target = position_;
    target[axis_] = level;
    move_to(target, is_rapid);
  }
  void rapid(double level) { go(level, true); }
  void feed(double level) { go(level, false); }

  void wait() {
    if (cycle_.dwell_s > 0.0) {
      moves_.push_back(OtherMove{make_line(position_, position_, 0.0, line_), cycle_.dwell_s});
    }
  }

  // G76 and G87 lift the tip off the wall by Q; the direction is a parameter (5148), the way the same.
  void shift(double by) {
    Vector3 target = position_;
    target[ArcFrame(axis_).a] += by;
    move_to(target, true);
  }

  void unshift() {
    const int side = ArcFrame(axis_).a;
    shift(centre_[side] - position_[side]);
    position_[side] = centre_[side];
  }

  const CannedCycle& cycle_;
  Vector3 centre_;
  Vector3 position_;
  int axis_;
  double feed_mm_per_s_;
  std::uint32_t line_;
  std::vector<OtherMove>& moves_;
};

}  // namespace

double cuts_per_hole(const CannedCycle& cycle) noexcept {
  return cuts_in_steps(cycle) ? std::ceil(depth_mm(cycle) / cycle.peck_mm) : 1.0;
}

double max_moves_per_cut(const CannedCycle& cycle) noexcept {
  // Down and back; G83 goes all the way up, so it has to come down again.
  return !cuts_in_steps(cycle) ? 1.0 : cycle.code == 73 ? 2.0 : 3.0;
}

Vector3 expand_cycle(const CannedCycle& cycle, const Vector3& position, int axis, double feed_mm_per_s,
                     std::uint32_t line, std::vector<OtherMove>& moves) {
  return Hole(cycle, position, axis, feed_mm_per_s, line, moves).drill();
}

}  // namespace shapegcode
