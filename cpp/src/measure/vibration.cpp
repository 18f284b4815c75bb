#include "shapegcode/measure/sections.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

#include "base/checks.hpp"
#include "base/refuse.hpp"

namespace shapegcode {
namespace {

using detail::refuse;

constexpr double still_mm = 1e-9;
constexpr double unproved_share = 0.125;

// Height of the parabola through three values one apart where the middle one is the largest, else 0.
double vertex(double before, double middle, double after) noexcept {
  const double bend = before - 2.0 * middle + after;
  if (!(middle >= before && middle >= after && bend < 0.0)) return 0.0;
  const double slope = 0.5 * (after - before);
  return middle - 0.5 * slope * slope / bend;
}

}  // namespace

VibrationWatch::VibrationWatch(double period_s, double band_mm) : period_(period_s), band_(band_mm) {
  require_period(period_s);
  require_above_zero(band_mm, "band", "mm");
}

bool VibrationWatch::moves(const Vector3& command) const noexcept {
  return count_ > 0 && (command - last_command_).cwiseAbs().maxCoeff() > still_mm;
}

Vector3 VibrationWatch::step(const Vector3& command, const Vector3& response) noexcept {
  const Vector3 now = response - command;
  Vector3 peak = now.cwiseAbs();
  if (moves(command)) {
    rest_begin_ = count_;
    residual_.setZero();
    outside_.setConstant(-1.0);
  }
  // The vertex lies about the sample before this one: it is in the rest only if that sample is.
  const bool vertex_rests = count_ > rest_begin_ + 1;
  for (Eigen::Index axis = 0; axis < axis_count; ++axis) {
    double rest_peak = peak[axis];
    if (count_ >= 2) {
      const double sign = last_[axis] < 0.0 ? -1.0 : 1.0;
      const double between = vertex(sign * before_last_[axis], sign * last_[axis], sign * now[axis]);
      peak[axis] = std::max(peak[axis], between);
      if (vertex_rests) rest_peak = std::max(rest_peak, between);
      if (vertex_rests && between > band_) outside_[axis] = static_cast<double>(count_ - 1 - rest_begin_);
    }
    residual_[axis] = std::max(residual_[axis], rest_peak);
    if (std::abs(now[axis]) > band_) outside_[axis] = static_cast<double>(count_ - rest_begin_);
  }
  before_last_ = last_;
  last_ = now;
  last_command_ = command;
  ++count_;
  return peak;
}

RestVibration VibrationWatch::rest() const noexcept {
  RestVibration rest;
  if (count_ == 0) return rest;
  const double observed = static_cast<double>(count_ - 1 - rest_begin_);
  rest.begin_s = static_cast<double>(rest_begin_) * period_;
  rest.observed_s = observed * period_;
  rest.residual_mm = residual_;
  for (Eigen::Index axis = 0; axis < axis_count; ++axis) {
    const bool proved = outside_[axis] < 0.0 || outside_[axis] + 1.0 <= (1.0 - unproved_share) * observed;
    rest.settling_s[axis] = proved ? (outside_[axis] + 1.0) * period_ : std::numeric_limits<double>::quiet_NaN();
  }
  return rest;
}

}  // namespace shapegcode
