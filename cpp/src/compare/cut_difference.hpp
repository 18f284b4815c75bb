// Private: comparison of two cuts.
#pragma once

#include <cstdint>
#include <optional>

#include "compare/events.hpp"

namespace shapegcode::detail {

/// The largest distance of a path from another one, and the line of the move on which it lies.
struct PathDistance {
  double distance_mm = 0.0;
  std::uint32_t line = 0;
};

/// Whether both have the same moves, whatever their feeds.
[[nodiscard]] bool same_moves(const Cut& one, const Cut& other);

/// Follows a path along another one. Looked at are the ends of its moves, lines at least every 0.2 mm and arcs
/// every two degrees; between them neither can leave the other unseen by its own points, as both are looked at. Where
/// it is near another part of the path only, that far from the start where it should be, the part that is meant counts.
[[nodiscard]] PathDistance path_distance(const Cut& moving, const Cut& still);

/// The least distance within which both paths can be run through side by side, each only forwards (Frechet), to 2 %,
/// if it is not above `allowed_mm`; nothing otherwise. Their lengths do not matter.
[[nodiscard]] std::optional<double> joint_distance_mm(const Cut& one, const Cut& other, double allowed_mm);

/// The first section whose programmed feed differs, as moves of either cut.
struct FeedDifference {
  std::uint32_t original_line = 0;
  std::uint32_t emitted_line = 0;
  double original_mm_per_s = 0.0;
  double emitted_mm_per_s = 0.0;
};
[[nodiscard]] std::optional<FeedDifference> feed_difference(const Cut& original, const Cut& emitted);

}  // namespace shapegcode::detail
