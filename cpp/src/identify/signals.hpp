// Checks of records common to all parts of identification.
#pragma once

#include <cstddef>
#include <span>

#include "shapegcode/identify/arma.hpp"

namespace shapegcode {

/// Throws Error(argument), naming record and sample, if there is no record, one of fewer than `min_samples`, or a
/// value that is not finite.
void check_responses(Responses responses, std::size_t min_samples);

/// As check_responses, and if force and response differ in length or a record's force is zero throughout.
void check_taps(std::span<const TapSignals> taps, std::size_t min_samples);

/// Throws Error(argument), naming the entry, on a value that is not finite.
void check_finite(std::span<const double> values, const char* what);

/// Throws Error(argument) unless the time between samples, in s, is finite and above 0.
void check_period(double period_s);

}  // namespace shapegcode
