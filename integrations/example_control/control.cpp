#include "control.hpp"

#include <utility>

#include "shapegcode/error.hpp"

using namespace shapegcode;

namespace {

// A restart puts the control where the machine stands.
MotionController made_at(const Machine& machine, const Vector3& start_mm) {
  MotionController motion(settings_of(machine));
  motion.restart(values_of(start_mm));
  return motion;
}

}  // namespace

Control::Control(const Machine& machine, Job job, const Vector3& start_mm)
    : machine_(machine), motion_(made_at(machine, start_mm)), rows_(16'384), job_(std::move(job)) {
  for (int axis = 0; axis < axis_count; ++axis) {
    drives_.emplace_back(machine, axis);
    drives_.back().reset(start_mm[axis]);
  }
}

// --- The planning thread ---------------------------------------------------------------------------------------------

bool Control::plan() {
  if (flushes_) {
    Vector3 rest;
    if (!motion_.flushed(values_of(rest))) return motion_.plan();  // it still moves
    job_ = Job{{}, {}, rest};
    next_ = 0;
    motion_.resume();  // a hold does not outlive what it held
    flushes_ = false;
  }
  std::optional<std::string> block;
  {
    const std::lock_guard lock(mutex_);
    block = std::exchange(block_, std::nullopt);
  }
  if (block) begin_block(*block);
  const std::size_t before = next_;
  while (next_ < job_.items.size() && push(job_.items[next_])) ++next_;
  if (next_ == job_.items.size() && !is_pushed_) {
    pushed_at_ = motion_.state().steps;
    is_pushed_ = true;
  }
  return motion_.plan() || next_ != before;
}

// What is not taken comes again: the queue is full, or an abort or a flush makes all of it void.
bool Control::push(const Item& item) noexcept {
  PushResult result = PushResult::accepted;
  if (const auto* segment = std::get_if<Segment>(&item)) result = motion_.push(*segment);
  if (const auto* event = std::get_if<ControllerEvent>(&item)) result = motion_.push_event(*event);
  if (const auto* dwell = std::get_if<Dwell>(&item)) result = motion_.push_dwell(dwell->time_s);
  if (std::holds_alternative<ProgramStop>(item)) result = motion_.push_stop();
  return result == PushResult::accepted;
}

void Control::begin_block(const std::string& text) {
  try {
    job_ = read_job(text + "\nM30\n", job_.end_mm, machine_);
    next_ = 0;
    is_on_path_ = false;
  } catch (const Error& error) {
    const std::lock_guard lock(mutex_);
    message_ = error.what();
  }
}

// --- The real-time thread --------------------------------------------------------------------------------------------

void Control::period() noexcept {
  Row row;
  row.time_s = time_s_ += machine_.period_s;
  row.activity = motion_.step(row.set_point);
  for (std::size_t axis = 0; axis < axis_count; ++axis) {
    row.table_mm[static_cast<int>(axis)] = drives_[axis].step(
        row.set_point.position[axis], row.set_point.velocity[axis], row.set_point.acceleration[axis]);
  }
  // Spindle, coolant and the rest are switched here; what finds no room in this row comes with the next one.
  while (row.event_count < Row::max_events && motion_.next_event(row.events[row.event_count])) ++row.event_count;
  if (touches_.exchange(false)) {
    std::array<double, axis_count> latched{};
    motion_.probe(latched);
    row.probed = true;
    is_cut_short_ = true;
    flushes_ = true;
  }
  const ControllerState state = motion_.state();
  row.feed_override = state.feed_override;
  row.line = state.set_point_line;
  row.is_on_path = is_on_path_;
  idle_periods_ = row.activity == Activity::idle ? idle_periods_ + 1 : 0;
  rows_.put(row);
}

// --- The operator's thread -------------------------------------------------------------------------------------------

void Control::resume() noexcept {
  resumed_at_ = motion_.state().steps;
  motion_.resume();
}

void Control::flush() noexcept {
  is_cut_short_ = true;
  motion_.flush();
  flushes_ = true;
}

bool Control::run_block(const std::string& text) {
  if (!is_done()) return false;
  const std::lock_guard lock(mutex_);
  block_ = text;
  is_pushed_ = false;
  return true;
}

std::optional<std::string> Control::take_message() {
  const std::lock_guard lock(mutex_);
  return std::exchange(message_, std::nullopt);
}

bool Control::is_done() const noexcept {
  const ControllerState state = motion_.state();
  if (state.activity == Activity::aborted) return true;
  if (!is_pushed_ || flushes_ || touches_ || state.steps < pushed_at_ + 2) return false;
  // Where a stop comes last, behind events, a period is idle until they are read.
  return idle_periods_ >= 3 && state.segments_waiting == 0;
}

// The state is that of the last step, which may not know of the last resume() yet.
bool Control::is_held() const noexcept {
  const ControllerState state = motion_.state();
  return state.activity == Activity::held && !flushes_ && !touches_ && state.steps >= resumed_at_ + 2;
}
