// How many random trials are enough under sanitizers, where each takes some eight times as long: they look at memory
// and undefined behaviour, the build without them at the motion.
#pragma once

#include <algorithm>

namespace shapegcode::tests {

#if defined(__SANITIZE_ADDRESS__)
inline constexpr bool is_sanitized = true;
#else
inline constexpr bool is_sanitized = false;
#endif

/// An eighth of `count` under sanitizers, at least one.
constexpr unsigned trials(unsigned count) { return is_sanitized ? std::max(1U, count / 8) : count; }

}  // namespace shapegcode::tests
