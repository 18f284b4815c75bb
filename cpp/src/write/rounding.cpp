#include "write/rounding.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <string>

#include "base/checks.hpp"
#include "shapegcode/error.hpp"

namespace shapegcode {
namespace {

// Number of candidates followed at a time; more on the last free blocks before a rest, where the effect is largest.
constexpr std::size_t width_underway = 4;
constexpr std::size_t width_before_rest = 128;
constexpr std::size_t free_nodes_before_rest = 8;
// How much what is left now counts against one period of what was left underway.
constexpr double weight_now = 4.0;
constexpr double max_decay = 2.0;  // natural logarithm
// So few choices are ranked by comparing each with each.
constexpr std::size_t small_field = 2 * width_underway;
constexpr double never = std::numeric_limits<double>::infinity();
constexpr std::size_t room = 2 * std::max(width_underway, width_before_rest);

}  // namespace

ModalRounder::ModalRounder(std::span<const Mode> modes, double block_period_s, int ticks_per_period) {
  require_period(block_period_s, "block period");
  if (ticks_per_period < 1) {
    throw Error(ErrorKind::argument, fmt::format("{} ticks in a block period, must be at least 1", ticks_per_period));
  }
  for (const Mode& mode : modes) {
    const std::complex<double> s = pole(mode);
    ModeStep step;
    step.pole_period = s * block_period_s;
    step.turn = std::exp(step.pole_period);
    step.scale = std::abs(mode.participation) / (s.imag() * block_period_s);
    step.gain = (1.0 - step.turn) * step.scale;
    const std::complex<double> tick_turn = std::exp(step.pole_period / static_cast<double>(ticks_per_period));
    double before = 0.0;
    for (int tick = 1; tick <= ticks_per_period; ++tick) {
      const double fraction = static_cast<double>(tick) / ticks_per_period;
      const double height = 4.0 * fraction * (1.0 - fraction);
      step.bulge_gain = step.bulge_gain * tick_turn + (1.0 - tick_turn) * (height - before);
      before = height;
    }
    step.bulge_gain *= step.scale * ticks_per_period;
    decay_ = std::max(decay_, -step.pole_period.real());
    modes_.push_back(step);
  }
  state_.resize(modes_.size());
  chosen_state_.resize(modes_.size());
  turn_.resize(modes_.size());
  gain_.resize(modes_.size());
  for (Choices* choices : {&kept_, &grown_}) {
    choices->cost.resize(room);
    choices->shift.resize(room);
    choices->step.resize(room);
    choices->real.resize(room * modes_.size());
    choices->imag.resize(room * modes_.size());
  }
  left_.resize(room);
  rank_.resize(room);
}

void ModalRounder::advance(std::span<std::complex<double>> excitation, double step) const noexcept {
  for (std::size_t m = 0; m < modes_.size(); ++m) {
    excitation[m] = excitation[m] * modes_[m].turn + modes_[m].gain * step;
  }
}

void ModalRounder::bulge(std::span<std::complex<double>> excitation, double height) const noexcept {
  for (std::size_t m = 0; m < modes_.size(); ++m) {
    excitation[m] += modes_[m].bulge_gain * height;
  }
}

// Every choice goes on to every candidate that it may go on to.
void ModalRounder::expand(const RoundingNode& node, const std::complex<double>* excitation) {
  for (std::size_t m = 0; m < modes_.size(); ++m) {
    const ModeStep& mode = modes_[m];
    turn_[m] = mode.turn;
    gain_[m] = mode.gain;
    if (node.periods != 1) {
      const auto periods = static_cast<double>(node.periods);
      turn_[m] = std::exp(mode.pole_period * periods);
      gain_[m] = (1.0 - turn_[m]) * (mode.scale / periods);
    }
  }
  grown_.count = 0;
  grow(node, 0, excitation);
  if (node.other != 0) {
    grow(node, 1, excitation);
  }
}

void ModalRounder::grow(const RoundingNode& node, unsigned side, const std::complex<double>* excitation) {
  const std::size_t count = kept_.count;
  const std::size_t first = grown_.count;
  const double shift = side != 0 ? node.other : 0.0;
  std::fill_n(left_.begin(), count, 0.0);
  for (std::size_t m = 0; m < modes_.size(); ++m) {
    const double* real = &kept_.real[m * room];
    const double* imag = &kept_.imag[m * room];
    double* to_real = &grown_.real[m * room + first];
    double* to_imag = &grown_.imag[m * room + first];
    const double turn_real = turn_[m].real();
    const double turn_imag = turn_[m].imag();
    const double gain_real = gain_[m].real();
    const double gain_imag = gain_[m].imag();
    const std::complex<double> given = excitation[m] + gain_[m] * shift;
    // What is left if the error is gone one period later: an error that lasts is no vibration.
    const std::complex<double> turn_back = modes_[m].turn;
    const std::complex<double> taken_back = modes_[m].gain * (node.error + shift);
    for (std::size_t i = 0; i < count; ++i) {
      const double before = kept_.shift[i];
      const double re = real[i] * turn_real - imag[i] * turn_imag + given.real() - gain_real * before;
      const double im = real[i] * turn_imag + imag[i] * turn_real + given.imag() - gain_imag * before;
      const double left_real = re * turn_back.real() - im * turn_back.imag() - taken_back.real();
      const double left_imag = re * turn_back.imag() + im * turn_back.real() - taken_back.imag();
      to_real[i] = re;
      to_imag[i] = im;
      left_[i] += left_real * left_real + left_imag * left_imag;
    }
  }
  const auto periods = static_cast<double>(node.periods);
  for (std::size_t i = 0; i < count; ++i) {
    const unsigned from = kept_.step[i] & 1U;
    grown_.cost[first + i] = kept_.cost[i] + left_[i] * periods;
    grown_.step[first + i] = static_cast<std::uint16_t>(2U * i + side);
    grown_.shift[first + i] = shift;
    const bool is_allowed = (node.allowed >> (2U * from + side) & 1U) != 0;
    rank_[first + i] = is_allowed ? grown_.cost[first + i] + weight_now * left_[i] : never;
  }
  grown_.count += count;
}

void ModalRounder::keep_best(std::size_t width) {
  if (grown_.count <= small_field) {
    // Each is kept that fewer than `width` others beat. No branch depends on the ranks, which nothing predicts.
    std::array<std::int64_t, small_field> beaten_by{};
    std::fill(rank_.begin() + static_cast<std::ptrdiff_t>(grown_.count), rank_.begin() + small_field, never);
    for (std::size_t other = 0; other < grown_.count; ++other) {
      for (std::size_t i = 0; i < small_field; ++i) {
        beaten_by[i] += rank_[other] < rank_[i] ? 1 : 0;
      }
    }
    order_.resize(small_field);
    std::size_t kept = 0;
    for (std::size_t i = 0; i < small_field; ++i) {
      order_[kept] = static_cast<std::uint16_t>(i);
      const auto few_beat_it = static_cast<unsigned>(beaten_by[i] < static_cast<std::int64_t>(width));
      kept += few_beat_it & static_cast<unsigned>(rank_[i] < never);
    }
    order_.resize(kept);
  } else {
    order_.clear();
    for (std::size_t i = 0; i < grown_.count; ++i) {
      if (rank_[i] < never) {
        order_.push_back(static_cast<std::uint16_t>(i));
      }
    }
    if (order_.size() > width) {
      const auto better = [&](std::uint16_t a, std::uint16_t b) { return rank_[a] < rank_[b]; };
      std::nth_element(order_.begin(), order_.begin() + static_cast<std::ptrdiff_t>(width), order_.end(), better);
      order_.resize(width);
    }
  }
  // The nearest end stays reachable, because from it every later nearest end is. Its choices are the first grown.
  const auto is_nearest = [&](std::uint16_t i) { return i < kept_.count; };
  if (std::none_of(order_.begin(), order_.end(), is_nearest)) {
    const auto best = std::min_element(rank_.begin(), rank_.begin() + static_cast<std::ptrdiff_t>(kept_.count));
    order_.back() = static_cast<std::uint16_t>(best - rank_.begin());
  }
  trace_begin_.push_back(trace_.size());
  kept_.count = order_.size();
  for (std::size_t i = 0; i < order_.size(); ++i) {
    const std::size_t from = order_[i];
    kept_.cost[i] = grown_.cost[from];
    kept_.shift[i] = grown_.shift[from];
    kept_.step[i] = grown_.step[from];
    trace_.push_back(grown_.step[from]);
  }
  for (std::size_t m = 0; m < modes_.size(); ++m) {
    for (std::size_t i = 0; i < order_.size(); ++i) {
      kept_.real[m * room + i] = grown_.real[m * room + order_[i]];
      kept_.imag[m * room + i] = grown_.imag[m * room + order_[i]];
    }
  }
}

// Gives every choice so far the state that becomes an excitation some periods later.
void ModalRounder::add_late(std::span<const std::complex<double>> excitation, double periods) {
  for (std::size_t m = 0; m < modes_.size(); ++m) {
    const std::complex<double> now = excitation[m] * std::exp(-modes_[m].pole_period * periods);
    for (std::size_t i = 0; i < kept_.count; ++i) {
      kept_.real[m * room + i] += now.real();
      kept_.imag[m * room + i] += now.imag();
    }
  }
}

std::complex<double> ModalRounder::state_of(std::size_t choice, std::size_t mode) const {
  return {kept_.real[mode * room + choice], kept_.imag[mode * room + choice]};
}

std::size_t ModalRounder::best_end(const RoundingEnd& end) const {
  std::size_t best = 0;
  double least = std::numeric_limits<double>::infinity();
  for (std::size_t i = 0; i < kept_.count; ++i) {
    double left = end.rest ? 0.0 : kept_.cost[i];
    for (std::size_t m = 0; m < modes_.size(); ++m) {
      std::complex<double> w = state_of(i, m);
      if (end.rest && end.rest_periods > 0) {
        w = w * std::exp(modes_[m].pole_period * static_cast<double>(end.rest_periods)) + end.rest_excitation[m];
      }
      left += std::norm(w);
    }
    if (left < least) {
      best = i;
      least = left;
    }
  }
  return best;
}

void ModalRounder::choose(std::span<const RoundingNode> nodes, std::span<const std::complex<double>> excitation,
                          const RoundingEnd& end, std::span<std::int8_t> shift) {
  std::size_t last_ones = nodes.size();
  for (std::size_t free = 0; end.rest && last_ones > 0 && free < free_nodes_before_rest; --last_ones) {
    free += nodes[last_ones - 1].other != 0 ? 1 : 0;
  }
  kept_.count = 1;
  kept_.cost[0] = 0.0;
  kept_.shift[0] = 0.0;
  kept_.step[0] = 0;
  for (std::size_t m = 0; m < modes_.size(); ++m) {
    kept_.real[m * room] = state_[m].real();
    kept_.imag[m * room] = state_[m].imag();
  }
  trace_.clear();
  trace_begin_.clear();
  // What comes late is met from the last free nodes on, but not so early that most of it would have decayed again.
  std::size_t late = nodes.size();
  double late_periods = 0.0;
  while (late > last_ones && decay_ * (late_periods + nodes[late - 1].periods) < max_decay) {
    late_periods += nodes[--late].periods;
  }
  for (std::size_t n = 0; n < nodes.size(); ++n) {
    if (n == late && !end.late_excitation.empty()) {
      add_late(end.late_excitation, late_periods);
    }
    expand(nodes[n], &excitation[n * modes_.size()]);
    keep_best(n < last_ones ? width_underway : width_before_rest);
  }
  if (late == nodes.size() && !end.late_excitation.empty()) {
    add_late(end.late_excitation, 0.0);
  }
  std::size_t choice = best_end(end);
  for (std::size_t m = 0; m < modes_.size(); ++m) {
    chosen_state_[m] = state_of(choice, m);
  }
  for (std::size_t n = nodes.size(); n-- > 0;) {
    const unsigned step = trace_[trace_begin_[n] + choice];
    shift[n] = (step & 1U) != 0 ? nodes[n].other : std::int8_t{0};
    choice = step >> 1U;
  }
}

}  // namespace shapegcode
