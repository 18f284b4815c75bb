#include "shapegcode/shaper.hpp"

#include <doctest/doctest.h>

#include <array>
#include <cmath>
#include <cstddef>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "shapegcode/error.hpp"

using shapegcode::Error;
using shapegcode::ErrorKind;
using shapegcode::grid_polynomial;
using shapegcode::Mode;
using shapegcode::Shaper;

namespace {

constexpr std::array machine{Mode{46.0, 0.02}, Mode{131.0, 0.02}};

std::string refusal(std::span<const Mode> modes, double period_s, ErrorKind kind) {
  try {
    static_cast<void>(grid_polynomial(modes, period_s));
  } catch (const Error& error) {
    CHECK(error.kind() == kind);
    return error.what();
  }
  return "accepted";
}

}  // namespace

TEST_CASE("grid polynomial: 46 and 131 Hz at 5 ms") {
  const Shaper shaper = grid_polynomial(machine, 0.005);
  const std::array expected{0.20394, 0.16162, 0.31387, 0.15731, 0.16327};
  REQUIRE(shaper.amplitudes.size() == expected.size());
  for (std::size_t k = 0; k < expected.size(); ++k) {
    CHECK(std::abs(shaper.amplitudes[k] - expected[k]) < 5e-6);
  }
  CHECK(duration_s(shaper) == doctest::Approx(0.02).epsilon(1e-15));
  CHECK(shapegcode::to_fir(shaper, 0.005).delays() == std::vector<int>{0, 1, 2, 3, 4});
}

TEST_CASE("grid polynomial: the taps are tame at some periods only, the zeros exact at all") {
  const std::vector<std::pair<double, double>> cases{
      {0.001, 248.0}, {0.002, 9.7}, {0.004, 1.0}, {0.005, 1.0}, {0.008, 10.3}};
  for (const auto& [period_s, sum] : cases) {
    const Shaper shaper = grid_polynomial(machine, period_s);
    CHECK(abs_sum(shaper) == doctest::Approx(sum).epsilon(0.006));
    for (const Mode& mode : machine) {
      CHECK(residual_ratio(shaper, mode) < 1e-12);
    }
  }
}

TEST_CASE("grid polynomial: real and coinciding roots take fewer taps") {
  // half a period of 100 Hz is 5 ms, and 300 Hz aliases onto it
  CHECK(grid_polynomial(std::array{Mode{100.0, 0.0}}, 0.005).amplitudes == std::vector<double>{0.5, 0.5});
  CHECK(grid_polynomial(std::array{Mode{100.0, 0.0}, Mode{300.0, 0.0}}, 0.005).times_s.size() == 2);
  // 154 Hz is the mirror of 46 Hz about 100 Hz
  const std::array mirrored{Mode{46.0, 0.0}, Mode{154.0, 0.0}, Mode{46.0, 0.0}};
  const Shaper shaper = grid_polynomial(mirrored, 0.005);
  CHECK(shaper.times_s.size() == 3);
  for (const Mode& mode : mirrored) {
    CHECK(residual_ratio(shaper, mode) < 1e-13);
  }
}

TEST_CASE("grid polynomial: what it refuses") {
  CHECK(refusal(std::array{Mode{131.0, 0.02}, Mode{200.0, 0.0}}, 0.005, ErrorKind::design)
            .find("mode 200 Hz cannot be cancelled on a 5 ms grid: z = 1.000") == 0);
  CHECK(refusal(std::array{Mode{1.0, 0.0}}, 0.001, ErrorKind::design).find("limit 0.01; choose another") !=
        std::string::npos);
  const std::array three{Mode{20.0, 0.0}, Mode{13.0, 0.02}, Mode{45.0, 0.01}};
  CHECK(refusal(three, 0.00025, ErrorKind::design).find("rounding leaves") != std::string::npos);
  CHECK(refusal({}, 0.005, ErrorKind::argument).find("0 given") != std::string::npos);
  CHECK(refusal(machine, 0.0, ErrorKind::argument).find("is 0 s") != std::string::npos);
  CHECK(refusal(machine, std::nan(""), ErrorKind::argument) != "accepted");
}
