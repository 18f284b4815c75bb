#include <doctest/doctest.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <limits>
#include <numbers>
#include <random>
#include <vector>

#include "shapegcode/error.hpp"
#include "shapegcode/filter.hpp"

using shapegcode::Error;
using shapegcode::Fir;
using shapegcode::FirStream;
using shapegcode::Samples;

namespace {

std::vector<double> random_walk(std::size_t count, unsigned seed) {
  std::mt19937_64 generator(seed);
  std::normal_distribution<double> increment(0.01, 0.1);
  std::vector<double> values(count);
  double position = 123.456;
  for (double& value : values) value = position += increment(generator);
  return values;
}

Fir spread_taps(int n_taps, int spacing) {
  std::vector<int> delays;
  std::vector<double> taps;
  double rest = 1.0;
  for (int k = 0; k < n_taps; ++k) {
    delays.push_back(k * spacing + k / 3);
    taps.push_back(k + 1 < n_taps ? (k % 2 == 0 ? 1.3 : -0.4) / n_taps : rest);
    rest -= taps.back();
  }
  return {delays, taps};
}

std::vector<double> streamed(const Fir& fir, const std::vector<double>& in) {
  FirStream stream(fir, 1);
  stream.reset(std::span(in).first(1));
  std::vector<double> out;
  for (std::size_t i = 0; i < in.size() + static_cast<std::size_t>(fir.duration_samples()); ++i) {
    double value = i < in.size() ? in[i] : in.back();
    stream.step({&value, 1}, {&value, 1});
    out.push_back(value);
  }
  return out;
}

std::vector<double> filtered(const Fir& fir, const std::vector<double>& in) {
  std::vector<double> out(in.size() + static_cast<std::size_t>(fir.duration_samples()));
  fir.apply(in, out);
  return out;
}

bool same_bits(const std::vector<double>& a, const std::vector<double>& b) {
  return a.size() == b.size() && std::memcmp(a.data(), b.data(), a.size() * sizeof(double)) == 0;
}

}  // namespace

TEST_CASE("fir: refuses what is not a filter") {
  const double nan = std::numeric_limits<double>::quiet_NaN();
  CHECK_THROWS_AS(Fir({}, {}), Error);
  CHECK_THROWS_AS(Fir({0, 1}, {1.0}), Error);
  CHECK_THROWS_AS(Fir({-1, 1}, {0.5, 0.5}), Error);
  CHECK_THROWS_AS(Fir({1, 1}, {0.5, 0.5}), Error);
  CHECK_THROWS_AS(Fir({2, 1}, {0.5, 0.5}), Error);
  CHECK_THROWS_AS(Fir({0, 1}, {0.5, nan}), Error);
  CHECK_THROWS_AS(Fir({0, 1}, {0.5, 0.5 + 2e-9}), Error);
  CHECK_NOTHROW(Fir({0, 1}, {0.5, 0.5 + 0.5e-9}));
  CHECK_THROWS_AS(Fir::moving_average(0), Error);
  for (const double constant : {0.0, -1.0, nan, 1e300}) CHECK_THROWS_AS(Fir::exponential(constant), Error);
  for (const double rest : {0.0, 1.0, -0.1, nan}) CHECK_THROWS_AS(Fir::exponential(5.0, rest), Error);
  CHECK_THROWS_AS(FirStream(Fir::moving_average(2), 0), Error);
  std::vector<double> in(3, 1.0);
  std::vector<double> out(3);
  CHECK_THROWS_AS(Fir::moving_average(2).apply(in, out), Error);
  CHECK_THROWS_AS(Fir({0}, {1.0}).apply(std::span<const double>(), std::span<double>()), Error);
  CHECK_THROWS_AS((void)Fir({0}, {1.0}).apply(Samples{1e-3, Eigen::MatrixXd(0, 3)}), Error);
}

