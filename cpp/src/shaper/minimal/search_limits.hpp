#pragma once

// Limits common to all searches for minimal shapers.
namespace shapegcode::minimal {

inline constexpr double same_pole = 1e-6;       ///< relative
inline constexpr double most_periods = 100.0;   ///< of the fastest mode within the duration: bounds time and memory
inline constexpr double duration_slack = 1e-9;  ///< relative: 0.8 s found as 0.8 (1 + 1e-16) is within 0.8 s

}  // namespace shapegcode::minimal
