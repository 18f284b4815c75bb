#pragma once

#include <cstdint>
#include <string>

namespace shapegcode {

/// Appends `value` * 10^-decimals in FANUC's decimal notation: always with a point, no trailing zeros ("12.", "-.5",
/// "0.").
void append_decimal(std::string& text, std::int64_t value, int decimals);

/// Appends F: as append_decimal, but a feed below 10 keeps a digit behind the point ("F5.0"), so that it can never be
/// taken for a one-digit feed code F1 ... F9.
void append_feed(std::string& text, std::int64_t value, int decimals);

}  // namespace shapegcode
