// A cubic between two set-points.
#pragma once

namespace shapegcode {

/// By the share of the interval, 0 to 1: from 0 to `chord`, with these first derivatives at both ends.
struct Cubic {
  double begin, bend, turn;
  Cubic(double chord, double begin_rate, double end_rate) noexcept
      : begin(begin_rate),
        bend(6.0 * chord - 4.0 * begin_rate - 2.0 * end_rate),
        turn(6.0 * (begin_rate + end_rate) - 12.0 * chord) {}

  [[nodiscard]] double value(double share) const noexcept {
    return share * (begin + share * (0.5 * bend + share * turn / 6.0));
  }
  [[nodiscard]] double first(double share) const noexcept { return begin + share * (bend + 0.5 * share * turn); }
  [[nodiscard]] double second(double share) const noexcept { return bend + share * turn; }
};

}  // namespace shapegcode
