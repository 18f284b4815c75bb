#include <doctest/doctest.h>

#include <cstdint>
#include <cstdio>
#include <random>
#include <string>
#include <string_view>

#include "program/text/lexer.hpp"
#include "program/text/number_format.hpp"
#include "shapegcode/error.hpp"

using shapegcode::Block;
using shapegcode::Error;
using shapegcode::ErrorKind;
using shapegcode::scan_block;
using shapegcode::Word;

namespace {

Block scan(std::string_view text) {
  Block block;
  scan_block(text, 7, 250, block);
  return block;
}

struct Refusal {
  bool thrown = false;
  std::string message;
  std::uint32_t line = 0;
  std::uint32_t column = 0;
};

Refusal refusal(std::string_view text, std::size_t max_length = 250) {
  Block block;
  try {
    scan_block(text, 42, max_length, block);
  } catch (const Error& error) {
    CHECK(error.kind() == ErrorKind::program);
    return {true, error.what(), error.line(), error.column()};
  }
  return {};
}

void check_refused(std::string_view text, std::uint32_t column, const std::string& part) {
  CAPTURE(std::string(text));
  const Refusal found = refusal(text);
  CHECK(found.thrown);
  CHECK(found.line == 42);
  CHECK(found.column == column);
  CAPTURE(found.message);
  CHECK(found.message.find(part) != std::string::npos);
}

void check_word(const Word& word, char letter, double value, bool has_point, std::uint32_t column) {
  CHECK(word.letter == letter);
  CHECK(word.value == value);
  CHECK(word.has_point == has_point);
  CHECK(word.column == column);
}

}  // namespace

TEST_CASE("lexer: words with letter, value, point and column") {
  const Block block = scan("N10 g01X-1.25 y.5Z+3 F1500.;");
  REQUIRE(block.word_count == 6);
  check_word(block.words[0], 'N', 10.0, false, 1);
  check_word(block.words[1], 'G', 1.0, false, 5);
  check_word(block.words[2], 'X', -1.25, true, 8);
  check_word(block.words[3], 'Y', 0.5, true, 15);
  check_word(block.words[4], 'Z', 3.0, false, 18);
  check_word(block.words[5], 'F', 1500.0, true, 22);
  CHECK(block.comment_count == 0);
  CHECK_FALSE(block.optional_skip);
}

TEST_CASE("lexer: blanks between words and between letter and number; others are refused, never misread") {
  const Block block = scan("\tX \t-1.5Y2.");
  REQUIRE(block.word_count == 2);
  check_word(block.words[0], 'X', -1.5, true, 2);
  check_word(block.words[1], 'Y', 2.0, true, 9);
  check_refused("X- 1.5", 1, "X has no number");
  check_refused("X1 0.5", 4, "'0'");
}

TEST_CASE("lexer: an empty line, a lone semicolon, a lone comment") {
  CHECK(scan("").word_count == 0);
  CHECK(scan(" ; \t").word_count == 0);
  const Block block = scan(" (TOOL 5 <12.5%>)");
  CHECK(block.word_count == 0);
  REQUIRE(block.comment_count == 1);
  CHECK(block.comments[0] == "(TOOL 5 <12.5%>)");
}

TEST_CASE("lexer: a comment may stand anywhere and leaves the words alone") {
  const std::string text = "G01 (ONE) X1. (X99. G00) Y2.";
  const Block block = scan(text);
  REQUIRE(block.word_count == 3);
  check_word(block.words[1], 'X', 1.0, true, 11);
  check_word(block.words[2], 'Y', 2.0, true, 26);
  REQUIRE(block.comment_count == 2);
  CHECK(block.comments[0] == "(ONE)");
  CHECK(block.comments[1] == "(X99. G00)");
  CHECK(block.comments[1].data() == text.data() + 14);
}

TEST_CASE("lexer: block skip at the start of a block, with and without a number") {
  for (const char* text : {"/G01X1.", "/3 G01X1.", " / G01X1.", "N5/G01X1."}) {
    CAPTURE(std::string(text));
    const Block block = scan(text);
    CHECK(block.optional_skip);
    CHECK(block.words[block.word_count - 1].letter == 'X');
    CHECK(block.words[block.word_count - 1].value == 1.0);
  }
  CHECK_FALSE(scan("G01X1.").optional_skip);
  check_refused("G01/X1.", 4, "'/'");
}

