#include "controller/retrace.hpp"

#include <algorithm>
#include <cmath>

#include "controller/cubic.hpp"

namespace shapegcode {
namespace {

// Ratio to the original speed. The set-points then need a quarter of the acceleration and an eighth of the jerk.
constexpr double highest_pace = 0.5;
// What the change of the pace may take of acceleration and, twice, of the jerk: 3 pace' pace a and pace'' v.
constexpr double acceleration_share = 0.5;
constexpr double jerk_share = 0.4;

}  // namespace

Retrace::Retrace(std::size_t periods, const AxisLimits& limits, double period_s)
    : limits_(limits), period_s_(period_s), records_(periods), pace_(period_s) {}

JogResult Retrace::ask(double distance_mm) noexcept {
  if (!std::isfinite(distance_mm) || distance_mm < 0.0) return JogResult::not_finite;
  if (records_.empty()) return JogResult::no_record;
  if (!is_open_.load(std::memory_order_relaxed)) return JogResult::path_moves;
  asked_.store(distance_mm, std::memory_order_relaxed);
  return JogResult::accepted;
}

void Retrace::note(const PlannedPoint& point) noexcept {
  if (records_.empty()) return;
  const bool is_new = kept_ == 0 || back(0).position != point.position;
  if (!is_new) return;
  travelled_ += point.distance >= last_distance_ ? point.distance - last_distance_ : point.distance;
  last_distance_ = point.distance;
  for (std::size_t i = 0; i < limits_.axes; ++i) fastest_[i] = std::max(fastest_[i], std::abs(point.velocity[i]));
  records_[count_++ % records_.size()] = {point.position, point.velocity, travelled_};
  kept_ = std::min(kept_ + 1, records_.size());
}

// Where the path was so many mm before, as far as it is known.
double Retrace::periods_back(double distance_mm) const noexcept {
  if (kept_ == 0 || distance_mm <= 0.0) return 0.0;
  const double wanted = back(0).travelled - distance_mm;
  std::size_t near = 0;
  std::size_t far = kept_ - 1;
  if (back(far).travelled >= wanted) return static_cast<double>(far);
  while (far - near > 1) {
    const std::size_t middle = (near + far) / 2;
    (back(middle).travelled > wanted ? near : far) = middle;
  }
  return static_cast<double>(far);
}

void Retrace::step(Jog::Mode mode) noexcept {
  if (records_.empty()) return;
  is_open_.store(mode == Jog::Mode::open, std::memory_order_relaxed);
  const double asked = asked_.exchange(std::numeric_limits<double>::quiet_NaN(), std::memory_order_relaxed);
  if (mode == Jog::Mode::open && !std::isnan(asked)) {
    goal_ = -periods_back(asked);
    double change = no_limit;
    double change_again = no_limit;
    for (std::size_t i = 0; i < limits_.axes; ++i) {
      if (fastest_[i] <= 0.0) continue;
      const double on_jerk = jerk_share * limits_.jerk[i] / (3.0 * highest_pace * limits_.acceleration[i]);
      change = std::min({change, acceleration_share * limits_.acceleration[i] / fastest_[i], on_jerk});
      change_again = std::min(change_again, jerk_share * limits_.jerk[i] / fastest_[i]);
    }
    change = std::min(change, highest_pace / period_s_);
    pace_limits_ = {highest_pace / period_s_, change / period_s_,
                    std::min(change_again, change / period_s_) / period_s_};
  }
  if (mode == Jog::Mode::returns) goal_ = 0.0;
  stops_ = stops_ && !pace_.at_rest();
  if (at_rest()) return;
  if (mode == Jog::Mode::closed || stops_) {
    pace_.step_to_speed(0.0, pace_limits_);
    if (pace_.at_rest()) goal_ = pace_.position();
    return;
  }
  pace_.step(goal_, pace_limits_);
}

void Retrace::restart() noexcept {
  pace_.restart(0.0);
  goal_ = travelled_ = last_distance_ = 0.0;
  kept_ = 0;
  stops_ = false;
  fastest_ = {};
}

void Retrace::add_to(AxisValues& position, AxisValues& velocity, AxisValues& acceleration) const noexcept {
  if (!is_beside()) return;
  const double periods = std::clamp(-pace_.position(), 0.0, static_cast<double>(kept_ - 1));
  const auto whole = static_cast<std::size_t>(periods);
  const Record& to = back(whole);
  const Record& from = back(std::min(whole + 1, kept_ - 1));
  const double share = 1.0 - (periods - static_cast<double>(whole));
  const double pace = pace_.velocity() * period_s_;
  const double change = pace_.acceleration() * period_s_;
  for (std::size_t i = 0; i < limits_.axes; ++i) {
    const Cubic cubic(to.position[i] - from.position[i], from.velocity[i] * period_s_, to.velocity[i] * period_s_);
    const double first = cubic.first(share);
    const double second = cubic.second(share);
    position[i] += from.position[i] - back(0).position[i] + cubic.value(share);
    velocity[i] += first / period_s_ * pace;
    acceleration[i] += second / (period_s_ * period_s_) * pace * pace + first / period_s_ * change;
  }
}

}  // namespace shapegcode