TEST_CASE("fir: moments") {
  const Fir average = Fir::moving_average(50);
  CHECK(average.duration_samples() == 49);
  CHECK(average.mean_samples() == doctest::Approx(24.5));
  CHECK(average.variance_samples2() == doctest::Approx((2500.0 - 1.0) / 12.0));
  const Fir same(average.delays(), average.taps());
  CHECK_FALSE(same.is_moving_average());
  CHECK(same.variance_samples2() == doctest::Approx(average.variance_samples2()));
  const Fir zv({0, 4}, {0.6, 0.4});
  CHECK(zv.mean_samples() == doctest::Approx(1.6));
  CHECK(zv.variance_samples2() == doctest::Approx(0.24 * 16.0));
}

TEST_CASE("fir: on a finer grid the taps stay and the delays are multiplied") {
  const Fir finer = Fir({0, 3, 7}, {0.5, 0.25, 0.25}).on_finer_grid(3);
  CHECK(finer.delays() == std::vector<int>{0, 9, 21});
  CHECK(finer.taps() == std::vector<double>{0.5, 0.25, 0.25});
  CHECK(Fir::moving_average(3).on_finer_grid(2).delays() == std::vector<int>{0, 2, 4});
  CHECK_FALSE(Fir::moving_average(3).on_finer_grid(2).is_moving_average());
  CHECK_THROWS_AS((void)finer.on_finer_grid(0), Error);
}

TEST_CASE("fir: holds the first value before the start and the last after the end") {
  const std::vector<double> out = filtered(Fir({1, 3}, {0.25, 0.75}), {2.0, 4.0, 8.0});
  const std::vector<double> expected{2.0, 2.0, 2.5, 3.5, 5.0, 8.0};
  REQUIRE(out.size() == expected.size());
  for (std::size_t i = 0; i < out.size(); ++i) CHECK(out[i] == expected[i]);
  CHECK(filtered(Fir::moving_average(4), {1.0, 5.0}) == std::vector<double>{1.0, 2.0, 3.0, 4.0, 5.0});
}

TEST_CASE("fir: batch and stream agree to the last bit") {
  for (const std::size_t rows : {1u, 2u, 7u, 100u, 1023u, 1024u, 1025u, 5000u}) {
    const std::vector<double> in = random_walk(rows, static_cast<unsigned>(rows));
    for (const int n_taps : {1, 2, 3, 4, 5, 6, 7, 8, 9, 16, 17, 23}) {
      for (const int spacing : {1, 11}) {
        const Fir fir = spread_taps(n_taps, spacing);
        CAPTURE(rows);
        CAPTURE(n_taps);
        CHECK(same_bits(filtered(fir, in), streamed(fir, in)));
      }
    }
    for (const int length : {1, 2, 3, 50, 64, 1024, 3000}) {
      CAPTURE(rows);
      CAPTURE(length);
      CHECK(same_bits(filtered(Fir::moving_average(length), in), streamed(Fir::moving_average(length), in)));
    }
    for (const double constant : {0.05, 1.0, 7.3, 60.0, 400.0}) {
      CAPTURE(rows);
      CAPTURE(constant);
      const Fir fir = Fir::exponential(constant, 1e-3);
      CHECK(same_bits(filtered(fir, in), streamed(fir, in)));
    }
  }
}

TEST_CASE("fir: every form gives the same, all axes at once") {
  for (const Fir& fir : {spread_taps(3, 7), spread_taps(20, 2), Fir::moving_average(50), Fir::exponential(12.5)}) {
    Samples in{1e-3, Eigen::MatrixXd(4000, 3)};
    for (int axis = 0; axis < 3; ++axis) {
      const std::vector<double> walk = random_walk(4000, static_cast<unsigned>(axis));
      for (Eigen::Index i = 0; i < 4000; ++i) in.positions_mm(i, axis) = walk[static_cast<std::size_t>(i)];
    }
    const Samples out = fir.apply(in);
    CHECK(out.period_s == in.period_s);
    REQUIRE(out.positions_mm.rows() == 4000 + fir.duration_samples());
    Eigen::MatrixXd raw(out.positions_mm.rows(), 3);
    fir.apply(in.positions_mm.data(), 4000, 3, raw.data());
    CHECK(raw == out.positions_mm);

    FirStream stream(fir, 3);
    Eigen::Vector3d position = in.positions_mm.row(0);
    stream.reset({position.data(), 3});
    int differing = 0;
    for (Eigen::Index i = 0; i < out.positions_mm.rows(); ++i) {
      position = in.positions_mm.row(std::min<Eigen::Index>(i, 3999));
      stream.step({position.data(), 3}, {position.data(), 3});
      if (position.transpose() != out.positions_mm.row(i)) ++differing;
    }
    CHECK(differing == 0);
  }
}

