#include "motion/phase_maker.hpp"

#include <algorithm>
#include <utility>

namespace shapegcode {

bool RampJoin::add(const Ramp& ramp, SpeedPhase& done) {
  if (ramp.distance <= 0.0 || ramp.v0 + ramp.v1 <= 0.0) {
    return false;
  }
  const double duration = PhaseJoin::duration_s(ramp.v0, ramp.v1, ramp.distance);
  const double acceleration = (ramp.v1 - ramp.v0) / duration;
  const bool joins = is_open_ && PhaseJoin::joins(open_, ramp.v0, acceleration);
  const bool completes = is_open_ && !joins;
  if (joins) {
    open_.duration_s += duration;
  } else {
    done = open_;
    open_ = {0.0, duration, length_, ramp.v0, acceleration};
    is_open_ = true;
  }
  length_ += ramp.distance;
  return completes;
}

bool RampJoin::end(SpeedPhase& done) {
  done = open_;
  return std::exchange(is_open_, false);
}

void RampStretch::add(const SpeedPhase& phase) { phases_[added_++ % phases_.size()] = phase; }

void RampStretch::end(double length_mm) {
  length_ = length_mm;
  ended_ = true;
}

double RampStretch::end_speed(std::size_t i) const noexcept {
  return phase(i).speed_mm_per_s + phase(i).acceleration_mm_per_s2 * phase(i).duration_s;
}

double RampStretch::distance(std::size_t i) const noexcept {
  return (exists(i + 1) ? phase(i + 1).distance_mm : length_) - phase(i).distance_mm;
}

std::size_t RampStretch::fast_neighbour(std::size_t i) const noexcept {
  const std::size_t k = phase(i).acceleration_mm_per_s2 > 0.0 ? i + 1 : i - 1;
  return exists(k) && steady(k) ? k : i;
}

double RampStretch::wanted_by(std::size_t i) const noexcept {
  if (!exists(i) || steady(i) || phase(i).duration_s >= time_constant_s_ || fast_neighbour(i) == i) {
    return 0.0;
  }
  const double mean = 0.5 * (phase(i).speed_mm_per_s + end_speed(i));
  return mean * (time_constant_s_ - phase(i).duration_s);
}

double RampStretch::taken_by(std::size_t i) const noexcept {
  const double extra = wanted_by(i);
  if (!(extra > 0.0)) {
    return extra;
  }
  const std::size_t k = fast_neighbour(i);
  // What the ramps on both sides ask of it.
  double wanted = 0.0;
  for (const std::size_t asks : {k - 1, k + 1}) {
    if (exists(asks) && fast_neighbour(asks) == k) wanted += wanted_by(asks);
  }
  return extra * std::min(1.0, distance(k) / wanted);
}

double RampStretch::given_by(std::size_t k) const noexcept {
  double given = 0.0;
  for (const std::size_t asks : {k - 1, k + 1}) {
    if (exists(asks) && !steady(asks) && fast_neighbour(asks) == k) given += std::max(0.0, taken_by(asks));
  }
  return given;
}

bool RampStretch::next(Ramp& ramp) {
  const std::size_t i = at_;
  if (!exists(i) || (!ended_ && !exists(i + around))) {
    return false;
  }
  const double speed = phase(i).speed_mm_per_s;
  ramp =
      steady(i) ? Ramp{speed, speed, distance(i) - given_by(i)} : Ramp{speed, end_speed(i), distance(i) + taken_by(i)};
  ++at_;
  if (at_ > around) first_ = at_ - around;
  return true;
}

void PhaseMaker::add(const Ramp& ramp) {
  SpeedPhase done;
  if (join_.add(ramp, done)) pass(done);
}

void PhaseMaker::end() {
  SpeedPhase done;
  if (join_.end(done)) pass(done);
  if (!stretches_) return;
  stretch_.end(join_.length_mm());
  stretch();
  if (join_again_.end(done)) ready_.push_back(done);
}

void PhaseMaker::pass(const SpeedPhase& phase) {
  if (stretches_) {
    stretch_.add(phase);
    stretch();
  } else {
    ready_.push_back(phase);
  }
}

void PhaseMaker::stretch() {
  Ramp ramp;
  SpeedPhase done;
  while (stretch_.next(ramp)) {
    if (join_again_.add(ramp, done)) ready_.push_back(done);
  }
}

}  // namespace shapegcode
