#include <doctest/doctest.h>

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <cstdint>
#include <cstdio>
#include <map>
#include <numbers>
#include <random>
#include <string>
#include <string_view>

#include "program/macro/macro_expression.hpp"
#include "shapegcode/error.hpp"

using shapegcode::Error;
using shapegcode::ErrorKind;
using shapegcode::evaluate_condition;
using shapegcode::evaluate_expression;
using shapegcode::evaluate_term;
using shapegcode::MacroValue;

namespace {

// A table: variables that are not in it are vacant, above #999 there is none.
class Table : public shapegcode::VariableAccess {
 public:
  std::map<int, double> values;
  bool around_zero = false;

  MacroValue read(int number, std::uint32_t line, std::uint32_t column) override {
    if (number > 999) {
      throw shapegcode::alarm_error(115, "no such variable", line, column);
    }
    const auto found = values.find(number);
    return found == values.end() ? MacroValue{} : MacroValue{found->second};
  }
  void write(int number, MacroValue value, std::uint32_t /*line*/, std::uint32_t /*column*/) override {
    values.erase(number);
    if (value.has_value()) {
      values[number] = *value;
    }
  }
  bool signed_angles() const noexcept override { return around_zero; }
};

Table sample() {
  Table table;
  table.values = {{1, 2.5}, {2, 100.0}, {5, -3.0}, {6, 0.0}, {100, 42.0}, {102, 7.0}};
  return table;
}

MacroValue value_of(std::string_view text, Table table = sample()) {
  std::size_t i = 0;
  const MacroValue value = evaluate_expression(text, i, 1, table);
  CAPTURE(std::string(text));
  CHECK(i == text.size());
  return value;
}

double number_of(std::string_view text) {
  const MacroValue value = value_of(text);
  CAPTURE(std::string(text));
  REQUIRE(value.has_value());
  return *value;
}

bool holds(std::string_view text, Table table = sample()) {
  std::size_t i = 0;
  const bool truth = evaluate_condition(text, i, 1, table);
  CAPTURE(std::string(text));
  CHECK(i == text.size());
  return truth;
}

void check_alarm(std::string_view text, int alarm, std::uint32_t column = 0) {
  CAPTURE(std::string(text));
  Table table = sample();
  std::size_t i = 0;
  try {
    if (!text.empty() && text[0] == '?') {
      i = 1;
      (void)evaluate_condition(text, i, 9, table);
    } else {
      (void)evaluate_expression(text, i, 9, table);
    }
    FAIL("not refused");
  } catch (const Error& error) {
    CAPTURE(error.what());
    CHECK(error.kind() == ErrorKind::program);
    CHECK(error.alarm() == alarm);
    CHECK(error.line() == 9);
    if (column != 0) {
      CHECK(error.column() == column);
    }
  }
}

}  // namespace

TEST_CASE("terms: constants, variables, signs, brackets") {
  CHECK(number_of("12") == 12.0);
  CHECK(number_of("12.") == 12.0);
  CHECK(number_of(".5") == 0.5);
  CHECK(number_of("-0.001") == -0.001);
  CHECK(number_of("+3") == 3.0);
  CHECK(number_of("123456789.012") == 123456789.012);
  CHECK(number_of("0000000000000012.5") == 12.5);
  CHECK(number_of("#1") == 2.5);
  CHECK(number_of("-#1") == -2.5);
  CHECK(number_of(" # 1 ") == 2.5);
  CHECK(number_of("#[#2]") == 42.0);
  CHECK(number_of("#[#2+2]") == 7.0);
  CHECK(number_of("#[99.6]") == 42.0);  // the control rounds numbers that it wants whole
  CHECK(number_of("[#1]") == 2.5);
  CHECK(number_of("-[#1+1]*2") == -7.0);
  CHECK(number_of("#1*-2") == -5.0);
  CHECK(std::bit_cast<std::uint64_t>(number_of("-#6")) == 0);  // no negative zero
}

TEST_CASE("a term ends where the next word begins") {
  Table table = sample();
  std::size_t i = 1;
  CHECK(evaluate_term("X-#1Y2", i, 1, table) == MacroValue{-2.5});
  CHECK(i == 4);
  i = 1;
  CHECK(evaluate_term("X[#1+1]F#2", i, 1, table) == MacroValue{3.5});
  CHECK(i == 7);
  i = 0;
  CHECK(evaluate_term("#1+1", i, 1, table) == MacroValue{2.5});
  CHECK(i == 2);
  i = 0;
  CHECK_FALSE(evaluate_term("-#33", i, 1, table).has_value());
  i = 0;
  CHECK(evaluate_expression("#1+1 (NOTE)", i, 1, table) == MacroValue{3.5});
  CHECK(i == 5);
}

