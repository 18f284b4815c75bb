#include <algorithm>
#include <array>
#include <atomic>
#include <bit>
#include <cmath>

#include "controller/intake.hpp"
#include "controller/online_profile.hpp"
#include "controller/set_point_filters.hpp"
#include "controller/settings.hpp"
#include "controller/shared_state.hpp"
#include "motion/speed_limits.hpp"
#include "shapegcode/controller.hpp"

namespace shapegcode {
const char* text_of(PushResult result) noexcept {
  switch (result) {
    case PushResult::accepted:
      return "accepted";
    case PushResult::queue_full:
      return "the queue is full: push it again later";
    case PushResult::not_connected:
      return "the segment does not start where the one before ended";
    case PushResult::no_length:
      return "the segment has no length";
    case PushResult::no_feed:
      return "the feed is not above zero";
    case PushResult::not_finite:
      return "a number of the segment is not finite";
    case PushResult::wrong_axes:
      return "not as many following axes as the settings have";
    case PushResult::aborted:
      return "aborted: nothing is taken until restart";
  }
  return "unknown";
}

const char* text_of(Activity activity) noexcept {
  switch (activity) {
    case Activity::idle:
      return "idle";
    case Activity::moving:
      return "moving";
    case Activity::stopping:
      return "stopping";
    case Activity::held:
      return "held";
    case Activity::starved:
      return "starved";
    case Activity::aborted:
      return "aborted";
  }
  return "unknown";
}

class MotionController::Implementation {
 public:
  explicit Implementation(const ControllerSettings& settings)
      : n_following_((check_settings(settings), settings.following.size())),
        filters_(settings, axis_count + static_cast<int>(n_following_)),
        limits_(planning_limits_of(settings, filters_)),
        jerk_periods_(jerk_periods(settings)),
        intake_(limits_, following_limits_of(settings, filters_), filters_.tolerance()),
        ring_(std::bit_ceil(std::max(settings.queue, settings.window + 2))),
        profile_(ring_, limits_, settings.window, settings.period_s),
        smoothing_(Fir::moving_average(jerk_periods_), 1) {
    override_.store(settings.limits.feed_override, std::memory_order_relaxed);
    restart(std::array<double, max_controller_axes>{});
  }

  PushResult push(const Segment& segment, std::span<const double> following_end) noexcept {
    if (abort_.load(std::memory_order_relaxed)) return PushResult::aborted;
    const std::uint64_t head = head_.load(std::memory_order_relaxed);
    if (head - tail_.load(std::memory_order_acquire) >= ring_.capacity()) return PushResult::queue_full;
    const PushResult result = intake_.take(segment, following_end, ring_[head]);
    if (result != PushResult::accepted) return result;
    head_.store(head + 1, std::memory_order_release);
    return PushResult::accepted;
  }

  Activity step(std::span<double> out) noexcept {
    const bool stopping = hold_.load(std::memory_order_relaxed) || abort_.load(std::memory_order_relaxed);
    profile_.stop(stopping);
    profile_.override_feeds(override_.load(std::memory_order_relaxed));
    profile_.look_ahead(head_.load(std::memory_order_acquire));
    const bool settled = rest_periods_ >= settling_periods();
    const bool rested = profile_.at_rest();
    const double distance = profile_.distance();
    profile_.advance(settled);
    const bool restarted = profile_.has_restarted();
    if (restarted) {
      const double nothing = 0.0;
      smoothing_.reset({&nothing, 1});
      cursor_ = profile_.running();
    }
    // The last of a path may be gone within one period.
    if (!rested || restarted || profile_.distance() != distance) rest_periods_ = 0;
    rest_periods_ = profile_.at_rest() ? std::min(rest_periods_ + 1, settling_periods()) : 0;
    stand_at(smoothed_distance());
    filters_.step({position_.data(), axes()});
    const Activity activity = activity_now();
    if (activity == Activity::idle) end_exactly();
    std::copy_n(position_.begin(), std::min(out.size(), axes()), out.begin());
    ++state_.steps;
    publish(activity);
    return activity;
  }

  void feed_override(double ratio) noexcept {
    if (!std::isnan(ratio)) override_.store(std::clamp(ratio, 0.0, max_override), std::memory_order_relaxed);
  }
  void hold(bool held) noexcept { hold_.store(held, std::memory_order_relaxed); }
  void abort() noexcept { abort_.store(true, std::memory_order_relaxed); }

  bool restart(std::span<const double> position) noexcept {
    if (!std::ranges::all_of(position, [](double value) { return std::isfinite(value); })) return false;
    const std::uint64_t head = head_.load(std::memory_order_relaxed);
    tail_.store(head, std::memory_order_relaxed);
    hold_.store(false, std::memory_order_relaxed);
    abort_.store(false, std::memory_order_relaxed);
    rest_ = {};
    std::copy_n(position.begin(), std::min(position.size(), axes()), rest_.begin());
    position_ = rest_;
    intake_.restart({rest_.data(), axes()});
    profile_.restart(head);
    cursor_ = head;
    has_cursor_ = false;
    const double nothing = 0.0;
    smoothing_.reset({&nothing, 1});
    filters_.reset({rest_.data(), axes()});
    rest_periods_ = settling_periods();
    state_ = {};
    first_ = head;
    ran_out_ = true;
    publish(Activity::idle);
    return true;
  }

  [[nodiscard]] ControllerState state() const noexcept { return shared_.read(); }
  [[nodiscard]] std::size_t axes() const noexcept { return axis_count + n_following_; }
  [[nodiscard]] double delay_periods() const noexcept { return 0.5 * (jerk_periods_ - 1) + filters_.mean_samples(); }
  [[nodiscard]] int correction_delay() const noexcept { return filters_.correction_samples(); }
  [[nodiscard]] const MotionLimits& limits() const noexcept { return limits_; }
  [[nodiscard]] const FilterTolerance& tolerance() const noexcept { return filters_.tolerance(); }

