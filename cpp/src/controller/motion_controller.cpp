#include <algorithm>
#include <array>
#include <atomic>
#include <bit>
#include <cmath>
#include <vector>

#include "controller/intake.hpp"
#include "controller/online_planner.hpp"
#include "controller/set_point_filters.hpp"
#include "controller/settings.hpp"
#include "controller/shared_state.hpp"
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
        intake_(settings, path_tolerance_of(settings, filters_), corner_time_of(filters_)),
        queue_(std::bit_ceil(std::max(settings.queue, settings.window + 2))),
        ring_(std::bit_ceil(queue_ + room_behind)),
        planner_(ring_, planning_rules_of(settings, filters_)),
        plans_in_step_(settings.plans_in_step),
        values_(SetPointFilters::values(axes())),
        passed_(static_cast<std::size_t>(std::lround(filters_.mean_samples())) + 1) {
    override_.store(settings.limits.feed_override, std::memory_order_relaxed);
    restart(std::array<double, max_controller_axes>{});
  }

  PushResult push(const Segment& segment, std::span<const double> following_end) noexcept {
    if (abort_.load(std::memory_order_relaxed)) return PushResult::aborted;
    const std::uint64_t head = head_.load(std::memory_order_relaxed);
    if (head - planner_.running() >= queue_) return PushResult::queue_full;
    const PushResult result = intake_.take(segment, following_end, ring_[head]);
    if (result != PushResult::accepted) return result;
    head_.store(head + 1, std::memory_order_release);
    return PushResult::accepted;
  }

  bool plan() noexcept {
    if (is_stopping()) return false;
    return planner_.plan(head_.load(std::memory_order_acquire), override_.load(std::memory_order_relaxed),
                         settled_.load(std::memory_order_relaxed));
  }

  Activity step() noexcept {
    Sections& sections = planner_.sections();
    if (plans_in_step_ && sections.wants_more()) plan();
    const PlannedPoint& point = sections.step(is_stopping());
    if (sections.was_late()) ++state_.late_plans;
    const bool rests = sections.at_rest();
    rest_periods_ = rests ? std::min(rest_periods_ + 1, settled_periods()) : 0;
    settled_.store(rest_periods_ == settled_periods(), std::memory_order_relaxed);
    const std::size_t n = axes();
    const auto value = [this, n](std::size_t order) {
      return values_.begin() + static_cast<std::ptrdiff_t>(order * n);
    };
    std::copy_n(point.position.begin(), n, value(0));
    std::copy_n(point.velocity.begin(), n, value(1));
    std::copy_n(point.acceleration.begin(), n, value(2));
    filters_.step(values_);
    const Activity activity = activity_now(sections.current());
    // At rest, to the last bit, whatever taps round to.
    if (activity == Activity::idle) {
      std::ranges::fill(values_, 0.0);
      std::copy_n(point.position.begin(), n, value(0));
    }
    ++state_.steps;
    publish(activity, point);
    return activity;
  }

  // Of the set-point that was given last: position, velocity, acceleration.
  [[nodiscard]] std::span<const double> values(std::size_t order) const noexcept {
    return std::span(values_).subspan(order * axes(), axes());
  }

  void feed_override(double ratio) noexcept {
    if (!std::isnan(ratio)) override_.store(std::clamp(ratio, 0.0, max_override), std::memory_order_relaxed);
  }
  void hold(bool held) noexcept { hold_.store(held, std::memory_order_relaxed); }
  void abort() noexcept { abort_.store(true, std::memory_order_relaxed); }

  bool restart(std::span<const double> position) noexcept {
    if (!std::ranges::all_of(position, [](double value) { return std::isfinite(value); })) return false;
    const std::uint64_t head = head_.load(std::memory_order_relaxed);
    hold_.store(false, std::memory_order_relaxed);
    abort_.store(false, std::memory_order_relaxed);
    AxisValues rest{};
    std::copy_n(position.begin(), std::min(position.size(), axes()), rest.begin());
    std::ranges::fill(values_, 0.0);
    std::copy_n(rest.begin(), axes(), values_.begin());
    intake_.restart(values(0));
    planner_.restart(head, rest);
    filters_.reset(values(0));
    std::ranges::fill(passed_, Passed{});
    rest_periods_ = settled_periods();
    settled_.store(true, std::memory_order_relaxed);
    state_ = {};
    first_ = head;
    runs_out_ = false;
    publish(Activity::idle, planner_.sections().current().before[0]);
    return true;
  }

  [[nodiscard]] ControllerState state() const noexcept { return shared_.read(); }
  [[nodiscard]] std::size_t axes() const noexcept { return axis_count + n_following_; }
  [[nodiscard]] double delay_periods() const noexcept { return filters_.mean_samples(); }
  [[nodiscard]] int correction_delay() const noexcept { return filters_.correction_samples(); }

 private:
  // At rest for so long what leaves the filters is at rest: the first period counts.
  [[nodiscard]] int settled_periods() const noexcept { return filters_.duration_samples() + 1; }
  [[nodiscard]] bool is_stopping() const noexcept {
    return hold_.load(std::memory_order_relaxed) || abort_.load(std::memory_order_relaxed) ||
           override_.load(std::memory_order_relaxed) <= 0.0;
  }

  Activity activity_now(const Section& section) noexcept {
    const bool rests = planner_.sections().at_rest();
    const bool settled = rests && rest_periods_ == settled_periods();
    if (abort_.load(std::memory_order_relaxed)) return settled ? Activity::aborted : Activity::stopping;
    if (hold_.load(std::memory_order_relaxed)) return settled ? Activity::held : Activity::stopping;
    const bool is_last = section.done == head_.load(std::memory_order_relaxed);
    const bool runs_out = section.runs_out && is_last;
    if (runs_out && !runs_out_) ++state_.starvations;
    runs_out_ = runs_out;
    if (settled && is_last) return Activity::idle;
    return runs_out ? Activity::starved : Activity::moving;
  }

  void publish(Activity activity, const PlannedPoint& point) noexcept {
    const Section& section = planner_.sections().current();
    const std::uint64_t running = planner_.sections().at_rest() ? section.done : point.point.segment;
    state_.activity = activity;
    std::ranges::copy(values(0), state_.set_point.begin());
    state_.speed_mm_per_s = point.point.state.speed;
    state_.distance_mm = point.distance;
    state_.feed_override = override_.load(std::memory_order_relaxed);
    state_.line = point.line;
    state_.segments_done = running - first_;
    state_.segments_waiting = head_.load(std::memory_order_relaxed) - running;
    passed_[state_.steps % passed_.size()] = {point.distance, point.line};
    const Passed& behind = passed_[(state_.steps + 1) % passed_.size()];
    state_.set_point_distance_mm = behind.distance_mm;
    state_.set_point_line = behind.line;
    shared_.write(state_);
  }

  struct Passed {
    double distance_mm = 0.0;
    std::uint32_t line = 0;
  };

  // For segments that are done with, but whose roundings may reach what follows.
  static constexpr std::size_t room_behind = RoundedPath::lookback + 1;

  std::size_t n_following_;
  SetPointFilters filters_;
  Intake intake_;  // of the pushing thread
  std::size_t queue_;
  SegmentRing ring_;
  OnlinePlanner planner_;
  bool plans_in_step_;
  std::atomic<std::uint64_t> head_{0};  // the next segment to be pushed
  std::atomic<double> override_{1.0};
  std::atomic<bool> hold_{false};
  std::atomic<bool> abort_{false};
  std::atomic<bool> settled_{true};

  // Of the real-time thread.
  std::uint64_t first_ = 0;
  bool runs_out_ = false;
  int rest_periods_ = 0;
  std::vector<double> values_;  // as the filters have them
  std::vector<Passed> passed_;  // as many periods back as the filters delay
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
bool MotionController::plan() noexcept { return implementation_->plan(); }
Activity MotionController::step(std::span<double> out) noexcept {
  const Activity activity = implementation_->step();
  const std::span position = implementation_->values(0);
  std::copy_n(position.begin(), std::min(out.size(), position.size()), out.begin());
  return activity;
}
Activity MotionController::step(MotionSetPoint& out) noexcept {
  const Activity activity = implementation_->step();
  std::ranges::copy(implementation_->values(0), out.position.begin());
  std::ranges::copy(implementation_->values(1), out.velocity.begin());
  std::ranges::copy(implementation_->values(2), out.acceleration.begin());
  return activity;
}
void MotionController::feed_override(double ratio) noexcept { implementation_->feed_override(ratio); }
void MotionController::hold() noexcept { implementation_->hold(true); }
void MotionController::resume() noexcept { implementation_->hold(false); }
void MotionController::abort() noexcept { implementation_->abort(); }
bool MotionController::restart(std::span<const double> position) noexcept { return implementation_->restart(position); }
ControllerState MotionController::state() const noexcept { return implementation_->state(); }
int MotionController::axes() const noexcept { return static_cast<int>(implementation_->axes()); }
double MotionController::delay_periods() const noexcept { return implementation_->delay_periods(); }
int MotionController::correction_delay() const noexcept { return implementation_->correction_delay(); }

}  // namespace shapegcode
