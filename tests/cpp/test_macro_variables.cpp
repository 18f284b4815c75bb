#include <doctest/doctest.h>

#include <array>
#include <cmath>
#include <string>

#include "program/macro/macro_variables.hpp"
#include "shapegcode/error.hpp"

using shapegcode::Error;
using shapegcode::ErrorKind;
using shapegcode::MacroValue;
using shapegcode::MacroVariables;

namespace {

// #1000 can be read and written, #5041 only read, #3000 only written.
class Few : public shapegcode::SystemVariables {
 public:
  MacroValue stored;
  bool read(int number, MacroValue& value) override {
    if (number == 1000) {
      value = stored;
      return true;
    }
    if (number == 5041) {
      value = 12.5;
      return true;
    }
    return false;
  }
  bool write(int number, MacroValue value) override {
    if (number == 1000 || number == 3006) {
      stored = value;
      return true;
    }
    return false;
  }
};

template <class F>
int alarm_of(F&& action) {
  try {
    action();
  } catch (const Error& error) {
    CHECK(error.kind() == ErrorKind::program);
    CHECK(error.line() == 3);
    CHECK(error.column() == 4);
    return error.alarm();
  }
  return -1;
}

}  // namespace

TEST_CASE("locals, common and retained variables") {
  MacroVariables variables({{500, 1.5}, {999, -2.0}});
  for (const int number : {0, 1, 33, 100, 199}) {
    CHECK_FALSE(variables.read(number, 3, 4).has_value());
  }
  for (const int number : {1, 33, 100, 199, 500, 777, 999}) {
    variables.write(number, number * 0.5, 3, 4);
  }
  for (const int number : {1, 33, 100, 199, 500, 777, 999}) {
    CHECK(variables.read(number, 3, 4) == MacroValue{number * 0.5});
  }
  CHECK_FALSE(variables.read(2, 3, 4).has_value());
  variables.write(100, std::nullopt, 3, 4);
  CHECK_FALSE(variables.read(100, 3, 4).has_value());
  variables.write(500, std::nullopt, 3, 4);
  CHECK_FALSE(variables.read(500, 3, 4).has_value());
}

TEST_CASE("a retained variable is known once it is given or written") {
  MacroVariables variables({{501, 1.5}});
  CHECK(variables.read(501, 3, 4) == MacroValue{1.5});
  CHECK(alarm_of([&] { (void)variables.read(500, 3, 4); }) == 0);
  try {
    (void)variables.read(500, 3, 4);
  } catch (const Error& error) {
    CHECK(std::string(error.what()) ==
          "variable #500 is retained by the control and its value is not known here: give it in the machine file "
          "(input.variables)");
  }
  variables.write(500, 7.0, 3, 4);
  CHECK(variables.read(500, 3, 4) == MacroValue{7.0});
  CHECK_THROWS_AS(MacroVariables({{499, 1.0}}), Error);
  CHECK_THROWS_AS(MacroVariables({{1000, 1.0}}), Error);
  CHECK_THROWS_AS(MacroVariables({{500, NAN}}), Error);
}

TEST_CASE("numbers that are no variables, and #0") {
  MacroVariables variables;
  for (const int number : {-1, 34, 99, 200, 499, 1000, 5041, 999999}) {
    CAPTURE(number);
    CHECK(alarm_of([&] { (void)variables.read(number, 3, 4); }) == 115);
    CHECK(alarm_of([&] { variables.write(number, 1.0, 3, 4); }) == 115);
  }
  CHECK(alarm_of([&] { variables.write(0, 1.0, 3, 4); }) == 116);
}

TEST_CASE("variables of the control") {
  Few few;
  MacroVariables variables({}, &few);
  variables.write(1000, 1.0, 3, 4);
  CHECK(few.stored == MacroValue{1.0});
  CHECK(variables.read(1000, 3, 4) == MacroValue{1.0});
  CHECK(variables.read(5041, 3, 4) == MacroValue{12.5});
  CHECK(alarm_of([&] { variables.write(5041, 1.0, 3, 4); }) == 116);
  CHECK(alarm_of([&] { variables.write(5042, 1.0, 3, 4); }) == 115);
  CHECK(alarm_of([&] { (void)variables.read(5042, 3, 4); }) == 115);
  shapegcode::SystemVariables none;
  MacroValue value;
  CHECK_FALSE(none.read(1000, value));
  CHECK_FALSE(none.write(1000, value));
}

TEST_CASE("levels: each call has locals of its own, common variables are shared") {
  MacroVariables variables;
  variables.write(1, 10.0, 3, 4);
  variables.write(100, 5.0, 3, 4);
  for (int level = 1; level <= 4; ++level) {
    std::array<MacroValue, 34> arguments{};
    arguments[0] = 99.0;
    arguments[1] = level;
    arguments[33] = -level;
    variables.push_level(arguments);
    CHECK(variables.level() == static_cast<std::size_t>(level));
    CHECK(variables.read(1, 3, 4) == MacroValue{level});
    CHECK(variables.read(33, 3, 4) == MacroValue{-level});
    CHECK_FALSE(variables.read(0, 3, 4).has_value());
    CHECK_FALSE(variables.read(2, 3, 4).has_value());
    CHECK(variables.read(100, 3, 4) == MacroValue{5.0});
    variables.write(2, 100.0 * level, 3, 4);
  }
  CHECK(alarm_of([&] { variables.push_level({}, 3, 4); }) == 122);
  CHECK(variables.read(2, 3, 4) == MacroValue{400.0});
  for (int level = 4; level >= 1; --level) {
    CHECK(variables.read(2, 3, 4) == MacroValue{100.0 * level});
    variables.pop_level();
  }
  CHECK(variables.read(1, 3, 4) == MacroValue{10.0});
  CHECK_FALSE(variables.read(2, 3, 4).has_value());
  CHECK_THROWS_AS(variables.pop_level(), Error);
}
