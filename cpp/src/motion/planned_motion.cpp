#include "motion/planned_motion.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <utility>

#include "base/checks.hpp"
#include "shapegcode/error.hpp"

namespace shapegcode {

bool PlainPlan::serves(const MotionLimits& limits) noexcept {
  return limits.feed_spread_s <= 0.0 && !(jerk_time(limits, MotionLimits::none) > 0.0) &&
         !limits.max_jerk_mm_per_s3.array().isFinite().any();
}

// Boundary speeds by a forward and a backward pass in v^2, as in pass_speeds.
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

// A ramp over the whole of a segment takes no less time than what is planned there; under the constant-time law both
// its ramps may be stretched.
double PlainPlan::longest_s() const noexcept {
  double sum_s = 0.0;
  for (std::size_t i = 0; i < start_speeds_.size(); ++i) {
    const double end_speed = i + 1 < start_speeds_.size() ? start_speeds_[i + 1] : 0.0;
    const double length = path_.distance_mm(i + 1) - path_.distance_mm(i);
    if (length > 0.0) sum_s += PhaseJoin::duration_s(start_speeds_[i], end_speed, length);
  }
  return sum_s + 2.0 * limits_.time_constant_s * static_cast<double>(start_speeds_.size());
}

PlainPlan::Phases::Phases(std::shared_ptr<const PlainPlan> plan) : plan_(std::move(plan)), maker_(plan_->limits_) {}

bool PlainPlan::Phases::next(SpeedPhase& phase) {
  const std::vector<double>& speeds = plan_->start_speeds_;
  std::vector<SpeedPhase>& ready = maker_.ready();
  std::array<Ramp, max_phases> ramps;
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
      plan_((check_limits(limits, {}), std::make_shared<const PlainPlan>(path_, limits, FilterTolerance{}))),
      phases_(plan_) {
  require_period(period_s);
  check_count();
  phases_.next(now_);
  has_next_ = phases_.next(next_);
  take_segment();
}

void PlannedMotion::check_count() const {
  if (plan_->longest_s() / period_s_ < max_set_points) return;
  double duration_s = 0.0;
  PlainPlan::Phases all(plan_);
  for (SpeedPhase phase; all.next(phase);) duration_s = phase.start_s + phase.duration_s;
  static_cast<void>(require_count(std::ceil(duration_s / period_s_ - 1e-9), max_set_points, "a path", "set-points"));
}

void PlannedMotion::take_segment() noexcept {
  on_ = path_[cursor_];
  on_begin_mm_ = path_.distance_mm(cursor_);
  on_end_mm_ = path_.distance_mm(cursor_ + 1);
}

void PlannedMotion::pass_to(double time_s) {
  while (has_next_ && time_s >= next_.start_s) {
    now_ = next_;
    has_next_ = phases_.next(next_);
  }
}

bool PlannedMotion::step(Vector3& position) {
  const double time_s = static_cast<double>(index_) * period_s_;
  pass_to(time_s);
  double distance = path_.length_mm();
  bool moving = true;
  if (has_next_) {
    distance = now_.distance_at(time_s);
  } else {
    const double duration_s = now_.start_s + now_.duration_s;
    const auto last = static_cast<std::size_t>(std::ceil(duration_s / period_s_ - 1e-9));
    moving = index_ <= last;
    // The last set-point is the path's end itself.
    if (index_ < last && time_s < duration_s) distance = now_.distance_at(time_s);
  }
  if (moving) ++index_;
  // As Path::point, with the segment at hand.
  if (distance < on_begin_mm_ || distance >= on_end_mm_) {
    path_.seek(distance, cursor_);
    take_segment();
  }
  position = point_at(on_, distance - on_begin_mm_);
  return moving;
}

}  // namespace shapegcode
