// The words of NC blocks and macro calls whose operands may be variables.

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <string>

#include "program/macro/macro_statement.hpp"
#include "program/macro/macro_text.hpp"
#include "program/text/number_format.hpp"
#include "program/text/number_scan.hpp"

namespace shapegcode {

using macro::fail;
using macro::name_at;
using macro::skip_blanks;

namespace {

constexpr int max_digits = 8;  // alarm 003: of a number behind an address

enum class Notation : std::uint8_t { whole, g_code, length, angle, feed };

Notation notation_of(char letter) noexcept {
  switch (letter) {
    case 'D':
    case 'H':
    case 'L':
    case 'M':
    case 'N':
    case 'O':
    case 'P':
    case 'S':
    case 'T':
      return Notation::whole;
    case 'G':
      return Notation::g_code;
    case 'A':
    case 'B':
    case 'C':
      return Notation::angle;
    case 'E':
    case 'F':
      return Notation::feed;
    default:
      return Notation::length;
  }
}

bool begins_operand(std::string_view line, std::size_t i) noexcept {
  if (i < line.size() && (line[i] == '-' || line[i] == '+')) {
    ++i;
    skip_blanks(line, i);
  }
  return i < line.size() && (line[i] == '#' || line[i] == '[');
}

// A computed operand ends where the next word, a comment or the block begins or ends.
void expect_operand_end(std::string_view line, std::size_t i, std::uint32_t line_number) {
  skip_blanks(line, i);
  if (i == line.size() || is_letter(line[i]) || line[i] == '(' || line[i] == ',' || line[i] == '/') {
    return;
  }
  if (line[i] == '=') {
    fail(127, "'=' in a block with words: an assignment takes a block of its own", line_number, i);
  }
  fail(114, name_at(line, i) + " behind an operand: an expression behind an address needs brackets", line_number, i);
}

[[noreturn]] void refuse_letter_run(std::string_view line, std::size_t i, std::uint32_t line_number) {
  fail(114,
       "'" + std::string(macro::letters_at(line, i).substr(0, 20)) +
           "': an address and its number expected (an expression behind an address needs brackets)",
       line_number, i);
}

std::size_t whole_digits(double magnitude) noexcept {
  std::size_t digits = 0;
  for (; magnitude >= 1.0; magnitude /= 10.0) {
    ++digits;
  }
  return digits;
}

// An address as it is written, and how its value is.
struct Address {
  char letter;
  Notation notation;
  int decimals;
  std::size_t at;  // in the line
};

void append_word(std::string& text, const Address& address, double value, std::uint32_t line_number) {
  const char letter = address.letter;
  const Notation notation = address.notation;
  int decimals = address.decimals;
  if (!(std::abs(value) < 1e8)) {
    fail(3, fmt::format("{} = {} has more than {} digits", letter, macro::shown(value), max_digits), line_number,
         address.at);
  }
  if (notation == Notation::feed) {
    decimals = std::min(decimals, max_digits - static_cast<int>(whole_digits(std::abs(value))));
  }
  double unit = 1.0;
  for (int k = 0; k < decimals; ++k) {
    unit *= 10.0;
  }
  const double scaled = std::round(value * unit);
  if (!(std::abs(scaled) < 1e8) && notation != Notation::feed) {
    fail(3,
         fmt::format("{} = {} has more than {} digits at {} decimals", letter, macro::shown(value), max_digits,
                     decimals),
         line_number, address.at);
  }
  const auto count = static_cast<std::int64_t>(scaled);
  if (notation == Notation::feed && upper(letter) == 'F') {
    append_feed(text, count, decimals);
    return;
  }
  text += letter;
  if (notation == Notation::whole || (notation == Notation::g_code && count % 10 == 0)) {
    text += fmt::format("{}", notation == Notation::whole ? count : count / 10);
    return;
  }
  append_decimal(text, count, decimals);
}

// Whether the block holds a dwell with a plain G04; a G of a variable is seen when it is evaluated.
bool has_dwell(std::string_view line) noexcept {
  for (std::size_t i = 0; i < line.size(); ++i) {
    if (line[i] == '(') {
      i = std::min(line.find(')', i), line.size() - 1);
    } else if (upper(line[i]) == 'G') {
      std::size_t k = i + 1;
      skip_blanks(line, k);
      const ScannedNumber code = scan_number(line, k);
      if (code.value == 4.0 && !code.has_point) {
        return true;
      }
    }
  }
  return false;
}

int decimals_of(char letter, Notation notation, bool dwell, const WordFormat& format) noexcept {
  switch (notation) {
    case Notation::whole:
      return 0;
    case Notation::g_code:
      return 1;
    case Notation::angle:
      return format.angle_decimals;
    case Notation::feed:
      return format.feed_decimals;
    case Notation::length:
      break;
  }
  return dwell && (letter == 'X' || letter == 'U') ? format.dwell_decimals : format.length_decimals;
}

}  // namespace

std::string substitute(std::string_view line, std::uint32_t line_number, VariableAccess& variables,
                       const WordFormat& format) {
  std::string text;
  text.reserve(line.size() + 16);
  bool dwell = has_dwell(line);
  std::size_t i = 0;
  while (i < line.size()) {
    const std::size_t start = i;
    const char c = line[i];
    if (c == '(') {
      macro::skip_comment(line, i, line_number);
      text.append(line.substr(start, i - start));
      continue;
    }
    if (c == '#' || c == '[' || c == ']' || c == '=') {
      fail(c == '=' ? 127 : 114, name_at(line, i) + " without an address in front of it", line_number, i);
    }
    const bool is_corner = c == ',';
    std::size_t at = i;
    if (is_corner) {
      ++at;
      skip_blanks(line, at);
    }
    if (at >= line.size() || !is_letter(line[at])) {
      text += c;
      ++i;
      continue;
    }
    std::size_t operand = at + 1;
    if (operand < line.size() && is_letter(line[operand])) {
      refuse_letter_run(line, at, line_number);
    }
    skip_blanks(line, operand);
    if (!begins_operand(line, operand)) {
      text.append(line.substr(i, at + 1 - i));
      i = at + 1;
      continue;
    }
    const char letter = upper(line[at]);
    if (letter == 'N' || letter == 'O') {
      fail(114, std::string(1, letter) + " cannot be a variable or an expression", line_number, at);
    }
    // ",R" and ",C" are lengths, ",A" is an angle.
    const Notation notation = is_corner && letter == 'C' ? Notation::length : notation_of(letter);
    const int decimals = decimals_of(letter, notation, dwell, format);
    const MacroValue value = macro::evaluate_operand(line, operand, line_number, variables, decimals);
    expect_operand_end(line, operand, line_number);
    if (value.has_value()) {
      text.append(line.substr(i, at - i));
      append_word(text, {line[at], notation, decimals, at}, *value, line_number);
      dwell = dwell || (letter == 'G' && std::round(*value * 10.0) == 40.0);
    } else if (!text.empty() && is_letter(text.back())) {
      fail(5, std::string("address ") + text.back() + " has no number", line_number, i);  // must not join the next word
    }
    i = operand;
  }
  return text;
}

namespace {

// Variables of argument specification I; 0: no argument (G L N O P).
constexpr std::array<int, 26> variable_of_letter = {1, 2, 3, 7,  8,  9,  0,  11, 4,  5,  6,  0,  13,
                                                    0, 0, 0, 17, 18, 19, 20, 21, 22, 23, 24, 25, 26};

constexpr int max_sets = 10;  // of I J K

class ArgumentReader {
 public:
  ArgumentReader(std::string_view line, std::uint32_t line_number, VariableAccess& variables,
                 const std::array<double, 26>& scale_without_point)
      : line_(line), line_number_(line_number), variables_(variables), scale_(scale_without_point) {}