TEST_CASE("priorities: functions, then * / AND MOD, then + - OR XOR, then comparisons; from the left") {
  CHECK(number_of("1+2*3") == 7.0);
  CHECK(number_of("[1+2]*3") == 9.0);
  CHECK(number_of("10-4-3") == 3.0);
  CHECK(number_of("24/4/3") == 2.0);
  CHECK(number_of("24/4*3") == 18.0);
  CHECK(number_of("1+SIN[30+60]*3") == 4.0);
  CHECK(number_of("6 AND 3 * 2") == 4.0);    // (6 AND 3) * 2
  CHECK(number_of("2 * 3 AND 5") == 4.0);    // (2 * 3) AND 5
  CHECK(number_of("1 + 6 AND 3") == 3.0);    // 1 + (6 AND 3)
  CHECK(number_of("1 OR 2 + 4") == 7.0);     // (1 OR 2) + 4
  CHECK(number_of("4 + 1 OR 5") == 5.0);     // (4 + 1) OR 5
  CHECK(number_of("1 XOR 3 OR 4") == 6.0);   // (1 XOR 3) OR 4
  CHECK(number_of("8 OR 6 AND 3") == 10.0);  // 8 OR (6 AND 3)
  CHECK(number_of("7 - 9 MOD 4") == 6.0);    // 7 - (9 MOD 4)
  CHECK(number_of("2 * 7 MOD 4") == 2.0);    // (2 * 7) MOD 4
  CHECK(holds("[1+1 EQ 4/2]"));
  CHECK(holds("[1 OR 2 EQ 3]"));
  CHECK(number_of("#2+#1*SIN[#100-42]") == 100.0);  // the order of the manuals: function, product, sum
  CHECK(number_of("SIN[[[#1+#2]*2+65]*0]") == 0.0);
}

namespace {

// A random expression: its text with brackets only where the priorities ask for them, and its value from the tree.
struct Sample {
  std::string text;
  double value = 0.0;
  int rank = 3;   // 1: sum, 2: product, 3: operand
  int depth = 0;  // of brackets
};

Sample random_expression(std::mt19937& random, int height) {
  if (height == 0 || random() % 4 == 0) {
    const int number = static_cast<int>(random() % 200U) + 1;
    return {std::to_string(number), static_cast<double>(number)};
  }
  static constexpr std::array<const char*, 8> names = {"*", "/", "MOD", "AND", "+", "-", "OR", "XOR"};
  const auto pick = random() % names.size();
  Sample a = random_expression(random, height - 1);
  Sample b = random_expression(random, height - 1);
  const int rank = pick < 4 ? 2 : 1;
  const auto bracket = [](Sample& s) {
    s.text = "[" + s.text + "]";
    ++s.depth;
  };
  if (a.rank < rank || a.value < 0.0) {
    bracket(a);
  }
  if (b.rank <= rank) {
    bracket(b);
  }
  const auto whole = [](double x) { return static_cast<std::int32_t>(std::lround(x)); };
  double value = 0.0;
  switch (pick) {
    case 0:
      value = a.value * b.value;
      break;
    case 1:
      value = a.value / b.value;
      break;
    case 2:
      value = whole(b.value) == 0 ? NAN : static_cast<double>(whole(a.value) % whole(b.value));
      break;
    case 3:
      value = static_cast<double>(whole(a.value) & whole(b.value));
      break;
    case 4:
      value = a.value + b.value;
      break;
    case 5:
      value = a.value - b.value;
      break;
    case 6:
      value = static_cast<double>(whole(a.value) | whole(b.value));
      break;
    default:
      value = static_cast<double>(whole(a.value) ^ whole(b.value));
      break;
  }
  const std::string blank = random() % 2 == 0 ? "" : " ";
  return {a.text + blank + names[pick] + blank + b.text, value, rank, std::max(a.depth, b.depth)};
}

}  // namespace

