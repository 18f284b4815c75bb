#include "shapegcode/emission/rounding.hpp"

#include <algorithm>
#include <cmath>
#include <string>

#include "shapegcode/error.hpp"

namespace shapegcode {
namespace {

// Choices followed at a time; more of them on the last free blocks before a rest, where it shows most.
constexpr std::size_t width_on_the_way = 12;
constexpr std::size_t width_before_rest = 128;
constexpr std::size_t free_nodes_before_rest = 8;
// How much what is left now counts against one period of what was left on the way.
constexpr double weight_now = 4.0;

}  // namespace

ModalRounder::ModalRounder(std::span<const Mode> modes, double block_period_s) : period_s_(block_period_s) {
  if (!std::isfinite(block_period_s) || !(block_period_s > 0.0)) {
    throw Error(ErrorKind::argument, "block period " + std::to_string(block_period_s) + " s, must be above 0");
  }
  for (const Mode& mode : modes) {
    const std::complex<double> s = pole(mode);
    ModeStep step;
    step.pole_period = s * block_period_s;
    step.turn = std::exp(step.pole_period);
    step.scale = std::abs(mode.participation) / (s.imag() * block_period_s);
    step.gain = (1.0 - step.turn) * step.scale;
    modes_.push_back(step);
  }
  state_.resize(modes_.size());
  chosen_state_.resize(modes_.size());
  turn_.resize(modes_.size());
  gain_.resize(modes_.size());
}

void ModalRounder::advance(std::span<std::complex<double>> excitation, double step) const noexcept {
  for (std::size_t m = 0; m < modes_.size(); ++m) {
    excitation[m] = excitation[m] * modes_[m].turn + modes_[m].gain * step;
  }
}

// Every survivor goes on to every candidate that it may go on to.
void ModalRounder::expand(const RoundingNode& node, std::int8_t other_before, const std::complex<double>* excitation,
                          std::size_t width) {
  const std::size_t count = modes_.size();
  for (std::size_t m = 0; m < count; ++m) {
    const ModeStep& mode = modes_[m];
    turn_[m] = mode.turn;
    gain_[m] = mode.gain;
    if (node.periods != 1) {
      const auto periods = static_cast<double>(node.periods);
      turn_[m] = std::exp(mode.pole_period * periods);
      gain_[m] = (1.0 - turn_[m]) * (mode.scale / periods);
    }
  }
  grown_.clear();
  grown_states_.clear();
  for (std::uint8_t side = 0; side <= (node.other != 0 ? 1 : 0); ++side) {
    const double shift = side != 0 ? node.other : 0.0;
    const double error = node.error + shift;
    for (std::size_t i = 0; i < kept_.size(); ++i) {
      const Survivor& from = kept_[i];
      if ((node.allowed >> (2 * from.side + side) & 1U) == 0) {
        continue;
      }
      const double change = shift - (from.side != 0 ? other_before : 0);
      double left = 0.0;
      for (std::size_t m = 0; m < count; ++m) {
        const std::complex<double> w = kept_states_[i * count + m] * turn_[m] + excitation[m] + gain_[m] * change;
        grown_states_.push_back(w);
        // What is left if the error is gone one period later: an error that lasts is no vibration.
        left += std::norm(w * modes_[m].turn - modes_[m].gain * error);
      }
      const double cost = from.cost + left * static_cast<double>(node.periods);
      grown_.push_back({cost, cost + weight_now * left, static_cast<std::uint16_t>(i), side});
    }
  }
  keep_best(width);
}

// The nearest end stays reachable, because from it every later nearest end is.
void ModalRounder::keep_best(std::size_t width) {
  const std::size_t count = modes_.size();
  order_.resize(grown_.size());
  for (std::size_t i = 0; i < order_.size(); ++i) {
    order_[i] = static_cast<std::uint16_t>(i);
  }
  const auto better = [&](std::uint16_t a, std::uint16_t b) { return grown_[a].rank < grown_[b].rank; };
  if (order_.size() > width) {
    const auto border = order_.begin() + static_cast<std::ptrdiff_t>(width);
    std::nth_element(order_.begin(), border, order_.end(), better);
    const auto is_nearest = [&](std::uint16_t i) { return grown_[i].side == 0; };
    if (std::none_of(order_.begin(), border, is_nearest)) {
      // Behind the border there is one: bit 0 of `allowed` is always set.
      std::uint16_t best = *std::find_if(border, order_.end(), is_nearest);
      for (auto it = border; it != order_.end(); ++it) {
        if (is_nearest(*it) && better(*it, best)) {
          best = *it;
        }
      }
      *(border - 1) = best;
    }
    order_.resize(width);
  }
  kept_.clear();
  kept_states_.clear();
  trace_begin_.push_back(trace_.size());
  for (const std::uint16_t i : order_) {
    kept_.push_back(grown_[i]);
    trace_.push_back(static_cast<std::uint16_t>(2U * grown_[i].parent + grown_[i].side));
    for (std::size_t m = 0; m < count; ++m) {
      kept_states_.push_back(grown_states_[i * count + m]);
    }
  }
}

std::size_t ModalRounder::best_end(const RoundingEnd& end) const {
  const std::size_t count = modes_.size();
  std::size_t best = 0;
  double least = 0.0;
  for (std::size_t i = 0; i < kept_.size(); ++i) {
    double left = end.rest ? 0.0 : kept_[i].rank;
    for (std::size_t m = 0; end.rest && m < count; ++m) {
      std::complex<double> w = kept_states_[i * count + m];
      if (end.rest_periods > 0) {
        w = w * std::exp(modes_[m].pole_period * static_cast<double>(end.rest_periods)) + end.rest_excitation[m];
      }
      left += std::norm(w);
    }
    if (i == 0 || left < least) {
      best = i;
      least = left;
    }
  }
  return best;
}

void ModalRounder::choose(std::span<const RoundingNode> nodes, std::span<const std::complex<double>> excitation,
                          const RoundingEnd& end, std::span<std::int8_t> shift) {
  const std::size_t count = modes_.size();
  std::size_t last_ones = nodes.size();
  for (std::size_t free = 0; end.rest && last_ones > 0 && free < free_nodes_before_rest; --last_ones) {
    free += nodes[last_ones - 1].other != 0 ? 1 : 0;
  }
  kept_.assign(1, {});
  kept_states_ = state_;
  trace_.clear();
  trace_begin_.clear();
  for (std::size_t n = 0; n < nodes.size(); ++n) {
    expand(nodes[n], n == 0 ? std::int8_t{0} : nodes[n - 1].other, &excitation[n * count],
           n < last_ones ? width_on_the_way : width_before_rest);
  }
  std::size_t survivor = best_end(end);
  std::copy_n(kept_states_.begin() + static_cast<std::ptrdiff_t>(survivor * count), count, chosen_state_.begin());
  for (std::size_t n = nodes.size(); n-- > 0;) {
    const unsigned step = trace_[trace_begin_[n] + survivor];
    shift[n] = (step & 1U) != 0 ? nodes[n].other : std::int8_t{0};
    survivor = step >> 1U;
  }
}

}  // namespace shapegcode