  MacroArguments read() {
    std::size_t i = 0;
    while (next_letter(i)) {
      const std::size_t at = i;
      const char letter = upper(line_[i]);
      ++i;
      if (i < line_.size() && is_letter(line_[i])) {
        refuse_letter_run(line_, at, line_number_);
      }
      bool is_computed = false;
      bool has_point = false;
      const MacroValue value = read_operand(i, is_computed, has_point);
      if (called_ && has_point && (letter == 'P' || letter == 'L')) {
        fail(7, std::string("decimal point in address ") + letter + " of a macro call, which takes whole numbers",
             line_number_, at);
      }
      take(letter, value, is_computed || has_point, at);
    }
    return arguments_;
  }

 private:
  // Goes to the next address; false at the end of the block.
  bool next_letter(std::size_t& i) {
    for (;;) {
      skip_blanks(line_, i);
      if (i == line_.size()) {
        return false;
      }
      if (line_[i] == '(') {
        macro::skip_comment(line_, i, line_number_);
      } else if (line_[i] == '/' && !called_) {
        scan_skip_switch(line_, i);
      } else if (is_letter(line_[i])) {
        return true;
      } else {
        fail(line_[i] == '=' ? 127 : 114, name_at(line_, i) + " in the block of a macro call", line_number_, i);
      }
    }
  }

