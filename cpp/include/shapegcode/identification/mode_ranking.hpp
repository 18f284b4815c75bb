#pragma once

#include <cstddef>
#include <span>
#include <vector>

#include "shapegcode/identification/signals.hpp"

namespace shapegcode {

/// Candidates in the order in which they explain most of what those before them leave.
struct ModeRanking {
  std::vector<std::size_t> chosen;     ///< indices into the candidates
  std::vector<double> sum_of_squares;  ///< of what is left after each choice, in the response's unit squared
  double total = 0.0;                  ///< of the responses, offsets taken out
};

/// Ranks candidates for the modes of taps by forward selection: at each step the candidate whose response to the force,
/// together with those already chosen, leaves the least squares; residues are fitted, frequencies and damping ratios
/// are not. Gives starts for fit_modes out of the poles of a stabilisation chart, also where the model with just as
/// many modes misses a weak one. Stops early where no candidate explains anything more.
///
/// `candidates` as the starts of fit_modes; `most` >= 1: how many to choose. The first `kept` of them are chosen before
/// all others, in their order: handed over as fitted, they leave only what is new to the rest of the candidates. Throws
/// Error(argument) as fit_modes.
[[nodiscard]] ModeRanking rank_modes(std::span<const TapSignals> taps, double period_s, const NaturalModes& candidates,
                                     std::size_t most, std::size_t kept = 0,
                                     Quantity quantity = Quantity::acceleration);

/// The same for free decays: amplitude and phase are each record's own.
[[nodiscard]] ModeRanking rank_modes(Responses responses, double period_s, const NaturalModes& candidates,
                                     std::size_t most, std::size_t kept = 0);

}  // namespace shapegcode
