#include "shapegcode/write.hpp"

#include <algorithm>
#include <cstddef>
#include <utility>

#include "program/text/number_format.hpp"

namespace shapegcode {
namespace {

int plane_code(std::uint8_t normal) noexcept { return normal == 2 ? 17 : normal == 1 ? 18 : 19; }

}  // namespace

WrittenBlocks write_blocks(std::span<const FittedBlock> blocks, std::array<std::int64_t, axis_count> start,
                           std::span<const BlockMark> marks, const WriterOptions& options) {
  std::string text;
  text.reserve(blocks.size() * 26 + 64);
  auto position = start;
  int motion = options.motion;
  int plane = options.plane;
  std::int64_t feed = -1;
  std::size_t mark = 0;
  const auto write_comment = [&](const BlockMark& m) {
    if (!m.comment.empty()) {
      text += m.comment;
      text += options.line_end;
    }
  };
  const auto write_number = [&](const BlockMark& m) {
    text += 'N';
    text += std::to_string(m.n_number);
  };
  for (const FittedBlock& block : blocks) {
    // Marks without a number are written at their place; the first numbered one gives its N to this block.
    while (mark < marks.size() && marks[mark].period <= block.first_period) {
      write_comment(marks[mark]);
      if (marks[mark].n_number >= 0) {
        write_number(marks[mark++]);
        break;
      }
      ++mark;
    }
    if (options.exact_stop_at_end && &block == &blocks.back()) {
      text += "G09";
    }
    if (block.kind != FittedKind::line && plane != plane_code(block.normal)) {
      plane = plane_code(block.normal);
      text += 'G';
      text += std::to_string(plane);
    }
    const int code = block.kind == FittedKind::line ? 1 : block.kind == FittedKind::clockwise ? 2 : 3;
    if (code != motion) {
      motion = code;
      text += "G0";
      text += static_cast<char>('0' + code);
    }
    for (std::size_t i = 0; i < axis_count; ++i) {
      if (block.end[i] != position[i]) {
        text += static_cast<char>('X' + i);
        append_decimal(text, options.incremental ? block.end[i] - position[i] : block.end[i],
                       options.position_decimals);
      }
    }
    if (block.kind != FittedKind::line) {
      text += 'R';
      append_decimal(text, block.radius, options.position_decimals);
    }
    if (block.feed != feed) {
      feed = block.feed;
      append_feed(text, feed, options.feed_decimals);
    }
    text += options.line_end;
    position = block.end;
  }
  for (; mark < marks.size(); ++mark) {
    write_comment(marks[mark]);
    if (marks[mark].n_number >= 0) {
      write_number(marks[mark]);
      text += options.line_end;
    }
  }
  return {std::move(text), motion, plane};
}

}  // namespace shapegcode