TEST_CASE("lexer: digits are counted without leading zeros and without the point") {
  CHECK(scan("X99999.999").words[0].digits == 8);
  CHECK(scan("X0000000001.").words[0].digits == 1);
  CHECK(scan("X0.001").words[0].digits == 1);
  CHECK(scan("X0").words[0].digits == 0);
  CHECK(scan("X-99999.999").words[0].value == -99999.999);
  check_refused("G01 X123456.789", 5, "9 (limit 8)");
  check_refused("X1234567890123456789012345", 1, "25 (limit 8)");
  check_refused("N123456789", 1, "9 (limit 8)");
}

TEST_CASE("lexer: every number is the double nearest to its decimal") {
  // Independent source: the C library's correctly rounded strtod.
  std::mt19937 generator(1);
  std::uniform_int_distribution<int> mantissa(-99999999, 99999999);
  std::uniform_int_distribution<int> places(0, 8);
  int differing = 0;
  for (int i = 0; i < 20000; ++i) {
    std::string digits = std::to_string(mantissa(generator));
    const std::string sign = digits[0] == '-' ? "-" : "";
    digits.erase(0, sign.size());
    const auto decimals = static_cast<std::size_t>(places(generator));
    if (digits.size() < decimals) digits.insert(0, decimals - digits.size(), '0');
    digits.insert(digits.size() - decimals, ".");
    const std::string number = sign + digits;
    if (scan("X" + number).words[0].value != std::stod(number)) ++differing;
  }
  CHECK(differing == 0);
}

TEST_CASE("lexer: refuses a letter without a number") {
  check_refused("G01 X", 5, "X has no number");
  check_refused("G01 X. Y2.", 5, "X has no number");
  check_refused("X-", 1, "X has no number");
  check_refused("X--1.", 1, "X has no number");
  check_refused("XY1.", 1, "X has no number");
  check_refused("X1.5.2", 5, "second decimal point in address X (alarm 0007)");
  check_refused("X1.,R2..", 8, "second decimal point in address ,R (alarm 0007)");
  check_refused("X15-2.", 4, "minus sign behind the number of address X (alarm 0006)");
  check_refused("X1. -2.", 5, "'-' stands where an address is expected (alarm 0004)");
  check_refused("5X1.", 1, "'5'");
}

TEST_CASE("lexer: a decimal point is noted, not judged: arguments of a macro call may carry one in every address") {
  for (const char* text : {"M3.", "S1000.5", "T1.", "N1.", "O1.", "H1.", "D1.", "L2.", "G54.1"}) {
    CAPTURE(std::string(text));
    const Block block = scan(text);
    REQUIRE(block.word_count == 1);
    check_word(block.words[0], text[0], std::stod(text + 1), true, 1);
  }
}

TEST_CASE("lexer: a block of custom macro is marked and left to the macro reader") {
  for (const char* text : {"#100=1.5", "G01 X#100", "X[1.+2.]", "X1.=2", "IF [#1 EQ 2] GOTO 10", "GOTO 10",
                           "N5 WHILE [1] DO1", "END1", "X1.,R#1", "X-#1", "POPEN"}) {
    CAPTURE(std::string(text));
    CHECK(scan(text).macro);
  }
  for (const char* text : {"G01 X1. (#100 = [2] GOTO 10)", "", "/G01 X1.,R2.", "M98 P1"}) {
    CAPTURE(std::string(text));
    CHECK_FALSE(scan(text).macro);
  }
}

TEST_CASE("lexer: refuses what is no program text") {
  check_refused("G01 X1. \x01", 9, "byte 0x01");
  check_refused("G01 X1.\xC3\xA9", 8, "byte 0xC3");
  check_refused("G01 $ X1.", 5, "'$'");
  check_refused("G01 *", 5, "'*'");
  check_refused("G01 (never closed X1.", 5, "does not close");
  check_refused("G01 )", 5, "')'");
  check_refused(std::string_view("G01\0", 4), 4, "0x00");
}

