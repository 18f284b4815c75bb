#pragma once

#include <complex>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "shapegcode/mode.hpp"

namespace shapegcode {

/// The end of a block on one axis, to be rounded to one of two neighbouring increments.
struct RoundingNode {
  double error = 0.0;         ///< nearest increment minus exact position, in increments
  std::uint32_t periods = 1;  ///< block periods that the block before it lasts
  std::int8_t other = 0;      ///< the other candidate minus the nearest: -1 or +1; 0: there is none
  std::uint8_t allowed =
      0xF;  ///< bit 2 f + t: the block may go from candidate f to t (0: nearest); bit 0 is always set
};

/// How a section of blocks ends. `late_excitation` (per mode, see ModalRounder::advance): what the blocks leave besides
/// their ends, which only the last choices before a rest meet; anywhere else it is no vibration but the path's own
/// curvature. Where the command comes to rest, what it still moves behind the last block's end is
/// left out by the blocks; `rest_periods` and `rest_excitation` (per mode, see ModalRounder::advance) account for it.
struct RoundingEnd {
  bool rest = false;
  std::span<const std::complex<double>> late_excitation;
  std::uint32_t rest_periods = 0;
  std::span<const std::complex<double>> rest_excitation;
};

/// Chooses block ends of one axis so that what rounding them leaves in the axis' modes stays small, most of all where
/// the command comes to rest.
///
/// A rounding error e(t), linear between block ends, drives the relative deflection of a mode with pole s: with the
/// modal velocity w, dw/dt = s w - s de/dt, so a block of n periods T takes w to z w + (1 - z)/(n T) * (change of e),
/// z = exp(s n T): exact, no time is sampled. At rest |w| / Im(s) is the amplitude of the vibration left. The ends are
/// found by a beam search (M-algorithm, Jelinek & Anderson 1971, "Instrumentable tree encoding of information
/// sources"): of all choices so far, those are kept that left least underway and now. The state is carried from
/// section to section.
class ModalRounder {
 public:
  /// Throws Error(argument) if a mode is none (see pole), the period is not finite and above 0 or it has no tick.
  ModalRounder(std::span<const Mode> modes, double block_period_s, int ticks_per_period);

  [[nodiscard]] std::size_t mode_count() const noexcept { return modes_.size(); }

  /// Takes excitations, one per mode, over one period in which the blocks move `step` increments further than the
  /// exact command.
  void advance(std::span<std::complex<double>> excitation, double step) const noexcept;

  /// Adds what a curved period leaves against a straight one: a parabola of a height in increments over it, joined by
  /// straight lines between the controller's ticks. To be called behind `advance` of that period.
  void bulge(std::span<std::complex<double>> excitation, double height) const noexcept;

  /// Chooses for every node how far it is from its nearest increment. `excitation`: per node and mode what the block
  /// before it leaves if both its ends are the nearest ones. The last node must have one candidate only.
  void choose(std::span<const RoundingNode> nodes, std::span<const std::complex<double>> excitation,
              const RoundingEnd& end, std::span<std::int8_t> shift);

  /// Goes on from the end of the section last chosen.
  void accept() { state_ = chosen_state_; }

 private:
  // Scaled so that a state's magnitude is an amplitude in increments.
  struct ModeStep {
    std::complex<double> pole_period;  // s T
    std::complex<double> turn;         // over one period
    std::complex<double> gain;         // of one increment in one period
    std::complex<double> bulge_gain;   // of a parabola one increment high over one period
    double scale = 1.0;                // amplitude per modal velocity and increment per period
  };
  // Choices made so far, side by side. States are per mode one behind the other, `room` apart.
  struct Choices {
    std::size_t count = 0;
    std::vector<double> cost;   // of what was left underway
    std::vector<double> shift;  // of the last node, increments from its nearest
    std::vector<double> real;   // modal states
    std::vector<double> imag;
    std::vector<std::uint16_t> step;  // 2 parent + side; side 0: nearest
  };

  void expand(const RoundingNode& node, const std::complex<double>* excitation);
  void grow(const RoundingNode& node, unsigned side, const std::complex<double>* excitation);
  void add_late(std::span<const std::complex<double>> excitation, double periods);
  void keep_best(std::size_t width);
  [[nodiscard]] std::size_t best_end(const RoundingEnd& end) const;
  [[nodiscard]] std::complex<double> state_of(std::size_t choice, std::size_t mode) const;

  std::vector<ModeStep> modes_;
  double decay_ = 0.0;                              // of the most damped mode over a period
  std::vector<std::complex<double>> state_;         // per mode, at the start of the next section
  std::vector<std::complex<double>> chosen_state_;  // at the end of the section last chosen
  Choices kept_;
  Choices grown_;
  std::vector<double> left_;  // per grown choice, what is left now
  std::vector<double> rank_;  // per grown choice: the less the better
  std::vector<std::uint16_t> order_;
  std::vector<std::size_t> trace_begin_;    // per node: its choices in trace_
  std::vector<std::uint16_t> trace_;        // their steps
  std::vector<std::complex<double>> turn_;  // of the block under expansion
  std::vector<std::complex<double>> gain_;
};

}  // namespace shapegcode
