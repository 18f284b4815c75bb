#include "play/free_modes.hpp"

#include <cmath>
#include <complex>

#include "base/rest.hpp"

namespace shapegcode::detail {

FreeModes::FreeModes(const AxisModes& modes, double period_s) : period_s_(period_s) {
  for (std::size_t axis = 0; axis < axis_count; ++axis) {
    for (const Mode& mode : modes[axis]) {
      const std::complex<double> s = pole(mode);
      modes_.push_back(mode);
      states_.push_back({mode_transition(mode, period_s), static_cast<Eigen::Index>(axis), mode.participation,
                         -s.real(), 1.0 / s.imag()});
      for (std::size_t k = 1; k <= tabulated; ++k) {
        over_.push_back(mode_transition(mode, static_cast<double>(k) * period_s));
      }
    }
  }
}

void FreeModes::reset() noexcept {
  for (State& state : states_) {
    state.deflection = 0.0;
    state.velocity = 0.0;
  }
  velocity_.setZero();
}

double FreeModes::step(const Vector3& velocity_mm_per_s, std::size_t periods) noexcept {
  const Vector3 jump = velocity_mm_per_s - velocity_;
  velocity_ = velocity_mm_per_s;
  Vector3 reachable = Vector3::Zero();
  for (std::size_t m = 0; m < states_.size(); ++m) {
    State& state = states_[m];
    state.velocity -= jump[state.axis];
    const double quadrature = (state.velocity + state.decay_rate * state.deflection) * state.damped_period_s;
    reachable[state.axis] +=
        std::abs(state.participation) * std::sqrt(state.deflection * state.deflection + quadrature * quadrature);
    const ModeTransition by = periods <= tabulated
                                  ? over_[m * tabulated + periods - 1]
                                  : mode_transition(modes_[m], static_cast<double>(periods) * period_s_);
    const double deflection = by.dd * state.deflection + by.dv * state.velocity;
    state.velocity = state_or_none(by.vd * state.deflection + by.vv * state.velocity);
    state.deflection = state_or_none(deflection);
  }
  return reachable.squaredNorm();
}

void FreeModes::save(std::span<double> state) const noexcept {
  for (std::size_t m = 0; m < states_.size(); ++m) {
    state[2 * m] = states_[m].deflection;
    state[2 * m + 1] = states_[m].velocity;
  }
}

void FreeModes::load(std::span<const double> state, const Vector3& velocity_mm_per_s) noexcept {
  for (std::size_t m = 0; m < states_.size(); ++m) {
    states_[m].deflection = state[2 * m];
    states_[m].velocity = state[2 * m + 1];
  }
  velocity_ = velocity_mm_per_s;
}

}  // namespace shapegcode::detail
