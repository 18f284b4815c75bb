#pragma once

#include <cstddef>

#include "shapegcode/path.hpp"

namespace shapegcode {

/// Change of direction as segment `i` >= 1 of a path is entered: the length of the difference of the unit tangents.
[[nodiscard]] double junction_change(const Path& path, std::size_t i) noexcept;

/// From this `junction_change` on a junction is a corner: 5 degrees. Smoother junctions of polylines are curves.
inline constexpr double corner_change = 0.0872;

/// Whether there is a corner on the way from one segment to a later one.
[[nodiscard]] bool passes_corner(const Path& path, std::size_t before, std::size_t after) noexcept;

}  // namespace shapegcode
