#pragma once

#include <cstddef>
#include <span>
#include <vector>

#include "shapegcode/path.hpp"

namespace shapegcode {

/// One programmed block with its active cutter compensation.
struct CompensationBlock {
  Segment segment;         ///< mm; a line, rapid or arc, or a block without motion in the plane
  int mode = 40;           ///< G40, G41 (tool left of the path) or G42 (right)
  double radius_mm = 0.0;  ///< value of D; a negative one swaps the sides, zero is a block without compensation
};

/// A move of the tool centre.
struct CompensatedMove {
  Segment segment;
  std::size_t source = 0;  ///< index of the block it belongs to
};

struct CompensationOptions {
  char start_up = 'A';               ///< 'A' or 'B': parameter 5003, for start-up and cancel
  bool check_interference = true;    ///< refuse a line that the compensation reverses (parameter 5008)
  double ignorable_corner_mm = 0.0;  ///< parameter 5010: corner vectors this close on both axes are one
  int blocks_read = 3;               ///< parameter 19625, 3 to 8: blocks_read - 2 blocks without motion are read past
};

/// FANUC cutter compensation (G40 to G42, "cutter compensation C") of consecutive blocks, in the plane across axis
/// `plane_normal`: the path of the tool centre, one or more moves for each block, each starting where the one before
/// ends. The span begins at a programmed point with the start-up block and ends after the cancel block, or anywhere:
/// without a cancel the last block ends with the vector across its end.
///
/// - Start-up: the first block with G41 or G42, a value other than zero and motion in the plane; cancel: the first such
///   block after it with G40 or value zero. Type A ends (begins) on the vector across the neighbouring block; type B
///   outside a corner adds the vector across the start-up (cancel) block and the corner's points.
/// - Inside a corner the offset curves are intersected. Outside, the tangents at the corner are: at an obtuse corner up
///   to their intersection, at an acute one (under 90 degrees) by the radius each, with a line between.
/// - Moves round a corner belong to the block after it: its feed, and its source. They carry no motion along the normal
///   axis: that of a block is spread over the block's own move.
/// - The corner at a block's end is worked out with the block's own radius: after a change of the value a line runs
///   askew and an arc changes its radius evenly.
/// - Where the side changes the offset curves are intersected, lines prolonged if necessary; without an intersection
///   that leaves both blocks their direction the tool goes straight from the vector at the end of the one to the vector
///   at the start of the other.
/// - A block without motion in the plane runs on the first vector of the corner. If more of them follow each other than
///   the control reads past, the vector stands across the end of the block before them, and the next block starts from
///   there (an arc: after a line to its own vector): this may cut into the corner, as on the control. A G40 alone puts
///   the vector across the end as well.
/// - Blocks in which nothing is compensated come back as they are.
///
/// Throws Error(program) with the block's line: alarm 0033 (no intersection), 0034 (start-up or cancel in an arc), 0037
/// (arc in another plane), 0038 (the centre path of an arc shrinks to a point), 0041 (arc smaller than the cutter,
/// block reversed by the compensation). Interference of blocks that do not follow each other is not looked for. Throws
/// Error(argument) on blocks that do not join, values that are not finite, and options out of range.
[[nodiscard]] std::vector<CompensatedMove> compensate(std::span<const CompensationBlock> blocks, int plane_normal,
                                                      const CompensationOptions& options);

}  // namespace shapegcode
