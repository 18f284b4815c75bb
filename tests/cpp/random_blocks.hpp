#pragma once

#include <cmath>
#include <random>

#include "shapegcode/path.hpp"

// Blocks in G17 that leave a point in a given direction, and random numbers for their sizes.
namespace shapegcode::tests {

using Random = std::mt19937_64;

inline double uniform(Random& random, double from, double to) {
  return std::uniform_real_distribution<double>(from, to)(random);
}

/// A block that leaves `start` in direction `heading` (radians): a line, or with a radius an arc about the normal axis
/// Z, to the left where `sense` is positive.
inline Segment block_from(const Vector3& start, double heading, double length, double radius, double sense,
                          double feed) {
  if (radius == 0.0) return make_line(start, start + length * Vector3(std::cos(heading), std::sin(heading), 0.0), feed);
  const Vector3 centre = start + radius * sense * Vector3(-std::sin(heading), std::cos(heading), 0.0);
  const double sweep = sense * length / radius;
  const double angle = std::atan2(start.y() - centre.y(), start.x() - centre.x()) + sweep;
  return make_arc(start, centre + radius * Vector3(std::cos(angle), std::sin(angle), 0.0), centre, sweep, 2, feed);
}

}  // namespace shapegcode::tests
