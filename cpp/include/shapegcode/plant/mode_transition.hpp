#pragma once

#include "shapegcode/mode.hpp"

namespace shapegcode {

/// (d, d')(t+h) = matrix * (d, d')(t): deflection and its velocity of a free mode over a time h.
struct ModeTransition {
  double dd = 1.0, dv = 0.0, vd = 0.0, vv = 1.0;
};

/// The matrix exponential of d'' + 2*zeta*omega*d' + omega^2*d = 0 over `time_s`, in closed form. Throws as pole().
[[nodiscard]] ModeTransition mode_transition(const Mode& mode, double time_s);

}  // namespace shapegcode