TEST_CASE("random expressions agree with their trees") {
  std::mt19937 random(5);
  int compared = 0;
  for (int n = 0; n < 20000; ++n) {
    const Sample sample_ = random_expression(random, 4);
    if (!std::isfinite(sample_.value) || sample_.depth > 5 || std::abs(sample_.value) > 1e6) {
      continue;
    }
    Table table;
    std::size_t i = 0;
    CAPTURE(sample_.text);
    try {
      const MacroValue value = evaluate_expression(sample_.text, i, 1, table);
      REQUIRE(value == MacroValue{sample_.value});
      ++compared;
    } catch (const Error& error) {
      // An intermediate value beyond 32 bits or a division by zero further down.
      CHECK((error.alarm() == 112 || error.alarm() == 119));
    }
  }
  CHECK(compared > 5000);
}

TEST_CASE("functions against the C library and closed forms") {
  constexpr double radian = std::numbers::pi / 180.0;
  Table table;
  for (int k = -1080; k <= 1080; k += 7) {
    table.values[1] = k * 0.5;
    const auto at = [&](std::string_view text) { return *value_of(text, table); };
    CAPTURE(k);
    CHECK(at("SIN[#1]") == doctest::Approx(std::sin(k * 0.5 * radian)).epsilon(1e-12));
    CHECK(at("COS[#1]") == doctest::Approx(std::cos(k * 0.5 * radian)).epsilon(1e-12));
    if (k % 180 != 0) {
      CHECK(at("TAN[#1]") == doctest::Approx(std::tan(k * 0.5 * radian)).epsilon(1e-12));
    }
  }
  CHECK(number_of("SIN[0]") == 0.0);
  CHECK(number_of("SIN[90]") == 1.0);
  CHECK(number_of("SIN[180]") == 0.0);
  CHECK(number_of("SIN[-90]") == -1.0);
  CHECK(number_of("COS[90]") == 0.0);
  CHECK(number_of("COS[180]") == -1.0);
  CHECK(number_of("COS[-270]") == 0.0);
  CHECK(number_of("TAN[45]") == doctest::Approx(1.0).epsilon(1e-15));
  CHECK(number_of("ASIN[1]") == doctest::Approx(90.0));
  CHECK(number_of("ACOS[-1]") == doctest::Approx(180.0));
  CHECK(number_of("ACOS[0.5]") == doctest::Approx(60.0));
  CHECK(number_of("ATAN[1]") == doctest::Approx(45.0));
  CHECK(number_of("ATAN[-1]") == doctest::Approx(-45.0));
  CHECK(number_of("SQRT[2]") == std::sqrt(2.0));
  CHECK(number_of("ABS[-#1]") == 2.5);
  CHECK(number_of("LN[EXP[2]]") == doctest::Approx(2.0));
  CHECK(number_of("EXP[1]") == doctest::Approx(std::numbers::e));
  CHECK(number_of("POW[2,10]") == 1024.0);
  CHECK(number_of("POW[-2,3]") == -8.0);
  CHECK(number_of("POW[4,-.5]") == 0.5);
}

TEST_CASE("ATAN of two arguments covers the circle; ASIN; both follow parameter 6004#0") {
  // "#1=ATAN[-1]/[-1]" is 225 degrees, -135 with NAT (B-64304EN, arithmetic operations).
  CHECK(number_of("ATAN[-1]/[-1]") == doctest::Approx(225.0));
  CHECK(number_of("ATAN[1]/[-1]") == doctest::Approx(135.0));
  CHECK(number_of("ATAN[-1]/[1]") == doctest::Approx(315.0));
  CHECK(number_of("ATAN[-1,0]") == doctest::Approx(270.0));
  CHECK(number_of("ATAN[0]/[-1]") == doctest::Approx(180.0));
  CHECK(number_of("ATAN[1] / [1] * 2") == doctest::Approx(90.0));
  CHECK(number_of("ATAN[1]/2") == doctest::Approx(22.5));
  CHECK(number_of("ASIN[-1]") == doctest::Approx(270.0));
  Table table;
  table.around_zero = true;
  CHECK(*value_of("ATAN[-1]/[-1]", table) == doctest::Approx(-135.0));
  CHECK(*value_of("ASIN[-1]", table) == doctest::Approx(-90.0));
}

