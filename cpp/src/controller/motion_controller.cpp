#include <algorithm>
#include <array>
#include <atomic>
#include <bit>
#include <cmath>
#include <utility>
#include <vector>

#include "controller/beside_path.hpp"
#include "controller/intake.hpp"
#include "controller/online_planner.hpp"
#include "controller/path_brake.hpp"
#include "controller/place_queue.hpp"
#include "controller/retrace.hpp"
#include "controller/set_point_filters.hpp"
#include "controller/settings.hpp"
#include "controller/shared_state.hpp"
#include "controller/spindle.hpp"
#include "planner/planned_limits.hpp"
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
      return "the segment moves no axis by more than 1e-9 mm";
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
    case PushResult::beyond_travel:
      return "the segment leads out of the travel of an axis";
    case PushResult::bad_limit:
      return "a limit of the segment is not above zero";
    case PushResult::not_straight:
      return "what is bound to the spindle must be a line";
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
    case Activity::jogging:
      return "jogging";
  }
  return "unknown";
}

const char* text_of(JogResult result) noexcept {
  switch (result) {
    case JogResult::accepted:
      return "accepted";
    case JogResult::path_moves:
      return "refused: the path moves; an axis is jogged, or the path retraced, only while it rests held, flushed or "
             "aborted";
    case JogResult::no_axis:
      return "there is no such axis";
    case JogResult::not_finite:
      return "a number of the jog is not finite";
    case JogResult::no_speed:
      return "the speed is not above zero";
    case JogResult::beyond_travel:
      return "it leads out of the travel of the axis";
    case JogResult::no_record:
      return "the settings keep no record of the path";
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
        rules_(planning_rules_of(settings, filters_)),
        planner_(ring_, rules_),
        travel_(settings),
        retrace_(settings.retrace_periods, planned_limits(rules_.limits, settings.period_s), settings.period_s),
        jog_(settings, planned_limits(rules_.limits, settings.period_s), travel_),
        offset_(settings, filters_),
        brake_(emergency_of(settings, filters_), axes(), settings.period_s),
        brakes_(!settings.emergency_acceleration.empty()),
        spindle_(settings.spindle_bandwidth_hz, settings.period_s, filters_.mean_samples() * settings.period_s),
        spindle_feed_(planned_limits(rules_.limits, settings.period_s), settings.period_s),
        plans_in_step_(settings.plans_in_step),
        values_(SetPointFilters::values(axes())),
        period_s_(settings.period_s),
        events_(std::bit_ceil(queue_)),
        stops_(std::bit_ceil(queue_)),
        delay_(static_cast<std::size_t>(std::lround(filters_.mean_samples()))),
        passed_(static_cast<std::size_t>(filters_.duration_samples()) + 1) {
    override_.store(settings.limits.feed_override, std::memory_order_relaxed);
    restart(std::array<double, max_controller_axes>{});
  }

  PushResult push(const Segment& segment, std::span<const double> following_end, const SegmentRules& rules) noexcept {
    if (const PushResult closed = closed_to_pushes(); closed != PushResult::accepted) return closed;
    const std::uint64_t head = head_.load(std::memory_order_relaxed);
    if (head - planner_.running() >= queue_) return PushResult::queue_full;
    if (!travel_.hold(segment, following_end)) return PushResult::beyond_travel;
    const PushResult result = intake_.take(segment, following_end, rules, ring_[head]);
    if (result != PushResult::accepted) return result;
    head_.store(head + 1, std::memory_order_release);
    return PushResult::accepted;
  }

  // Behind the segment that was pushed last.
  PushResult push_event(const ControllerEvent& event) noexcept {
    if (const PushResult closed = closed_to_pushes(); closed != PushResult::accepted) return closed;
    const bool has_room = events_.push(head_.load(std::memory_order_relaxed), {event, stops_.pushed()});
    return has_room ? PushResult::accepted : PushResult::queue_full;
  }
  PushResult push_stop() noexcept {
    if (const PushResult closed = closed_to_pushes(); closed != PushResult::accepted) return closed;
    const std::uint64_t head = head_.load(std::memory_order_relaxed);
    if (!stops_.push(head, {})) return PushResult::queue_full;
    intake_.wait(stops_.pushed());
    rests_at_.store(head, std::memory_order_relaxed);
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
    const auto* const next = events_.first();
    if (next == nullptr || stops_.taken() < next->what.stops_before || !has_reached(next->segment)) return false;
    event = next->what.event;
    events_.drop();
    return true;
  }

  bool plan() noexcept {
    if (is_stopping()) return false;
    // Either this is seen by flushed(), or the flush is seen here.
    is_planning_.store(true, std::memory_order_seq_cst);
    const Flush flush = flush_.load(std::memory_order_seq_cst);
    const bool worked = (flush == Flush::none || flush == Flush::over) &&
                        planner_.plan(head_.load(std::memory_order_acquire), planned_ratios(),
                                      settled_.load(std::memory_order_relaxed), stops_.taken());
    is_planning_.store(false, std::memory_order_release);
    return worked;
  }

  Activity step() noexcept {
    if (!std::exchange(is_measured_, false)) spindle_.miss();
    const Flush flush = flush_.load(std::memory_order_acquire);
    if (flush == Flush::over || flush == Flush::asked_again) go_on();
    const bool stays = flush == Flush::at_rest || flush == Flush::taken;
    const Now now = stays ? Now{&rest_, first_ + done_, true, 0} : run();
    rest_periods_ = now.rests ? std::min(rest_periods_ + 1, settled_periods()) : 0;
    settled_.store(is_settled(), std::memory_order_relaxed);
    const PlannedPoint& point = *now.point;
    step_beside(jog_mode(now.rests, flush), point);
    still_periods_ = now.rests && rests_beside() ? std::min(still_periods_ + 1, settled_periods()) : 0;
    // What leaves the control has to be back on the path as well.
    is_beside_ = jog_.is_beside() || retrace_.is_beside() || (is_beside_ && !is_still());
    filter(point);
    ++state_.steps;
    passed_[state_.steps % passed_.size()] = {point.distance, now.running, point.line,
                                              now.rests || point.point.state.speed <= 0.0};
    const Activity activity = stays ? activity_at_rest() : activity_now();
    // At rest, to the last bit, whatever taps round to.
    if (activity == Activity::idle && offset_.is_none() && !is_beside_) set_values(point.position, {}, {});
    publish(activity, now);
    if (is_still() && flush_.load(std::memory_order_relaxed) == Flush::asked) {
      rest_ = point;
      rest_at_ = point.position;
      AxisValues velocity{};
      AxisValues acceleration{};
      add_beside(rest_at_, velocity, acceleration);
      done_ = now.running - first_;
      flush_.store(Flush::at_rest, std::memory_order_release);
    }
    return activity;
  }

  // Of the set-point that was given last: position, velocity, acceleration.
  [[nodiscard]] std::span<const double> values(std::size_t order) const noexcept {
    return std::span(values_).subspan(order * axes(), axes());
  }

  void feed_override(double ratio) noexcept { set_override(override_, ratio); }
  void rapid_override(double ratio) noexcept { set_override(rapid_override_, ratio); }
  void spindle(double revolutions) noexcept {
    spindle_.measure(revolutions);
    is_measured_ = true;
  }
  void hold() noexcept {
    hold_.store(true, std::memory_order_relaxed);
    stops_beside_.store(true, std::memory_order_relaxed);
  }
  void resume() noexcept {
    hold_.store(false, std::memory_order_relaxed);
    const std::uint64_t reached = stops_reached_.load(std::memory_order_relaxed);
    if (reached > stops_resumed_.load(std::memory_order_relaxed)) {
      stops_resumed_.store(reached, std::memory_order_relaxed);
    }
    // What is asked for from now on would be dropped by the step that leads back.
    if (abort_.load(std::memory_order_relaxed) || flush_.load(std::memory_order_relaxed) != Flush::none) return;
    jog_.close();
    retrace_.close();
  }
  void abort() noexcept {
    abort_.store(true, std::memory_order_relaxed);
    stops_beside_.store(true, std::memory_order_relaxed);
  }
  void emergency_stop() noexcept {
    emergency_.store(brakes_, std::memory_order_relaxed);
    abort();
  }
  JogResult jog(int axis, double speed) noexcept { return jog_.jog(static_cast<std::size_t>(axis), speed); }
  JogResult jog_by(int axis, double distance, double speed) noexcept {
    return jog_.jog_by(static_cast<std::size_t>(axis), distance, speed);
  }
  JogResult retrace(double distance_mm) noexcept { return retrace_.ask(distance_mm); }
  bool offset(int axis, double value) noexcept { return offset_.set(static_cast<std::size_t>(axis), value); }
  bool travel(int axis, const AxisTravel& travel) noexcept {
    return travel_.set(static_cast<std::size_t>(axis), travel);
  }
  void flush() noexcept {
    stops_beside_.store(true, std::memory_order_relaxed);
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
    // Either the jog that would begin sees this, or its begin is seen here.
    Flush rest = Flush::at_rest;
    if (!flush_.compare_exchange_strong(rest, Flush::taken, std::memory_order_seq_cst)) return false;
    if (is_planning_.load(std::memory_order_seq_cst)) {
      flush_.store(Flush::at_rest, std::memory_order_seq_cst);
      return false;
    }
    new_head_ = push_from(rest_at_);
    std::copy_n(rest_at_.begin(), std::min(position.size(), axes()), position.begin());
    flush_.store(Flush::over, std::memory_order_seq_cst);
    return true;
  }

  bool exchange_shaper(std::size_t number) noexcept {
    if (number >= filters_.shapers()) return false;
    shaper_.store(number, std::memory_order_relaxed);
    return true;
  }

  bool restart(std::span<const double> position) noexcept {
    if (!std::ranges::all_of(position, [](double value) { return std::isfinite(value); })) return false;
    hold_.store(false, std::memory_order_relaxed);
    abort_.store(false, std::memory_order_relaxed);
    flush_.store(Flush::none, std::memory_order_relaxed);
    offset_.restart();
    AxisValues rest{};
    std::copy_n(position.begin(), std::min(position.size(), axes()), rest.begin());
    std::ranges::fill(values_, 0.0);
    std::copy_n(rest.begin(), axes(), values_.begin());
    const std::uint64_t head = push_from(rest);
    filters_.reset(values(0));
    step_from(head, 0);
    rest_periods_ = still_periods_ = settled_periods();
    settled_.store(true, std::memory_order_relaxed);
    state_ = {};
    first_ = head;
    publish(Activity::idle, {&planner_.sections().point(), head, true, 0});
    return true;
  }

  [[nodiscard]] ControllerState state() const noexcept { return shared_.read(); }
  [[nodiscard]] std::size_t axes() const noexcept { return axis_count + n_following_; }
  [[nodiscard]] double delay_periods() const noexcept {
    return filters_.mean_samples(shaper_.load(std::memory_order_relaxed));
  }
  [[nodiscard]] int correction_delay() const noexcept { return filters_.correction_samples(); }

 private:
  // Asked for by anybody, at_rest is said by the thread that steps, over by the one that pushes, none by the former.
  // While it is taken the pushing thread is at work.
  enum class Flush : std::uint8_t { none, asked, at_rest, taken, over, asked_again };
  // A period: where the path is, which segment is run, whether it rests.
  struct Now {
    const PlannedPoint* point;
    std::uint64_t running;
    bool rests;
    std::uint64_t waiting;  // segments that are not run to their ends
  };

  [[nodiscard]] PushResult closed_to_pushes() const noexcept {
    if (abort_.load(std::memory_order_relaxed)) return PushResult::aborted;
    const Flush flush = flush_.load(std::memory_order_acquire);
    return flush == Flush::none || flush == Flush::over ? PushResult::accepted : PushResult::flushing;
  }

  // One period of the path.
  Now run() noexcept {
    Sections& sections = planner_.sections();
    if (emergency_.load(std::memory_order_relaxed) && !is_bound_) {
      if (!is_braked_) brake_.begin(sections.current(), sections.index());
      is_braked_ = true;
      const bool rested = brake_.at_rest();
      const PlannedPoint& point = brake_.step();
      return now_at(point, point.point.segment, rested);
    }
    const bool is_paused = !sections.at_rest() && ratios().of(sections.point().rate_of) <= 0.0;
    is_paused_.store(is_paused, std::memory_order_relaxed);
    if (plans_in_step_ && sections.wants_more()) plan();
    const PlannedPoint& point = sections.step(is_stopping() || is_beside_, travel_);
    if (sections.was_late() && !planner_.has_failed()) ++state_.late_plans;
    if (sections.was_refused()) {
      ++state_.travel_stops;
      hold_.store(true, std::memory_order_relaxed);
    }
    if (sections.is_bound()) return follow_spindle(sections);
    const bool rests = sections.at_rest();
    return now_at(point, rests ? sections.current().done : point.point.segment, rests);
  }
  // One period of motion that is bound to the spindle.
  Now follow_spindle(Sections& sections) noexcept {
    const std::uint64_t segment = sections.current().points[0].point.segment;
    if (!is_bound_) spindle_feed_.begin(ring_[segment], sections.point());
    is_bound_ = true;
    const bool brakes =
        abort_.load(std::memory_order_relaxed) || flush_.load(std::memory_order_relaxed) == Flush::asked;
    spindle_feed_.step(spindle_, is_settled() && !is_stopping() && !is_beside_ && !fades_, brakes);
    if (spindle_feed_.is_lost()) abort_.store(true, std::memory_order_relaxed);
    if (spindle_feed_.at_end()) {
      sections.pass();
      is_bound_ = false;
    }
    return now_at(spindle_feed_.point(), segment, spindle_feed_.at_rest());
  }
  [[nodiscard]] Now now_at(const PlannedPoint& point, std::uint64_t running, bool rests) const noexcept {
    return {&point, running, rests, head_.load(std::memory_order_relaxed) - running};
  }

  // Whether axes may be jogged, or have to go back to the path.
  Jog::Mode jog_mode(bool rests, Flush flush) noexcept {
    if (stops_beside_.exchange(false, std::memory_order_relaxed)) {
      jog_.stop();
      retrace_.stop();
    }
    if (!rests || flush == Flush::taken) return Jog::Mode::closed;
    if (flush == Flush::at_rest) {
      // What is jogged rests elsewhere.
      const bool is_asked = jog_.is_asked() || retrace_.is_asked();
      if (is_asked && !flush_.compare_exchange_strong(flush, Flush::asked, std::memory_order_seq_cst)) {
        return Jog::Mode::closed;
      }
      return Jog::Mode::open;
    }
    const bool is_open = flush == Flush::asked || hold_.load(std::memory_order_relaxed) ||
                         abort_.load(std::memory_order_relaxed) || stops_reached_.load(std::memory_order_relaxed) > 0;
    if (is_open) return Jog::Mode::open;
    return jog_.is_beside() || retrace_.is_beside() ? Jog::Mode::returns : Jog::Mode::closed;
  }

  // One of them at a time: back from a jog first, then forward along the path.
  void step_beside(Jog::Mode mode, const PlannedPoint& point) noexcept {
    if (is_bound_ || is_braked_) {
      // Neither a thread nor an emergency stop is run backwards; one in which the path rested ends beside it.
      if (!retrace_.is_beside()) retrace_.restart();
    } else if (!is_beside_) {
      retrace_.note(point);
    }
    const bool retraces = !retrace_.at_rest();
    const bool jogs = mode == Jog::Mode::returns ? jog_.is_beside() : !jog_.at_rest();
    retrace_.step(jogs ? Jog::Mode::closed : mode);
    AxisValues base = point.position;
    AxisValues unused{};
    retrace_.add_to(base, unused, unused);
    jog_.step(retraces || !retrace_.at_rest() ? Jog::Mode::closed : mode, base);
  }
  void add_beside(AxisValues& position, AxisValues& velocity, AxisValues& acceleration) const noexcept {
    retrace_.add_to(position, velocity, acceleration);
    jog_.add_to(position, velocity, acceleration);
  }
  [[nodiscard]] bool rests_beside() const noexcept { return jog_.at_rest() && retrace_.at_rest(); }

  void set_values(const AxisValues& position, const AxisValues& velocity, const AxisValues& acceleration) noexcept {
    std::size_t order = 0;
    for (const AxisValues* derivative : {&position, &velocity, &acceleration}) {
      std::copy_n(derivative->begin(), axes(), values_.begin() + static_cast<std::ptrdiff_t>(axes() * order++));
    }
  }
  // Everything that moves an axis, through the filters.
  void filter(const PlannedPoint& point) noexcept {
    AxisValues position = point.position;
    AxisValues velocity = point.velocity;
    AxisValues acceleration = point.acceleration;
    add_beside(position, velocity, acceleration);
    offset_.step(position);
    offset_.add_to(position, velocity, acceleration);
    set_values(position, velocity, acceleration);
    // What is bound to the spindle has begun with the delay of its shaper.
    const bool fades =
        (!is_bound_ || spindle_feed_.waits()) && filters_.choose(shaper_.load(std::memory_order_relaxed));
    filters_.step(values_);
    if (fades || fades_) {
      delay_ = static_cast<std::size_t>(std::lround(filters_.mean_samples()));
      spindle_.set_ahead(filters_.mean_samples() * period_s_);
    }
    fades_ = fades;
  }

  // Between flush() and flushed() what is planned is not looked at.
  [[nodiscard]] Activity activity_at_rest() const noexcept {
    return rest_of(abort_.load(std::memory_order_relaxed), hold_.load(std::memory_order_relaxed));
  }
  void go_on() noexcept {
    first_ = new_head_ - done_;
    step_from(new_head_, rest_.line);
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
    events_from_ = events_.pushed();
    stops_from_ = stops_.pushed();
    return head;
  }
  // At rest before a segment; what belongs to places before it is dropped.
  void step_from(std::uint64_t segment, std::uint32_t line) noexcept {
    runs_out_ = is_braked_ = is_bound_ = is_beside_ = false;
    emergency_.store(false, std::memory_order_relaxed);
    retrace_.restart();
    jog_.restart();
    std::ranges::fill(passed_, Passed{0.0, segment, line, true});
    events_.drop_before(events_from_);
    stops_.drop_before(stops_from_);
    stops_reached_.store(0, std::memory_order_relaxed);
  }

  [[nodiscard]] static Activity rest_of(bool aborts, bool holds) noexcept {
    if (aborts) return Activity::aborted;
    return holds ? Activity::held : Activity::idle;
  }

  // At rest for so long what leaves the filters is at rest: the first period counts.
  [[nodiscard]] int settled_periods() const noexcept { return filters_.duration_samples() + 1; }
  [[nodiscard]] bool is_settled() const noexcept { return rest_periods_ == settled_periods(); }
  // With the axes that are jogged.
  [[nodiscard]] bool is_still() const noexcept { return still_periods_ == settled_periods(); }
  static void set_override(std::atomic<double>& override, double ratio) noexcept {
    if (!std::isnan(ratio)) override.store(std::clamp(ratio, 0.0, max_override), std::memory_order_relaxed);
  }
  [[nodiscard]] FeedRatios ratios() const noexcept {
    return {override_.load(std::memory_order_relaxed), rapid_override_.load(std::memory_order_relaxed),
            spindle_.speed()};
  }
  // Of the thread that plans: the spindle's speed is not followed into its ripple.
  FeedRatios planned_ratios() noexcept {
    FeedRatios now = ratios();
    if (std::abs(now.revolutions_per_s - planned_speed_) > followed_share * planned_speed_) {
      planned_speed_ = now.revolutions_per_s;
    }
    now.revolutions_per_s = planned_speed_;
    return now;
  }
  [[nodiscard]] bool is_stopping() const noexcept {
    return hold_.load(std::memory_order_relaxed) || abort_.load(std::memory_order_relaxed) ||
           is_paused_.load(std::memory_order_relaxed) || flush_.load(std::memory_order_relaxed) == Flush::asked;
  }

  Activity activity_now() noexcept {
    const bool still = is_still();
    // Each once: another thread may change them meanwhile.
    const bool aborts = abort_.load(std::memory_order_relaxed);
    const bool holds = hold_.load(std::memory_order_relaxed);
    const bool stops = aborts || holds || flush_.load(std::memory_order_relaxed) == Flush::asked;
    const bool waits = !stops && waits_at_stop(is_settled());
    if (!rests_beside() || (!stops && !waits && is_beside_)) return Activity::jogging;
    if (stops) return still ? rest_of(aborts, holds) : Activity::stopping;
    if (waits) return still ? Activity::held : Activity::stopping;
    const Section& section = planner_.sections().current();
    const bool is_last = section.done == head_.load(std::memory_order_relaxed);
    const bool runs_out = section.runs_out && is_last && section.done != rests_at_.load(std::memory_order_relaxed);
    if (runs_out && !runs_out_) ++state_.starvations;
    runs_out_ = runs_out;
    if (still && is_last && !is_bound_) return Activity::idle;
    return runs_out ? Activity::starved : Activity::moving;
  }

  // A stop that was pushed is over when it was reached and resumed: each one of several at the same place.
  bool waits_at_stop(bool settled) noexcept {
    const auto* next = stops_.first();
    if (next != nullptr && stops_resumed_.load(std::memory_order_relaxed) > stops_.taken()) {
      stops_.drop();
      next = stops_.first();
    }
    const bool waits = next != nullptr && settled && has_reached(next->segment);
    stops_reached_.store(waits ? stops_.taken() + 1 : 0, std::memory_order_relaxed);
    return waits;
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

  void publish(Activity activity, const Now& now) noexcept {
    const PlannedPoint& point = *now.point;
    state_.activity = activity;
    std::ranges::copy(values(0), state_.set_point.begin());
    state_.speed_mm_per_s = point.point.state.speed;
    state_.distance_mm = point.distance;
    state_.feed_override = override_.load(std::memory_order_relaxed);
    state_.rapid_override = rapid_override_.load(std::memory_order_relaxed);
    state_.line = point.line;
    state_.spindle_speed = spindle_.smooth().speed;
    state_.spindle_error_mm = is_bound_ ? spindle_feed_.error_mm() : 0.0;
    state_.segments_done = now.running - first_;
    state_.segments_waiting = now.waiting;
    const Passed& behind = passed(delay_);
    state_.set_point_distance_mm = behind.distance_mm;
    state_.set_point_line = behind.line;
    for (std::size_t i = 0; i < axes(); ++i) state_.offset[i] = offset_.of(i);
    state_.shaper = filters_.shaper();
    shared_.write(state_);
  }

  static constexpr double followed_share = 0.005;
  static constexpr double longest_dwell_s = 1e6;
  static constexpr double dwell_rounding = 1e-12;
  // For segments that are done with, but whose roundings may reach what follows.
  static constexpr std::size_t room_behind = RoundedPath::lookback + 1;

  std::size_t n_following_;
  SetPointFilters filters_;
  Intake intake_;  // of the pushing thread
  std::size_t queue_;
  SegmentRing ring_;
  PlanningRules rules_;
  OnlinePlanner planner_;
  SoftLimits travel_;
  Retrace retrace_;
  Jog jog_;
  ExternalOffset offset_;
  PathBrake brake_;
  bool brakes_;  // harder than planned
  Spindle spindle_;
  SpindleFeed spindle_feed_;
  bool plans_in_step_;
  alignas(cache_line) std::atomic<std::uint64_t> head_{0};  // the next segment to be pushed
  alignas(cache_line) std::atomic<double> override_{1.0}, rapid_override_{1.0};
  std::atomic<bool> is_paused_{false};  // moves where the feed is multiplied with 0
  double planned_speed_ = 0.0;
  std::atomic<bool> hold_{false};
  std::atomic<bool> abort_{false};
  std::atomic<bool> emergency_{false};
  std::atomic<std::size_t> shaper_{0};
  std::atomic<bool> stops_beside_{false};
  std::atomic<bool> settled_{true};
  std::atomic<Flush> flush_{Flush::none};
  std::atomic<bool> is_planning_{false};
  // Of a flush: where it rests, segments done before it, and what comes behind it.
  PlannedPoint rest_;
  AxisValues rest_at_{};  // with what was jogged
  std::uint64_t done_ = 0;
  std::uint64_t new_head_ = 0, events_from_ = 0, stops_from_ = 0;

  // Of the real-time thread.
  alignas(cache_line) std::uint64_t first_ = 0;
  bool runs_out_ = false;
  int rest_periods_ = 0, still_periods_ = 0;
  bool is_measured_ = false;  // the spindle, for this period
  bool is_braked_ = false, is_bound_ = false, is_beside_ = false, fades_ = false;
  std::vector<double> values_;  // as the filters have them
  double period_s_;
  struct Event {
    ControllerEvent event;
    std::uint64_t stops_before = 0;  // that were pushed
  };
  struct Nothing {};
  PlaceQueue<Event> events_;
  PlaceQueue<Nothing> stops_;               // that were pushed
  std::atomic<std::uint64_t> rests_at_{0};  // a dwell or stop is behind the segment before this one
  // Stops, counted as they were pushed: up to the one at which it waits, 0 if it does not; and those that are over.
  std::atomic<std::uint64_t> stops_reached_{0}, stops_resumed_{0};
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

PushResult MotionController::push(const Segment& segment, std::span<const double> following_end,
                                  const SegmentRules& rules) noexcept {
  return implementation_->push(segment, following_end, rules);
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
void MotionController::rapid_override(double ratio) noexcept { implementation_->rapid_override(ratio); }
void MotionController::spindle(double revolutions) noexcept { implementation_->spindle(revolutions); }
void MotionController::hold() noexcept { implementation_->hold(); }
void MotionController::resume() noexcept { implementation_->resume(); }
PushResult MotionController::push_event(const ControllerEvent& event) noexcept {
  return implementation_->push_event(event);
}
PushResult MotionController::push_dwell(double time_s) noexcept { return implementation_->push_dwell(time_s); }
PushResult MotionController::push_stop() noexcept { return implementation_->push_stop(); }
void MotionController::flush() noexcept { implementation_->flush(); }
bool MotionController::flushed(std::span<double> position) noexcept { return implementation_->flushed(position); }
void MotionController::probe(std::span<double> latched) noexcept { implementation_->probe(latched); }
bool MotionController::next_event(ControllerEvent& event) noexcept { return implementation_->next_event(event); }
void MotionController::abort() noexcept { implementation_->abort(); }
void MotionController::emergency_stop() noexcept { implementation_->emergency_stop(); }
JogResult MotionController::jog(int axis, double speed) noexcept { return implementation_->jog(axis, speed); }
JogResult MotionController::jog_by(int axis, double distance, double speed) noexcept {
  return implementation_->jog_by(axis, distance, speed);
}
JogResult MotionController::retrace(double distance_mm) noexcept { return implementation_->retrace(distance_mm); }
bool MotionController::offset(int axis, double value) noexcept { return implementation_->offset(axis, value); }
bool MotionController::travel(int axis, const AxisTravel& travel) noexcept {
  return implementation_->travel(axis, travel);
}
bool MotionController::restart(std::span<const double> position) noexcept { return implementation_->restart(position); }
ControllerState MotionController::state() const noexcept { return implementation_->state(); }
int MotionController::axes() const noexcept { return static_cast<int>(implementation_->axes()); }
bool MotionController::exchange_shaper(std::size_t number) noexcept { return implementation_->exchange_shaper(number); }
double MotionController::delay_periods() const noexcept { return implementation_->delay_periods(); }
int MotionController::correction_delay() const noexcept { return implementation_->correction_delay(); }

}  // namespace shapegcode
