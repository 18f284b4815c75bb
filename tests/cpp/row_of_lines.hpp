// Lines along X, one after the other, each with a feed of its own.
#pragma once

#include <cstddef>
#include <vector>

#include "shapegcode/path.hpp"

namespace shapegcode::tests {

inline std::vector<Segment> row_of_lines(const std::vector<double>& lengths_mm, const std::vector<double>& feeds) {
  std::vector<Segment> lines;
  double x = 0.0;
  for (std::size_t i = 0; i < lengths_mm.size(); ++i) {
    lines.push_back(make_line({x, 0, 0}, {x + lengths_mm[i], 0, 0}, feeds[i]));
    x += lengths_mm[i];
  }
  return lines;
}

}  // namespace shapegcode::tests
