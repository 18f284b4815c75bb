#include "shapegcode/write.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cstddef>
#include <iterator>
#include <utility>

#include "program/text/number_format.hpp"

namespace shapegcode {
namespace {

int plane_code(std::uint8_t normal) noexcept { return normal == 2 ? 17 : normal == 1 ? 18 : 19; }

/// Blocks and marks as text, with only the words that change.
class BlockText {
 public:
  BlockText(std::size_t blocks, const std::array<std::int64_t, axis_count>& start, std::span<const BlockMark> marks,
            const WriterOptions& options)
      : options_(options), position_(start), motion_(options.motion), plane_(options.plane), marks_(marks) {
    text_.reserve(blocks * 26 + 64);
  }

  /// Marks without a number are written at their place; the first numbered one gives its N to the block that follows.
  void marks_before(const FittedBlock& block) {
    while (mark_ < marks_.size() && marks_[mark_].period <= block.first_period) {
      const BlockMark& mark = marks_[mark_++];
      comment(mark);
      if (mark.n_number >= 0) {
        number(mark);
        return;
      }
    }
  }

  void write(const FittedBlock& block, bool is_last) {
    if (options_.exact_stop_at_end && is_last) text_ += "G09";
    codes(block);
    for (std::size_t i = 0; i < axis_count; ++i) {
      if (block.end[i] != position_[i]) {
        text_ += static_cast<char>('X' + i);
        append_decimal(text_, options_.incremental ? block.end[i] - position_[i] : block.end[i],
                       options_.position_decimals);
      }
    }
    if (block.kind != FittedKind::line) {
      text_ += 'R';
      append_decimal(text_, block.radius, options_.position_decimals);
    }
    if (block.feed != feed_) {
      feed_ = block.feed;
      append_feed(text_, feed_, options_.feed_decimals);
    }
    text_ += options_.line_end;
    position_ = block.end;
  }

  [[nodiscard]] WrittenBlocks finish() {
    for (; mark_ < marks_.size(); ++mark_) {
      comment(marks_[mark_]);
      if (marks_[mark_].n_number >= 0) {
        number(marks_[mark_]);
        text_ += options_.line_end;
      }
    }
    return {std::move(text_), motion_, plane_};
  }

 private:
  void comment(const BlockMark& mark) {
    if (!mark.comment.empty()) {
      text_ += mark.comment;
      text_ += options_.line_end;
    }
  }
  void number(const BlockMark& mark) {
    fmt::format_to(std::back_inserter(text_), "N{:0{}}", mark.n_number, mark.n_digits);
  }
  void codes(const FittedBlock& block) {
    if (block.kind != FittedKind::line && plane_ != plane_code(block.normal)) {
      plane_ = plane_code(block.normal);
      text_ += 'G';
      text_ += std::to_string(plane_);
    }
    const int code = block.kind == FittedKind::line ? 1 : block.kind == FittedKind::clockwise ? 2 : 3;
    if (code != motion_) {
      motion_ = code;
      text_ += "G0";
      text_ += static_cast<char>('0' + code);
    }
  }

  const WriterOptions& options_;
  std::string text_;
  std::array<std::int64_t, axis_count> position_;
  int motion_;
  int plane_;
  std::int64_t feed_ = -1;
  std::span<const BlockMark> marks_;
  std::size_t mark_ = 0;
};

}  // namespace

WrittenBlocks write_blocks(std::span<const FittedBlock> blocks, std::array<std::int64_t, axis_count> start,
                           std::span<const BlockMark> marks, const WriterOptions& options) {
  BlockText text(blocks.size(), start, marks, options);
  for (const FittedBlock& block : blocks) {
    text.marks_before(block);
    text.write(block, &block == &blocks.back());
  }
  return text.finish();
}

}  // namespace shapegcode
