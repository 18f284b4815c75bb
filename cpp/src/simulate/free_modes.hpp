// Modes of three axes over many periods at once, while their command has constant velocity.
#pragma once

#include <array>
#include <cstddef>
#include <span>
#include <vector>

#include "shapegcode/mode.hpp"
#include "shapegcode/plant/modal.hpp"

namespace shapegcode::detail {

/// The motion of a ModalPlant with constant modes.
class FreeModes {
 public:
  FreeModes(const AxisModes& modes, double period_s);
  /// At rest, the command too.
  void reset() noexcept;
  /// The command moves on at a velocity for a period.
  void step(const Vector3& velocity_mm_per_s) noexcept;
  /// The same for so many periods. Returns a bound of the square of |response - command|, from their beginning on
  /// and for as long as the velocity stays.
  double step(const Vector3& velocity_mm_per_s, std::size_t periods) noexcept;
  /// Response less command.
  [[nodiscard]] Vector3 deflection() const noexcept;
  [[nodiscard]] const Vector3& velocity_mm_per_s() const noexcept { return velocity_; }
  /// Numbers of a state; what save() writes and load() reads beside the velocity.
  [[nodiscard]] std::size_t size() const noexcept { return 2 * states_.size(); }
  void save(std::span<double> state) const noexcept;
  void load(std::span<const double> state, const Vector3& velocity_mm_per_s) noexcept;

 private:
  static constexpr std::size_t tabulated = 64;  // periods

  struct State {
    ModeTransition over_period;
    Eigen::Index axis = 0;  // which it moves
    Vector3 excited_by = Vector3::Zero();
    double participation = 1.0;
    double weight2 = 1.0;          // its square, times the number of modes of the axis
    double decay_rate = 0.0;       // 1/s
    double damped_period_s = 0.0;  // over 2 pi
    double deflection = 0.0;       // mm
    double velocity = 0.0;         // mm/s
  };

  double period_s_;
  std::vector<Mode> modes_;
  std::vector<State> states_;         // one for each
  std::vector<ModeTransition> over_;  // of each mode over 1, 2 ... periods
  Vector3 velocity_ = Vector3::Zero();
};

inline void FreeModes::step(const Vector3& velocity_mm_per_s) noexcept {
  const Vector3 jump = velocity_mm_per_s - velocity_;
  velocity_ = velocity_mm_per_s;
  for (State& state : states_) {
    const ModeTransition& by = state.over_period;
    const double velocity = state.velocity - state.excited_by.dot(jump);
    const double deflection = by.dd * state.deflection + by.dv * velocity;
    state.velocity = by.vd * state.deflection + by.vv * velocity;
    state.deflection = deflection;
  }
}

inline Vector3 FreeModes::deflection() const noexcept {
  Vector3 deflection = Vector3::Zero();
  for (const State& state : states_) {
    deflection[state.axis] += state.participation * state.deflection;
  }
  return deflection;
}

}  // namespace shapegcode::detail
