#include "controller/path_brake.hpp"

#include <algorithm>
#include <cmath>

#include "controller/cubic.hpp"

namespace shapegcode {
namespace {

// Fraction of the acceleration used; the rest is for a curve that begins within the period.
constexpr double braking_share = 0.995;
// Points of the section that the next period may lead to.
constexpr std::size_t periods_ahead = 2;

}  // namespace

void PathBrake::begin(const Section& section, std::size_t index) noexcept {
  section_ = &section;
  index_ = index;
  point_ = section.at(static_cast<std::ptrdiff_t>(index));
}

// Beside what the path itself asks for at this speed, here and wherever the next period may lead.
double PathBrake::hardest() const noexcept {
  const double speed = point_.point.state.speed;
  double most = no_limit;
  const auto less = [&](const PlannedPoint& point) {
    const AlongPath& state = point.point.state;
    if (state.speed <= 0.0) return;
    const double slower = speed * speed / (state.speed * state.speed);
    for (std::size_t i = 0; i < axes_; ++i) {
      const double along = point.velocity[i] / state.speed;
      if (along == 0.0) continue;
      const double across = slower * std::abs(point.acceleration[i] - along * state.acceleration);
      most = std::min(most, std::max(0.0, braking_share * acceleration_[i] - across) / std::abs(along));
    }
  };
  less(point_);
  const std::size_t behind = std::min(index_ + periods_ahead, section_->whole_count);
  for (std::size_t k = index_ + 1; k <= behind; ++k) less(section_->at(static_cast<std::ptrdiff_t>(k)));
  return most;
}

// How fast the section itself passes a place that is not behind.
double PathBrake::planned_speed(double distance) const noexcept {
  for (std::size_t k = index_; k < section_->whole_count; ++k) {
    const PlannedPoint& from = section_->at(static_cast<std::ptrdiff_t>(k));
    const PlannedPoint& to = section_->at(static_cast<std::ptrdiff_t>(k + 1));
    if (to.distance < distance && to.point.state.speed > 0.0) continue;
    const double share = std::clamp((distance - from.distance) / (to.distance - from.distance), 0.0, 1.0);
    return std::sqrt(std::lerp(from.point.state.speed * from.point.state.speed,
                               to.point.state.speed * to.point.state.speed, to.distance > from.distance ? share : 1.0));
  }
  return 0.0;
}

const PlannedPoint& PathBrake::step() noexcept {
  const double speed = point_.point.state.speed;
  if (speed <= 0.0) return point_;
  const double hard = hardest();
  const double time_s = speed < hard * period_s_ ? speed / hard : period_s_;
  double slower = time_s < period_s_ ? 0.0 : speed - hard * period_s_;
  // Nowhere faster than planned, or the stop of the section would be passed.
  const double planned = planned_speed(point_.distance + 0.5 * (speed + slower) * time_s);
  if (planned < slower) slower = planned;
  go_to(point_.distance + 0.5 * (speed + slower) * time_s, slower, (speed - slower) / time_s);
  return point_;
}

// Between two points: a cubic by the distance, along their directions.
void PathBrake::go_to(double distance, double speed, double deceleration) noexcept {
  const auto at = [this](std::size_t index) -> const PlannedPoint& {
    return section_->at(static_cast<std::ptrdiff_t>(index));
  };
  while (index_ + 1 < section_->whole_count && at(index_ + 1).distance < distance &&
         at(index_ + 1).point.state.speed > 0.0) {
    ++index_;
  }
  const PlannedPoint& from = at(index_);
  const PlannedPoint& to = at(std::min(index_ + 1, section_->whole_count));
  const double length = to.distance - from.distance;
  const double share = length > 0.0 ? std::min(1.0, (distance - from.distance) / length) : 1.0;
  // It may end just where the planned period does, and go on.
  const bool ends = share >= 1.0 && to.point.state.speed <= 0.0;
  point_.point = share < 1.0 ? from.point : to.point;
  point_.line = share < 1.0 ? from.line : to.line;
  point_.distance = share < 1.0 ? distance : to.distance;
  point_.point.state = ends ? AlongPath{} : AlongPath{speed, speed > 0.0 ? -deceleration : 0.0};
  for (std::size_t i = 0; i < axes_; ++i) {
    const double chord = to.position[i] - from.position[i];
    const auto direction = [&](const PlannedPoint& point) {
      return point.point.state.speed > 0.0 ? point.velocity[i] / point.point.state.speed * length : chord;
    };
    const Cubic cubic(chord, direction(from), direction(to));
    point_.position[i] = from.position[i] + cubic.value(share);
    const double first = length > 0.0 ? cubic.first(share) / length : 0.0;
    const double second = length > 0.0 ? cubic.second(share) / (length * length) : 0.0;
    point_.velocity[i] = first * point_.point.state.speed;
    point_.acceleration[i] = first * point_.point.state.acceleration + second * speed * speed;
  }
}

}  // namespace shapegcode
