// Private: the words of one block sorted by address, and its G codes by modal group.
#pragma once

#include <array>
#include <cstdint>
#include <string>

#include "program/text/lexer.hpp"

namespace shapegcode::detail {

/// Modal groups of the M-series controllers; `none` marks one-shot codes.
enum class Group : std::uint8_t {
  none = 0,
  motion = 1,
  plane = 2,
  distance = 3,
  feed_mode = 5,
  units = 6,
  compensation = 7,
  length_offset = 8,
  cycle = 9,
  cycle_return = 10,
  coordinates = 14,
  exact_stop = 15,
  mirror = 18,    ///< G50.1, G51.1
  polar = 17,     ///< G15, G16
  scaling = 11,   ///< G50, G51
  rotation = 19,  ///< G68, G69 (group 16 of the control)
  foreign = 20,   ///< switches a mode that this reader passes through untouched
  harmless = 21,  ///< no effect on position or path
  unknown_position = 22,
  refused = 23,
  invalid = 24,
  call = 25,  ///< macro calls G65, G66, G66.1, G67
};

constexpr std::uint32_t group_bit(Group group) noexcept { return 1U << static_cast<unsigned>(group); }

/// Group of a G code given in tenths (G54.1 = 541).
[[nodiscard]] Group group_of(int g_tenths) noexcept;

/// "G54.1" for 541.
[[nodiscard]] std::string g_code_name(int g_tenths);

struct BlockWords {
  std::uint32_t present = 0;  ///< bit (letter - 'A')
  std::array<const Word*, 26> by_letter;
  std::array<int, 12> g_tenths;
  std::array<std::uint32_t, 12> g_column;
  std::array<Group, 12> g_group;
  std::uint32_t groups = 0;  ///< group_bit of every G code
  int g_count = 0;
  bool has_m = false;
  std::array<int, 6> m_codes;
  int m_count = 0;
  const Word* corner = nullptr;  ///< ,R or ,C
  // What only a macro call may hold.
  const Word* duplicate = nullptr;   ///< an address that stands twice
  const Word* fractional = nullptr;  ///< a decimal point in an address of whole numbers
  const Word* negative = nullptr;    ///< a minus sign in one

  [[nodiscard]] bool has(char letter) const noexcept { return (present >> (letter - 'A')) & 1U; }
  [[nodiscard]] bool has_any(std::uint32_t mask) const noexcept { return (present & mask) != 0; }
  [[nodiscard]] const Word& operator[](char letter) const noexcept {
    return *by_letter[static_cast<std::size_t>(letter - 'A')];
  }
};

constexpr std::uint32_t letter_mask(const char* letters) {
  std::uint32_t mask = 0;
  for (; *letters != '\0'; ++letters) {
    mask |= 1U << (*letters - 'A');
  }
  return mask;
}

/// Sorts the words (G and M may repeat). Throws Error(program) on too many G or M codes.
void sort_words(const Block& block, std::uint32_t line, BlockWords& words);

}  // namespace shapegcode::detail
