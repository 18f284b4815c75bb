// Private: LinuxCNC's drilling cycles as FANUC's where both move alike, else move by move. What moves: recorded from
// its interpreter rs274 (2.9). A row's first level and R are FANUC's; G89 feeds out to the level of G98, G86 waits and
// starts the spindle again, G84 waits once, G73 and G83 come within 0.254 mm of the last depth.
#pragma once

#include <cstdint>
#include <functional>
#include <string>

#include "program/linuxcnc/interpreter_state.hpp"
#include "program/linuxcnc/word_values.hpp"

namespace shapegcode::linuxcnc {

inline constexpr std::int64_t max_cycle_repeats = 10'000;

using WriteLine = std::function<void(const std::string&)>;

/// Writes the lines of one block of a drilling cycle, `code` in tenths; the state is behind it then. `is_first`: no
/// block before it is of the same row.
void drill(State& state, int code, const WordValues& words, bool is_first, const WriteLine& write);

}  // namespace shapegcode::linuxcnc
