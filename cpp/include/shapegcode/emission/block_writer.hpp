#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "shapegcode/emission/block_fit.hpp"

namespace shapegcode {

/// What stood at a place of the original: written before the block that begins there.
struct BlockMark {
  std::uint32_t period = 0;    ///< block period at which it stood
  std::int32_t n_number = -1;  ///< -1: none
  std::string comment;         ///< with its parentheses; empty: none
};

struct WriterOptions {
  int position_decimals = 3;
  int feed_decimals = 1;
  bool incremental = false;        ///< G91 words: differences of the rounded absolute positions
  int motion = 1;                  ///< modal motion code before the first block
  int plane = 17;                  ///< plane active before the first block; G01 is active too
  bool exact_stop_at_end = false;  ///< G09 on the last block
  std::string line_end = "\n";
};

struct WrittenBlocks {
  std::string text;
  int motion = 1;  ///< modal motion code behind the last block: 1, 2 or 3
  int plane = 17;  ///< modal plane behind the last block
};

/// Text of fitted blocks: modal G codes, X Y Z, R, F only where they change. N words go to distinct blocks in their
/// order, at or behind their place; those that find no block of their own stand alone. `start` is in increments.
[[nodiscard]] WrittenBlocks write_blocks(std::span<const FittedBlock> blocks,
                                         std::array<std::int64_t, axis_count> start, std::span<const BlockMark> marks,
                                         const WriterOptions& options);

}  // namespace shapegcode
