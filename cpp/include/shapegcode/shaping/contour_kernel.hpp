#pragma once

#include <span>
#include <vector>

#include "shapegcode/filter/fir.hpp"
#include "shapegcode/mode.hpp"

namespace shapegcode {

/// What shall follow the programmed path.
enum class ContourTarget {
  none,      ///< nothing: the path is shaped as it is
  command,   ///< the shaped command
  response,  ///< the plant's response to it: the part
};

/// Kernel, at delays 0, 1, ... samples of `period_s`, from a command before shaping to what shall follow the path: the
/// shaper's own taps, or its taps followed by an axis' modes under a command that is linear between samples. A shaper
/// that cancels the modes leaves a kernel hardly longer than itself; the tail of one that does not is cut where less
/// than 1e-4 of it is left, or at four times the shaper, and the outer taps mended so that sum and mean delay
/// are the shaper's.
/// Throws Error(argument) as ModalPlant does. Source: spec 5.
[[nodiscard]] std::vector<double> contour_kernel(const Fir& shaper, std::span<const Mode> modes, double period_s,
                                                 ContourTarget target);

}  // namespace shapegcode