 private:
  [[nodiscard]] int settling_periods() const noexcept { return jerk_periods_ + filters_.duration_samples(); }

  double smoothed_distance() noexcept {
    double distance = profile_.distance();
    smoothing_.step({&distance, 1}, {&distance, 1});
    // At rest, whatever the running sum rounds to.
    return rest_periods_ >= jerk_periods_ ? profile_.distance() : distance;
  }

  // The point of the path at a distance.
  void stand_at(double distance) noexcept {
    while (cursor_ + 1 < profile_.entered() && distance >= ring_[cursor_ + 1].distance) ++cursor_;
    has_cursor_ = has_cursor_ || cursor_ < profile_.absorbed();
    if (!has_cursor_) {
      position_ = rest_;
      return;
    }
    const QueuedSegment& entry = ring_[cursor_];
    const double along = distance - entry.distance;
    const Vector3 point = point_at(entry.segment, along);
    for (int i = 0; i < axis_count; ++i) position_[static_cast<std::size_t>(i)] = point[i];
    const double within = std::clamp(along, 0.0, entry.segment.length_mm);
    for (std::size_t i = 0; i < n_following_; ++i) {
      position_[axis_count + i] = entry.following_start[i] + entry.following_rate[i] * within;
    }
    tail_.store(cursor_, std::memory_order_release);
  }

  // At rest at the end of what was pushed: to the last bit, whatever distances and taps round to.
  void end_exactly() noexcept {
    if (!has_cursor_) return;
    const QueuedSegment& last = ring_[cursor_];
    std::copy_n(last.segment.end_mm.data(), axis_count, position_.begin());
    std::copy_n(last.following_end.begin(), n_following_, position_.begin() + axis_count);
  }

  Activity activity_now() noexcept {
    const bool settled = rest_periods_ >= settling_periods();
    const bool stopping = hold_.load(std::memory_order_relaxed);
    const bool out = profile_.ran_out();
    if (out && !ran_out_ && !ring_[profile_.running() - 1].segment.stop_at_end) ++state_.starvations;
    ran_out_ = out;
    if (abort_.load(std::memory_order_relaxed)) return settled ? Activity::aborted : Activity::stopping;
    if (stopping) return settled ? Activity::held : Activity::stopping;
    if (out && settled) return Activity::idle;
    if (out && !ring_[profile_.running() - 1].segment.stop_at_end) return Activity::starved;
    return Activity::moving;
  }

  void publish(Activity activity) noexcept {
    state_.activity = activity;
    std::copy_n(position_.begin(), axes(), state_.set_point.begin());
    state_.speed_mm_per_s = profile_.speed();
    state_.distance_mm = profile_.distance();
    state_.feed_override = override_.load(std::memory_order_relaxed);
    state_.line = has_cursor_ ? ring_[cursor_].segment.line : 0;
    state_.segments_done = profile_.running() - first_;
    state_.segments_waiting = head_.load(std::memory_order_relaxed) - profile_.running();
    shared_.write(state_);
  }

  std::size_t n_following_;
  SetPointFilters filters_;
  MotionLimits limits_;
  int jerk_periods_;
  Intake intake_;  // of the planning thread
  SegmentRing ring_;
  std::atomic<std::uint64_t> head_{0};  // the next segment to be pushed
  std::atomic<std::uint64_t> tail_{0};  // the oldest one that is still needed
  std::atomic<double> override_{1.0};
  std::atomic<bool> hold_{false};
  std::atomic<bool> abort_{false};

  // Of the real-time thread.
  OnlineProfile profile_;
  FirStream smoothing_;
  std::uint64_t cursor_ = 0;  // segment of the set-point before the filters
  std::uint64_t first_ = 0;
  bool has_cursor_ = false;
  bool ran_out_ = true;
  int rest_periods_ = 0;
  std::array<double, max_controller_axes> position_{}, rest_{};
  ControllerState state_;
  SharedState shared_;
};

MotionController::MotionController(const ControllerSettings& settings)
    : implementation_(std::make_unique<Implementation>(settings)) {}
MotionController::~MotionController() = default;
MotionController::MotionController(MotionController&&) noexcept = default;
MotionController& MotionController::operator=(MotionController&&) noexcept = default;

PushResult MotionController::push(const Segment& segment, std::span<const double> following_end) noexcept {
  return implementation_->push(segment, following_end);
}
Activity MotionController::step(std::span<double> out) noexcept { return implementation_->step(out); }
void MotionController::feed_override(double ratio) noexcept { implementation_->feed_override(ratio); }
void MotionController::hold() noexcept { implementation_->hold(true); }
void MotionController::resume() noexcept { implementation_->hold(false); }
void MotionController::abort() noexcept { implementation_->abort(); }
bool MotionController::restart(std::span<const double> position) noexcept { return implementation_->restart(position); }
ControllerState MotionController::state() const noexcept { return implementation_->state(); }
int MotionController::axes() const noexcept { return static_cast<int>(implementation_->axes()); }
double MotionController::delay_periods() const noexcept { return implementation_->delay_periods(); }
int MotionController::correction_delay() const noexcept { return implementation_->correction_delay(); }
const MotionLimits& MotionController::planning_limits() const noexcept { return implementation_->limits(); }
const FilterTolerance& MotionController::planning_tolerance() const noexcept { return implementation_->tolerance(); }

}  // namespace shapegcode
