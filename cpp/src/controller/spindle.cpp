#include "controller/spindle.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <utility>

namespace shapegcode {
namespace {

// Fraction of acceleration and jerk for catching up with the spindle; the rest is for its ripple.
constexpr double catching_share = 0.8;
// Where the motion begins it is followed as near as that, revolutions.
constexpr double followed_within = 0.005;
// Of the speed of the spindle, by which it may rise.
constexpr double speed_room = 1.15;
// No count is beyond that.
constexpr double most_revolutions = 1e9;
// Slower than that it stands, revolutions per s.
constexpr double stands = 0.01;
// An angle that would take a faster spindle is none, revolutions per s; so many in a row are where the spindle is.
constexpr double impossible_speed = 5000.0;
constexpr int believed_after = 4;

SpindleState after(const SpindleState& state, double time_s) noexcept {
  return {state.angle + time_s * (state.speed + 0.5 * time_s * state.acceleration),
          state.speed + time_s * state.acceleration, state.acceleration};
}

}  // namespace

Spindle::Spindle(double bandwidth_hz, double period_s, double ahead_s) noexcept
    : pole_(2.0 * std::numbers::pi * bandwidth_hz), period_s_(period_s), ahead_s_(ahead_s) {
  const double memory = std::exp(-pole_ * period_s);
  const double forgotten = 1.0 - memory;
  angle_gain_ = 1.0 - memory * memory * memory;
  speed_gain_ = 1.5 * forgotten * forgotten * (1.0 + memory) / period_s;
  acceleration_gain_ = forgotten * forgotten * forgotten / (period_s * period_s);
}

SpindleState Spindle::foreseen() const noexcept { return after(observed_, ahead_s_); }

void Spindle::measure(double revolutions) noexcept {
  if (!(std::abs(revolutions) < most_revolutions)) return miss();
  if (!is_measured_) {
    is_measured_ = true;
    observed_ = smooth_ = {revolutions, 0.0, 0.0};
  }
  const double missing = revolutions - after(observed_, period_s_).angle;
  const bool is_possible = std::abs(missing) < impossible_speed * period_s_;
  impossible_ = is_possible ? 0 : impossible_ + 1;
  if (impossible_ < believed_after) return correct(is_possible ? missing : 0.0);
  impossible_ = 0;
  observed_ = smooth_ = {revolutions, 0.0, 0.0};
}

void Spindle::miss() noexcept {
  if (is_measured_) correct(0.0);
}

// One period on, with what was missing from what was expected.
void Spindle::correct(double missing) noexcept {
  observed_ = after(observed_, period_s_);
  observed_.angle += angle_gain_ * missing;
  observed_.speed += speed_gain_ * missing;
  observed_.acceleration += acceleration_gain_ * missing;
  // One period on with the jerk that ends what it is behind.
  const SpindleState goal = foreseen();
  smooth_ = after(smooth_, period_s_);
  const double jerk = pole_ * (3.0 * (goal.acceleration - smooth_.acceleration) +
                               pole_ * (3.0 * (goal.speed - smooth_.speed) + pole_ * (goal.angle - smooth_.angle)));
  const double t = period_s_;
  smooth_.angle += jerk * t * t * t / 6.0;
  smooth_.speed += jerk * t * t / 2.0;
  smooth_.acceleration += jerk * t;
  const double speed = std::abs(smooth_.speed);
  speed_.store(speed > stands ? speed : 0.0, std::memory_order_relaxed);
}

void SpindleFeed::begin(const PlannedSegment& segment, const PlannedPoint& start) noexcept {
  segment_ = &segment;
  phase_ = Phase::waits;
  start_ = point_ = start;
  error_mm_ = 0.0;
  is_lost_ = false;
  AxisValues direction = segment.rate;
  const Vector3 tangent = tangent_at(segment.segment, 0.0);
  std::copy_n(tangent.data(), axis_count, direction.begin());
  along_limits_ = {std::min(segment.max_speed, along(direction, limits_.speed, limits_.axes)),
                   std::min(segment.max_acceleration, along(direction, limits_.acceleration, limits_.axes)),
                   std::min(segment.max_jerk, along(direction, limits_.jerk, limits_.axes))};
  pitch_mm_ = segment.programmed;
  beside_ = along_ = AxisTracker(period_s_);
  first_angle_ = no_limit;
}

// At a whole revolution the motion begins, at rest and so behind what turns on.
void SpindleFeed::wait(const Spindle& spindle, bool may_begin) noexcept {
  const SpindleState& now = spindle.smooth();
  const double sign = now.speed < 0.0 ? -1.0 : 1.0;
  const double speed = pitch_mm_ * std::abs(now.speed);
  const bool can_follow = std::abs(now.speed) > stands && speed_room * speed < along_limits_.speed;
  const bool is_near = std::abs(spindle.foreseen().angle - now.angle) < followed_within;
  if (!may_begin || !can_follow || !is_near || asks_too_much(now, now)) {
    first_angle_ = no_limit;
    return;
  }
  if (!std::isfinite(first_angle_)) first_angle_ = sign * std::ceil(sign * now.angle);
  const double master = pitch_mm_ * sign * (now.angle - first_angle_);
  if (master < 0.0) return;
  pitch_mm_ *= sign;
  beside_.restart(-master, -speed, -pitch_mm_ * now.acceleration);
  phase_ = Phase::follows;
}

// More than what catching up leaves of the limits.
bool SpindleFeed::asks_too_much(const SpindleState& now, const SpindleState& before) const noexcept {
  const double pitch = std::abs(pitch_mm_);
  const double jerk = (now.acceleration - before.acceleration) / period_s_;
  // Of one that is somewhere else at once as well.
  const double speed = std::max(std::abs(now.speed), std::abs(now.angle - before.angle) / period_s_);
  const double acceleration = std::max(std::abs(now.acceleration), std::abs(now.speed - before.speed) / period_s_);
  return pitch * speed > along_limits_.speed ||
         pitch * acceleration > (1.0 - catching_share) * along_limits_.acceleration ||
         pitch * std::abs(jerk) > (1.0 - catching_share) * along_limits_.jerk;
}

void SpindleFeed::step(const Spindle& spindle, bool may_begin, bool brakes) noexcept {
  const SpindleState& now = spindle.smooth();
  const SpindleState before = std::exchange(before_, now);
  const double length = segment_->segment.length_mm;
  if (phase_ == Phase::waits) {
    if (!brakes) wait(spindle, may_begin);
    return;
  }
  is_lost_ = is_lost_ || (phase_ == Phase::follows && asks_too_much(now, before));
  if (brakes || is_lost_) phase_ = Phase::brakes;
  if (phase_ == Phase::follows) {
    const double room = along_limits_.speed - std::abs(pitch_mm_ * now.speed);
    beside_.step(
        0.0, {std::max(room, 0.0), catching_share * along_limits_.acceleration, catching_share * along_limits_.jerk});
    along_.restart(std::max(along_.position(), pitch_mm_ * (now.angle - first_angle_) + beside_.position()),
                   pitch_mm_ * now.speed + beside_.velocity(), pitch_mm_ * now.acceleration + beside_.acceleration());
    error_mm_ = along_.position() - pitch_mm_ * (spindle.foreseen().angle - first_angle_);
    // However fast the next period may be.
    AxisTracker on = along_;
    on.step_to_speed(along_limits_.speed, along_limits_);
    if (!on.leaves_room(length, 1.0, along_limits_)) {
      phase_ = Phase::ends;
      along_limits_.speed = along_.velocity();
    }
  } else if (phase_ == Phase::ends) {
    along_.step(length, along_limits_);
  } else {
    along_.step_to_speed(0.0, along_limits_);
  }
  write();
}

void SpindleFeed::write() noexcept {
  const Segment& segment = segment_->segment;
  // A little past its end as well, where it cannot be met at once.
  const double s = along_.position();
  const Vector3 tangent = tangent_at(segment, 0.0);
  const Vector3 position = s == segment.length_mm ? segment.end_mm : Vector3(segment.start_mm + s * tangent);
  point_.point = {start_.point.segment, s, {along_.velocity(), along_.acceleration()}};
  point_.distance = s;
  point_.line = segment.line;
  for (std::size_t i = 0; i < limits_.axes; ++i) {
    const bool leads = i < axis_count;
    const auto axis = static_cast<Eigen::Index>(i);
    const double rate = leads ? tangent[axis] : segment_->rate[i];
    point_.position[i] = leads ? position[axis] : segment_->start[i] + rate * s;
    point_.velocity[i] = rate * along_.velocity();
    point_.acceleration[i] = rate * along_.acceleration();
  }
}

}  // namespace shapegcode
