// Private: one file of a program, its lines and O words.
#pragma once

#include <cstddef>
#include <cstdint>
#include <initializer_list>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <unordered_map>
#include <vector>

#include "program/linuxcnc/block.hpp"

namespace shapegcode::linuxcnc {

enum class Keyword : std::uint8_t {
  none,  ///< the head of a program, as FANUC's
  other,
  sub,
  endsub,
  call,
  returns,
  opens_if,
  elseif,
  otherwise,
  endif,
  opens_while,
  endwhile,
  opens_do,
  repeat,
  endrepeat,
  breaks,
  continues,
};

/// An O word: its label, its keyword, and what follows.
struct OLine {
  std::string label;
  std::string word;  ///< the keyword as it stands there, its letters small
  Keyword keyword = Keyword::none;
  std::string_view rest;

  // Its values in brackets, once they are read.
  std::vector<Value> values;
  Code code;
  bool is_read = false;
};

class SourceFile {
 public:
  /// `index`: 0: the main program, n: the n-th of the files that were read besides.
  SourceFile(std::string name, std::string_view text, std::uint32_t index);
  SourceFile(const SourceFile&) = delete;
  SourceFile& operator=(const SourceFile&) = delete;

  [[nodiscard]] const std::string& name() const noexcept { return name_; }
  [[nodiscard]] std::uint32_t index() const noexcept { return index_; }
  [[nodiscard]] std::string_view text() const noexcept { return text_; }
  [[nodiscard]] std::size_t count() const noexcept { return starts_.size() - 1; }
  [[nodiscard]] std::size_t start(std::size_t line) const noexcept { return starts_[line]; }
  /// A line, from 0, without its end.
  [[nodiscard]] std::string_view line(std::size_t index) const noexcept;

  [[nodiscard]] OLine* o_line(std::size_t line) noexcept;
  /// Whether a line may be executed twice.
  [[nodiscard]] bool has_o_lines() const noexcept { return !o_lines_.empty(); }

  /// The first line with this O word.
  [[nodiscard]] std::optional<std::size_t> find(const std::string& label, Keyword keyword) const;
  /// The next line behind `line` with this label and one of these keywords.
  [[nodiscard]] std::optional<std::size_t> after(std::size_t line, const std::string& label,
                                                 std::initializer_list<Keyword> keywords) const;
  /// The last line before `line` likewise.
  [[nodiscard]] std::optional<std::size_t> before(std::size_t line, const std::string& label,
                                                  std::initializer_list<Keyword> keywords) const;
  /// Whether a WHILE is the end of a DO: the last loop word of its label before it is that DO.
  [[nodiscard]] bool closes_do(std::size_t line, const std::string& label) const;

  /// The words of a line that may be executed again; empty: not read yet.
  [[nodiscard]] std::unique_ptr<Block>& block(std::size_t line) { return blocks_[line]; }

 private:
  void find_o_line(std::size_t line);
  [[nodiscard]] const std::vector<std::size_t>& places(const std::string& label) const;

  std::string name_;
  std::uint32_t index_;
  std::string text_;
  std::vector<std::size_t> starts_;  ///< of each line; the text's end
  std::unordered_map<std::size_t, OLine> o_lines_;
  std::unordered_map<std::string, std::vector<std::size_t>> places_;  ///< by label
  std::unordered_map<std::size_t, std::unique_ptr<Block>> blocks_;
};

[[nodiscard]] std::string_view text_of(Keyword keyword);

}  // namespace shapegcode::linuxcnc
