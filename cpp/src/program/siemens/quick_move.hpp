#pragma once

#include <array>
#include <cstddef>
#include <optional>
#include <string_view>

namespace shapegcode::siemens {

/// A line of nothing but N, G0 or G1, X, Y, Z with numbers and F.
struct QuickMove {
  char code = '\0';  // '0' or '1' of G0, G1; none: the one in force
  std::array<std::optional<double>, 3> values;
  std::optional<double> feed;
};

/// None: the line needs another look.
[[nodiscard]] std::optional<QuickMove> read_quick_move(std::string_view line);

}  // namespace shapegcode::siemens
