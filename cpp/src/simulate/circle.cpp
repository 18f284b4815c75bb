#include "shapegcode/timing.hpp"

#include <cmath>
#include <numbers>

#include "base/checks.hpp"
#include "shapegcode/plant/servo_lag.hpp"

namespace shapegcode {

CircleFigures simulate_circle(double radius_mm, double feed_mm_per_s, const FanucModel& model) {
  check(model);
  require_above_zero(radius_mm, "radius of a circle", "mm");
  require_above_zero(feed_mm_per_s, "feed on a circle", "mm/s");
  constexpr double max_samples = 1e9;
  constexpr double memory = 40.0;  // time constants of the servo loop after which a transient is rounding error
  const double turn = 2.0 * std::numbers::pi * radius_mm / feed_mm_per_s / model.period_s;
  const std::int64_t count = require_count(std::ceil(turn), max_samples, "a turn", "periods");
  const std::vector<Fir> designs = acceleration_filters(model);
  std::vector<FirStream> filters;
  filters.reserve(designs.size());
  for (const Fir& design : designs) {
    filters.emplace_back(design, axis_count);
  }
  ServoLag servo(model.position_gain_per_s, model.feed_forward_ratio, model.period_s);
  Vector3 position(radius_mm, 0.0, 0.0);
  for (FirStream& filter : filters) {
    filter.reset(values_of(position));
  }
  servo.reset(position);
  const double settling = filter_periods(designs) + memory / (model.position_gain_per_s.minCoeff() * model.period_s);
  const std::int64_t begin = require_count(std::ceil(settling), max_samples, "the servo loop's settling", "periods");
  const double step_rad = feed_mm_per_s * model.period_s / radius_mm;
  double command_sum = 0.0;
  double response_sum = 0.0;
  for (std::int64_t i = 1; i < begin + count; ++i) {
    const double angle = step_rad * static_cast<double>(i);
    position = Vector3(radius_mm * std::cos(angle), radius_mm * std::sin(angle), 0.0);
    for (FirStream& filter : filters) {
      filter.step(values_of(position), values_of(position));
    }
    const Vector3 response = servo.step(position);
    if (i >= begin) {
      command_sum += radius_mm - position.norm();
      response_sum += radius_mm - response.norm();
    }
  }
  return {command_sum / static_cast<double>(count), response_sum / static_cast<double>(count)};
}

}  // namespace shapegcode
