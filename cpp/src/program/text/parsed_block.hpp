// Private: one line of a program, parsed once and passed from reader to rewriter to interpreter.
#pragma once

#include <cstdint>
#include <string>
#include <string_view>
#include <utility>

#include "program/text/block_words.hpp"
#include "program/text/lexer.hpp"

namespace shapegcode::detail {

/// A line with its words, in the order in which they stand (the Block) and by address (`sorted`), which point into it:
/// it stays where it is. The words are its own; of the text it is enough that it stays until the next one is read.
class ParsedBlock : public Block {
 public:
  ParsedBlock() = default;
  ParsedBlock(const ParsedBlock&) = delete;
  ParsedBlock& operator=(const ParsedBlock&) = delete;

  /// Reads a line in the place of the one before. Throws as scan_block and sort_words do. Words of a line that is
  /// `macro` are not sorted.
  void read(std::string_view text, std::uint32_t line, std::size_t max_length) {
    text_ = text;
    scan_block(text_, line, max_length, *this);
    if (!macro) {
      sort_words(*this, line, sorted_);
    }
  }
  /// Reads a line that nobody else keeps.
  void read_and_keep(std::string text, std::uint32_t line, std::size_t max_length) {
    kept_ = std::move(text);
    read(kept_, line, max_length);
  }

  [[nodiscard]] std::string_view text() const noexcept { return text_; }
  [[nodiscard]] const BlockWords& sorted() const noexcept { return sorted_; }
  /// A word as it is written.
  [[nodiscard]] std::string_view text_of(const Word& word) const noexcept {
    return text_.substr(word.column - 1, word.end - (word.column - 1));
  }
  /// Where a comment of this block begins in its text.
  [[nodiscard]] std::size_t offset_of(std::string_view comment) const noexcept {
    return static_cast<std::size_t>(comment.data() - text_.data());
  }

 private:
  std::string_view text_;
  std::string kept_;
  BlockWords sorted_;
};

}  // namespace shapegcode::detail
