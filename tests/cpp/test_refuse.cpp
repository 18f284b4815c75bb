#include <fmt/format.h>

#include <bit>
#include <cmath>
#include <cstdint>
#include <limits>
#include <random>
#include <string>

#include <doctest/doctest.h>

#include "base/refuse.hpp"

using shapegcode::Error;
using shapegcode::ErrorKind;
using shapegcode::detail::message;

namespace {

void check_as_fmt(double value) {
  CHECK(message("{} mm", value) == fmt::format("{} mm", value));
  CHECK(message("{:g}/{:.3g}/{:.10g}", value, value, value) == fmt::format("{:g}/{:.3g}/{:.10g}", value, value, value));
}

}  // namespace

TEST_CASE("Numbers in messages are written as {fmt} writes them") {
  for (const double value : {0.0,
                             -0.0,
                             1.0,
                             -2.5,
                             0.1,
                             1e-4,
                             9.9999999999999991e-5,
                             1e-5,
                             123456.0,
                             1234567.0,
                             1e15,
                             9007199254740993.0,
                             9999999999999998.0,
                             1e16,
                             1e22,
                             1e300,
                             4e9,
                             std::numeric_limits<double>::max(),
                             std::numeric_limits<double>::min(),
                             std::numeric_limits<double>::denorm_min(),
                             std::numeric_limits<double>::infinity(),
                             -std::numeric_limits<double>::infinity(),
                             std::numeric_limits<double>::quiet_NaN(),
                             -std::numeric_limits<double>::quiet_NaN()}) {
    check_as_fmt(value);
  }
  std::mt19937_64 random(20261124);
  std::uniform_real_distribution<double> digits(-1e6, 1e6);
  for (int i = 0; i < 20000; ++i) {
    check_as_fmt(std::bit_cast<double>(random()));
    check_as_fmt(digits(random));
    check_as_fmt(std::round(digits(random)) / 1000.0);
  }
}

TEST_CASE("Whole numbers and texts in messages are written as {fmt} writes them") {
  const std::string text = "of a mode";
  const char* const literal = "Hz";
  CHECK(message("nothing to put in") == "nothing to put in");
  CHECK(message("{}{}", text, literal) == "of a modeHz");
  CHECK(message("{} of {} is {}, not {}", std::numeric_limits<std::int64_t>::min(), std::size_t{7},
                std::numeric_limits<std::uint64_t>::max(), std::uint8_t{65}) ==
        fmt::format("{} of {} is {}, not {}", std::numeric_limits<std::int64_t>::min(), std::size_t{7},
                    std::numeric_limits<std::uint64_t>::max(), std::uint8_t{65}));
}

TEST_CASE("A refusal is an error about an argument") {
  try {
    shapegcode::detail::refuse("step is {} mm, limit {:g}", -0.5, 1e-7);
    FAIL("nothing was thrown");
  } catch (const Error& error) {
    CHECK(error.kind() == ErrorKind::argument);
    CHECK(std::string(error.what()) == "step is -0.5 mm, limit 1e-07");
  }
}
