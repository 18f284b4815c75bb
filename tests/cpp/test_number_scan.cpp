#include "program/text/number_scan.hpp"

#include <doctest/doctest.h>

#include <charconv>
#include <random>
#include <string>
#include <tuple>

using shapegcode::scan_number;
using shapegcode::scan_skip_switch;
using shapegcode::scan_whole;
using shapegcode::ScannedNumber;

TEST_CASE("number scan: what is read and where it ends") {
  struct Case {
    const char* text;
    double value;
    unsigned digits, significant, decimals;
    bool point;
    std::size_t end;
  };
  for (const Case& c :
       {Case{"12", 12.0, 2, 2, 0, false, 2}, Case{"0.050X", 0.05, 4, 2, 3, true, 5},
        Case{"12.", 12.0, 2, 2, 0, true, 3}, Case{".5", 0.5, 1, 1, 1, true, 2}, Case{"1.2.3", 1.2, 2, 2, 1, true, 3},
        Case{"007", 7.0, 3, 1, 0, false, 3}, Case{"", 0.0, 0, 0, 0, false, 0}, Case{".", 0.0, 0, 0, 0, true, 1},
        Case{"-1", 0.0, 0, 0, 0, false, 0}, Case{"0", 0.0, 1, 0, 0, false, 1}}) {
    CAPTURE(c.text);
    std::size_t i = 0;
    const ScannedNumber number = scan_number(c.text, i);
    CHECK(number.value == c.value);
    CHECK(number.digits == c.digits);
    CHECK(number.significant == c.significant);
    CHECK(number.decimals == c.decimals);
    CHECK(number.has_point == c.point);
    CHECK(i == c.end);
  }
}

TEST_CASE("number scan: decimals are rounded correctly, as the standard library does") {
  std::mt19937_64 random(5);
  for (int n = 0; n < 100'000; ++n) {
    std::string text;
    const std::size_t digits = 1 + random() % 15;
    const std::size_t point = random() % (digits + 1);
    for (std::size_t k = 0; k < digits; ++k) {
      text += k == point ? "." : "";
      text += static_cast<char>('0' + random() % 10);
    }
    double expected = 0.0;
    std::from_chars(text.data(), text.data() + text.size(), expected);
    std::size_t i = 0;
    CAPTURE(text);
    REQUIRE(scan_number(text, i).value == expected);
    REQUIRE(i == text.size());
  }
}

TEST_CASE("number scan: thousands of digits are counted and overflow nothing") {
  std::size_t i = 0;
  const ScannedNumber number = scan_number(std::string(5000, '9') + "." + std::string(5000, '9'), i);
  CHECK(number.significant == 10'000);
  CHECK(i == 10'001);
  i = 0;
  const ScannedNumber zeros = scan_number("0." + std::string(5000, '0') + "1", i);
  CHECK(zeros.significant == 1);
  CHECK(zeros.decimals == 5001);
  CHECK(zeros.value == 1e-18);  // far below what any caller takes
  i = 0;
  CHECK(scan_whole(std::string(5000, '9'), i) < 1'000'000'000'000'000'000);
  CHECK(i == 5000);
}

TEST_CASE("number scan: whole numbers and block skips") {
  std::size_t i = 1;
  CHECK(scan_whole("N0120X", i) == 120);
  CHECK(i == 5);
  CHECK(scan_whole("N0120X", i) == -1);
  CHECK(i == 5);
  for (const auto& [text, skip_switch, end] :
       {std::tuple{"/N1", 1, 1U}, {"/", 1, 1U}, {"/0", 1, 2U}, {"/9", 9, 2U}, {"/12", 1, 2U}}) {
    const std::string written(text);
    CAPTURE(written);
    i = 0;
    CHECK(scan_skip_switch(text, i) == skip_switch);
    CHECK(i == end);
  }
}
