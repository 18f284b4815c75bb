#pragma once

#include <array>
#include <cstdint>

#include "shapegcode/samples.hpp"

namespace shapegcode {

/// The modal state of the controller that a program carries from block to block, as G numbers.
struct ModalState {
  int motion = 0;                    ///< group 01: 0, 1, 2, 3
  int plane = 17;                    ///< group 02: 17, 18, 19
  int distance = 90;                 ///< group 03: 90, 91
  int feed_mode = 94;                ///< group 05: 93, 94, 95
  int units = 21;                    ///< group 06: 20, 21
  int compensation = 40;             ///< group 07: 40, 41, 42
  int length_offset = 49;            ///< group 08: 43, 44, 49
  int length_number = 0;             ///< H
  int cycle = 80;                    ///< group 09: 73 ... 89, 80
  int cycle_return = 98;             ///< group 10: 98, 99
  int coordinate_system = 54;        ///< group 14; 541 for G54.1
  int coordinate_number = 0;         ///< P of G54.1
  int exact_stop = 64;               ///< group 15: 61, 62, 63, 64
  double feed = 0.0;                 ///< F as programmed (mm or inch per minute, per revolution; 1/min); 0: none yet
  double spindle_rev_per_min = 0.0;  ///< S, 0 before the first
  Vector3 position_mm = Vector3::Zero();  ///< in the active work coordinates
  std::array<bool, axis_count> known = {false, false, false};
  /// Modal groups whose value depends on the block-skip switch (bit n = group n; bit 0 = F).
  std::uint32_t uncertain_groups = 0;
};

}  // namespace shapegcode
