#include "motion/planned_motion.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <utility>

#include "base/checks.hpp"
#include "shapegcode/error.hpp"

namespace shapegcode {

bool PlainPlan::serves(const MotionLimits& limits) noexcept {
  return !looks_at_jumps(limits) && limits.feed_spread_s <= 0.0 && !(jerk_time(limits, MotionLimits::none) > 0.0) &&
         !limits.max_jerk_mm_per_s3.array().isFinite().any();
}

// Boundary speeds by a forward and a backward pass in v^2, as pass_speeds does it.
PlainPlan::PlainPlan(Path path, const MotionLimits& limits, const FilterTolerance& filter)
    : path_(std::move(path)), limits_(limits), filter_(filter) {
  const std::size_t n = path_.size();
  start_speeds_.reserve(n);
  double speed = 0.0;
  Segment before;
  for (std::size_t i = 0; i < n; ++i) {
    const Segment segment = path_[i];
    const Piece piece = piece_of(segment);
    if (!(piece.limit > 0.0) || !std::isfinite(piece.limit)) {
      throw Error(ErrorKind::argument, "segment without a feed greater than zero", segment.line);
    }
    const double corner = i > 0 ? corner_speed_limit(before, segment, limits_, filter_) : MotionLimits::none;
    speed = std::min({speed, corner, piece.limit});
    start_speeds_.push_back(speed);
    speed = speed_beyond(piece, speed);
    before = segment;
  }
  speed = 0.0;
  for (std::size_t i = n; i-- > 0;) {
    // Whoever enters no faster than the next one is entered has nothing to slow down for.
    double& start = start_speeds_[i];
    if (start > speed) start = std::min(start, speed_beyond(piece_of(path_[i]), speed));
    speed = start;
  }
}

Piece PlainPlan::piece_of(const Segment& segment) const noexcept {
  const double limit = segment_speed_limit(segment, limits_, filter_);
  return {segment.length_mm, limit, segment_acceleration(segment, limit, limits_), 0.0};
}

PlainPlan::Phases::Phases(std::shared_ptr<const PlainPlan> plan) : plan_(std::move(plan)), maker_(plan_->limits_) {}

bool PlainPlan::Phases::next(SpeedPhase& phase) {
  const std::vector<double>& speeds = plan_->start_speeds_;
  std::vector<SpeedPhase>& ready = maker_.ready();
  std::array<Ramp, most_phases> ramps;
  while (given_ == ready.size()) {
    ready.clear();
    given_ = 0;
    if (segment_ > speeds.size()) {
      return false;
    }
    if (segment_ == speeds.size()) {
      maker_.end();
    } else {
      const double v1 = segment_ + 1 < speeds.size() ? speeds[segment_ + 1] : 0.0;
      const Piece piece = plan_->piece_of(plan_->path_[segment_]);
      const std::size_t count = ramps_of(piece, speeds[segment_], v1, maker_.length_mm(), ramps);
      for (std::size_t k = 0; k < count; ++k) maker_.add(ramps[k]);
    }
    ++segment_;
  }
  phase = ready[given_++];
  phase.start_s = start_s_;
  start_s_ += phase.duration_s;
  return true;
}

PlannedMotion::PlannedMotion(Path path, const MotionLimits& limits, double period_s)
    : path_(std::move(path)),
      period_s_(period_s),
      smoothing_(Fir::moving_average(1), 1),
      plan_((check_limits(limits, {}), std::make_shared<const PlainPlan>(path_, limits, FilterTolerance{}))),
      phases_(plan_) {
  require_period(period_s);
  const double rest = 0.0;
  smoothing_.reset({&rest, 1});
  PlainPlan::Phases all(plan_);
  for (SpeedPhase phase; all.next(phase);) duration_s_ = phase.start_s + phase.duration_s;
  const double ramps = std::ceil(duration_s_ / period_s - 1e-9);
  sample_count_ = static_cast<std::size_t>(require_count(ramps, most_set_points, "a path", "set-points")) + 1;
  phases_.next(now_);
  has_next_ = phases_.next(next_);
}

// As SpeedProfile, for times that rise.
double PlannedMotion::distance_mm(double time_s) {
  if (time_s >= duration_s_) {
    return path_.length_mm();
  }
  if (time_s <= 0.0) {
    return 0.0;
  }
  while (has_next_ && time_s >= next_.start_s) {
    now_ = next_;
    has_next_ = phases_.next(next_);
  }
  return now_.distance_at(time_s);
}

bool PlannedMotion::step(Vector3& position) {
  const bool moving = index_ < sample_count_;
  double distance = path_.length_mm();
  if (moving) {
    double at = distance_mm(static_cast<double>(index_) * period_s_);
    ++index_;
    smoothing_.step({&at, 1}, {&at, 1});
    if (index_ < sample_count_) distance = at;
  }
  position = path_.point(distance, cursor_);
  return moving;
}

}  // namespace shapegcode
