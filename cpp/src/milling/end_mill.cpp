#include "shapegcode/milling/force.hpp"

#include <cmath>
#include <numbers>

#include "milling/checks.hpp"

namespace shapegcode {

namespace {

using detail::refuse;

constexpr int max_flutes = 1000;
constexpr double steepest_helix_rad = 80.0 / 180.0 * std::numbers::pi;

}  // namespace

void check(const EndMill& tool) {
  detail::check_positive(tool.diameter_mm, "tool diameter", "mm");
  if (tool.flutes < 1) refuse("tool has {} flutes, must have at least 1", tool.flutes);
  if (tool.flutes > max_flutes) refuse("tool has {} flutes, limit {}", tool.flutes, max_flutes);
  if (!(tool.helix_rad >= 0.0 && tool.helix_rad <= steepest_helix_rad)) {
    refuse("helix is {:g} degrees, must be 0 to 80", tool.helix_rad * 180.0 / std::numbers::pi);
  }
  if (tool.runout_mm.empty()) {
    return;
  }
  if (tool.runout_mm.size() != static_cast<std::size_t>(tool.flutes)) {
    refuse("runout is given for {} of {} flutes", tool.runout_mm.size(), tool.flutes);
  }
  for (const double value : tool.runout_mm) {
    if (!(std::abs(value) < tool.radius_mm())) {
      refuse("runout of a flute is {} mm, must stay below the radius, {} mm", value, tool.radius_mm());
    }
  }
}

}  // namespace shapegcode
