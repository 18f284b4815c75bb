// Checks of arguments with uniform messages. Every function throws Error(argument) with the value and its limit.
#pragma once

#include <cstdint>
#include <limits>
#include <string_view>

namespace shapegcode {

inline constexpr double unbounded = std::numeric_limits<double>::infinity();

/// "`name` is `value` `unit`, must be `range`" unless the condition holds; `unit` may be empty.
void require(bool holds, std::string_view name, double value, std::string_view unit, std::string_view range);

/// lowest <= value <= highest, and finite.
void require_within(double value, double lowest, double highest, std::string_view name, std::string_view unit);

/// Finite and >= 0.
void require_not_below_zero(double value, std::string_view name, std::string_view unit);

/// Finite and > 0.
void require_above_zero(double value, std::string_view name, std::string_view unit);

/// A time between samples, s: finite and > 0.
void require_period(double period_s, std::string_view name = "interpolation period");

/// `count`, rounded down, as a whole number: 0 <= count <= most. "`what` takes `count` `things`, at most `most` are
/// possible": what is not checked before it becomes a whole number may become any.
[[nodiscard]] std::int64_t require_count(double count, double most, std::string_view what, std::string_view things);

/// Set-points of one run that can be numbered and, in principle, computed.
inline constexpr double max_set_points = 4e9;
/// Samples over which a filter may reach.
inline constexpr double max_filter_samples = 1e7;

}  // namespace shapegcode
