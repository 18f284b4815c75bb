#pragma once

#include <vector>

#include "write/block_shape.hpp"

namespace shapegcode {

// Gives arcs another R, and the F for it, so that they meet their neighbours at smaller angles: an arc through the ends
// and the middle of a block in which the curvature changes is a little off its tangents at both ends. Ends and kinds do
// not change; the middle of an arc moves by at most `most_mm`. For planners that slow where the direction jumps.
void smooth_arcs(std::vector<FittedBlock>& blocks, const BlockPosition& start, const BlockShape& shape, double most_mm,
                 double increment_mm);

}  // namespace shapegcode
