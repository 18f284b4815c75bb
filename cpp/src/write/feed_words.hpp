#pragma once

#include <vector>

#include "write/block_shape.hpp"

namespace shapegcode {

// Gives blocks that may share an F the same one, so that it is written once, with the fewest digits: F words are a
// quarter of a shaped program.
void shorten_feeds(std::vector<FittedBlock>& blocks, BlockPosition start, const BlockShape& shape);

}  // namespace shapegcode
