#include "shapegcode/plant/modal.hpp"

#include <algorithm>
#include <cmath>
#include <complex>
#include <sstream>
#include <utility>

#include "shapegcode/error.hpp"

namespace shapegcode {
namespace {

constexpr double peak_steps_per_swing = 20.0;
constexpr double most_substeps = 1024.0;
constexpr double residual_steps_per_swing = 64.0;
constexpr double most_residual_steps = 1e6;

double fastest_hz(const std::vector<Mode>& modes) {
  double fastest = 0.0;
  for (const Mode& mode : modes) fastest = std::max(fastest, mode.frequency_hz);
  return fastest;
}

double slowest_hz(const std::vector<Mode>& modes) {
  double slowest = modes.front().frequency_hz;
  for (const Mode& mode : modes) slowest = std::min(slowest, mode.frequency_hz);
  return slowest;
}

}  // namespace

double ModalPlant::State::reachable() const noexcept {
  const double quadrature = (velocity + decay_rate * deflection) * damped_period_s;
  return std::abs(participation) * std::sqrt(deflection * deflection + quadrature * quadrature);
}

ModalPlant::Transition ModalPlant::transition(const Mode& mode, double time_s) {
  const std::complex<double> s = pole(mode);
  const double decay = std::exp(s.real() * time_s);
  const double cosine = decay * std::cos(s.imag() * time_s);
  const double sine = decay * std::sin(s.imag() * time_s) / s.imag();
  return {cosine - s.real() * sine, sine, -std::norm(s) * sine, cosine + s.real() * sine};
}

double ModalPlant::largest_between(const Motion& from, const Motion& to, double time_s) noexcept {
  double largest = std::max(std::abs(from.deflection), std::abs(to.deflection));
  if (from.rate * to.rate < 0.0) {
    const double until_turn = time_s * from.rate / (from.rate - to.rate);
    largest = std::max(largest, std::abs(from.deflection + 0.5 * from.rate * until_turn));
    largest = std::max(largest, std::abs(to.deflection - 0.5 * to.rate * (time_s - until_turn)));
  }
  return largest;
}

ModalPlant::ModalPlant(AxisModes modes, double period_s)
    : modes_(std::move(modes)), period_s_(period_s), rate_hz_(1.0 / period_s) {
  if (!std::isfinite(period_s) || !(period_s > 0.0)) {
    std::ostringstream message;
    message << "interpolation period " << period_s << " s, must be finite and above 0";
    throw Error(ErrorKind::argument, message.str());
  }
  for (std::size_t axis = 0; axis < axis_count; ++axis) {
    const std::vector<Mode>& axis_modes = modes_[axis];
    first_[axis] = states_.size();
    for (const Mode& mode : axis_modes) {
      if (!std::isfinite(mode.participation)) {
        throw Error(ErrorKind::argument, "participation of a mode of axis " + std::to_string(axis) + " is not finite");
      }
      State state;
      const std::complex<double> s = pole(mode);
      state.over_period = transition(mode, period_s);
      state.participation = mode.participation;
      state.decay_rate = -s.real();
      state.damped_period_s = 1.0 / s.imag();
      states_.push_back(state);
    }
    const double substeps = std::ceil(period_s * peak_steps_per_swing * fastest_hz(axis_modes));
    substeps_[axis] = static_cast<int>(std::clamp(substeps, 1.0, most_substeps));
    first_sub_[axis] = sub_.size();
    for (int k = 1; k <= substeps_[axis]; ++k) {
      for (const Mode& mode : axis_modes) {
        Transition part = transition(mode, period_s * k / substeps_[axis]);
        part.dd *= mode.participation;
        part.dv *= mode.participation;
        part.vd *= mode.participation;
        part.vv *= mode.participation;
        sub_.push_back(part);
      }
    }
  }
  first_[axis_count] = states_.size();
}

void ModalPlant::reset(const Vector3& position) noexcept {
  for (State& state : states_) {
    state.deflection = 0.0;
    state.velocity = 0.0;
  }
  command_ = position;
  command_velocity_.setZero();
  deflection_.setZero();
  peak_.setZero();
}

void ModalPlant::look_between(std::size_t axis) noexcept {
  const auto a = static_cast<Eigen::Index>(axis);
  const std::size_t first = first_[axis];
  const std::size_t last = first_[axis + 1];
  const int substeps = substeps_[axis];
  const double substep_s = period_s_ / substeps;
  const Transition* sub = sub_.data() + first_sub_[axis];
  Motion before;
  for (std::size_t m = first; m < last; ++m) {
    before.deflection += states_[m].participation * states_[m].deflection;
    before.rate += states_[m].participation * states_[m].velocity;
  }
  double peak = peak_[a];
  for (int k = 1; k <= substeps; ++k) {
    Motion now;
    for (std::size_t m = first; m < last; ++m, ++sub) {
      now.deflection += sub->dd * states_[m].deflection + sub->dv * states_[m].velocity;
      now.rate += sub->vd * states_[m].deflection + sub->vv * states_[m].velocity;
    }
    peak = std::max(peak, largest_between(before, now, substep_s));
    before = now;
  }
  peak_[a] = peak;
}

Vector3 ModalPlant::step(const Vector3& command) noexcept {
  for (std::size_t axis = 0; axis < axis_count; ++axis) {
    const auto a = static_cast<Eigen::Index>(axis);
    const double velocity = (command[a] - command_[a]) * rate_hz_;
    const double jump = velocity - command_velocity_[a];
    command_[a] = command[a];
    command_velocity_[a] = velocity;
    const std::size_t first = first_[axis];
    const std::size_t last = first_[axis + 1];
    if (first == last) continue;

    // The command's velocity jumps at the set-point; the table does not, so the deflection's velocity jumps back.
    double reachable = 0.0;
    for (std::size_t m = first; m < last; ++m) {
      states_[m].velocity -= jump;
      reachable += states_[m].reachable();
    }
    if (reachable > peak_[a]) look_between(axis);
    double deflection = 0.0;
    for (std::size_t m = first; m < last; ++m) {
      states_[m].propagate();
      deflection += states_[m].participation * states_[m].deflection;
    }
    deflection_[a] = deflection;
  }
  return command_ + deflection_;
}

Vector3 ModalPlant::residual_peak(int n_periods) const {
  if (n_periods < 1) {
    throw Error(ErrorKind::argument, "residual over " + std::to_string(n_periods) + " swings, at least 1 needed");
  }
  Vector3 result = Vector3::Zero();
  for (std::size_t axis = 0; axis < axis_count; ++axis) {
    if (modes_[axis].empty()) continue;
    const auto a = static_cast<Eigen::Index>(axis);
    std::vector<State> free(states_.begin() + static_cast<std::ptrdiff_t>(first_[axis]),
                            states_.begin() + static_cast<std::ptrdiff_t>(first_[axis + 1]));
    const double step_s = 1.0 / (residual_steps_per_swing * fastest_hz(modes_[axis]));
    const double steps = std::min(std::ceil(n_periods / (slowest_hz(modes_[axis]) * step_s)), most_residual_steps);
    Motion before{deflection_[a], 0.0};
    for (std::size_t m = 0; m < free.size(); ++m) {
      free[m].velocity += command_velocity_[a];  // the command stops
      free[m].over_period = transition(modes_[axis][m], step_s);
      before.rate += free[m].participation * free[m].velocity;
    }
    double peak = std::abs(before.deflection);
    for (double k = 0.0; k < steps; ++k) {
      Motion now;
      double reachable = 0.0;
      for (State& state : free) {
        state.propagate();
        now.deflection += state.participation * state.deflection;
        now.rate += state.participation * state.velocity;
        reachable += state.reachable();
      }
      peak = std::max(peak, largest_between(before, now, step_s));
      before = now;
      if (reachable <= peak) break;
    }
    result[a] = peak;
  }
  return result;
}

}  // namespace shapegcode
