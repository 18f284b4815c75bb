#include "controller/path_brake.hpp"

#include <algorithm>
#include <cmath>

#include "controller/cubic.hpp"

namespace shapegcode {
namespace {

// Of the acceleration: the rest is for a curve that begins within the period.
constexpr double braking_share = 0.995;

}  // namespace

void PathBrake::begin(const Section& section, std::size_t index) noexcept {
  section_ = &section;
  index_ = index;
  point_ = section.at(static_cast<std::ptrdiff_t>(index));
}

double PathBrake::hardest() const noexcept {
  const double speed = point_.point.state.speed;
  double most = no_limit;
  for (std::size_t i = 0; i < axes_; ++i) {
    const double along = point_.velocity[i] / speed;
    const double across = point_.acceleration[i] - along * point_.point.state.acceleration;
    if (along != 0.0)
      most = std::min(most, std::max(0.0, braking_share * acceleration_[i] - std::abs(across)) / std::abs(along));
  }
  return most;
}

const PlannedPoint& PathBrake::step() noexcept {
  const double speed = point_.point.state.speed;
  if (speed <= 0.0) return point_;
  // Never less than what is planned.
  const double least = std::max(0.0, -section_->at(static_cast<std::ptrdiff_t>(index_)).point.state.acceleration);
  const double deceleration = std::max(least, hardest());
  const double time_s = std::min(period_s_, speed / deceleration);
  const double slower = time_s < period_s_ ? 0.0 : speed - deceleration * period_s_;
  go_to(point_.distance + 0.5 * (speed + slower) * time_s, slower, deceleration);
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
  point_.point = share < 1.0 ? from.point : to.point;
  point_.line = share < 1.0 ? from.line : to.line;
  point_.distance = share < 1.0 ? distance : to.distance;
  point_.point.state = share < 1.0 ? AlongPath{speed, speed > 0.0 ? -deceleration : 0.0} : AlongPath{};
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
