// A motion controller as Python has it: rows of set-points at once, segments that begin where the last one ended.
#pragma once

#include <pybind11/numpy.h>
#include <pybind11/stl.h>
#include <pybind11/typing.h>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <mutex>
#include <optional>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "shapegcode/controller.hpp"
#include "shapegcode/error.hpp"

namespace shapegcode::bindings {

/// What `run` may take and an array may hold.
inline constexpr std::size_t most_periods = 100'000'000;

/// Throws ArgumentError below zero.
inline std::size_t count_of(pybind11::ssize_t value, const char* name) {
  if (value >= 0) return static_cast<std::size_t>(value);
  throw Error(ErrorKind::argument, std::string(name) + " is " + std::to_string(value) + ", must not be below 0");
}

/// Angles of a spindle, copied where they are no array of numbers in a row.
using Angles = pybind11::array_t<double, pybind11::array::c_style | pybind11::array::forcecast>;

/// An event, and with which step it was reached.
struct PyEvent {
  ControllerEvent event;
  std::uint64_t step = 0;
};

/// A snapshot that knows how many axes there are.
struct PyState {
  ControllerState state;
  std::size_t axes;
};

// One thread may push, one may step and one may plan: the global lock keeps two from pushing at once, locks of their
// own two that step or plan.
class PyController {
 public:
  explicit PyController(const ControllerSettings& settings)
      : control_(settings),
        axes_(static_cast<std::size_t>(control_.axes())),
        following_(axes_ - axis_count, 0.0),
        stepping_(std::make_unique<std::mutex>()),
        planning_(std::make_unique<std::mutex>()) {}

  const MotionController& control() const noexcept { return control_; }
  MotionController& control() noexcept { return control_; }
  PyState state() const { return {control_.state(), axes_}; }
  pybind11::array_t<double> following_end() const {
    return pybind11::array_t<double>(static_cast<pybind11::ssize_t>(following_.size()), following_.data());
  }
  const Vector3& end() const noexcept { return end_; }

  PushResult push(const Segment& segment, const std::optional<std::vector<double>>& following,
                  const std::optional<SegmentRules>& rules) {
    const std::vector<double>& ends = following ? *following : following_;
    const PushResult result = control_.push(segment, ends, rules.value_or(SegmentRules{}));
    if (result == PushResult::accepted) {
      end_ = segment.end_mm;
      following_ = ends;
    }
    return result;
  }

  PushResult push_line(const Vector3& end, double feed, const std::optional<std::vector<double>>& following,
                       const std::optional<SegmentRules>& rules, std::uint32_t line, bool stop_at_end) {
    Segment segment = make_line(end_, end, feed, line);
    segment.stop_at_end = stop_at_end;
    return push(segment, following, rules);
  }

  PushResult push_arc(const Vector3& end, const Vector3& centre, double sweep, double feed, int normal,
                      const std::optional<std::vector<double>>& following, const std::optional<SegmentRules>& rules,
                      std::uint32_t line, bool stop_at_end) {
    Segment segment = make_arc(end_, end, centre, sweep, normal, feed, line);
    segment.stop_at_end = stop_at_end;
    return push(segment, following, rules);
  }

  /// Segments from `first` on, as many as are taken: the next one, and what the last one was answered.
  std::pair<pybind11::ssize_t, PushResult> push_path(const Path& path, pybind11::ssize_t first) {
    std::size_t i = count_of(first, "first");
    PushResult result = PushResult::accepted;
    while (i < path.size() && result == PushResult::accepted) {
      result = push(path[i], std::nullopt, std::nullopt);
      if (result == PushResult::accepted) ++i;
    }
    return {static_cast<pybind11::ssize_t>(i), result};
  }

  pybind11::array_t<double> step(pybind11::ssize_t periods, const std::optional<Angles>& spindle) {
    const std::size_t rows = count_of(periods, "periods");
    const auto angles = spindle ? static_cast<std::size_t>(spindle->size()) : rows;
    const double* const angle = spindle ? spindle->data() : nullptr;
    if (angles != rows) {
      throw Error(ErrorKind::argument,
                  std::to_string(angles) + " angles of the spindle for " + std::to_string(rows) + " periods");
    }
    pybind11::array_t<double> out({static_cast<pybind11::ssize_t>(rows), static_cast<pybind11::ssize_t>(axes_)});
    double* to = out.mutable_data();
    const pybind11::gil_scoped_release release;
    const std::lock_guard lock(*stepping_);
    for (std::size_t i = 0; i < rows; ++i) {
      if (angle != nullptr) control_.spindle(angle[i]);
      control_.step({to + i * axes_, axes_});
      note_events();
    }
    return out;
  }

