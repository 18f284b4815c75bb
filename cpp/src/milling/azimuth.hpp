// Private to milling: the front half of a tool lies between the azimuths -half_pi and half_pi.
#pragma once

#include <numbers>

namespace shapegcode::detail {

inline constexpr double half_pi = 0.5 * std::numbers::pi;
/// So far inside of its border an azimuth surely cuts: the flute that makes the wall still counts,
/// and a force without helix, which jumps where an arc begins, is looked at from both sides.
inline constexpr double inside_rad = 1e-9;

}  // namespace shapegcode::detail
