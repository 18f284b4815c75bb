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

}  // namespace

double cuts_per_hole(const CannedCycle& cycle) noexcept {
  return cuts_in_steps(cycle) ? std::ceil(depth_mm(cycle) / cycle.peck_mm) : 1.0;
}

double most_moves_per_cut(const CannedCycle& cycle) noexcept {
  // Down and back; G83 goes all the way up, so it has to come down again.
  return !cuts_in_steps(cycle) ? 1.0 : cycle.code == 73 ? 2.0 : 3.0;
}

Vector3 expand_cycle(const CannedCycle& cycle, Vector3 position, int axis, double feed_mm_per_s, std::uint32_t line,
                     std::vector<OtherMove>& moves) {
  const auto go = [&](double level, bool rapid) {
    Vector3 target = position;
    target[axis] = level;
    OtherMove move{make_line(position, target, rapid ? 0.0 : feed_mm_per_s, line), 0.0};
    if (rapid) {
      move.segment.kind = SegmentKind::rapid;
    }
    if (move.segment.length_mm > 0.0) {
      moves.push_back(move);
    }
    position = target;
  };
  const auto wait = [&] {
    if (cycle.dwell_s > 0.0) {
      moves.push_back(OtherMove{make_line(position, position, 0.0, line), cycle.dwell_s});
    }
  };
  // G76 and G87 lift the tip off the wall by Q; the direction is a parameter (5148), the way the same.
  const int side = ArcFrame(axis).a;
  const auto shift = [&](double by) {
    Vector3 target = position;
    target[side] += by;
    OtherMove move{make_line(position, target, 0.0, line), 0.0};
    move.segment.kind = SegmentKind::rapid;
    if (move.segment.length_mm > 0.0) {
      moves.push_back(move);
    }
    position = target;
  };
  const Vector3 centre = position;
  const auto unshift = [&] {
    shift(centre[side] - position[side]);
    position[side] = centre[side];
  };
  if (cycle.code == 87) {  // back boring goes down beside the bore and cuts upwards
    shift(cycle.peck_mm);
    go(cycle.r_mm, true);
    unshift();
    go(cycle.bottom_mm, false);
    wait();
    shift(cycle.peck_mm);
    go(cycle.initial_mm, true);
    unshift();
    return position;
  }
  go(cycle.r_mm, true);
  const double depth = depth_mm(cycle);
  const double down = cycle.bottom_mm < cycle.r_mm ? -1.0 : 1.0;
  if (cuts_in_steps(cycle)) {
    const auto count = static_cast<std::int64_t>(cuts_per_hole(cycle));
    for (std::int64_t i = 1; i <= count; ++i) {
      const double reached = std::min(depth, static_cast<double>(i) * cycle.peck_mm);
      go(cycle.r_mm + down * reached, false);
      if (i < count) {
        const double back = cycle.code == 83 ? 0.0 : std::max(0.0, reached - cycle.clearance_mm);
        go(cycle.r_mm + down * back, true);
        go(cycle.r_mm + down * std::max(0.0, reached - cycle.clearance_mm), true);
      }
    }
  } else {
    go(cycle.bottom_mm, false);
  }
  // P has no meaning in G81, G85 and G86; tapping waits at both ends.
  const bool taps = cycle.code == 74 || cycle.code == 84;
  if (cycle.code != 81 && cycle.code != 85 && cycle.code != 86) {
    wait();
  }
  if (taps || cycle.code == 85 || cycle.code == 89) {
    go(cycle.r_mm, false);
  }
  if (taps) {
    wait();
  }
  if (cycle.code == 88) {
    go(cycle.r_mm, true);  // the operator retracts to R by hand
  }
  if (cycle.code == 76) {
    shift(cycle.peck_mm);
  }
  go(cycle.return_to_r ? cycle.r_mm : cycle.initial_mm, true);
  if (cycle.code == 76) {
    unshift();
  }
  return position;
}

}  // namespace shapegcode
