// Private: lines that mean the same to LinuxCNC and FANUC, found quickly and taken as they are.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

namespace shapegcode::linuxcnc {

/// Consecutive lines of moves: N, G0 to G3, axis words, centres, F.
struct PlainLines {
  std::size_t end = 0;    ///< behind the last one
  std::size_t count = 0;  ///< 0: there is none
  bool begins_with_g = false;
  int last_motion = -1;  ///< of the last G word; -1: there is none
  std::optional<double> last_feed;
  std::array<std::optional<double>, 3> last{};  ///< number of the last word of each axis
  std::array<double, 3> sum{};                  ///< of all words of each axis
  std::array<std::size_t, 3> last_centre{};     ///< last line with I, J, K, from 1; 0: none
  std::vector<std::uint32_t> n_words;           ///< their N words
};

/// `n_counts`: how often each N may still be written; a line whose N has another count than 1 is no plain one.
[[nodiscard]] PlainLines scan_plain_lines(std::string_view text, std::size_t begin, bool with_arcs,
                                          std::span<const std::uint8_t> n_counts);

/// Whether the line there begins with G0 to G3, an N word aside.
[[nodiscard]] bool begins_with_motion(std::string_view text, std::size_t begin) noexcept;

/// Plain lines with a point behind every number that has none and on which a unit hangs.
[[nodiscard]] std::string with_points(std::string_view lines);

}  // namespace shapegcode::linuxcnc
