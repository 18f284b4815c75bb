// Number of random trials. Under sanitizers, which look at memory and undefined behaviour, each takes some eight times
// as long: an eighth of them. `make test` runs a third of them; all of them run in `make test-all`.
#pragma once

#include <algorithm>
#include <cstdlib>

namespace shapegcode::tests {

#if defined(__SANITIZE_ADDRESS__)
inline constexpr bool is_sanitized = true;
#else
inline constexpr bool is_sanitized = false;
#endif

/// How many of `count` trials to run, at least one.
inline unsigned trials(unsigned count) {
  const unsigned part = is_sanitized ? 8 : std::getenv("SHAPEGCODE_ALL_TRIALS") != nullptr ? 1 : 3;
  return std::max(1U, count / part);
}

}  // namespace shapegcode::tests
