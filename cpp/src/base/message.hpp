#pragma once

#include <cstdio>
#include <string>

namespace shapegcode {

/// printf into a string: error messages that carry values and limits.
template <class... Values>
[[nodiscard]] std::string format_message(const char* pattern, Values... values) {
  char buffer[400];
  std::snprintf(buffer, sizeof buffer, pattern, values...);
  return buffer;
}

}  // namespace shapegcode
