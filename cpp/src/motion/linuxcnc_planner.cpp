#include <algorithm>
#include <cmath>
#include <utility>
#include <vector>

#include "motion/linuxcnc_blend.hpp"
#include "motion/planner_rules.hpp"

namespace shapegcode::detail {
namespace {

// Smallest distances, speeds and times that the planner considers.
constexpr double least_distance_mm = 1e-12;
constexpr double least_speed_mm_per_s = 1e-8;
constexpr double least_time_s = 1e-12;

// Speed at the start of the last segment that is known: it could stop in half of it, what a blend may take.
double unfinished_speed(const QueuedSegment& last) noexcept {
  return std::min(last.max_speed_mm_per_s, std::sqrt(last.acceleration_mm_per_s2() * last.length_mm));
}

// Final speeds, backwards from the last segment that is known, which is so many behind; the feed is not looked at.
void plan_final_speeds(std::vector<QueuedSegment>& queue, std::size_t depth) {
  const std::size_t n = queue.size();
  for (std::size_t i = 0; i + 1 < n; ++i) {
    QueuedSegment& planned = queue[i];
    if (planned.termination == Termination::stop) continue;
    const std::size_t last = std::min(n - 1, i + depth + 1);
    double speed = -1.0;  // not known
    for (std::size_t k = last; k > i; --k) {
      const QueuedSegment& next = queue[k];
      const QueuedSegment& before = queue[k - 1];
      if (before.termination == Termination::stop) {
        speed = 0.0;
        continue;
      }
      const double reached = speed < 0.0
                                 ? unfinished_speed(next)
                                 : std::sqrt(speed * speed + 2.0 * next.acceleration_mm_per_s2() * next.length_mm);
      speed = std::min({reached, next.max_speed_mm_per_s, before.max_speed_mm_per_s, before.kink_speed_mm_per_s});
    }
    planned.final_speed_mm_per_s = speed;
  }
}

// The queue run period by period, as phases of constant acceleration.
class Execution {
 public:
  Execution(const std::vector<QueuedSegment>& queue, const PlannerRules& rules, double feed_override)
      : queue_(queue), rules_(rules), override_(std::min(feed_override, rules.max_feed_override)) {}

  std::vector<SpeedPhase> run() {
    while (at_ < queue_.size()) {
      activate();
      if (split_) {
        finish_segment();
      } else {
        update(next_of(1), rules_.period_s);
      }
      if (is_done_) advance(0.0, 0.0);
    }
    return std::move(phases_);
  }

 private:
  [[nodiscard]] const QueuedSegment& now() const noexcept { return queue_[at_]; }
  [[nodiscard]] const QueuedSegment* next_of(std::size_t behind) const noexcept {
    return at_ + behind < queue_.size() ? &queue_[at_ + behind] : nullptr;
  }
  [[nodiscard]] double target(const QueuedSegment& queued) const noexcept {
    return std::min(queued.request_mm_per_s * override_, queued.max_speed_mm_per_s);
  }
  [[nodiscard]] double final_speed(const QueuedSegment* next) const noexcept {
    if (now().termination == Termination::stop || next == nullptr) return 0.0;
    return std::min({now().final_speed_mm_per_s, target(now()), target(*next)});
  }

  // A segment that takes less than 1/frequency is a linear ramp from its first speed to its last one.
  void activate() noexcept {
    if (is_active_) return;
    is_active_ = true;
    const double mean = 0.5 * (speed_ + std::min(now().final_speed_mm_per_s, target(now())));
    const double time_s = mean > 0.0 ? (now().length_mm - progress_) / mean : MotionLimits::none;
    const bool is_known = at_ > 0;  // what follows it: the first segment starts as soon as it is there
    ramps_ = is_known && now().termination == Termination::tangent && time_s < 1.0 / rules_.ramp_frequency_hz;
  }

  // One period or what is left of it, on the segment that runs.
  void update(const QueuedSegment* next, double time_s) {
    // In the first period nothing is known of what follows.
    const bool is_alone = phases_.empty() && next != nullptr;
    const double most = now().acceleration_mm_per_s2() * (is_alone && !now().overlaps ? 0.5 : 1.0);
    const double left = now().length_mm - progress_;
    const double last = is_alone ? 0.0 : final_speed(next);
    double acceleration = 0.0;
    if (ramps_ && last >= least_speed_mm_per_s) {
      const double mean = 0.5 * (speed_ + last);
      acceleration = left > 0.0 ? (last - speed_) * mean / left : MotionLimits::none * (last - speed_);
    } else {
      acceleration = (trapezoid_speed(most, left, last, time_s) - speed_) / time_s;
    }
    acceleration = std::clamp(acceleration, -most, most);
    move(acceleration, time_s);
    check_end(last);
  }

  // The speed at the end of a period from which the last speed is reached at the end of the segment.
  [[nodiscard]] double trapezoid_speed(double most, double left, double last, double time_s) const noexcept {
    const double half = 0.5 * most * time_s;
    const double rest = last * last + most * (2.0 * left - speed_ * time_s);
    const double reached = rest > 0.0 ? std::sqrt(rest + half * half) - half : -half;
    return std::min(reached, target(now()));
  }

