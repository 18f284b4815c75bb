#include <doctest/doctest.h>

#include <algorithm>
#include <cmath>
#include <numbers>
#include <span>
#include <vector>

#include "measure/profile.hpp"
#include "shapegcode/error.hpp"
#include "shapegcode/measure/sections.hpp"

using shapegcode::gaussian_low_pass;
using shapegcode::measure_roughness;
using shapegcode::Roughness;
using shapegcode::standard_cutoff_mm;

namespace {

constexpr double pi = std::numbers::pi;
constexpr double spacing = 0.01;

std::vector<double> wave(double amplitude, double length_mm, int count = 2000) {
  std::vector<double> values;
  for (int i = 0; i < count; ++i) values.push_back(amplitude * std::sin(2.0 * pi * i * spacing / length_mm));
  return values;
}

/// Largest value in the middle, where no end is near.
double middle_peak(std::span<const double> values) {
  const auto n = static_cast<std::ptrdiff_t>(values.size());
  return *std::max_element(values.begin() + n / 4, values.end() - n / 4);
}

}  // namespace

TEST_CASE("roughness: the Gaussian filter's transmission is exp(-pi (alpha L / wave)^2)") {
  const double alpha2 = std::numbers::ln2 / pi;
  for (const double length : {0.3, 0.8, 1.0, 2.5, 5.0}) {
    CAPTURE(length);
    const double expected = std::exp(-pi * alpha2 * std::pow(0.8 / length, 2));
    CHECK(middle_peak(gaussian_low_pass(wave(3.0, length), spacing, 0.8)) / 3.0 ==
          doctest::Approx(expected).epsilon(2e-4));
  }
  CHECK(middle_peak(gaussian_low_pass(wave(1.0, 0.8), spacing, 0.8)) == doctest::Approx(0.5).epsilon(1e-3));
  for (const double value : gaussian_low_pass(std::vector<double>(30, 7.0), spacing, 0.8)) {
    CHECK(value == doctest::Approx(7.0));
  }
  CHECK(gaussian_low_pass({}, spacing, 0.8).empty());
}

TEST_CASE("roughness: a sine has Ra = 2 A / pi, Rz = 2 A") {
  const Roughness fine = measure_roughness(wave(1e-3, 0.1), spacing, 0.8);
  CHECK(fine.ra_mm == doctest::Approx(2e-3 / pi).epsilon(0.02));  // ten stations per wave
  CHECK(fine.rz_mm == doctest::Approx(2e-3).epsilon(0.06));
  CHECK(fine.wa_mm < 1e-6);
  CHECK(fine.evaluated_mm == doctest::Approx(20.0 - 1.6));
  const Roughness coarse = measure_roughness(wave(1e-3, 4.6), spacing, 0.8);
  const double passed = std::exp(-std::numbers::ln2 * std::pow(0.8 / 4.6, 2));
  CHECK(coarse.wa_mm == doctest::Approx(passed * 2e-3 / pi).epsilon(5e-3));
  CHECK(coarse.ra_mm == doctest::Approx((1.0 - passed) * 2e-3 / pi).epsilon(0.02));
  const Roughness smoothed = measure_roughness(wave(1e-3, 0.1), spacing, 0.8, 0.1);
  CHECK(smoothed.ra_mm == doctest::Approx(0.5 * fine.ra_mm).epsilon(0.01));
}

TEST_CASE("roughness: form is taken off") {
  std::vector<double> line;
  std::vector<double> circle;
  const double step = 0.002;
  for (int i = 0; i < 800; ++i) {
    line.push_back(0.3 + 0.01 * i);
    circle.push_back(0.2 + 0.1 * std::cos(step * i) - 0.4 * std::sin(step * i));
  }
  for (const double value : shapegcode::without_line(line)) CHECK(std::abs(value) < 1e-12);
  for (const double value : shapegcode::without_circle(circle, step)) CHECK(std::abs(value) < 1e-12);
  for (const double value : shapegcode::without_circle(line, 1e-5)) CHECK(std::abs(value) < 1e-12);
  CHECK(shapegcode::without_line({}).empty());
}

TEST_CASE("roughness: cut-offs of the standard, and what is too short") {
  CHECK(standard_cutoff_mm(20.0, 0.05) == 0.8);
  CHECK(standard_cutoff_mm(5.6, 0.05) == 0.8);
  CHECK(standard_cutoff_mm(5.5, 0.05) == 0.25);
  CHECK(standard_cutoff_mm(1.0, 0.01) == 0.08);
  CHECK_FALSE(standard_cutoff_mm(1.0, 0.05).has_value());
  CHECK_THROWS_AS(static_cast<void>(measure_roughness(wave(1.0, 1.0, 200), spacing, 0.8)), shapegcode::Error);
  CHECK_THROWS_AS(static_cast<void>(gaussian_low_pass(wave(1.0, 1.0), 0.0, 0.8)), shapegcode::Error);
  CHECK_THROWS_WITH_AS(static_cast<void>(gaussian_low_pass(wave(1.0, 1.0), 1e-7, -1e-7)),
                       "spacing 1e-07 mm and cut-off -1e-07 mm must be > 0", shapegcode::Error);
  CHECK_THROWS_WITH_AS(static_cast<void>(gaussian_low_pass(std::vector<double>{0.0, std::nan("")}, 0.01, 0.8)),
                       "the profile is not finite at station 1", shapegcode::Error);
  // A cut-off of more spacings than an integer counts: the mean, and no profile is long enough.
  CHECK(gaussian_low_pass(std::vector<double>{1.0, 3.0}, 1e-300, 1e300) == std::vector<double>{2.0, 2.0});
  CHECK_THROWS_AS(static_cast<void>(measure_roughness(wave(1.0, 1.0, 200), 1e-300, 0.8)), shapegcode::Error);
}
