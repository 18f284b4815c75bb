#pragma once

#include <cmath>
#include <limits>
#include <sstream>
#include <string>

#include "shapegcode/error.hpp"

namespace shapegcode {

inline constexpr double unbounded = std::numeric_limits<double>::infinity();

/// Throws Error(argument) unless lowest <= value <= highest and the value is finite.
inline void check_within(double value, double lowest, double highest, const std::string& name, const char* unit) {
  if (std::isfinite(value) && value >= lowest && value <= highest) return;
  std::ostringstream message;
  message << name << " is " << value << ' ' << unit << ", must be ";
  if (highest < unbounded) {
    message << "within " << lowest << " ... " << highest;
  } else {
    message << "finite and >= " << lowest;
  }
  throw Error(ErrorKind::argument, message.str());
}

inline void check_not_below_zero(double value, const std::string& name, const char* unit) {
  check_within(value, 0.0, unbounded, name, unit);
}

/// Throws Error(argument) unless the value is finite and > 0.
inline void check_above_zero(double value, const std::string& name, const char* unit) {
  if (std::isfinite(value) && value > 0.0) return;
  std::ostringstream message;
  message << name << " is " << value << ' ' << unit << ", must be finite and > 0";
  throw Error(ErrorKind::argument, message.str());
}

}  // namespace shapegcode
