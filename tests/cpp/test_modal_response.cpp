#include <doctest/doctest.h>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <numbers>
#include <random>
#include <vector>

#include "shapegcode/error.hpp"
#include "shapegcode/plant/modal.hpp"

using Eigen::Index;
using Eigen::MatrixXd;
using shapegcode::Error;
using shapegcode::ModalResponse;
using shapegcode::Mode;
using shapegcode::plant_response;

namespace {

using Modes = std::vector<std::vector<Mode>>;

constexpr double period_s = 1e-3;

/// Set-points that ramp, jump and rest.
MatrixXd command(Index rows, Index axes) {
  std::mt19937 random(7);
  std::normal_distribution<double> step(0.0, 0.1);
  MatrixXd samples(rows, axes);
  for (Index a = 0; a < axes; ++a) {
    double at = 100.0 * static_cast<double>(a) - 50.0;
    for (Index k = 0; k < rows; ++k) samples(k, a) = at += k % 300 < 200 ? step(random) : 0.0;
  }
  return samples;
}

MatrixXd streamed(const MatrixXd& samples, const Modes& modes) {
  shapegcode::AxisModes by_axis;
  std::copy(modes.begin(), modes.end(), by_axis.begin());
  shapegcode::ModalPlant plant(by_axis, period_s);
  shapegcode::Vector3 row = shapegcode::Vector3::Zero();
  MatrixXd response = samples;
  for (Index k = 0; k < samples.rows(); ++k) {
    row.head(samples.cols()) = samples.row(k);
    if (k == 0) plant.reset(row);
    response.row(k) = k == 0 ? row.head(samples.cols()) : plant.step(row).head(samples.cols());
  }
  return response;
}

std::vector<Mode> some_modes(int count) {
  std::vector<Mode> modes;
  for (int m = 0; m < count; ++m) modes.push_back({46.0 + 37.0 * m, 0.03 * (m % 4), 1.0 / (1.0 + m)});
  return modes;
}

}  // namespace

TEST_CASE("modal response: ModalPlant's to the last bit, whatever the number of axes and modes") {
  const std::vector<Modes> plants = {
      {some_modes(1)},
      {some_modes(2), some_modes(2)},
      {some_modes(0), some_modes(3)},
      {some_modes(5), some_modes(1), some_modes(9)},
      {{}, {}, some_modes(4)},
      {{}},
  };
  for (const Modes& modes : plants) {
    const MatrixXd samples = command(1500, static_cast<Index>(modes.size()));
    CHECK(plant_response(samples, modes, period_s) == streamed(samples, modes));
  }
}

TEST_CASE("modal response: modes that other axes excite") {
  const Mode crossing{46.0, 0.02, 0.7, {0.5, -2.0, 0.0}};
  for (const Modes& modes :
       {Modes{{crossing}, some_modes(2)}, Modes{some_modes(1), {}, {crossing, {30.0, 0.01, 1.0}}}}) {
    const MatrixXd samples = command(1200, static_cast<Index>(modes.size()));
    const MatrixXd whole = plant_response(samples, modes, period_s);
    CHECK(whole == streamed(samples, modes));
    ModalResponse plant(modes, period_s);
    MatrixXd pieces = samples;
    plant.apply(samples.topRows(701), pieces.topRows(701));
    plant.apply(samples.bottomRows(499), pieces.bottomRows(499));
    CHECK(pieces == whole);
  }
  CHECK_THROWS_AS((void)plant_response(command(20, 4), {{crossing}, {}, {}, {}}, period_s), Error);
}

TEST_CASE("modal response: more axes than three are as good") {
  const MatrixXd samples = command(700, 5);
  const Modes modes{some_modes(1), some_modes(2), some_modes(3), some_modes(0), some_modes(2)};
  const MatrixXd together = plant_response(samples, modes, period_s);
  for (Index a = 0; a < 5; ++a) {
    CHECK(together.col(a) == plant_response(samples.col(a), {modes[static_cast<std::size_t>(a)]}, period_s));
  }
}

