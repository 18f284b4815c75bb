#pragma once

#include <cstdint>
#include <vector>

namespace shapegcode {

/// Sense in which the spindle turns, seen from the spindle towards the work piece.
enum class SpindleSense : std::uint8_t {
  clockwise,          ///< M03
  counter_clockwise,  ///< M04
};

/// A cylindrical end mill with a flat end. Its axis is Z; heights count from the tip.
struct EndMill {
  double diameter_mm = 0.0;
  int flutes = 0;
  double helix_rad = 0.0;  ///< of a right-hand helix on a right-hand cutter: the tip enters first
  /// How far each flute stands out beyond the mean radius, in the order in which they cut; empty: no runout.
  std::vector<double> runout_mm = {};

  [[nodiscard]] double radius_mm() const noexcept { return 0.5 * diameter_mm; }
};

/// Throws Error(argument) on a diameter or number of flutes that is not positive, a helix outside 0 ... 80 degrees, or
/// a runout that is not one finite number per flute or reaches the radius.
void check(const EndMill& tool);

}  // namespace shapegcode