  /// Positions, velocities and accelerations.
  pybind11::typing::Tuple<pybind11::array_t<double>, pybind11::array_t<double>, pybind11::array_t<double>> step_motion(
      pybind11::ssize_t periods) {
    using Rows = pybind11::array_t<double>;
    const std::size_t rows = count_of(periods, "periods");
    std::array<Rows, 3> out;
    std::array<double*, 3> to{};
    for (std::size_t i = 0; i < out.size(); ++i) {
      out[i] = Rows({static_cast<pybind11::ssize_t>(rows), static_cast<pybind11::ssize_t>(axes_)});
      to[i] = out[i].mutable_data();
    }
    {
      const pybind11::gil_scoped_release release;
      const std::lock_guard lock(*stepping_);
      MotionSetPoint now;
      for (std::size_t row = 0; row < rows; ++row) {
        control_.step(now);
        note_events();
        std::size_t order = 0;
        for (const auto* values : {&now.position, &now.velocity, &now.acceleration}) {
          std::copy_n(values->begin(), axes_, to[order++] + row * axes_);
        }
      }
    }
    return pybind11::make_tuple(out[0], out[1], out[2]);
  }

  /// Steps until there is nothing more to do, at most so often.
  pybind11::array_t<double> run(pybind11::ssize_t max_periods) {
    const std::size_t most = std::min(count_of(max_periods, "max_periods"), most_periods);
    std::vector<double> rows;
    {
      const pybind11::gil_scoped_release release;
      const std::lock_guard lock(*stepping_);
      for (std::size_t i = 0; i < most; ++i) {
        rows.resize(rows.size() + axes_);
        const Activity activity = control_.step(std::span(rows).last(axes_));
        note_events();
        if (is_at_rest(activity)) break;
      }
    }
    const auto count = static_cast<pybind11::ssize_t>(rows.size() / axes_);
    return pybind11::array_t<double>({count, static_cast<pybind11::ssize_t>(axes_)}, rows.data());
  }

  std::vector<PyEvent> take_events() {
    const std::lock_guard lock(*stepping_);
    return std::exchange(events_, {});
  }

  bool plan() {
    const pybind11::gil_scoped_release release;
    const std::lock_guard lock(*planning_);
    return control_.plan();
  }

  std::optional<pybind11::array_t<double>> flushed() {
    pybind11::array_t<double> position(static_cast<pybind11::ssize_t>(axes_));
    double* const at = position.mutable_data();
    if (!control_.flushed({at, axes_})) return std::nullopt;
    end_ = Vector3(at[0], at[1], at[2]);
    following_.assign(at + axis_count, at + axes_);
    return position;
  }

  pybind11::array_t<double> probe() {
    pybind11::array_t<double> latched(static_cast<pybind11::ssize_t>(axes_));
    const std::lock_guard lock(*stepping_);
    control_.probe({latched.mutable_data(), axes_});
    return latched;
  }

  void restart(const std::vector<double>& position) {
    if (position.size() != axes_) {
      throw Error(ErrorKind::argument, "position has " + std::to_string(position.size()) + " values, must have " +
                                           std::to_string(axes_) + ", one for each axis");
    }
    if (!std::ranges::all_of(position, [](double value) { return std::isfinite(value); })) {
      throw Error(ErrorKind::argument, "a value of the position is not finite");
    }
    const std::lock_guard lock(*stepping_);
    control_.restart(position);
    end_ = Vector3(position[0], position[1], position[2]);
    following_.assign(position.begin() + axis_count, position.end());
  }

 private:
  static bool is_at_rest(Activity activity) noexcept {
    return activity == Activity::idle || activity == Activity::held || activity == Activity::aborted;
  }

  void note_events() {
    ControllerEvent event;
    while (control_.next_event(event)) events_.push_back({event, control_.state().steps});
  }

  MotionController control_;
  std::size_t axes_;
  std::vector<PyEvent> events_;  // that nobody has taken
  Vector3 end_ = Vector3::Zero();
  std::vector<double> following_;
  std::unique_ptr<std::mutex> stepping_, planning_;
};

}  // namespace shapegcode::bindings