TEST_CASE("modal response: in pieces, in place and by rows") {
  const MatrixXd samples = command(2000, 2);
  const Modes modes{some_modes(2), some_modes(3)};
  const MatrixXd whole = plant_response(samples, modes, period_s);
  ModalResponse plant(modes, period_s);
  Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor> rows = samples;
  Eigen::Map<MatrixXd, 0, Eigen::Stride<Eigen::Dynamic, Eigen::Dynamic>> by_row(rows.data(), 2000, 2, {1, 2});
  Index first = 0;
  for (const Index count : {1, 0, 511, 512, 513, 463}) {
    plant.apply(by_row.middleRows(first, count), by_row.middleRows(first, count));
    first += count;
  }
  CHECK(first == 2000);
  CHECK(rows == whole);
}

TEST_CASE("modal response: an undamped mode after ten million samples is that of the closed form") {
  // A ramp of 100 samples from rest: d'' + omega^2 d = -x'' leaves (sin(omega (t - T)) - sin(omega t)) v / omega.
  constexpr std::int64_t samples = 10'000'000;
  constexpr Index piece = 100'000;
  constexpr int frequency_hz = 131;
  constexpr int ramp = 100;
  ModalResponse plant({{{frequency_hz, 0.0, 1.0}}}, period_s);
  MatrixXd record(piece, 1);
  double worst = 0.0;
  for (std::int64_t first = 0; first < samples; first += piece) {
    for (Index k = 0; k < piece; ++k) record(k, 0) = static_cast<double>(std::min<std::int64_t>(first + k, ramp));
    plant.apply(record, record);
    if (first + piece < samples) continue;
    const auto sine = [](std::int64_t k) {  // of omega*k*period_s, whole turns left out
      return std::sin(2.0 * std::numbers::pi * static_cast<double>(frequency_hz * k % 1000) / 1000.0);
    };
    const double amplitude = 1.0 / (2.0 * std::numbers::pi * frequency_hz * period_s);
    for (Index k = 0; k < piece; ++k) {
      const double expected = ramp + amplitude * (sine(first + k - ramp) - sine(first + k));
      worst = std::max(worst, std::abs(record(k, 0) - expected));
    }
  }
  CHECK(worst < 2e-9);
}

TEST_CASE("modal response: what dies away is none, and costs no more") {
  MatrixXd samples = MatrixXd::Zero(400'000, 1);
  samples.topRows(10).setConstant(1.0);
  const MatrixXd response = plant_response(samples, {{{46.0, 0.02, 1.0}}}, period_s);
  CHECK(response(399'999, 0) == 0.0);
  CHECK(std::abs(response(20'000, 0)) > 0.0);
}

TEST_CASE("modal response: refusals") {
  const double nan = std::numeric_limits<double>::quiet_NaN();
  const MatrixXd samples = command(20, 2);
  const Modes good{some_modes(1), some_modes(1)};
  CHECK_THROWS_AS((void)plant_response(samples, good, 0.0), Error);
  CHECK_THROWS_AS((void)plant_response(samples, good, nan), Error);
  CHECK_THROWS_AS((void)plant_response(samples, {}, period_s), Error);
  CHECK_THROWS_AS((void)plant_response(samples, {some_modes(1)}, period_s), Error);
  CHECK_THROWS_AS((void)plant_response(samples, {{{46.0, 1.0, 1.0}}, {}}, period_s), Error);
  CHECK_THROWS_AS((void)plant_response(samples, {{{46.0, 0.02, nan}}, {}}, period_s), Error);
  for (const double bad : {nan, std::numeric_limits<double>::infinity()}) {
    MatrixXd spoilt = samples;
    spoilt(13, 1) = bad;
    CHECK_THROWS_AS((void)plant_response(spoilt, {some_modes(1), {}}, period_s), Error);
  }
  MatrixXd shorter(19, 2);
  ModalResponse plant(good, period_s);
  CHECK_THROWS_AS(plant.apply(samples, shorter), Error);
}
