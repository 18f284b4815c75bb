#include "program/siemens/scanner.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <utility>

#include "program/siemens/value.hpp"

namespace shapegcode::siemens {
namespace {

constexpr int most_expression_levels = 1000;  // of an expression that is read
constexpr std::size_t shown_rest = 30;        // characters
constexpr std::size_t most_digits = 4300;     // of a whole number

}  // namespace

Scanner::Scanner(std::string text)
    : text_(std::move(text)),
      is_ascii_(std::ranges::all_of(text_, [](char c) { return static_cast<unsigned char>(c) < 0x80; })) {}

Scanner::Level::Level(Scanner& scan) : scan_(scan) {
  if (scan.levels_ >= most_expression_levels) throw too_deep();
  ++scan.levels_;
}

std::uint32_t Scanner::column(std::size_t at) const {
  if (is_ascii_) return static_cast<std::uint32_t>(at) + 1;
  return count_characters(text().substr(0, at)) + 1;
}

void Scanner::skip() {
  while (peek() == ' ' || peek() == '\t') ++at_;
}

bool Scanner::is_done() {
  skip();
  return at_ >= text_.size();
}

std::string Scanner::rest() const {
  return std::string(first_characters(without_spaces(text().substr(at_)), shown_rest));
}

std::string Scanner::rest_or(std::string_view other) const {
  std::string left = rest();
  return left.empty() ? std::string(other) : left;
}

bool Scanner::takes(std::string_view sign) {
  skip();
  if (!text().substr(at_).starts_with(sign)) return false;
  at_ += sign.size();
  return true;
}

void Scanner::require(std::string_view sign, std::string_view what) {
  if (!takes(sign)) throw error(fmt::format("{} where {} is expected", rest_or("the end of the block"), what));
}

std::size_t Scanner::name_end(std::size_t at) const {
  const char first = peek(at);
  if (!is_capital(first) && first != '_' && first != '$') return at;
  do ++at;
  while (is_name_character(peek(at)));
  return at;
}

std::string_view Scanner::take_name() {
  std::size_t begin = at_;
  while (peek(begin) == ' ' || peek(begin) == '\t') ++begin;
  const std::size_t end = name_end(begin);
  if (end == begin) return {};
  at_ = end;
  return text().substr(begin, end - begin);
}

bool Scanner::is_word(std::size_t at, std::string_view word) const {
  return text().substr(std::min(at, text_.size())).starts_with(word) && !is_name_character(peek(at + word.size()));
}

bool Scanner::take_word(std::string_view word) {
  std::size_t begin = at_;
  while (peek(begin) == ' ' || peek(begin) == '\t') ++begin;
  if (!is_word(begin, word)) return false;
  at_ = begin + word.size();
  return true;
}

std::size_t Scanner::number_end(std::size_t at) const {
  const std::size_t end = decimal_end(text_, at);
  if (end == at || peek(end) != 'E' || peek(end + 1) != 'X') return end;
  std::size_t exponent = end + 2;
  if (peek(exponent) == '+' || peek(exponent) == '-') ++exponent;
  const std::size_t last = digits_end(text_, exponent);
  return last == exponent ? end : last;
}

Error Scanner::error(const std::string& message, std::size_t at) const { return error_at(column(at), message); }

std::size_t decimal_end(std::string_view text, std::size_t at) {
  std::size_t end = digits_end(text, at);
  const bool has_digits = end > at;
  if (end < text.size() && text[end] == '.') {
    const std::size_t decimals = digits_end(text, end + 1);
    if (has_digits || decimals > end + 1) end = decimals;
  }
  return end;
}

bool is_digits(std::string_view text) { return std::ranges::all_of(text, is_digit); }

std::string_view without_zeros(std::string_view digits) {
  if (digits.size() > most_digits) throw too_large();
  const std::size_t first = digits.find_first_not_of('0');
  return first == std::string_view::npos ? digits.substr(digits.size() - 1) : digits.substr(first);
}

double scanned_number(std::string_view text) {
  const std::size_t exponent = text.find("EX");
  if (exponent == std::string_view::npos) return number_of(text);
  std::string digits(text);
  digits.replace(exponent, 2, "e");
  return number_of(digits);
}

}  // namespace shapegcode::siemens