  void move(double acceleration, double time_s) {
    const double before = progress_;
    double end = speed_ + acceleration * time_s;
    if (end < 0.0) {
      end = 0.0;
      if (now().length_mm - progress_ < speed_ * time_s) progress_ = now().length_mm;
    } else {
      progress_ = std::min(now().length_mm, progress_ + 0.5 * (speed_ + end) * time_s);
    }
    add_phase(progress_ - before, end - speed_, time_s);
    speed_ = end;
  }

  // Whether the segment ends within the next period, and when.
  void check_end(double last) noexcept {
    split_ = false;
    const double left = now().length_mm - progress_;
    if (left <= least_distance_mm) {
      progress_ = now().length_mm;
      if (now().termination == Termination::stop) {
        is_done_ = true;
      } else {
        set_split(0.0, speed_);
      }
      return;
    }
    if (now().termination == Termination::stop) return;
    const double mean = 0.5 * (speed_ + last);
    if (!(mean > least_speed_mm_per_s)) return;
    double time_s = std::max(0.5 * least_time_s, left / mean);
    const double most = now().acceleration_mm_per_s2();
    double end = last;
    if (std::abs(last - speed_) > most * time_s) {
      const double a = last > speed_ ? most : -most;
      const double square = speed_ * speed_ / (a * a) + 2.0 / a * left;
      if (square < 0.0) return;
      time_s = -speed_ / a + (a > 0.0 ? std::sqrt(square) : -std::sqrt(square));
      end = speed_ + time_s * a;
    }
    if (time_s < least_time_s) {
      progress_ = now().length_mm;
      set_split(0.0, end);
    } else if (time_s < rules_.period_s && (left < end * rules_.period_s || left < speed_ * rules_.period_s)) {
      set_split(time_s, end);
    }
  }

  void set_split(double time_s, double end_speed) noexcept {
    split_ = true;
    split_s_ = time_s;
    split_speed_ = end_speed;
  }

  // The rest of the segment, then the rest of the period on the next one.
  void finish_segment() {
    const double left = now().length_mm - progress_;
    const double time_s = left > 0.0 && split_s_ <= 0.0 ? least_time_s : split_s_;
    if (time_s > 0.0) add_phase(left, split_speed_ - speed_, time_s);
    const double rest_s = rules_.period_s - split_s_;
    advance(split_speed_, rest_s);
  }

  // To the next segment; what is left of the period runs on it, before it is active.
  void advance(double speed, double rest_s) {
    ++at_;
    progress_ = 0.0;
    speed_ = speed;
    is_active_ = split_ = is_done_ = ramps_ = false;
    if (at_ < queue_.size() && rest_s > 0.0) update(next_of(1), rest_s);
  }

  // A phase of the distance that was gone.
  void add_phase(double distance, double change, double time_s) {
    const double acceleration = change / time_s;
    const double speed = distance / time_s - 0.5 * change;
    if (!phases_.empty()) {
      SpeedPhase& last = phases_.back();
      const double scale = 1e-10 * (1.0 + std::abs(speed));
      const bool goes_on = std::abs(last.acceleration_mm_per_s2 - acceleration) * rules_.period_s < scale &&
                           std::abs(last.speed_mm_per_s + change_in(last) - speed) < scale;
      if (goes_on && std::abs(acceleration) * rules_.period_s < scale) {
        last.duration_s += time_s;
        // As long as was gone, with a speed that is that of all of it.
        last.speed_mm_per_s = (gone_mm_ + distance - last.distance_mm) / last.duration_s;
        last.acceleration_mm_per_s2 = 0.0;
        gone_mm_ += distance;
        return;
      }
    }
    phases_.push_back({0.0, time_s, gone_mm_, speed, acceleration});
    gone_mm_ += distance;
  }
  [[nodiscard]] static double change_in(const SpeedPhase& phase) noexcept {
    return phase.acceleration_mm_per_s2 * phase.duration_s;
  }

  const std::vector<QueuedSegment>& queue_;
  const PlannerRules& rules_;
  double override_;
  std::vector<SpeedPhase> phases_;
  std::size_t at_ = 0;
  double gone_mm_ = 0.0;
  double progress_ = 0.0;  // on the segment that runs
  double speed_ = 0.0;
  double split_s_ = 0.0;
  double split_speed_ = 0.0;
  bool is_active_ = false;
  bool ramps_ = false;
  bool split_ = false;
  bool is_done_ = false;
};

}  // namespace

ControlledMotion linuxcnc_motion(const Path& path, const MotionLimits& limits, const PlannerRules& rules) {
  std::vector<QueuedSegment> queue = linuxcnc_queue(path, limits, rules);
  plan_final_speeds(queue, rules.optimization_depth);
  PathBuilder builder;
  for (const QueuedSegment& queued : queue) {
    for (const Segment& segment : queued.geometry) builder.add(segment);
  }
  auto followed = std::make_shared<const Path>(builder.path());
  std::vector<SpeedPhase> phases = Execution(queue, rules, limits.feed_override).run();
  const double length_mm = followed->length_mm();
  return {std::move(followed), std::make_shared<const SpeedProfile>(std::move(phases), length_mm, 0.0)};
}

}  // namespace shapegcode::detail
