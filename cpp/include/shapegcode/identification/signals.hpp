#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

namespace shapegcode {

/// What a sensor measured: the order of the derivative of the displacement.
enum class Quantity : std::uint8_t { displacement = 0, velocity = 1, acceleration = 2 };

/// One tap: force (N) and response (m, m/s or m/s²) at the same instants, as long as the caller keeps them.
struct TapSignals {
  std::span<const double> force_n;
  std::span<const double> response;
};

/// Free decays: the responses of one or several records, as long as the caller keeps them.
using Responses = std::span<const std::span<const double>>;

/// Natural frequencies (rad/s, undamped) and damping ratios (no unit) of modes, of equal length.
struct NaturalModes {
  std::vector<double> omega_rad_s;
  std::vector<double> damping_ratio;
};

/// Throws Error(argument), naming record and sample, if there is no record, one of fewer than `least_samples`, or a
/// value that is not finite.
void check_responses(Responses responses, std::size_t least_samples);

/// As check_responses, and if force and response differ in length or a record's force is zero throughout.
void check_taps(std::span<const TapSignals> taps, std::size_t least_samples);

/// Throws Error(argument) unless the time between samples, in s, is finite and above 0.
void check_period(double period_s);

}  // namespace shapegcode
