#include "shapegcode/plant/servo_lag.hpp"

#include <cmath>

#include "base/checks.hpp"
#include "base/rest.hpp"

namespace shapegcode {

ServoLag::ServoLag(const Vector3& position_gain_per_s, const Vector3& feed_forward_ratio, double period_s) {
  require_period(period_s);
  for (int i = 0; i < axis_count; ++i) {
    const double gain = position_gain_per_s[i];
    const double forward = feed_forward_ratio[i];
    require_above_zero(gain, "position gain", "1/s");
    require(forward >= 0.0 && forward <= 1.0, "feed-forward ratio", forward, "", "0 to 1");
    // e' = (1 - a) r' - K e over one period in which r' is constant.
    decay_[i] = std::exp(-gain * period_s);
    share_[i] = (1.0 - forward) * -std::expm1(-gain * period_s) / (gain * period_s);
  }
}

void ServoLag::reset(const Vector3& position) noexcept {
  setpoint_ = position;
  error_mm_ = Vector3::Zero();
  row_ = 0;
}

Vector3 ServoLag::step(const Vector3& setpoint) noexcept {
  error_mm_ = decay_.cwiseProduct(error_mm_) + share_.cwiseProduct(setpoint - setpoint_);
  // Not in every period: errors written one by one keep the next step waiting, which reads them together.
  if (++row_ % rows_between_looks == 0) {
    for (double& error : error_mm_) error = state_or_none(error);
  }
  setpoint_ = setpoint;
  return setpoint - error_mm_;
}

}  // namespace shapegcode
