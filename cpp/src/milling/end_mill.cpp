#include "shapegcode/milling/force.hpp"

#include <cmath>
#include <numbers>
#include <string>

#include "milling/refuse.hpp"

namespace shapegcode {

namespace {

using detail::refuse;

constexpr double steepest_helix_rad = 80.0 / 180.0 * std::numbers::pi;

}  // namespace

void check(const EndMill& tool) {
  if (!(tool.diameter_mm > 0.0) || !std::isfinite(tool.diameter_mm)) {
    refuse("tool diameter is " + std::to_string(tool.diameter_mm) + " mm, must be above 0");
  }
  if (tool.flutes < 1) {
    refuse("tool has " + std::to_string(tool.flutes) + " flutes, must have at least 1");
  }
  if (!(tool.helix_rad >= 0.0 && tool.helix_rad <= steepest_helix_rad)) {
    refuse("helix is " + std::to_string(tool.helix_rad * 180.0 / std::numbers::pi) + " degrees, must be 0 to 80");
  }
  if (tool.runout_mm.empty()) {
    return;
  }
  if (tool.runout_mm.size() != static_cast<std::size_t>(tool.flutes)) {
    refuse("runout is given for " + std::to_string(tool.runout_mm.size()) + " of " + std::to_string(tool.flutes) +
           " flutes");
  }
  for (const double value : tool.runout_mm) {
    if (!(std::abs(value) < tool.radius_mm())) {
      refuse("runout of a flute is " + std::to_string(value) + " mm, must stay below the radius, " +
             std::to_string(tool.radius_mm()) + " mm");
    }
  }
}

}  // namespace shapegcode