TEST_CASE("rounding functions and whole numbers") {
  // FIX and FUP of the manuals: #1=1.2, #2=-1.2 give FUP 2 and -2, FIX 1 and -1.
  CHECK(number_of("FUP[1.2]") == 2.0);
  CHECK(number_of("FIX[1.2]") == 1.0);
  CHECK(number_of("FUP[-1.2]") == -2.0);
  CHECK(number_of("FIX[-1.2]") == -1.0);
  CHECK(number_of("FUP[3]") == 3.0);
  CHECK(number_of("ROUND[2.5]") == 3.0);
  CHECK(number_of("ROUND[-2.5]") == -3.0);
  CHECK(number_of("ROUND[2.4999]") == 2.0);
  CHECK(number_of("10 MOD 4") == 2.0);
  CHECK(number_of("-10 MOD 4") == -2.0);    // the sign of the dividend
  CHECK(number_of("10.4 MOD 3.6") == 2.0);  // operands rounded: 10 MOD 4
  CHECK(number_of("BCD[1234]") == 0x1234);
  CHECK(number_of("BIN[4660]") == 1234.0);  // 4660 = 0x1234
  CHECK(number_of("BCD[99999999]") == static_cast<double>(0x99999999U));
  CHECK(number_of("BIN[BCD[99999999]]") == 99999999.0);
  CHECK(number_of("BIN[BCD[0]]") == 0.0);
  CHECK(number_of("-1 AND 255") == 255.0);
}

TEST_CASE("names may be cut down to two letters and written small") {
  for (const auto& [small, full] : std::map<std::string, std::string>{{"RO[2.6]", "ROUND[2.6]"},
                                                                      {"ROU[2.6]", "ROUND[2.6]"},
                                                                      {"FI[2.6]", "FIX[2.6]"},
                                                                      {"FU[2.6]", "FUP[2.6]"},
                                                                      {"SQ[9]", "SQRT[9]"},
                                                                      {"SI[30]", "SIN[30]"},
                                                                      {"CO[30]", "COS[30]"},
                                                                      {"TA[30]", "TAN[30]"},
                                                                      {"AS[.3]", "ASIN[.3]"},
                                                                      {"AC[.3]", "ACOS[.3]"},
                                                                      {"AT[3]/[4]", "ATAN[3]/[4]"},
                                                                      {"AB[-3]", "ABS[-3]"},
                                                                      {"EX[3]", "EXP[3]"},
                                                                      {"BI[16]", "BIN[16]"},
                                                                      {"BC[16]", "BCD[16]"},
                                                                      {"ln[3]", "LN[3]"},
                                                                      {"sqrt[9]+5 mod 3", "SQRT[9]+5MOD3"}}) {
    CHECK(number_of(small) == number_of(full));
  }
  check_alarm("PO[2,3]", 114);  // POW has no short form
  check_alarm("S[30]", 114);
  check_alarm("SINE[30]", 114);
}

TEST_CASE("vacant: 0 in arithmetic, itself alone, told from 0 by EQ and NE only") {
  CHECK_FALSE(value_of("#0").has_value());
  CHECK_FALSE(value_of("#9").has_value());
  CHECK_FALSE(value_of("[#0]").has_value());
  CHECK(number_of("#0*5") == 0.0);
  CHECK(number_of("#0+#0") == 0.0);
  CHECK(number_of("#0+1") == 1.0);
  CHECK(number_of("-#0") == 0.0);
  CHECK(number_of("ABS[#0]") == 0.0);
  // The table of the manuals for #9 vacant and #6 = 0 (EQ #0, NE 0, GE #0, GT 0, LE, LT).
  CHECK(holds("[#9EQ#0]"));
  CHECK_FALSE(holds("[#6EQ#0]"));
  CHECK_FALSE(holds("[#9EQ0]"));
  CHECK(holds("[#9NE0]"));
  CHECK_FALSE(holds("[#6NE0]"));
  CHECK(holds("[#6NE#0]"));
  CHECK(holds("[#9GE#0]"));
  CHECK(holds("[#6GE#0]"));
  CHECK_FALSE(holds("[#9GT0]"));
  CHECK_FALSE(holds("[#6GT0]"));
  CHECK(holds("[#9LE0]"));
  CHECK_FALSE(holds("[#9LT0]"));
  CHECK_FALSE(holds("[#0+0EQ#0]"));
}

