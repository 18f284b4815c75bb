// Private: the values of a block's words by their letters.
#pragma once

#include <array>
#include <bit>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>
#include <string_view>

#include "program/dialect/expanded_lines.hpp"
#include "program/text/characters.hpp"

namespace shapegcode::linuxcnc {

/// Place of a letter: a to z, and the three signs that are words of LinuxCNC.
[[nodiscard]] constexpr std::size_t place_of(char letter) noexcept {
  switch (letter) {
    case '@':
      return 26;
    case '^':
      return 27;
    case '$':
      return 28;
    default:
      return static_cast<std::size_t>(letter - 'a');
  }
}

/// A set of letters.
[[nodiscard]] constexpr std::uint32_t letter_set(std::string_view letters) noexcept {
  std::uint32_t set = 0;
  for (const char letter : letters) set |= 1U << place_of(letter);
  return set;
}

inline constexpr std::string_view axis_letters = "xyz";
inline constexpr std::string_view centre_letters = "ijk";

class WordValues {
 public:
  [[nodiscard]] bool has(char letter) const noexcept { return (given_ & (1U << place_of(letter))) != 0; }
  [[nodiscard]] bool has_any(std::uint32_t letters) const noexcept { return (given_ & letters) != 0; }
  /// Of a letter that is given.
  [[nodiscard]] double operator[](char letter) const noexcept { return values_[place_of(letter)]; }
  [[nodiscard]] double get(char letter, double otherwise) const noexcept {
    return has(letter) ? (*this)[letter] : otherwise;
  }
  [[nodiscard]] std::optional<double> find(char letter) const noexcept {
    return has(letter) ? std::optional((*this)[letter]) : std::nullopt;
  }

  void set(char letter, double value) noexcept {
    values_[place_of(letter)] = value;
    given_ |= 1U << place_of(letter);
  }
  void remove(std::uint32_t letters) noexcept { given_ &= ~letters; }

  /// Of a letter set, in the order of the alphabet, the first that is given; 0: none.
  [[nodiscard]] char first_of(std::uint32_t letters) const noexcept {
    const std::uint32_t found = given_ & letters;
    return found == 0 ? '\0' : static_cast<char>('a' + std::countr_zero(found));
  }

 private:
  std::array<double, 29> values_{};
  std::uint32_t given_ = 0;
};

/// Those of the letters that are given as words of the expanded program, in the order of the letters.
[[nodiscard]] inline std::string words_of(const WordValues& values, std::string_view letters = axis_letters) {
  std::string text;
  for (const char letter : letters) {
    if (!values.has(letter)) continue;
    text += upper(letter);
    text += dialect::number_text(values[letter]);
  }
  return text;
}

}  // namespace shapegcode::linuxcnc
