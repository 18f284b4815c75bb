#include "shapegcode/prototype.hpp"

#include <doctest/doctest.h>

#include <cmath>
#include <complex>
#include <numbers>
#include <vector>

namespace {

using shapegcode::Fir;
using shapegcode::make_line;
using shapegcode::Mode;
using shapegcode::MotionLimits;
using shapegcode::Path;
using shapegcode::ShapedMotion;
using shapegcode::values_of;
using shapegcode::Vector3;

constexpr double period_s = 0.005;
const std::vector<Mode> modes = {{46.0, 0.02, 1.0}, {131.0, 0.02, 1.0}};

Path corner() { return Path({make_line({1, 2, 3}, {41, 2, 3}, 200.0), make_line({41, 2, 3}, {41, 42, 3}, 200.0)}); }

// What a command that is linear between its samples leaves of a mode: d'' + 2 zeta w d' + w^2 d = -x'' is driven by the
// jumps of x', so the vibration at the end is the sum of their free decays, |sum dv_k e^(-s (T - t_k))| / w_d.
double left_mm(const std::vector<double>& x, const Mode& mode) {
  const double w = 2.0 * std::numbers::pi * mode.frequency_hz;
  const double damped = w * std::sqrt(1.0 - mode.damping_ratio * mode.damping_ratio);
  const std::complex<double> s(-mode.damping_ratio * w, damped);
  std::complex<double> sum = 0.0;
  const auto n = static_cast<double>(x.size());
  for (std::size_t k = 0; k < x.size(); ++k) {
    const double before = k == 0 ? 0.0 : x[k] - x[k - 1];
    const double after = k + 1 == x.size() ? 0.0 : x[k + 1] - x[k];
    sum += (after - before) / period_s * std::exp(s * ((n - 1.0 - static_cast<double>(k)) * period_s));
  }
  return std::abs(sum) / damped;
}

}  // namespace

TEST_CASE("a prototype's set-points begin and end where the path does and leave the modes at rest") {
  ShapedMotion shaped(corner(), MotionLimits{}, modes, period_s);
  ShapedMotion plain(corner(), MotionLimits{}, Fir({0}, {1.0}), period_s);
  double left[2] = {0.0, 0.0};
  int run = 0;
  for (ShapedMotion* motion : {&shaped, &plain}) {
    const std::size_t count = motion->sample_count();
    std::vector<double> x;
    Vector3 at;
    while (motion->step(values_of(at))) {
      if (x.empty()) CHECK((at - Vector3(1, 2, 3)).norm() < 1e-12);
      x.push_back(at[0]);
    }
    CHECK(x.size() == count);
    CHECK((at - Vector3(41, 42, 3)).norm() < 1e-12);
    for (const Mode& mode : modes) left[run] = std::max(left[run], left_mm(x, mode));
    ++run;
  }
  CHECK(left[0] < 1e-9);
  CHECK(left[1] > 1e-3);
}

TEST_CASE("a path without segments is refused") {
  CHECK_THROWS_AS(ShapedMotion(Path{}, MotionLimits{}, modes, period_s), shapegcode::Error);
}