TEST_CASE("conditions") {
  CHECK(holds("[#1 EQ 2.5]"));
  CHECK(holds("[#1NE2]"));
  CHECK(holds("[#1 GT 2]"));
  CHECK(holds("[#1 GE 2.5]"));
  CHECK(holds("[#1 lt 3]"));
  CHECK(holds("[#1 LE [2+.5]]"));
  CHECK(holds("[[#1+1] EQ 3.5]"));
  CHECK(holds("[[#1 EQ 2.5] AND [#2 EQ 100]]"));
  CHECK_FALSE(holds("[[#1 EQ 2.5] AND [#2 EQ 1]]"));
  CHECK(holds("[[#1 EQ 1] OR [#2 EQ 100]]"));
  CHECK_FALSE(holds("[[#1 EQ 2.5] XOR [#2 EQ 100]]"));
  CHECK(holds("[[#1 EQ 2.5] OR [#1 EQ 0] AND [#1 EQ 1]]"));  // AND first
  CHECK(holds("[[[#1 EQ 1] OR [#1 EQ 2.5]] AND [#2 EQ 100]]"));
  CHECK(holds("[[#1 EQ 2.5]]"));
  CHECK(holds("[1EQ1]"));
}

TEST_CASE("every alarm of expressions") {
  check_alarm("1234567890123", 3);
  check_alarm(".0000000000000000001", 3);
  check_alarm("EXP[1000]", 111);
  check_alarm("EXP[700]*EXP[700]", 111, 9);
  check_alarm("1/0", 112, 2);
  check_alarm("1/#0", 112);
  check_alarm("5 MOD .4", 112);
  check_alarm("TAN[90]", 112);
  check_alarm("TAN[-270]", 112);
  check_alarm("ATAN[0]/[0]", 112);
  check_alarm("POW[0,-1]", 112);
  for (const char* text :
       {"",        "+",      "--1",       "1+",       "1*",         "[1",      "[1)",     "SIN",    "SIN30",
        "SIN(30)", "SIN[]",  "[]",        "FOO[1]",   "##1",        "#",       "#A",      "#[",     "#[1",
        "1E5",     "1.5E-3", "POW[2]",    "SIN[1,2]", "POW[1,2,3]", "[1 2]",   "[1EQ1]",  "1 EQ 1", "[1EQ1]+1",
        "=",       ".",      "[1 LTE 2]", "[1<2]",    "ATAN[1,2",   "#[1EQ1]", "-[1EQ1]", "\x80",   "ADP[#1]"}) {
    check_alarm(text, 114);
  }
  for (const char* text : {"?", "?1", "?[]", "?[1]", "?[#1]", "?[1EQ1", "?[1 EQ 1 EQ 1]", "?[1EQ1 AND 2EQ2]",
                           "?[[1EQ1] AND 1]", "?[[1EQ1] + [1EQ1]]", "?[1 LTE 2]", "?[1=1]", "?[EQ 1]"}) {
    check_alarm(text, 114);
  }
  check_alarm("#-1", 115, 1);
  check_alarm("#[-1]", 115);
  check_alarm("#[#0]", 115);
  check_alarm("#[1000*1000]", 115);
  check_alarm("#99999999999999999999", 115);
  check_alarm("1+#5000", 115, 3);
  CHECK(number_of("[[[[[1]]]]]") == 1.0);
  CHECK(number_of("SIN[[[[#1+#2]*0+0]*0+90]*1]") == 1.0);
  check_alarm("[[[[[[1]]]]]]", 118, 6);
  check_alarm("SIN[[[[[0]]]]]+SIN[[[[[[0]]]]]]", 118);
  CHECK(number_of("[[[[[1]]]]]+[[[[[1]]]]]") == 2.0);
  CHECK(holds("[[[[[[1]]]]]EQ1]"));
  check_alarm("?[[[[[[[1]]]]]]EQ1]", 118);
  check_alarm("SQRT[-1]", 119);
  check_alarm("ASIN[1.001]", 119);
  check_alarm("ACOS[-1.001]", 119);
  check_alarm("LN[0]", 119);
  check_alarm("LN[-1]", 119);
  check_alarm("BIN[-1]", 119);
  check_alarm("BCD[-1]", 119);
  check_alarm("BIN[10]", 119);  // 0xA is no decimal digit
  check_alarm("BCD[100000000]", 119);
  check_alarm("POW[-2,.5]", 119);
  check_alarm("3000000000 AND 1", 119);
}

TEST_CASE("a line of a million characters takes time in proportion") {
  std::string text = "1";
  for (int k = 0; k < 500000; ++k) {
    text += k % 2 == 0 ? "+1" : "-1";
  }
  CHECK(number_of(text) == 1.0);
  check_alarm(std::string(1000000, '['), 118);
  check_alarm(std::string(1000000, '-'), 114);
  check_alarm("[" + std::string(1000000, ' '), 114);
}
