#include "program/siemens/block.hpp"

#include <fmt/format.h>

#include <array>
#include <utility>

namespace shapegcode::siemens {
namespace {

/// A line without its comment, in capitals but for its strings.
std::string code_in_capitals(std::string_view code) {
  if (code.find('"') == std::string_view::npos) return capitals(code);
  std::string found;
  bool quoted = false;
  while (true) {
    const std::size_t end = code.find('"');
    const std::string_view part = code.substr(0, end);
    found += quoted ? std::string(part) : capitals(part);
    if (end == std::string_view::npos) return found;
    found += '"';
    quoted = !quoted;
    code.remove_prefix(end + 1);
  }
}

/// `/`, N and the number of the block.
void read_head(Scanner& scan, Block& block) {
  const std::string_view text = scan.text();
  std::size_t at = 0;
  skip_spaces_of_any_kind(text, at);
  if (scan.peek(at) == '/') {
    block.is_skipped = true;
    at += is_digit(scan.peek(at + 1)) ? 2 : 1;
  }
  skip_spaces_of_any_kind(text, at);
  if (scan.peek(at) == 'N' || scan.peek(at) == ':') {
    std::size_t begin = at + 1;
    skip_spaces_of_any_kind(text, begin);
    if (const std::size_t end = digits_end(text, begin); end > begin) {
      block.number = fmt::format("N{}", without_zeros(text.substr(begin, end - begin)));
      at = end;
    }
  }
  scan.go_to(at);
  scan.skip();
}

/// Two characters or more, and a colon that is no `:=`.
void read_label(Scanner& scan, Block& block) {
  const std::size_t begin = scan.at();
  const std::size_t end = scan.peek() == '$' ? begin : scan.name_end(begin);
  if (end < begin + 2) return;
  std::size_t colon = end;
  skip_spaces_of_any_kind(scan.text(), colon);
  if (scan.peek(colon) != ':' || scan.peek(colon + 1) == '=') return;
  block.label = scan.text().substr(begin, end - begin);
  scan.go_to(colon + 1);
}

/// A letter with its number, at an index: where the number begins and ends.
struct Address {
  std::size_t begin = 0;  // of the number
  std::size_t end = 0;    // 0: there is none
};

Address address_at(const Scanner& scan, std::size_t at) {
  if (!is_capital(scan.peek(at))) return {};
  const std::size_t begin = at + 1;
  const std::size_t digits = begin + (scan.peek(begin) == '-' || scan.peek(begin) == '+' ? 1 : 0);
  const std::size_t end = scan.number_end(digits);
  return {.begin = begin, .end = end > digits ? end : 0};
}

/// Whether it can be the name of a word or a program and not an address with its number: two letters begin it.
bool is_name(std::string_view name) { return name.size() > 1 && (is_capital(name[1]) || name[1] == '_'); }

bool is_assigned(const Scanner& scan) {
  std::size_t at = scan.at();
  skip_spaces_of_any_kind(scan.text(), at);
  return scan.peek(at) == '=' && scan.peek(at + 1) != '=';
}

Word named_word(std::string name, std::uint32_t column) {
  Word word;
  word.id = word_id(name);
  word.name = std::move(name);
  word.column = column;
  return word;
}

/// The name of =AC( and its relatives; the scanner goes behind the bracket. Empty: an expression follows.
std::string_view mode_name(Scanner& scan) {
  constexpr std::array<std::string_view, 8> modes = {"AC", "IC", "DC", "ACP", "ACN", "CAC", "CIC", "CDC"};
  for (const std::string_view each : modes) {
    if (!scan.text().substr(scan.at()).starts_with(each)) continue;
    std::size_t at = scan.at() + each.size();
    skip_spaces_of_any_kind(scan.text(), at);
    if (scan.peek(at) != '(') continue;
    if (each == "AC" || each == "IC") scan.go_to(at + 1);
    return each;
  }
  return {};
}

Word assigned_word(Scanner& scan, ExpressionPool& pool, Word word) {
  scan.require("=", "=");
  scan.skip();
  const std::string_view mode = mode_name(scan);
  if (mode.empty()) {
    word.value = read_expression(scan, pool);
    return word;
  }
  if (mode != "AC" && mode != "IC") {
    throw scan.error(fmt::format("{}={}( ) is one of a rotary axis: AC( ) or IC( ) is expected", word.name, mode));
  }
  word.mode = mode == "AC" ? Mode::absolute : Mode::incremental;
  word.value = read_expression(scan, pool);
  scan.require(")", "a closing bracket )");
  return word;
}

Word address_word(Scanner& scan, ExpressionPool& pool, std::size_t begin, const Address& address) {
  scan.go_to(address.end);
  const char letter = scan.peek(begin);
  const std::string_view digits = scan.text().substr(address.begin, address.end - address.begin);
  if (letter == 'G') {
    if (!is_digits(digits)) throw scan.error(fmt::format("G{}: a G code must be a whole number", digits), begin);
    return named_word(fmt::format("G{}", without_zeros(digits)), scan.column(begin));
  }
  // Zeros at the start of it count: L1 is not L01.
  if (letter == 'L') return named_word(fmt::format("L{}", digits), scan.column(begin));
  Word word = named_word(std::string(1, letter), scan.column(begin));
  const bool has_sign = digits[0] == '-' || digits[0] == '+';
  const std::string_view size = digits.substr(has_sign ? 1 : 0);
  const bool is_whole = is_digits(size);
  double value = is_whole ? number_of(without_zeros(size)) : scanned_number(size);
  if (digits[0] == '-') value = -value;
  word.value = Expression(pool, pool.add_constant(is_whole ? whole_value(value) : real_value(value)));
  return word;
}

Word read_word(Scanner& scan, ExpressionPool& pool) {
  const std::size_t begin = scan.at();
  const std::size_t name_end = scan.name_end(begin);
  if (name_end == begin) {
    throw scan.error(fmt::format("{} where a word must begin: an address, a name or a code", scan.rest()));
  }
  const std::string_view name = scan.text().substr(begin, name_end - begin);
  scan.go_to(name_end);
  std::vector<Expression> index;
  if (scan.peek() == '[') index = read_indices(scan, pool);
  const Address address = address_at(scan, begin);
  // The next word begins within what looks like a name: `X10Y=5`.
  const bool holds_a_word = address.end != 0 && address.end < name_end && name_end == scan.at() &&
                            is_capital(scan.peek(address.end)) &&
                            std::string_view("GMXYZFS").find(name[0]) != std::string_view::npos && !is_name(name);
  if (is_assigned(scan) && !holds_a_word) {
    Word word = named_word(std::string(name), scan.column(begin));
    word.index = std::move(index);
    return assigned_word(scan, pool, std::move(word));
  }
  if (!index.empty()) throw scan.error(fmt::format("{}[...] without a value: = and a value must follow", name));
  if (address.end != 0 && (address.end >= name_end || !is_name(name))) {
    return address_word(scan, pool, begin, address);
  }
  if (name.size() == 1) {
    throw scan.error(fmt::format("{} without a value: a number must follow it directly, or = and a value", name),
                     begin);
  }
  Word word = named_word(std::string(name), scan.column(begin));
  scan.skip();
  if (scan.peek() == '(') {
    word.has_brackets = true;
    word.given = read_arguments(scan, pool, name);
  }
  return word;
}

}  // namespace

void read_words(Scanner& scan, ExpressionPool& pool, std::vector<Word>& words) {
  while (!scan.is_done()) words.push_back(read_word(scan, pool));
}

std::shared_ptr<const Block> read_block(std::string_view line) {
  auto block = std::make_shared<Block>();
  const auto [code, comment] = split_comment(without_end_spaces(line));
  block->comment = comment;
  Scanner scan(code_in_capitals(code));
  read_head(scan, *block);
  read_label(scan, *block);
  scan.skip();
  block->column = scan.column();
  if (scan.is_done()) return block;
  const std::size_t begin = scan.at();
  const std::string_view name = scan.text().substr(begin, scan.name_end(begin) - begin);
  if (name.empty() || !read_statement(scan, name, *block)) {
    read_words(scan, block->pool, block->words);
  } else if (!scan.is_done()) {
    throw scan.error(fmt::format("{} after {}: the block must end here", scan.rest(), name));
  }
  return block;
}

}  // namespace shapegcode::siemens
