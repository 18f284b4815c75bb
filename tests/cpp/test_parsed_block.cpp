#include "program/text/parsed_block.hpp"

#include <doctest/doctest.h>

#include <string>
#include <utility>

using shapegcode::detail::ParsedBlock;

TEST_CASE("parsed block: words, addresses and comments of one reading") {
  ParsedBlock block;
  const std::string text = "N10 G01 X1.5(ONE) Y-2. (TWO) F100";
  block.read(text, 3, 250);
  CHECK(block.text() == text);
  CHECK(block.word_count == 5);
  CHECK(block.sorted()['Y'].value == -2.0);
  CHECK(block.text_of(block.sorted()['X']) == "X1.5");
  CHECK(block.text_of(block.words[0]) == "N10");
  REQUIRE(block.comment_count == 2);
  CHECK(block.offset_of(block.comments[1]) == text.find("(TWO)"));
}

TEST_CASE("parsed block: a text that nobody else keeps stays with it, and the next line takes its place") {
  ParsedBlock block;
  {
    std::string text = "G02 X1. R5. (GONE)";
    block.read_and_keep(std::move(text), 1, 250);
  }
  CHECK(block.text() == "G02 X1. R5. (GONE)");
  CHECK(block.comments[0] == "(GONE)");
  CHECK(block.sorted().has('R'));
  block.read("M30", 2, 250);
  CHECK(block.word_count == 1);
  CHECK(block.comment_count == 0);
  CHECK_FALSE(block.sorted().has('R'));
  block.read("#1=2", 3, 250);
  CHECK(block.macro);
}
