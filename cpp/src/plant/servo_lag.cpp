#include "shapegcode/plant/servo_lag.hpp"

#include <cmath>
#include <string>

#include "shapegcode/error.hpp"

namespace shapegcode {

ServoLag::ServoLag(const Vector3& position_gain_per_s, const Vector3& feed_forward_ratio, double period_s) {
  if (!(period_s > 0.0)) {
    throw Error(ErrorKind::argument, "interpolation period is " + std::to_string(period_s) + " s, must be > 0");
  }
  for (int i = 0; i < axis_count; ++i) {
    const double gain = position_gain_per_s[i];
    const double forward = feed_forward_ratio[i];
    if (!(gain > 0.0) || !std::isfinite(gain)) {
      throw Error(ErrorKind::argument, "position gain is " + std::to_string(gain) + " 1/s, must be > 0 and finite");
    }
    if (!(forward >= 0.0 && forward <= 1.0)) {
      throw Error(ErrorKind::argument, "feed-forward ratio is " + std::to_string(forward) + ", must be 0 to 1");
    }
    // e' = (1 - a) r' - K e over one period in which r' is constant.
    decay_[i] = std::exp(-gain * period_s);
    share_[i] = (1.0 - forward) * -std::expm1(-gain * period_s) / (gain * period_s);
  }
}

void ServoLag::reset(const Vector3& position) noexcept {
  setpoint_ = position;
  error_mm_ = Vector3::Zero();
}

Vector3 ServoLag::step(const Vector3& setpoint) noexcept {
  error_mm_ = decay_.cwiseProduct(error_mm_) + share_.cwiseProduct(setpoint - setpoint_);
  setpoint_ = setpoint;
  return setpoint - error_mm_;
}

}  // namespace shapegcode