TEST_CASE("lexer: refuses a line over the limit and takes one at it") {
  const std::string at_limit = "G01X1." + std::string(44, ' ');
  REQUIRE(at_limit.size() == 50);
  CHECK_FALSE(refusal(at_limit, 50).thrown);
  const Refusal found = refusal(at_limit + " ", 50);
  CHECK(found.thrown);
  CHECK(found.message == "line of 51 characters (limit 50)");
  CHECK(found.column == 51);
}

TEST_CASE("lexer: takes 40 words in a block and refuses 41") {
  std::string text;
  for (int i = 0; i < 40; ++i) text += "M1";
  CHECK(scan(text).word_count == 40);
  check_refused(text + "M1", 81, "more than 40 words");
}

TEST_CASE("lexer: takes 8 comments in a block and refuses 9") {
  std::string text;
  for (int i = 0; i < 8; ++i) text += "(A)";
  CHECK(scan(text).comment_count == 8);
  check_refused(text + "(A)", 25, "more than 8 comments");
}

TEST_CASE("lexer: corner words keep apart from R and C") {
  const Block block = scan("X1.,R2.");
  REQUIRE(block.word_count == 2);
  CHECK(block.words[1].letter != 'R');
  CHECK(block.words[1].value == 2.0);
  CHECK(block.words[1].column == 4);
  check_refused("X1.,", 4, "','");
}

TEST_CASE("lexer: any byte string is read or refused with a place inside it, never more") {
  std::mt19937 generator(3);
  const std::string likely = "GXYZFIJKRMNO0123456789.-+ /();#[]=,%<\t\r";
  std::uniform_int_distribution<std::size_t> pick(0, likely.size() - 1);
  std::uniform_int_distribution<int> any(0, 255);
  std::uniform_int_distribution<int> length(0, 60);
  int outside = 0;
  int accepted = 0;
  for (int i = 0; i < 20000; ++i) {
    std::string text;
    for (int k = length(generator); k > 0; --k) {
      text += any(generator) < 250 ? likely[pick(generator)] : static_cast<char>(any(generator));
    }
    Block block;
    try {
      scan_block(text, 1, 250, block);
      ++accepted;
      for (const Word& word : block) {
        if (word.column < 1 || word.column > text.size() || !(word.value == word.value)) ++outside;
      }
    } catch (const Error& error) {
      if (error.line() != 1 || error.column() < 1 || error.column() > text.size() + 1) ++outside;
    }
  }
  CHECK(outside == 0);
  CHECK(accepted > 100);
}

TEST_CASE("number format: FANUC decimals by hand") {
  const auto decimal = [](std::int64_t value, int decimals) {
    std::string text;
    shapegcode::append_decimal(text, value, decimals);
    return text;
  };
  CHECK(decimal(0, 3) == "0.");
  CHECK(decimal(12000, 3) == "12.");
  CHECK(decimal(-500, 3) == "-.5");
  CHECK(decimal(1, 3) == ".001");
  CHECK(decimal(-1, 4) == "-.0001");
  CHECK(decimal(20031, 3) == "20.031");
  CHECK(decimal(100010, 3) == "100.01");
  CHECK(decimal(-99999999, 3) == "-99999.999");
  CHECK(decimal(7, 0) == "7.");
  const auto feed = [](std::int64_t value, int decimals) {
    std::string text;
    shapegcode::append_feed(text, value, decimals);
    return text;
  };
  CHECK(feed(50, 1) == "F5.0");
  CHECK(feed(55, 1) == "F5.5");
  CHECK(feed(90, 1) == "F9.0");
  CHECK(feed(100, 1) == "F10.");
  CHECK(feed(37773, 1) == "F3777.3");
  CHECK(feed(6000, 0) == "F6000.");
}

TEST_CASE("number format: what is written is read back as the same increments") {
  std::mt19937 generator(5);
  std::uniform_int_distribution<std::int64_t> value(-99999999, 99999999);
  int wrong = 0;
  for (int i = 0; i < 20000; ++i) {
    const int decimals = i % 5;
    const std::int64_t wanted = i % 3 == 0 ? value(generator) / 10000 : value(generator);
    std::string text = "X";
    shapegcode::append_decimal(text, wanted, decimals);
    double scale = 1.0;
    for (int k = 0; k < decimals; ++k) scale *= 10.0;
    const Block block = scan(text);
    if (!block.words[0].has_point || block.words[0].value != static_cast<double>(wanted) / scale) ++wrong;
  }
  CHECK(wrong == 0);
}
