#include "operator_session.hpp"

#include <algorithm>
#include <cmath>
#include <span>

namespace shapegcode::tests {
namespace {

constexpr double period_s = 0.001;
constexpr double speed = 150.0;
constexpr double acceleration = 1500.0;
constexpr double jerk = 60'000.0;
constexpr double emergency = 2.0 * acceleration;
constexpr double tolerance_mm = 0.05;
constexpr double slack = 1.001;
constexpr int settled = 30;                 // periods, more than the filters have
constexpr std::size_t longest_stop = 3000;  // periods
constexpr std::size_t longest_run = 60'000;

ControllerSettings settings_of(std::uint32_t seed) {
  ControllerSettings settings;
  settings.period_s = period_s;
  settings.limits.law = AccelerationLaw::jerk_limited;
  settings.limits.max_feed_mm_per_s.setConstant(speed);
  settings.limits.max_acceleration_mm_per_s2.setConstant(acceleration);
  settings.limits.max_jerk_mm_per_s3.setConstant(jerk);
  settings.contour_tolerance_mm = tolerance_mm;
  settings.window = 32;
  settings.queue = 64;
  settings.plans_in_step = seed % 2 != 0;
  settings.lead_periods = 40;
  settings.retrace_periods = 800;
  settings.emergency_acceleration.assign(axis_count, emergency);
  if (seed % 4 == 3) settings.offset.assign(axis_count, {15.0, 150.0, 6000.0, 0.0});
  if (seed % 3 == 1) settings.shaper = Fir({0, 9}, {0.55, 0.45});
  if (seed % 3 == 2) {
    settings.smoothing_time_s = 0.008;
    settings.shaper = Fir({0, 7, 15}, {0.3, 0.4, 0.3});
  }
  if (seed % 5 == 0) {
    settings.other_shapers = {Fir({0, 22}, {0.5, 0.5}),
                              std::vector<Fir>(axis_count, Fir({0, 6, 12}, {1.0, -1.0, 1.0}))};
    settings.fade_time_s = 0.5;
  }
  return settings;
}

Eigen::Vector3d vector_of(const std::array<double, axis_count>& point) { return {point[0], point[1], point[2]}; }

double distance_to(const Eigen::Vector3d& point, const Eigen::Vector3d& begin, const Eigen::Vector3d& end) {
  const Eigen::Vector3d along = end - begin;
  const double share = along.squaredNorm() > 0.0 ? (point - begin).dot(along) / along.squaredNorm() : 0.0;
  return (point - begin - std::clamp(share, 0.0, 1.0) * along).norm();
}

}  // namespace

OperatorSession::OperatorSession(std::uint32_t seed)
    : draw_{std::mt19937(seed)},
      plans_(seed % 2 == 0),
      offsets_(seed % 4 == 3),
      exchanges_(seed % 5 == 0),
      control_(settings_of(seed)) {
  rows_.push_back({});
}

void OperatorSession::expect(bool holds, const std::string& what) {
  if (!holds && broken_.empty()) broken_ = what;
}

void OperatorSession::step() {
  if (plans_) control_.plan();
  Point point{};
  control_.step(point);
  rows_.push_back(point);
  ControllerEvent event;
  while (control_.next_event(event)) {
    expect(event.word == 7 * std::uint64_t{event.id}, "an event lost its word");
    reached_.emplace_back(event.id, rows_.size() - 1);
  }
}

// A segment with what follows it.
void OperatorSession::push() {
  const double kind = draw_.uniform();
  const double reach = kind < 0.1 ? 0.05 : 8.0;
  Point end = at_;
  for (std::size_t i = 0; i < axis_count; ++i) end[i] += draw_.between(-reach, reach) * (i == 2 ? 0.3 : 1.0);
  const double feed = draw_.between(5.0, 140.0);
  Segment segment = make_line(vector_of(at_), vector_of(end), feed);
  if (kind > 0.8) {
    const Eigen::Vector3d centre =
        vector_of(at_) + Eigen::Vector3d{draw_.between(1.0, 6.0), draw_.between(1.0, 6.0), 0.0};
    const double sweep = draw_.between(0.3, 6.0) * (draw_.chance(0.5) ? 1.0 : -1.0);
    const Eigen::Vector3d from = vector_of(at_) - centre;
    const Eigen::Vector3d to(centre.x() + from.x() * std::cos(sweep) - from.y() * std::sin(sweep),
                             centre.y() + from.x() * std::sin(sweep) + from.y() * std::cos(sweep), end[2]);
    segment = make_arc(vector_of(at_), to, centre, sweep, 2, feed);
    end = {to.x(), to.y(), to.z()};
  }
  segment.stop_at_end = draw_.chance(0.1);
  if (control_.push(segment) != PushResult::accepted) return;
  at_ = end;
  if (draw_.chance(0.3)) {
    const auto number = static_cast<std::uint32_t>(places_.size());
    if (control_.push_event({number, 7 * std::uint64_t{number}}) == PushResult::accepted) places_.push_back(end);
  }
  if (draw_.chance(0.05)) control_.push_dwell(draw_.between(0.0, 0.05));
  if (draw_.chance(0.03)) control_.push_stop();
}

void OperatorSession::flush() {
  if (draw_.chance(0.5)) {
    control_.flush();
  } else {
    Point latched{};
    control_.probe(latched);
    expect(latched == rows_.back(), "a probe latched another set-point");
  }
  const Eigen::Vector3d here = vector_of(at_);
  const Eigen::Vector3d further = here + Eigen::Vector3d::Ones();
  expect(control_.push(make_line(here, further, 50.0)) == PushResult::flushing, "a segment was taken in a flush");
  control_.resume();
  control_.feed_override(1.0);
  Point position{};
  std::size_t waited = 0;
  while (!control_.flushed(position) && ++waited < longest_stop) step();
  expect(waited < longest_stop, "a flush did not come to its end");
  for (std::size_t i = 0; i < axis_count; ++i) {
    expect(offsets_ || std::abs(position[i] - rows_.back()[i]) < 1e-9, "flushed() gave another place");
  }
  at_ = position;
  forgotten_ = places_.size();
}

// After hold, flush or an emergency stop.
void OperatorSession::rest() {
  for (std::size_t i = 0; i < longest_stop; ++i) {
    const Activity activity = control_.state().activity;
    if (activity == Activity::held || activity == Activity::idle || activity == Activity::aborted) return;
    step();
  }
  expect(false, "it did not come to rest");
}

void OperatorSession::move_by_hand() {
  control_.hold();
  rest();
  for (int moves = static_cast<int>(draw_.between(1.0, 6.0)); moves > 0; --moves) {
    const int axis = static_cast<int>(draw_.between(0.0, 3.0));
    const double jog_speed = draw_.between(-60.0, 60.0);
    const double kind = draw_.uniform();
    if (kind < 0.4) {
      control_.jog(axis, jog_speed);
    } else if (kind < 0.7) {
      control_.jog_by(axis, draw_.between(-3.0, 3.0), std::abs(jog_speed));
    } else {
      control_.retrace(draw_.between(0.0, 10.0));
    }
    for (int i = static_cast<int>(draw_.between(1.0, 150.0)); i > 0; --i) step();
    control_.jog(axis, 0.0);
    if (draw_.chance(0.05)) {
      emergency_stop();
      return;
    }
  }
  if (draw_.chance(0.3)) flush();
}

void OperatorSession::emergency_stop() {
  braked_.push_back(rows_.size());
  control_.emergency_stop();
  rest();
  for (int i = 0; i < settled; ++i) step();
  while (rows_.back() != rows_[rows_.size() - 2]) step();  // an offset on its way
  at_ = rows_.back();
  expect(control_.restart(at_), "no restart");
  forgotten_ = places_.size();
}

void OperatorSession::operate() {
  const double kind = draw_.uniform();
  if (kind < 0.003) {
    control_.hold();
  } else if (kind < 0.02) {
    control_.resume();
  } else if (kind < 0.03) {
    control_.feed_override(draw_.between(0.0, 2.0));
  } else if (kind < 0.0315) {
    flush();
  } else if (kind < 0.0330) {
    move_by_hand();
  } else if (kind < 0.0335) {
    emergency_stop();
  } else if (kind < 0.0375 && exchanges_) {
    const auto number = static_cast<std::size_t>(draw_.between(0.0, 4.0));
    expect(control_.exchange_shaper(number) == (number < 3), "a shaper that is none was taken, or one was not");
  } else if (kind < 0.0395 && offsets_) {
    control_.offset(static_cast<int>(draw_.between(0.0, 3.0)), draw_.between(-2.0, 2.0));
  }
}

void OperatorSession::end() {
  control_.feed_override(1.0);
  std::size_t waited = 0;
  ControllerState state;
  do {
    control_.resume();
    step();
    state = control_.state();
  } while ((state.activity != Activity::idle || state.segments_waiting > 0) && ++waited < longest_run);
  expect(waited < longest_run, "the path did not end");
  for (int axis = 0; offsets_ && axis < axis_count; ++axis) control_.offset(axis, 0.0);
  for (int i = 0; i < 600; ++i) step();
}

std::string OperatorSession::run(std::size_t periods) {
  for (std::size_t i = 0; i < periods && broken_.empty(); ++i) {
    if (draw_.chance(0.15)) push();
    operate();
    step();
  }
  if (broken_.empty()) end();
  if (broken_.empty()) see_limits();
  if (broken_.empty()) see_events();
  return broken_;
}

// The taps of a shaper may be at rest between them.
bool OperatorSession::rests_from(std::size_t row) const {
  const auto begin = rows_.begin() + static_cast<std::ptrdiff_t>(row);
  const auto end = begin + std::min<std::ptrdiff_t>(settled, rows_.end() - begin);
  return std::all_of(begin, end, [&](const Point& point) { return point == *begin; });
}

void OperatorSession::see_limits() {
  // What follows an emergency stop, which has its own acceleration, begins at rest.
  std::size_t begin = 0;
  for (const std::size_t braked : braked_) {
    see_piece(begin, braked);
    begin = braked - 1;
    while (!rests_from(begin)) ++begin;
    for (std::size_t row = braked - 2; row + 2 < rows_.size() && row < begin; ++row) {
      for (std::size_t i = 0; i < axis_count; ++i) {
        const double change = rows_[row + 2][i] - 2.0 * rows_[row + 1][i] + rows_[row][i];
        expect(std::abs(change) <= slack * emergency * period_s * period_s, "braking above the emergency acceleration");
      }
    }
  }
  see_piece(begin, rows_.size());
  for (std::size_t i = 0; i < axis_count; ++i) {
    expect(std::abs(rows_.back()[i] - at_[i]) < 1e-9, "it rests elsewhere than the path ends");
  }
}

void OperatorSession::see_piece(std::size_t begin, std::size_t end) {
  for (std::size_t i = 0; i < axis_count; ++i) {
    double last_speed = 0.0;
    double last_acceleration = 0.0;
    for (std::size_t row = begin + 1; row < end; ++row) {
      const double now = (rows_[row][i] - rows_[row - 1][i]) / period_s;
      const double change = (now - last_speed) / period_s;
      const double change_again = (change - last_acceleration) / period_s;
      expect(std::abs(now) <= slack * speed && std::abs(change) <= slack * acceleration &&
                 std::abs(change_again) <= slack * jerk,
             "axis " + std::to_string(i) + " beyond its limits in period " + std::to_string(row) + ": " +
                 std::to_string(now) + ", " + std::to_string(change) + ", " + std::to_string(change_again));
      last_speed = now;
      last_acceleration = change;
    }
  }
}

void OperatorSession::see_events() {
  std::int64_t last = -1;
  std::size_t next = forgotten_;
  for (const auto& [number, row] : reached_) {
    expect(number > last, "event " + std::to_string(number) + " came twice, or late");
    last = number;
    // Behind the last flush none is missing; before it what had not been reached is gone.
    if (number >= forgotten_) expect(number == next++, "event " + std::to_string(number) + " is missing");
    const Eigen::Vector3d place = vector_of(places_[number]);
    const double off =
        std::min(distance_to(place, vector_of(rows_[row - 1]), vector_of(rows_[row])),
                 distance_to(place, vector_of(rows_[row]), vector_of(rows_[std::min(row + 1, rows_.size() - 1)])));
    // Places are without the offset.
    expect(offsets_ || off <= 2.0 * tolerance_mm, "event " + std::to_string(number) + " in period " +
                                                      std::to_string(row) + ", " + std::to_string(off) + " mm off");
  }
  expect(next == places_.size(), "an event was lost");
}

}  // namespace shapegcode::tests
