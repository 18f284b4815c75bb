#include <doctest/doctest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <random>
#include <vector>

#include "shapegcode/error.hpp"
#include "shapegcode/filter.hpp"

using Eigen::Index;
using shapegcode::Error;
using shapegcode::Fir;
using shapegcode::FollowingFir;
using shapegcode::Samples;
using shapegcode::VaryingFir;
using shapegcode::VaryingFirStream;

namespace {

Samples random_walk(Index rows, Index axes, unsigned seed) {
  std::mt19937 random(seed);
  std::uniform_real_distribution<double> step(-0.2, 0.3);
  Samples samples;
  samples.period_s = 1e-3;
  samples.positions_mm.resize(rows, axes);
  for (Index axis = 0; axis < axes; ++axis) {
    double at = 10.0 * static_cast<double>(axis);
    for (Index row = 0; row < rows; ++row) {
      samples.positions_mm(row, axis) = at;
      at += row % 7 == 0 ? 0.0 : step(random);
    }
  }
  return samples;
}

const std::vector<Fir> three{Fir({0, 3, 7}, {0.5, 0.2, 0.3}), Fir({0}, {1.0}), Fir({1, 12}, {0.4, 0.6})};

}  // namespace

TEST_CASE("varying fir: one filter of the set throughout is that filter") {
  const VaryingFir varying(three);
  CHECK(varying.duration_samples() == 12);
  CHECK(varying.mean_samples() == doctest::Approx((2.7 + 0.0 + 7.6) / 3.0));
  CHECK(varying.variance_samples2() == doctest::Approx(0.4 * 0.6 * 121.0));
  const Samples in = random_walk(300, 3, 1);
  for (std::size_t k = 0; k < three.size(); ++k) {
    const Samples out = varying.apply(in, std::vector<double>(300, static_cast<double>(k)));
    const Samples expected = three[k].apply(in);
    REQUIRE(out.positions_mm.rows() == 312);
    const Index rows = expected.positions_mm.rows();
    CHECK((out.positions_mm.topRows(rows) - expected.positions_mm).cwiseAbs().maxCoeff() < 1e-13);
    for (Index row = rows; row < 312; ++row) CHECK(out.positions_mm.row(row) == in.positions_mm.row(299));
  }
}

TEST_CASE("varying fir: each increment carries its own train (against the double sum)") {
  const VaryingFir varying(three);
  const Samples in = random_walk(200, 2, 2);
  std::mt19937 random(3);
  std::uniform_real_distribution<double> anywhere(-0.5, 2.5);
  std::vector<double> place(200);
  for (double& at : place) at = anywhere(random);
  const Samples out = varying.apply(in, place);
  double worst = 0.0;
  for (Index axis = 0; axis < 2; ++axis) {
    for (Index row = 0; row < out.positions_mm.rows(); ++row) {
      long double expected = in.positions_mm(0, axis);
      for (Index begin = 1; begin < 200; ++begin) {
        const double at = std::clamp(place[static_cast<std::size_t>(begin)], 0.0, 2.0);
        const long double increment = in.positions_mm(begin, axis) - in.positions_mm(begin - 1, axis);
        for (std::size_t k = 0; k < three.size(); ++k) {
          const double share = std::max(0.0, 1.0 - std::abs(at - static_cast<double>(k)));
          for (std::size_t tap = 0; tap < three[k].taps().size(); ++tap) {
            if (begin + three[k].delays()[tap] <= row) expected += share * three[k].taps()[tap] * increment;
          }
        }
      }
      worst = std::max(worst, std::abs(out.positions_mm(row, axis) - static_cast<double>(expected)));
    }
  }
  CHECK(worst < 1e-12);
  CHECK(out.positions_mm.row(out.positions_mm.rows() - 1) == in.positions_mm.row(199));

  // One output at a time, out of a kept input.
  std::vector<double> kept(12, in.positions_mm(0, 1));
  std::vector<double> kept_place(12, std::numeric_limits<double>::quiet_NaN());
  for (Index row = 0; row < out.positions_mm.rows(); ++row) {
    kept.push_back(in.positions_mm(std::min<Index>(row, 199), 1));
    kept_place.push_back(place[static_cast<std::size_t>(std::min<Index>(row, 199))]);
  }
  worst = 0.0;
  for (Index row = 0; row < out.positions_mm.rows(); ++row) {
    const auto at = static_cast<std::size_t>(row) + 12;
    worst = std::max(worst, std::abs(varying.value(&kept[at], &kept_place[at]) - out.positions_mm(row, 1)));
  }
  CHECK(worst < 1e-12);
}

