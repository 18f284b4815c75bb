#include "simulate/free_modes.hpp"

#include <cmath>
#include <complex>

#include "base/rest.hpp"

namespace shapegcode::detail {

FreeModes::FreeModes(const AxisModes& modes, double period_s) : period_s_(period_s) {
  for (std::size_t axis = 0; axis < axis_count; ++axis) {
    for (const Mode& mode : modes[axis]) {
      const std::complex<double> s = pole(mode);
      modes_.push_back(mode);
      // The square of a sum is at most its number of terms times the sum of their squares.
      const double weight2 = static_cast<double>(modes[axis].size()) * mode.participation * mode.participation;
      states_.push_back({mode_transition(mode, period_s), static_cast<Eigen::Index>(axis), excitation(mode, axis),
                         mode.participation, weight2, -s.real(), 1.0 / s.imag()});
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
  double reachable2 = 0.0;
  for (std::size_t m = 0; m < states_.size(); ++m) {
    State& state = states_[m];
    const double before = state.deflection;
    const double velocity = state.velocity - state.excited_by.dot(jump);
    const double quadrature = (velocity + state.decay_rate * before) * state.damped_period_s;
    reachable2 += state.weight2 * (before * before + quadrature * quadrature);
    const ModeTransition by = periods <= tabulated
                                  ? over_[m * tabulated + periods - 1]
                                  : mode_transition(modes_[m], static_cast<double>(periods) * period_s_);
    state.deflection = state_or_none(by.dd * before + by.dv * velocity);
    state.velocity = state_or_none(by.vd * before + by.vv * velocity);
  }
  return reachable2;
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
