#pragma once

#include <cstddef>
#include <cstdint>
#include <string>
#include <string_view>

#include "program/siemens/line_text.hpp"
#include "shapegcode/error.hpp"

namespace shapegcode::siemens {

/// A line of a program in capitals, read from left to right. Blanks are spaces and tabs.
class Scanner {
 public:
  explicit Scanner(std::string text);

  [[nodiscard]] std::string_view text() const { return text_; }
  [[nodiscard]] std::size_t at() const { return at_; }
  void go_to(std::size_t at) { at_ = at; }
  void go_to_end() { at_ = text_.size(); }

  /// The character at an index; behind the end a zero.
  [[nodiscard]] char peek(std::size_t at) const { return at < text_.size() ? text_[at] : '\0'; }
  [[nodiscard]] char peek() const { return peek(at_); }

  /// Column of an index, from 1.
  [[nodiscard]] std::uint32_t column(std::size_t at) const;
  [[nodiscard]] std::uint32_t column() const { return column(at_); }

  void skip();
  /// Whether nothing but blanks is left.
  [[nodiscard]] bool is_done();
  /// What is left, for messages.
  [[nodiscard]] std::string rest() const;
  [[nodiscard]] std::string rest_or(std::string_view other) const;

  /// Read this sign behind blanks if it comes next; whether it did.
  bool takes(std::string_view sign);
  /// Read a sign that must be here.
  void require(std::string_view sign, std::string_view what);
  /// The end of the name that begins at an index; the index itself: none does.
  [[nodiscard]] std::size_t name_end(std::size_t at) const;
  /// Read a name behind blanks; empty: there is none.
  std::string_view take_name();
  /// Whether this word stands at an index, and no longer one.
  [[nodiscard]] bool is_word(std::size_t at, std::string_view word) const;
  /// Read this word behind blanks; whether it is there.
  bool take_word(std::string_view word);
  /// The end of the number without a sign at an index: digits, a point, an exponent behind EX; the index: there is
  /// none.
  [[nodiscard]] std::size_t number_end(std::size_t at) const;

  /// An error at the next character, or at an index.
  [[nodiscard]] Error error(const std::string& message) const { return error(message, at_); }
  [[nodiscard]] Error error(const std::string& message, std::size_t at) const;

  /// While it lives, one level of an expression more: as many as any program has.
  class Level {
   public:
    explicit Level(Scanner& scan);
    ~Level() { --scan_.levels_; }
    Level(const Level&) = delete;
    Level& operator=(const Level&) = delete;

   private:
    Scanner& scan_;
  };

 private:
  std::string text_;
  std::size_t at_ = 0;
  int levels_ = 0;
  bool is_ascii_ = true;
};

/// Where digits end that begin at an index.
[[nodiscard]] inline std::size_t digits_end(std::string_view text, std::size_t at) {
  while (at < text.size() && is_digit(text[at])) ++at;
  return at;
}

/// The number of digits that end at an index, with one point among them or none: where it ends, from where it begins.
[[nodiscard]] std::size_t decimal_end(std::string_view text, std::size_t at);

/// Whether all of a text, which is not empty, is digits.
[[nodiscard]] bool is_digits(std::string_view text);

/// Digits without zeros at their start.
[[nodiscard]] std::string_view without_zeros(std::string_view digits);

/// What digits with EX or without are worth.
[[nodiscard]] double scanned_number(std::string_view text);

}  // namespace shapegcode::siemens
