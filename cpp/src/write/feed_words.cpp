#include "write/feed_words.hpp"

#include <algorithm>

namespace shapegcode {
namespace {

// The number with the most zeros at its end.
std::int64_t roundest(BlockShape::FeedRange range) {
  std::int64_t found = range.least;
  for (std::int64_t step = 10; step <= range.most; step *= 10) {
    const std::int64_t up = (range.least + step - 1) / step * step;
    if (up > range.most) {
      break;
    }
    found = up;
  }
  return found;
}

}  // namespace

void shorten_feeds(std::vector<FittedBlock>& blocks, BlockPosition start, const BlockShape& shape) {
  std::size_t first = 0;
  BlockShape::FeedRange shared{0, 0};
  const auto settle = [&](std::size_t end) {
    for (const std::int64_t feed = roundest(shared); first < end; ++first) {
      blocks[first].feed = feed;
    }
  };
  for (std::size_t n = 0; n < blocks.size(); ++n) {
    const BlockShape::FeedRange own = shape.feeds_like(blocks[n], shape.length_mm(start, blocks[n]));
    const BlockShape::FeedRange both{std::max(shared.least, own.least), std::min(shared.most, own.most)};
    if (n > first && both.least > both.most) {
      settle(n);
    }
    shared = n > first ? both : own;
    start = blocks[n].end;
  }
  settle(blocks.size());
}

}  // namespace shapegcode