TEST_CASE("fir: a moving average is its taps") {
  const std::vector<double> in = random_walk(2000, 5);
  const Fir fast = Fir::moving_average(37);
  const std::vector<double> a = filtered(fast, in);
  const std::vector<double> b = filtered(Fir(fast.delays(), fast.taps()), in);
  for (std::size_t i = 0; i < a.size(); ++i) CHECK(std::abs(a[i] - b[i]) < 1e-12);
  CHECK(std::abs(a.back() - in.back()) < 1e-13);
}

TEST_CASE("fir: an exponential is its taps, cut off where the share is left, and rests exactly behind them") {
  const std::vector<double> in = random_walk(3000, 6);
  for (const double constant : {0.3, 4.0, 50.0}) {
    const Fir fast = Fir::exponential(constant, 1e-3);
    CHECK(fast.taps().size() == static_cast<std::size_t>(std::ceil(constant * std::log(1e3))));
    for (std::size_t k = 1; k < fast.taps().size(); ++k) {
      CHECK(fast.taps()[k] / fast.taps()[k - 1] == doctest::Approx(std::exp(-1.0 / constant)));
    }
    const std::vector<double> a = filtered(fast, in);
    const std::vector<double> b = filtered(Fir(fast.delays(), fast.taps()), in);
    for (std::size_t i = 0; i < a.size(); ++i) CHECK(std::abs(a[i] - b[i]) < 1e-10);
    CHECK(a.back() == in.back());
  }
  // The variance of an exponential acceleration is A^2.
  CHECK(Fir::exponential(200.0, 1e-9).variance_samples2() == doctest::Approx(200.0 * 200.0).epsilon(1e-5));
}

TEST_CASE("fir: a moving average does not drift in 1e8 real-time steps") {
  constexpr int length = 50;
  constexpr long steps = 100'000'000;
  // Climbs to 1e4 mm and back with increments that are no binary fraction, beside a small unrelated oscillation.
  const double up = std::sqrt(2.0) * 2e-4;
  double position = std::numbers::pi;
  double slope = up;
  double ripple = 1e-3;
  const auto next = [&] {
    position += slope;
    if (position > 1e4) slope = -up * 0.7320508;
    if (position < 0.0) slope = up;
    ripple = -ripple * 0.999999999;
    return position + ripple;
  };
  FirStream stream(Fir::moving_average(length), 1);
  std::vector<double> last(length, position);
  stream.reset({&position, 1});
  double worst = 0.0;
  for (long i = 0; i < steps; ++i) {
    const double in = next();
    double out = in;
    stream.step({&out, 1}, {&out, 1});
    if (i % 1'000'000 > 1'000'000 - 1 - length) last[static_cast<std::size_t>(i % length)] = in;
    if ((i + 1) % 1'000'000 == 0) {
      long double sum = 0.0L;
      for (const double value : last) sum += static_cast<long double>(value);
      worst = std::max(worst, static_cast<double>(std::abs(sum / length - static_cast<long double>(out))));
    }
  }
  MESSAGE("largest error " << worst << " mm");
  CHECK(worst < 4e-12);
}

TEST_CASE("fir: delays that no int holds on a finer grid or in a row of axes") {
  CHECK_THROWS_WITH_AS(Fir({0, 2147483647}, {0.5, 0.5}), "filter delay 2147483647, at most 100000000 is possible",
                       Error);
  CHECK_THROWS_WITH_AS(Fir({0, 5}, {0.5, 0.5}).on_finer_grid(2'000'000'000),
                       "filter delay 5 on a grid 2000000000 times as fine, at most 100000000 is possible", Error);
  CHECK(Fir({0, 5}, {0.5, 0.5}).on_finer_grid(20'000'000).duration_samples() == 100'000'000);
  CHECK_THROWS_WITH_AS(Fir::moving_average(2147483647),
                       "moving average over 2147483647 samples, at most 100000000 are possible", Error);
}