  MacroValue read_operand(std::size_t& i, bool& is_computed, bool& has_point) {
    skip_blanks(line_, i);
    if (begins_operand(line_, i)) {
      is_computed = true;
      const MacroValue value = evaluate_term(line_, i, line_number_, variables_);
      expect_operand_end(line_, i, line_number_);
      return value;
    }
    bool negative = false;
    if (i < line_.size() && (line_[i] == '-' || line_[i] == '+')) {
      negative = line_[i] == '-';
      ++i;
      skip_blanks(line_, i);
    }
    const macro::Constant constant = macro::scan_constant(line_, i, line_number_, unsigned{max_digits});
    has_point = constant.has_point;
    return negative ? 0.0 - constant.value : constant.value;
  }

  void take(char letter, MacroValue value, bool as_it_is, std::size_t at) {
    if (letter == 'N' && !called_) {
      return;
    }
    const bool is_g_call = letter == 'G' && value.has_value() && (*value == 65.0 || *value == 66.0 || *value == 66.1);
    if (!called_) {
      called_ = true;
      by_g_call_ = is_g_call;
      return;
    }
    if (is_g_call && !by_g_call_) {
      fail(129, "word in front of G" + macro::shown(*value) + ": arguments follow it", line_number_, at);
    }
    switch (letter) {
      case 'P':
        arguments_.program = whole(letter, value, 76, at);
        return;
      case 'L':
        arguments_.repeats = static_cast<int>(whole(letter, value, 0, at));
        return;
      case 'I':
      case 'J':
      case 'K':
        begin_set_at(letter, at);
        break;
      default:
        break;
    }
    int variable = variable_of_letter[static_cast<std::size_t>(letter - 'A')];
    if (variable == 0) {
      fail(129, std::string("address ") + letter + " cannot be an argument", line_number_, at);
    }
    if (letter >= 'I' && letter <= 'K') {
      variable += 3 * set_;
    }
    if (value.has_value() && !as_it_is) {
      *value *= scale_[static_cast<std::size_t>(letter - 'A')];
    }
    arguments_.locals[static_cast<std::size_t>(variable)] = value;
  }

  void begin_set_at(char letter, std::size_t at) {
    if (last_of_set_ != 0 && letter <= last_of_set_) {
      ++set_;
      if (set_ == max_sets) {
        fail(129, fmt::format("more than {} sets of I J K", max_sets), line_number_, at);
      }
    }
    last_of_set_ = letter;
  }

  std::int64_t whole(char letter, MacroValue value, int alarm, std::size_t at) const {
    const double number = std::round(value.value_or(0.0));
    if (!(number >= 1.0 && number < 1e8)) {
      const std::string message = std::string(1, letter) + " of a macro call is " +
                                  (value.has_value() ? macro::shown(*value) : "<vacant>") + " (limit 1 ... 99999999)";
      if (alarm == 0) {
        throw Error(ErrorKind::program, message, line_number_, macro::column_of(at));
      }
      fail(alarm, message, line_number_, at);
    }
    return static_cast<std::int64_t>(number);
  }

  std::string_view line_;
  std::uint32_t line_number_;
  VariableAccess& variables_;
  const std::array<double, 26>& scale_;
  MacroArguments arguments_;
  bool called_ = false;     // the calling word has been read
  bool by_g_call_ = false;  // it is G65, G66 or G66.1
  int set_ = 0;
  char last_of_set_ = 0;
};

}  // namespace

MacroArguments parse_arguments(std::string_view line, std::uint32_t line_number, VariableAccess& variables,
                               const std::array<double, 26>& scale_without_point) {
  return ArgumentReader(line, line_number, variables, scale_without_point).read();
}

}  // namespace shapegcode
