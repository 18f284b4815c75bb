#include "shapegcode/motion.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

namespace shapegcode {

SpeedProfile::SpeedProfile(std::vector<SpeedPhase> phases, double length_mm, double jerk_time_s)
    : phases_(std::move(phases)), length_mm_(length_mm), jerk_time_s_(jerk_time_s) {
  double time = 0.0;
  for (SpeedPhase& phase : phases_) {
    phase.start_s = time;
    time += phase.duration_s;
  }
  duration_s_ = time;
}

void SpeedProfile::seek(double time_s, std::size_t& cursor) const noexcept {
  cursor = std::min(cursor, phases_.size() - 1);
  while (cursor > 0 && time_s < phases_[cursor].start_s) {
    --cursor;
  }
  while (cursor + 1 < phases_.size() && time_s >= phases_[cursor + 1].start_s) {
    ++cursor;
  }
}

double SpeedProfile::distance_mm(double time_s, std::size_t& cursor) const noexcept {
  if (phases_.empty() || time_s >= duration_s_) {
    return length_mm_;
  }
  if (time_s <= 0.0) {
    return 0.0;
  }
  seek(time_s, cursor);
  return phases_[cursor].distance_at(time_s);
}

double SpeedProfile::speed_mm_per_s(double time_s, std::size_t& cursor) const noexcept {
  if (phases_.empty() || time_s < 0.0 || time_s >= duration_s_) {
    return 0.0;
  }
  seek(time_s, cursor);
  const SpeedPhase& phase = phases_[cursor];
  return phase.speed_mm_per_s + phase.acceleration_mm_per_s2 * (time_s - phase.start_s);
}

double SpeedProfile::time_s(double distance_mm, std::size_t& cursor) const noexcept {
  if (phases_.empty() || distance_mm <= 0.0) {
    return 0.0;
  }
  if (distance_mm >= length_mm_) {
    return duration_s_;
  }
  cursor = std::min(cursor, phases_.size() - 1);
  while (cursor > 0 && distance_mm < phases_[cursor].distance_mm) {
    --cursor;
  }
  while (cursor + 1 < phases_.size() && distance_mm >= phases_[cursor + 1].distance_mm) {
    ++cursor;
  }
  const SpeedPhase& phase = phases_[cursor];
  const double d = distance_mm - phase.distance_mm;
  const double v = phase.speed_mm_per_s;
  // d = v t + a t^2 / 2, in the form that stays exact for a = 0.
  const double root = std::sqrt(std::max(0.0, v * v + 2.0 * phase.acceleration_mm_per_s2 * d));
  const double t = v + root > 0.0 ? 2.0 * d / (v + root) : 0.0;
  return phase.start_s + std::min(t, phase.duration_s);
}

}  // namespace shapegcode
