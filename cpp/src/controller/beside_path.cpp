#include "controller/beside_path.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "controller/settings.hpp"

namespace shapegcode {
namespace {

// Round-off by which a position may exceed a limit, mm.
constexpr double at_limit_mm = 1e-6;
// An axis that comes back by less than that has not turned, in its unit.
constexpr double turned_back = 1e-6;

template <typename Tracked>
void add_trackers(const std::vector<Tracked>& axes, AxisValues& position, AxisValues& velocity,
                  AxisValues& acceleration) noexcept {
  for (std::size_t i = 0; i < axes.size(); ++i) {
    position[i] += axes[i].tracker.position();
    velocity[i] += axes[i].tracker.velocity();
    acceleration[i] += axes[i].tracker.acceleration();
  }
}

// Whether an arc comes by an angle in its plane.
bool passes(const Segment& arc, double angle_rad) noexcept {
  constexpr double turn = 2.0 * std::numbers::pi;
  const double from = arc.sweep_rad >= 0.0 ? arc.start_angle_rad : arc.start_angle_rad + arc.sweep_rad;
  const double behind = std::remainder(angle_rad - from, turn);
  return (behind < 0.0 ? behind + turn : behind) <= std::abs(arc.sweep_rad);
}

}  // namespace

SoftLimits::SoftLimits(const ControllerSettings& settings) noexcept
    : axes_(axis_count + settings.following.size()),
      slack_mm_(at_limit_mm + (std::isfinite(settings.contour_tolerance_mm) ? settings.contour_tolerance_mm : 0.0)) {
  for (std::size_t i = 0; i < max_path_axes; ++i) {
    const AxisTravel travel = i < settings.travel.size() ? settings.travel[i] : AxisTravel{};
    low_[i].store(travel.low, std::memory_order_relaxed);
    high_[i].store(travel.high, std::memory_order_relaxed);
  }
}

bool SoftLimits::set(std::size_t axis, const AxisTravel& travel) noexcept {
  if (axis >= axes_ || !(travel.low <= travel.high)) return false;
  low_[axis].store(travel.low, std::memory_order_relaxed);
  high_[axis].store(travel.high, std::memory_order_relaxed);
  return true;
}

bool SoftLimits::hold(const Segment& segment, std::span<const double> following_end) const noexcept {
  const auto is_beyond = [this](std::size_t axis, double value) {
    const AxisTravel travel = of(axis);
    return value < travel.low - at_limit_mm || value > travel.high + at_limit_mm;
  };
  for (std::size_t i = 0; i < axis_count; ++i) {
    if (is_beyond(i, segment.end_mm[static_cast<Eigen::Index>(i)])) return false;
  }
  for (std::size_t i = 0; i < std::min(following_end.size(), axes_ - axis_count); ++i) {
    if (is_beyond(axis_count + i, following_end[i])) return false;
  }
  if (segment.kind != SegmentKind::arc) return true;
  const double radius = std::max(segment.start_radius_mm, segment.end_radius_mm);
  for (int quarter = 0; quarter < 4; ++quarter) {
    if (!passes(segment, quarter * 0.5 * std::numbers::pi)) continue;
    const int axis = (segment.normal + 1 + quarter % 2) % axis_count;
    if (is_beyond(static_cast<std::size_t>(axis), segment.centre_mm[axis] + (quarter < 2 ? radius : -radius))) {
      return false;
    }
  }
  return true;
}

bool SoftLimits::hold(const AxisValues& low, const AxisValues& high, const AxisValues& here) const noexcept {
  for (std::size_t i = 0; i < axes_; ++i) {
    const AxisTravel travel = of(i);
    if (low[i] < std::min(travel.low, here[i]) - slack_mm_ || high[i] > std::max(travel.high, here[i]) + slack_mm_) {
      return false;
    }
  }
  return true;
}

Jog::Jog(const ControllerSettings& settings, const AxisLimits& limits, const SoftLimits& travel) : travel_(&travel) {
  for (std::size_t i = 0; i < limits.axes; ++i) {
    axes_.push_back({AxisTracker(settings.period_s), {0.0, limits.acceleration[i], limits.jerk[i]}, limits.speed[i]});
  }
}

JogResult Jog::closed_to(std::size_t axis, double number, double speed) const noexcept {
  if (axis >= axes_.size()) return JogResult::no_axis;
  if (!std::isfinite(number) || !std::isfinite(speed)) return JogResult::not_finite;
  return is_open_.load(std::memory_order_relaxed) ? JogResult::accepted : JogResult::path_moves;
}

JogResult Jog::jog(std::size_t axis, double speed) noexcept {
  const JogResult closed = closed_to(axis, speed, speed);
  if (closed != JogResult::accepted) return closed;
  const AxisTravel travel = travel_->of(axis);
  const double here = commands_[axis].from.load(std::memory_order_relaxed);
  if ((speed > 0.0 && here >= travel.high) || (speed < 0.0 && here <= travel.low)) return JogResult::beyond_travel;
  commands_[axis].distance.store(0.0, std::memory_order_relaxed);
  commands_[axis].velocity.store(speed, std::memory_order_relaxed);
  return JogResult::accepted;
}

JogResult Jog::jog_by(std::size_t axis, double distance, double speed) noexcept {
  const JogResult closed = closed_to(axis, distance, speed);
  if (closed != JogResult::accepted) return closed;
  if (!(speed > 0.0)) return JogResult::no_speed;
  Command& command = commands_[axis];
  const double waiting = command.distance.load(std::memory_order_relaxed);
  const double end = command.from.load(std::memory_order_relaxed) + waiting + distance;
  const AxisTravel travel = travel_->of(axis);
  if ((distance > 0.0 && end > travel.high) || (distance < 0.0 && end < travel.low)) return JogResult::beyond_travel;
  command.speed.store(speed, std::memory_order_relaxed);
  command.distance.fetch_add(distance, std::memory_order_release);
  return JogResult::accepted;
}

// What was asked for since the period before.
void Jog::take(Axis& axis, Command& command, double here) noexcept {
  const double velocity = command.velocity.exchange(nothing, std::memory_order_relaxed);
  if (!std::isnan(velocity)) {
    axis.goes = velocity != 0.0;
    axis.goal = std::copysign(std::numeric_limits<double>::infinity(), velocity);
    if (axis.goes) axis.limits.speed = std::min(std::abs(velocity), axis.highest_speed);
  }
  const double distance = command.distance.exchange(0.0, std::memory_order_acquire);
  if (distance != 0.0) {
    axis.goal = (axis.goes && std::isfinite(axis.goal) ? axis.goal : here) + distance;
    axis.goes = true;
    axis.limits.speed = std::min(command.speed.load(std::memory_order_relaxed), axis.highest_speed);
  }
}

bool Jog::is_asked() const noexcept {
  return std::ranges::any_of(commands_, [](const Command& command) {
    return !std::isnan(command.velocity.load(std::memory_order_relaxed)) ||
           command.distance.load(std::memory_order_relaxed) != 0.0;
  });
}

void Jog::step(Mode mode, const AxisValues& base) noexcept {
  const bool was_open = is_open_.exchange(mode == Mode::open, std::memory_order_relaxed);
  if (mode == Mode::closed && !was_open && !is_beside_) return;
  moves_ = is_beside_ = false;
  for (std::size_t i = 0; i < axes_.size(); ++i) {
    Axis& axis = axes_[i];
    AxisTracker& tracker = axis.tracker;
    take(axis, commands_[i], base[i] + tracker.position());
    if (mode != Mode::open) axis.goes = false;
    if (mode == Mode::returns) {
      // As fast as it was away from the path at the most: what was asked for last may be a creep.
      TrackerLimits limits = axis.limits;
      limits.speed = axis.fastest;
      tracker.step(0.0, limits);
    } else if (axis.goes) {
      const double here = base[i] + tracker.position();
      const AxisTravel travel = travel_->of(i);
      const double goal = std::clamp(axis.goal, std::min(travel.low, here), std::max(travel.high, here)) - base[i];
      tracker.step(goal, axis.limits);
      axis.goes = !tracker.at_rest() || tracker.position() != goal;
    } else {
      tracker.step_to_speed(0.0, axis.limits);
    }
    const double from = axis.goes && std::isfinite(axis.goal) ? axis.goal : base[i] + tracker.position();
    commands_[i].from.store(from, std::memory_order_relaxed);
    const bool is_away = !tracker.at_rest() || tracker.position() != 0.0;
    axis.fastest = is_away || axis.goes ? std::max(axis.fastest, axis.limits.speed) : 0.0;
    moves_ = moves_ || axis.goes || !tracker.at_rest();
    is_beside_ = is_beside_ || is_away;
  }
}

void Jog::stop() noexcept {
  for (std::size_t i = 0; i < axes_.size(); ++i) {
    take(axes_[i], commands_[i], 0.0);
    axes_[i].goes = false;
  }
}

void Jog::restart() noexcept {
  for (Axis& axis : axes_) {
    axis.tracker.restart(0.0);
    axis.goes = false;
  }
  moves_ = is_beside_ = false;
}

void Jog::add_to(AxisValues& position, AxisValues& velocity, AxisValues& acceleration) const noexcept {
  add_trackers(axes_, position, velocity, acceleration);
}

ExternalOffset::ExternalOffset(const ControllerSettings& settings, const SetPointFilters& filters) {
  for (std::size_t i = 0; i < settings.offset.size(); ++i) {
    const OffsetLimits& offset = settings.offset[i];
    const InputShare share = input_share(settings, filters, i);
    // As of a motion: no more than what changes the acceleration within a period.
    const double jerk = std::min(offset.max_jerk, offset.max_acceleration / settings.period_s);
    const TrackerLimits limits{offset.max_feed * share.speed, offset.max_acceleration * share.acceleration,
                               jerk * share.jerk};
    axes_.push_back({AxisTracker(settings.period_s), limits, offset.backlash});
  }
}

bool ExternalOffset::set(std::size_t axis, double value) noexcept {
  if (axis >= axes_.size() || !(axes_[axis].limits.speed > 0.0) || !std::isfinite(value)) return false;
  goals_[axis].store(value, std::memory_order_relaxed);
  return true;
}

void ExternalOffset::step(const AxisValues& position) noexcept {
  for (std::size_t i = 0; i < axes_.size(); ++i) {
    Axis& axis = axes_[i];
    if (!(axis.limits.speed > 0.0)) continue;
    const double goal = goals_[i].load(std::memory_order_relaxed);
    const double sign = axis.goes_down ? -1.0 : 1.0;
    const double place = sign * (position[i] + goal);
    axis.furthest = axis.has_moved ? std::max(axis.furthest, place) : place;
    axis.has_moved = true;
    if (place < axis.furthest - turned_back) {
      axis.goes_down = !axis.goes_down;
      axis.furthest = -place;
    }
    axis.tracker.step(goal + (axis.goes_down ? -axis.backlash : 0.0), axis.limits);
  }
}

void ExternalOffset::restart() noexcept {
  for (std::size_t i = 0; i < axes_.size(); ++i) {
    axes_[i].tracker.restart(0.0);
    axes_[i].goes_down = axes_[i].has_moved = false;
    goals_[i].store(0.0, std::memory_order_relaxed);
  }
}

void ExternalOffset::add_to(AxisValues& position, AxisValues& velocity, AxisValues& acceleration) const noexcept {
  add_trackers(axes_, position, velocity, acceleration);
}

}  // namespace shapegcode
