// Private: conversion of digits to numbers, for words, macro expressions, sequence numbers and the search for them.
#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <string_view>

#include "program/text/characters.hpp"

namespace shapegcode {

/// Digits with at most one decimal point among them. A sign belongs to whoever reads it.
struct ScannedNumber {
  double value = 0.0;
  unsigned digits = 0;       ///< 0: there is no number
  unsigned significant = 0;  ///< of them, leading zeros not counted
  unsigned decimals = 0;     ///< of the digits that `value` holds
  bool has_point = false;
};

/// Reads the number at text[i]; `i` ends behind it. Of more than 17 significant digits the rest is counted, but has no
/// part in the value: every caller refuses far fewer.
inline ScannedNumber scan_number(std::string_view text, std::size_t& i) noexcept {
  constexpr std::array<double, 19> powers_of_ten = {1e0,  1e1,  1e2,  1e3,  1e4,  1e5,  1e6,  1e7,  1e8, 1e9,
                                                    1e10, 1e11, 1e12, 1e13, 1e14, 1e15, 1e16, 1e17, 1e18};
  constexpr unsigned most_significant = 17;
  std::uint64_t mantissa = 0;
  unsigned significant = 0;
  std::size_t k = i;
  const auto read_digits = [&] {
    unsigned kept = 0;
    for (; k < text.size() && is_digit(text[k]); ++k) {
      if (significant < most_significant) {
        mantissa = mantissa * 10 + static_cast<unsigned>(text[k] - '0');
        significant += mantissa != 0 ? 1U : 0U;
        ++kept;
      } else {
        ++significant;
      }
    }
    return kept;
  };
  ScannedNumber number;
  read_digits();
  number.has_point = k < text.size() && text[k] == '.';
  if (number.has_point) {
    ++k;
    number.decimals = read_digits();
  }
  number.significant = significant;
  number.digits = static_cast<unsigned>(k - i) - (number.has_point ? 1U : 0U);
  i = k;
  // A mantissa below 2^53 over an exact power of ten is the correctly rounded decimal.
  const std::size_t power = std::min<std::size_t>(number.decimals, powers_of_ten.size() - 1);
  number.value = static_cast<double>(mantissa) / powers_of_ten[power];
  return number;
}

/// Reads digits alone; -1 if there are none. A number above 10^17 stays below 10^18.
inline std::int64_t scan_whole(std::string_view text, std::size_t& i) noexcept {
  constexpr std::int64_t most = 100'000'000'000'000'000;
  std::int64_t number = -1;
  for (; i < text.size() && is_digit(text[i]); ++i) {
    if (number < most) {
      number = std::max<std::int64_t>(number, 0) * 10 + (text[i] - '0');
    }
  }
  return number;
}

/// `i` stands on the '/' of a block skip and ends behind it and its digit: the switch, 1 ... 9.
inline int scan_skip_switch(std::string_view text, std::size_t& i) noexcept {
  ++i;
  if (i == text.size() || !is_digit(text[i])) {
    return 1;
  }
  return std::max(1, text[i++] - '0');
}

/// Blanks in the narrow sense: what may stand between an address and its number.
inline void skip_spaces(std::string_view text, std::size_t& i) noexcept {
  while (i < text.size() && (text[i] == ' ' || text[i] == '\t')) {
    ++i;
  }
}

}  // namespace shapegcode
