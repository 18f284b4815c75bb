#pragma once

#include <doctest/doctest.h>

#include <array>
#include <span>

#include "shapegcode/samples.hpp"

// Both forms of a interpolator's step, side by side.
namespace shapegcode::tests {

/// Two equal players give the same set-points to the end, one of them into memory of the caller's.
template <class PositionSource>
void check_same_into_memory(PositionSource& interpolator, PositionSource& other) {
  Vector3 position;
  std::array<double, 3> out{};
  bool moving = true;
  while (moving) {
    moving = interpolator.step(position);
    CHECK(other.step(std::span<double>(out)) == moving);
    CHECK(Vector3(out[0], out[1], out[2]) == position);
  }
}

}  // namespace shapegcode::tests