TEST_CASE("varying fir: stream and batch agree to the last bit, no drift over a million samples") {
  const VaryingFir varying(three);
  const Index rows = 1'000'000;
  const Samples in = random_walk(rows, 3, 4);
  std::vector<double> place(static_cast<std::size_t>(rows));
  for (std::size_t i = 0; i < place.size(); ++i) place[i] = std::fmod(0.37 * static_cast<double>(i), 2.4);
  const Samples out = varying.apply(in, place);
  VaryingFirStream stream(varying, 3);
  Eigen::Vector3d position = in.positions_mm.row(0);
  stream.reset({position.data(), 3});
  bool same = true;
  for (Index row = 0; row < rows; ++row) {
    position = in.positions_mm.row(row);
    stream.step({position.data(), 3}, {position.data(), 3}, place[static_cast<std::size_t>(row)]);
    same = same && position.transpose() == out.positions_mm.row(row);
  }
  CHECK(same);
  // Before the end is held long enough to be exact, the lag holds a million roundings.
  CHECK((out.positions_mm.row(rows + 11) - in.positions_mm.row(rows - 1)).cwiseAbs().maxCoeff() < 1e-10);
}

TEST_CASE("varying fir: a step that is no place, a place beyond the set") {
  const VaryingFir varying(three);
  VaryingFirStream stream(varying, 1);
  for (const double place : {std::numeric_limits<double>::quiet_NaN(), -5.0, 0.0}) {
    double position = 0.0;
    stream.reset({&position, 1});
    position = 2.0;
    stream.step({&position, 1}, {&position, 1}, place);
    CHECK(position == doctest::Approx(1.0));
  }
  for (const double place : {1e300, std::numeric_limits<double>::infinity()}) {
    double position = 0.0;
    stream.reset({&position, 1});
    for (int i = 0; i < 2; ++i) {
      position = 2.0;
      stream.step({&position, 1}, {&position, 1}, place);
    }
    CHECK(position == doctest::Approx(0.8));
  }
}

TEST_CASE("varying fir: following an axis") {
  const FollowingFir following(VaryingFir(three), 1, {-10.0, 0.0, 30.0});
  CHECK(following.place(-11.0) == 0.0);
  CHECK(following.place(-10.0) == 0.0);
  CHECK(following.place(-2.5) == doctest::Approx(0.75));
  CHECK(following.place(0.0) == 1.0);
  CHECK(following.place(15.0) == doctest::Approx(1.5));
  CHECK(following.place(30.0) == 2.0);
  CHECK(following.place(1e9) == 2.0);
  CHECK(following.place(std::numeric_limits<double>::quiet_NaN()) == 0.0);

  const Samples in = random_walk(400, 3, 5);
  std::vector<double> place(400);
  for (Index row = 0; row < 400; ++row) {
    place[static_cast<std::size_t>(row)] =
        following.place(0.5 * (in.positions_mm(row, 1) + in.positions_mm(std::max<Index>(row - 1, 0), 1)));
  }
  CHECK(following.apply(in).positions_mm == following.fir().apply(in, place).positions_mm);

  // On a grid twice as fine, with samples twice as dense: every second one is the same where nothing varies.
  const FollowingFir finer = following.on_finer_grid(2);
  CHECK(finer.fir().set()[0].delays() == std::vector<int>{0, 6, 14});
  CHECK(finer.fir().duration_samples() == 24);
}

TEST_CASE("varying fir: refusals") {
  CHECK_THROWS_AS(VaryingFir({}), Error);
  const VaryingFir varying(three);
  CHECK_THROWS_AS((void)varying.on_finer_grid(0), Error);
  Samples in = random_walk(5, 3, 6);
  CHECK_THROWS_AS((void)varying.apply(in, std::vector<double>(4)), Error);
  const double nan = std::numeric_limits<double>::quiet_NaN();
  CHECK_THROWS_AS((void)varying.apply(in, std::vector<double>{0, 0, nan, 0, 0}), Error);
  CHECK_THROWS_AS((void)varying.apply(Samples{}, std::vector<double>{}), Error);
  CHECK_THROWS_AS(VaryingFirStream(varying, 0), Error);
  CHECK_THROWS_AS(FollowingFir(varying, 3, {0, 1, 2}), Error);
  CHECK_THROWS_AS(FollowingFir(varying, -1, {0, 1, 2}), Error);
  CHECK_THROWS_AS(FollowingFir(varying, 0, {0, 1}), Error);
  CHECK_THROWS_AS(FollowingFir(varying, 0, {0, 1, 1}), Error);
  CHECK_THROWS_AS(FollowingFir(varying, 0, {0, 1, nan}), Error);
  CHECK_THROWS_AS((void)FollowingFir(varying, 2, {0, 1, 2}).apply(random_walk(5, 2, 7)), Error);
}
