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
    case PushResult::flushing:
      return "the motion is flushed: push it again when it rests";
    case PushResult::no_time:
      return "a dwell takes 0 to 1e6 s";
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
        period_s_(settings.period_s),
        events_(std::bit_ceil(queue_)),
        delay_(static_cast<std::size_t>(std::lround(filters_.mean_samples()))),
        passed_(static_cast<std::size_t>(filters_.duration_samples()) + 1) {
    override_.store(settings.limits.feed_override, std::memory_order_relaxed);
    restart(std::array<double, max_controller_axes>{});
  }

  PushResult push(const Segment& segment, std::span<const double> following_end) noexcept {
    if (const PushResult closed = closed_to_pushes(); closed != PushResult::accepted) return closed;
    const std::uint64_t head = head_.load(std::memory_order_relaxed);
    if (head - planner_.running() >= queue_) return PushResult::queue_full;
    const PushResult result = intake_.take(segment, following_end, ring_[head]);
    if (result != PushResult::accepted) return result;
    head_.store(head + 1, std::memory_order_release);
    return PushResult::accepted;
  }

  // Behind the segment that was pushed last.
  PushResult push_event(const ControllerEvent& event, bool waits) noexcept {
    if (const PushResult closed = closed_to_pushes(); closed != PushResult::accepted) return closed;
    const std::uint64_t end = events_pushed_.load(std::memory_order_relaxed);
    if (end - events_taken_.load(std::memory_order_acquire) == events_.size()) return PushResult::queue_full;
    const std::uint64_t head = head_.load(std::memory_order_relaxed);
    events_[end & (events_.size() - 1)] = {head, event, waits};
    if (waits) {
      intake_.wait();
      rests_at_.store(head, std::memory_order_relaxed);
    }
    events_pushed_.store(end + 1, std::memory_order_release);
    return PushResult::accepted;
  }
  PushResult push_dwell(double time_s) noexcept {
    if (const PushResult closed = closed_to_pushes(); closed != PushResult::accepted) return closed;
    if (!(time_s >= 0.0 && time_s <= longest_dwell_s)) return PushResult::no_time;
    intake_.dwell(static_cast<std::uint32_t>(std::ceil(time_s / period_s_ * (1.0 - dwell_rounding))));
    rests_at_.store(head_.load(std::memory_order_relaxed), std::memory_order_relaxed);
    return PushResult::accepted;
  }
  bool next_event(ControllerEvent& event) noexcept {
    const Event* const next = first_event();
    if (next == nullptr || next->waits || !has_reached(next->segment)) return false;
    event = next->event;
    drop_event();
    return true;
  }

  bool plan() noexcept {
    if (is_stopping()) return false;
    // Either this is seen by flushed(), or the flush is seen here.
    is_planning_.store(true, std::memory_order_seq_cst);
    const Flush flush = flush_.load(std::memory_order_seq_cst);
    const bool worked =
        (flush == Flush::none || flush == Flush::over) &&
        planner_.plan(head_.load(std::memory_order_acquire), override_.load(std::memory_order_relaxed),
                      settled_.load(std::memory_order_relaxed), released_.load(std::memory_order_relaxed));
    is_planning_.store(false, std::memory_order_release);
    return worked;
  }

  Activity step() noexcept {
    const Flush flush = flush_.load(std::memory_order_acquire);
    if (flush == Flush::at_rest) return rest_on();
    if (flush == Flush::over || flush == Flush::asked_again) go_on();
    Sections& sections = planner_.sections();
    if (plans_in_step_ && sections.wants_more()) plan();
    const PlannedPoint& point = sections.step(is_stopping());
    if (sections.was_late()) ++state_.late_plans;
    const bool rests = sections.at_rest();
    rest_periods_ = rests ? std::min(rest_periods_ + 1, settled_periods()) : 0;
    settled_.store(is_settled(), std::memory_order_relaxed);
    const std::size_t n = axes();
    const auto value = [this, n](std::size_t order) {
      return values_.begin() + static_cast<std::ptrdiff_t>(order * n);
    };
    std::copy_n(point.position.begin(), n, value(0));
    std::copy_n(point.velocity.begin(), n, value(1));
    std::copy_n(point.acceleration.begin(), n, value(2));
    filters_.step(values_);
    ++state_.steps;
    passed_[state_.steps % passed_.size()] = {point.distance, running(point), point.line,
                                              rests || point.point.state.speed <= 0.0};
    const Activity activity = activity_now(sections.current());
    // At rest, to the last bit, whatever taps round to.
    if (activity == Activity::idle) {
      std::ranges::fill(values_, 0.0);
      std::copy_n(point.position.begin(), n, value(0));
    }
    publish(activity, point);
    if (is_settled() && flush_.load(std::memory_order_relaxed) == Flush::asked) {
      rest_ = point;
      done_ = sections.current().done - first_;
      flush_.store(Flush::at_rest, std::memory_order_release);
    }
    return activity;
  }

  // Of the set-point that was given last: position, velocity, acceleration.
  [[nodiscard]] std::span<const double> values(std::size_t order) const noexcept {
    return std::span(values_).subspan(order * axes(), axes());
  }

  void feed_override(double ratio) noexcept {
    if (!std::isnan(ratio)) override_.store(std::clamp(ratio, 0.0, max_override), std::memory_order_relaxed);
  }
  void hold() noexcept { hold_.store(true, std::memory_order_relaxed); }
  void resume() noexcept {
    hold_.store(false, std::memory_order_relaxed);
    const std::uint64_t waits = waits_before_.load(std::memory_order_relaxed);
    if (waits > released_.load(std::memory_order_relaxed)) released_.store(waits, std::memory_order_relaxed);
  }
  void abort() noexcept { abort_.store(true, std::memory_order_relaxed); }
  void flush() noexcept {
    Flush now = flush_.load(std::memory_order_relaxed);
    while (now == Flush::none || now == Flush::over) {
      const Flush next = now == Flush::none ? Flush::asked : Flush::asked_again;
      if (flush_.compare_exchange_weak(now, next, std::memory_order_seq_cst)) return;
    }
  }
  void probe(std::span<double> latched) noexcept {
    std::copy_n(values(0).begin(), std::min(latched.size(), axes()), latched.begin());
    flush();
  }
  bool flushed(std::span<double> position) noexcept {
    if (flush_.load(std::memory_order_seq_cst) != Flush::at_rest) return false;
    if (is_planning_.load(std::memory_order_seq_cst)) return false;
    new_head_ = push_from(rest_.position);
    events_from_ = events_pushed_.load(std::memory_order_relaxed);
    std::copy_n(rest_.position.begin(), std::min(position.size(), axes()), position.begin());
    flush_.store(Flush::over, std::memory_order_seq_cst);
    return true;
  }

  bool restart(std::span<const double> position) noexcept {
    if (!std::ranges::all_of(position, [](double value) { return std::isfinite(value); })) return false;
    hold_.store(false, std::memory_order_relaxed);
    abort_.store(false, std::memory_order_relaxed);
    flush_.store(Flush::none, std::memory_order_relaxed);
    AxisValues rest{};
    std::copy_n(position.begin(), std::min(position.size(), axes()), rest.begin());
    std::ranges::fill(values_, 0.0);
    std::copy_n(rest.begin(), axes(), values_.begin());
    const std::uint64_t head = push_from(rest);
    filters_.reset(values(0));
    step_from(head, 0, events_pushed_.load(std::memory_order_relaxed));
    rest_periods_ = settled_periods();
    settled_.store(true, std::memory_order_relaxed);
    state_ = {};
    first_ = head;
    publish(Activity::idle, planner_.sections().current().before[0]);
    return true;
  }

  [[nodiscard]] ControllerState state() const noexcept { return shared_.read(); }
  [[nodiscard]] std::size_t axes() const noexcept { return axis_count + n_following_; }
  [[nodiscard]] double delay_periods() const noexcept { return filters_.mean_samples(); }
  [[nodiscard]] int correction_delay() const noexcept { return filters_.correction_samples(); }

 private:
  // Asked for by anybody, at_rest is said by the thread that steps, over by the one that pushes, none by the former.
  enum class Flush : std::uint8_t { none, asked, at_rest, over, asked_again };

  [[nodiscard]] PushResult closed_to_pushes() const noexcept {
    if (abort_.load(std::memory_order_relaxed)) return PushResult::aborted;
    const Flush flush = flush_.load(std::memory_order_acquire);
    return flush == Flush::none || flush == Flush::over ? PushResult::accepted : PushResult::flushing;
  }

  // A period at rest between flush() and flushed(): what is planned is not looked at.
  Activity rest_on() noexcept {
    ++state_.steps;
    state_.segments_waiting = 0;
    state_.activity = rest_of(abort_.load(std::memory_order_relaxed), hold_.load(std::memory_order_relaxed));
    shared_.write(state_);
    return state_.activity;
  }
  void go_on() noexcept {
    first_ = new_head_ - done_;
    step_from(new_head_, rest_.line, events_from_);
    Flush over = Flush::over;
    if (!flush_.compare_exchange_strong(over, Flush::none, std::memory_order_seq_cst)) flush_.store(Flush::asked);
  }
  // Segments follow from a position, the first of them with the number that is returned. Nobody plans or looks at
  // sections.
  std::uint64_t push_from(const AxisValues& rest) noexcept {
    const std::uint64_t head = head_.load(std::memory_order_relaxed);
    intake_.restart({rest.data(), axes()});
    planner_.restart(head, rest);
    rests_at_.store(head, std::memory_order_relaxed);
    return head;
  }
  // At rest before a segment; events before `events` are dropped.
  void step_from(std::uint64_t segment, std::uint32_t line, std::uint64_t events) noexcept {
    runs_out_ = false;
    std::ranges::fill(passed_, Passed{0.0, segment, line, true});
    events_taken_.store(events, std::memory_order_release);
    waits_before_.store(0, std::memory_order_relaxed);
  }

  [[nodiscard]] static Activity rest_of(bool aborts, bool holds) noexcept {
    if (aborts) return Activity::aborted;
    return holds ? Activity::held : Activity::idle;
  }

  // At rest for so long what leaves the filters is at rest: the first period counts.
  [[nodiscard]] int settled_periods() const noexcept { return filters_.duration_samples() + 1; }
  [[nodiscard]] bool is_settled() const noexcept { return rest_periods_ == settled_periods(); }
  [[nodiscard]] bool is_stopping() const noexcept {
    return hold_.load(std::memory_order_relaxed) || abort_.load(std::memory_order_relaxed) ||
           override_.load(std::memory_order_relaxed) <= 0.0 || flush_.load(std::memory_order_relaxed) == Flush::asked;
  }

  Activity activity_now(const Section& section) noexcept {
    const bool settled = is_settled();
    // Each once: another thread may change them meanwhile.
    const bool aborts = abort_.load(std::memory_order_relaxed);
    const bool holds = hold_.load(std::memory_order_relaxed);
    if (aborts || holds || flush_.load(std::memory_order_relaxed) == Flush::asked) {
      return settled ? rest_of(aborts, holds) : Activity::stopping;
    }
    if (waits_at_stop(settled)) return Activity::held;
    const bool is_last = section.done == head_.load(std::memory_order_relaxed);
    const bool runs_out = section.runs_out && is_last && section.done != rests_at_.load(std::memory_order_relaxed);
    if (runs_out && !runs_out_) ++state_.starvations;
    runs_out_ = runs_out;
    if (settled && is_last) return Activity::idle;
    return runs_out ? Activity::starved : Activity::moving;
  }

  // A stop that was pushed is over when it was reached and resumed.
  bool waits_at_stop(bool settled) noexcept {
    const Event* next = first_event();
    if (next != nullptr && next->waits && released_.load(std::memory_order_relaxed) > next->segment) {
      drop_event();
      next = first_event();
    }
    const bool waits = next != nullptr && next->waits && settled && has_reached(next->segment);
    waits_before_.store(waits ? next->segment + 1 : 0, std::memory_order_relaxed);
    return waits;
  }

  struct Event {
    std::uint64_t segment = 0;  // behind which it comes, plus 1
    ControllerEvent event;
    bool waits = false;
  };
  [[nodiscard]] const Event* first_event() const noexcept {
    const std::uint64_t taken = events_taken_.load(std::memory_order_relaxed);
    if (taken == events_pushed_.load(std::memory_order_acquire)) return nullptr;
    return &events_[taken & (events_.size() - 1)];
  }
  void drop_event() noexcept {
    events_taken_.store(events_taken_.load(std::memory_order_relaxed) + 1, std::memory_order_release);
  }

  [[nodiscard]] std::uint64_t running(const PlannedPoint& point) const noexcept {
    const Sections& sections = planner_.sections();
    return sections.at_rest() ? sections.current().done : point.point.segment;
  }

  // Where the motion was so many periods ago.
  struct Passed {
    double distance_mm = 0.0;
    std::uint64_t running = 0;
    std::uint32_t line = 0;
    bool rests = true;
  };
  [[nodiscard]] const Passed& passed(std::size_t periods) const noexcept {
    return passed_[(state_.steps + passed_.size() - periods) % passed_.size()];
  }
  // Whether the set-point given last is behind the start of a segment; where the motion rested, whether it has come to
  // rest.
  [[nodiscard]] bool has_reached(std::uint64_t segment) const noexcept {
    const Passed& now = passed(delay_);
    return (now.running >= segment && !now.rests) || passed(passed_.size() - 1).running >= segment;
  }

  void publish(Activity activity, const PlannedPoint& point) noexcept {
    const std::uint64_t running = this->running(point);
    state_.activity = activity;
    std::ranges::copy(values(0), state_.set_point.begin());
    state_.speed_mm_per_s = point.point.state.speed;
    state_.distance_mm = point.distance;
    state_.feed_override = override_.load(std::memory_order_relaxed);
    state_.line = point.line;
    state_.segments_done = running - first_;
    state_.segments_waiting = head_.load(std::memory_order_relaxed) - running;
    const Passed& behind = passed(delay_);
    state_.set_point_distance_mm = behind.distance_mm;
    state_.set_point_line = behind.line;
    shared_.write(state_);
  }

  static constexpr double longest_dwell_s = 1e6;
  static constexpr double dwell_rounding = 1e-12;
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
  std::atomic<Flush> flush_{Flush::none};
  std::atomic<bool> is_planning_{false};
  // Of a flush: where it rests, segments done before it, and what comes behind it.
  PlannedPoint rest_;
  std::uint64_t done_ = 0;
  std::uint64_t new_head_ = 0, events_from_ = 0;

  // Of the real-time thread.
  std::uint64_t first_ = 0;
  bool runs_out_ = false;
  int rest_periods_ = 0;
  std::vector<double> values_;  // as the filters have them
  double period_s_;
  std::vector<Event> events_;
  std::atomic<std::uint64_t> events_pushed_{0}, events_taken_{0};
  std::atomic<std::uint64_t> rests_at_{0};      // a dwell or stop is behind the segment before this one
  std::atomic<std::uint64_t> released_{0};      // segments before this one do not wait
  std::atomic<std::uint64_t> waits_before_{0};  // the segment that waits, plus 1; 0: none
  std::size_t delay_;
  std::vector<Passed> passed_;  // as many periods as the filters last
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
void MotionController::hold() noexcept { implementation_->hold(); }
void MotionController::resume() noexcept { implementation_->resume(); }
PushResult MotionController::push_event(const ControllerEvent& event) noexcept {
  return implementation_->push_event(event, false);
}
PushResult MotionController::push_dwell(double time_s) noexcept { return implementation_->push_dwell(time_s); }
PushResult MotionController::push_stop() noexcept { return implementation_->push_event({}, true); }
void MotionController::flush() noexcept { implementation_->flush(); }
bool MotionController::flushed(std::span<double> position) noexcept { return implementation_->flushed(position); }
void MotionController::probe(std::span<double> latched) noexcept { implementation_->probe(latched); }
bool MotionController::next_event(ControllerEvent& event) noexcept { return implementation_->next_event(event); }
void MotionController::abort() noexcept { implementation_->abort(); }
bool MotionController::restart(std::span<const double> position) noexcept { return implementation_->restart(position); }
ControllerState MotionController::state() const noexcept { return implementation_->state(); }
int MotionController::axes() const noexcept { return static_cast<int>(implementation_->axes()); }
double MotionController::delay_periods() const noexcept { return implementation_->delay_periods(); }
int MotionController::correction_delay() const noexcept { return implementation_->correction_delay(); }

}  // namespace shapegcode
