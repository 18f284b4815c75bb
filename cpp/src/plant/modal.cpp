#include "shapegcode/plant/modal.hpp"

#include <algorithm>
#include <cmath>
#include <complex>
#include <utility>

#include <fmt/format.h>

#include "base/checks.hpp"
#include "base/rest.hpp"
#include "shapegcode/error.hpp"

namespace shapegcode {
namespace {

constexpr double peak_steps_per_swing = 20.0;
constexpr double max_substeps = 1024.0;
constexpr double residual_steps_per_swing = 64.0;
constexpr double max_residual_steps = 1e6;
constexpr double node_angle_rad = 1e-3;       // omega*period between neighbouring nodes of a mode that varies
constexpr double surely_below = 1.0 - 1e-12;  // rounding included
constexpr double max_matrices = 262144;       // of a mode that varies: 8 MB

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

double ModalPlant::State::reachable() const noexcept { return std::abs(participation) * std::sqrt(amplitude2()); }

double ModalPlant::reachable(std::size_t axis) const noexcept {
  double sum = 0.0;
  for (std::size_t m = first_[axis]; m < first_[axis + 1]; ++m) sum += states_[m].reachable();
  return sum;
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

ModalPlant::Transition ModalPlant::sub_transition(std::size_t axis, const Mode& mode, int substep) const {
  Transition part = mode_transition(mode, period_s_ * substep / substeps_[axis]);
  part.dd *= mode.participation;
  part.dv *= mode.participation;
  part.vd *= mode.participation;
  part.vv *= mode.participation;
  return part;
}

ModalPlant::Transition ModalPlant::between(const Transition& a, const Transition& b, double share) noexcept {
  return {a.dd + share * (b.dd - a.dd), a.dv + share * (b.dv - a.dv), a.vd + share * (b.vd - a.vd),
          a.vv + share * (b.vv - a.vv)};
}

ModalPlant::Node ModalPlant::node_of(const Mode& mode, double period_s) {
  const std::complex<double> s = pole(mode);
  return {mode_transition(mode, period_s), -s.real(), 1.0 / s.imag()};
}

ModalPlant::ModalPlant(AxisModes modes, double period_s, AxisModeTables tables)
    : modes_(std::move(modes)), period_s_(period_s), rate_hz_(1.0 / period_s) {
  require_period(period_s);
  std::vector<Varying> varying;
  for (std::size_t axis = 0; axis < axis_count; ++axis) {
    const std::vector<Mode>& axis_modes = modes_[axis];
    if (tables[axis].size() > axis_modes.size()) {
      throw Error(ErrorKind::argument,
                  fmt::format("{} tables for {} modes of axis {}", tables[axis].size(), axis_modes.size(), axis));
    }
    tables[axis].resize(axis_modes.size());
    first_[axis] = states_.size();
    for (const Mode& mode : axis_modes) {
      check_shares(mode, axis);
      State state;
      static_cast<Node&>(state) = node_of(mode, period_s);
      state.participation = mode.participation;
      state.excited_by = excitation(mode, axis);
      states_.push_back(state);
    }
    double fastest = fastest_hz(axis_modes);
    for (const ModeTable& table : tables[axis]) {
      check_table(table);
      for (const double frequency : table.frequency_hz) fastest = std::max(fastest, frequency);
    }
    const double substeps = std::ceil(period_s * peak_steps_per_swing * fastest);
    substeps_[axis] = static_cast<int>(std::clamp(substeps, 1.0, max_substeps));
    first_sub_[axis] = sub_.size();
    for (int k = 1; k <= substeps_[axis]; ++k) {
      for (const Mode& mode : axis_modes) sub_.push_back(sub_transition(axis, mode, k));
    }
    for (std::size_t m = 0; m < axis_modes.size(); ++m) {
      if (!tables[axis][m].empty()) varying.push_back(tabulate(axis, m, tables[axis][m]));
    }
  }
  first_[axis_count] = states_.size();
  table_position_.resize(varying.size());
  varying_ = std::make_shared<const std::vector<Varying>>(std::move(varying));
  move_to(command_);
}

ModalPlant::Varying ModalPlant::tabulate(std::size_t axis, std::size_t mode, const ModeTable& table) const {
  Varying varying{axis, mode, table, {0}, {}, {}};
  const Mode& nominal = modes_[axis][mode];
  const std::size_t rows = table.position_mm.size();
  const double max_nodes = max_matrices / static_cast<double>((substeps_[axis] + 1) * static_cast<int>(rows));
  const auto add = [&](double position) {
    const Mode here = mode_at(nominal, table, position);
    varying.nodes.push_back(node_of(here, period_s_));
    for (int k = 1; k <= substeps_[axis]; ++k) varying.sub.push_back(sub_transition(axis, here, k));
  };
  for (std::size_t row = 0; row + 1 < rows; ++row) {
    const double from = table.position_mm[row];
    const double to = table.position_mm[row + 1];
    const std::complex<double> turn = pole(mode_at(nominal, table, to)) - pole(mode_at(nominal, table, from));
    const double wanted = std::ceil(std::abs(turn) * period_s_ / node_angle_rad);
    const double intervals = std::clamp(wanted, 1.0, std::max(1.0, std::floor(max_nodes)));
    for (double k = 0.0; k < intervals; ++k) add(from + k / intervals * (to - from));
    varying.first_node.push_back(varying.nodes.size());
  }
  add(table.position_mm.back());
  return varying;
}

void ModalPlant::move_to(const Vector3& position) noexcept {
  for (std::size_t v = 0; v < table_position_.size(); ++v) {
    const Varying& varying = (*varying_)[v];
    TablePosition& found = table_position_[v];
    const double at = position[varying.table.axis];
    if (at == found.position_mm && found.known) continue;
    found = {at, 0, 0.0, true};
    const std::vector<double>& rows = varying.table.position_mm;
    const auto above = static_cast<std::size_t>(std::upper_bound(rows.begin(), rows.end(), at) - rows.begin());
    if (above == rows.size()) {
      found.node = varying.nodes.size() - 1;
    } else if (above > 0) {
      const std::size_t first = varying.first_node[above - 1];
      const std::size_t intervals = varying.first_node[above] - first;
      const double along = (at - rows[above - 1]) / (rows[above] - rows[above - 1]) * static_cast<double>(intervals);
      const std::size_t whole = std::min(static_cast<std::size_t>(along), intervals - 1);
      found.node = first + whole;
      found.share = along - static_cast<double>(whole);
    }
    const Node& low = varying.nodes[found.node];
    const Node& high = varying.nodes[std::min(found.node + 1, varying.nodes.size() - 1)];
    Node& here = states_[first_[varying.axis] + varying.mode];
    here.over_period = between(low.over_period, high.over_period, found.share);
    here.decay_rate = low.decay_rate + found.share * (high.decay_rate - low.decay_rate);
    here.damped_period_s = low.damped_period_s + found.share * (high.damped_period_s - low.damped_period_s);
  }
}

void ModalPlant::move_sub_steps(std::size_t axis) noexcept {
  const std::size_t modes = first_[axis + 1] - first_[axis];
  const auto substeps = static_cast<std::size_t>(substeps_[axis]);
  for (std::size_t v = 0; v < table_position_.size(); ++v) {
    const Varying& varying = (*varying_)[v];
    if (varying.axis != axis) continue;
    const std::size_t next = std::min(table_position_[v].node + 1, varying.nodes.size() - 1);
    for (std::size_t k = 0; k < substeps; ++k) {
      sub_[first_sub_[axis] + k * modes + varying.mode] =
          between(varying.sub[table_position_[v].node * substeps + k], varying.sub[next * substeps + k],
                  table_position_[v].share);
    }
  }
}

Mode ModalPlant::mode_now(std::size_t axis, std::size_t mode) const noexcept {
  for (const Varying& varying : *varying_) {
    if (varying.axis == axis && varying.mode == mode) {
      return mode_at(modes_[axis][mode], varying.table, command_[varying.table.axis]);
    }
  }
  return modes_[axis][mode];
}

void ModalPlant::reset(const Vector3& position) noexcept {
  for (State& state : states_) {
    state.deflection = 0.0;
    state.velocity = 0.0;
  }
  row_ = 0;
  command_ = position;
  move_to(position);
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
  move_sub_steps(axis);
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

void ModalPlant::forget_nothing() noexcept {
  for (State& state : states_) {
    state.deflection = state_or_none(state.deflection);
    state.velocity = state_or_none(state.velocity);
  }
}

// The same as of several modes, to the last bit.
inline void ModalPlant::step_only_mode(std::size_t axis, const Vector3& jumps) noexcept {
  const auto a = static_cast<Eigen::Index>(axis);
  State& stored = states_[first_[axis]];
  State state = stored;
  state.velocity -= state.excited_by.dot(jumps);
  const double share2 = state.participation * state.participation;
  const bool may_grow = share2 * state.amplitude2() > surely_below * peak_[a] * peak_[a];
  if (may_grow && state.reachable() > peak_[a]) {
    stored.velocity = state.velocity;
    look_between(axis);
  }
  state.propagate();
  stored.deflection = state.deflection;
  stored.velocity = state.velocity;
  deflection_[a] = 0.0 + state.participation * state.deflection;
}

Vector3 ModalPlant::step(const Vector3& command) noexcept {
  if (!table_position_.empty()) move_to(0.5 * (command_ + command));
  const Vector3 velocity = (command - command_) * rate_hz_;
  const Vector3 jumps = velocity - command_velocity_;
  command_ = command;
  command_velocity_ = velocity;
  for (std::size_t axis = 0; axis < axis_count; ++axis) {
    const auto a = static_cast<Eigen::Index>(axis);
    const std::size_t first = first_[axis];
    const std::size_t last = first_[axis + 1];
    if (first == last) continue;
    if (last - first == 1) {
      step_only_mode(axis, jumps);
      continue;
    }

    // The command's velocity jumps at the set-point; the table does not, so the deflection's velocity jumps back.
    double squares = 0.0;
    for (std::size_t m = first; m < last; ++m) {
      State& state = states_[m];
      state.velocity -= state.excited_by.dot(jumps);
      squares += state.participation * state.participation * state.amplitude2();
    }
    // The square of a sum is at most its number of terms times the sum of their squares: mostly it settles the matter.
    const bool may_grow = static_cast<double>(last - first) * squares > surely_below * peak_[a] * peak_[a];
    if (may_grow && reachable(axis) > peak_[a]) look_between(axis);
    double deflection = 0.0;
    for (std::size_t m = first; m < last; ++m) {
      states_[m].propagate();
      deflection += states_[m].participation * states_[m].deflection;
    }
    deflection_[a] = deflection;
  }
  if (++row_ % rows_between_looks == rows_between_looks - 1) forget_nothing();
  return {command[0] + deflection_[0], command[1] + deflection_[1], command[2] + deflection_[2]};
}

Vector3 ModalPlant::residual_peak(int n_periods) const {
  if (n_periods < 1) {
    throw Error(ErrorKind::argument, fmt::format("residual over {} periods, at least 1 needed", n_periods));
  }
  Vector3 result = Vector3::Zero();
  for (std::size_t axis = 0; axis < axis_count; ++axis) {
    if (modes_[axis].empty()) continue;
    const auto a = static_cast<Eigen::Index>(axis);
    std::vector<Mode> modes(modes_[axis].size());
    for (std::size_t m = 0; m < modes.size(); ++m) modes[m] = mode_now(axis, m);
    std::vector<State> free(states_.begin() + static_cast<std::ptrdiff_t>(first_[axis]),
                            states_.begin() + static_cast<std::ptrdiff_t>(first_[axis + 1]));
    const double step_s = 1.0 / (residual_steps_per_swing * fastest_hz(modes));
    const double steps = std::min(std::ceil(n_periods / (slowest_hz(modes) * step_s)), max_residual_steps);
    Motion before{deflection_[a], 0.0};
    for (std::size_t m = 0; m < free.size(); ++m) {
      free[m].velocity += free[m].excited_by.dot(command_velocity_);  // the command stops
      static_cast<Node&>(free[m]) = node_of(modes[m], step_s);
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
