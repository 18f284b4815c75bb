#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "shapegcode/gcode/program.hpp"
#include "shapegcode/milling/feed_schedule.hpp"

namespace shapegcode {

/// How new feeds are written into the blocks of a region.
struct FeedWriterOptions {
  double increment_mm = 0.001;    ///< least increment of positions
  double unit_mm = 1.0;           ///< of a position word and of the length in F: 1 or 25.4
  int position_decimals = 3;      ///< of a position word
  bool absolute_centres = false;  ///< I J K are positions
  double modal_feed = 0.0;        ///< F that holds before the region; 0: as in the original
  bool restore_feed = true;       ///< leave the modal feed of the original behind
};

/// A region's text with other feeds.
struct RefedRegion {
  std::string text;                  ///< whole lines
  std::uint32_t blocks = 0;          ///< blocks with a cutting move
  double modal_feed = 0.0;           ///< F that holds behind it
  std::vector<std::uint32_t> lines;  ///< per block, ascending: its line, counted from the text's first one = 0
};

/// Whether F is a feed per minute in every block of a region, in one unit of length: what other feeds can be written
/// for.
[[nodiscard]] bool feeds_per_minute(const Program& program, const Region& region);

/// Which segments of a region's path may be divided into several blocks: lines, and arcs in the XY plane, that have a
/// source line of their own without one-shot codes, whose words are the positions of the path.
[[nodiscard]] std::vector<bool> divisible_segments(const Program& program, const Region& region,
                                                   const FeedWriterOptions& options);

/// The region's lines with the feeds of `stretches`; comments, numbers, spaces and everything else stay as they are.
/// F stands where the feed changes and where it stood; where asked for, a last line with F alone gives the modal feed
/// back that the original leaves behind. Where a stretch ends within a divisible block, the block is divided: the first
/// piece keeps the words of the original, ends lie on the least increment (so they are off the path by half of it at
/// most). Throws Error(argument) if the stretches do not cover the path.
[[nodiscard]] RefedRegion write_feeds(const Program& program, const Region& region,
                                      std::span<const FeedStretch> stretches, const FeedWriterOptions& options);

}  // namespace shapegcode
