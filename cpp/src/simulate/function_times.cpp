#include "simulate/function_times.hpp"

#include <algorithm>
#include <cmath>
#include <span>
#include <utility>

#include "simulate/program_runs.hpp"

namespace shapegcode {
namespace {

// Linear between the rows, in proportion to the speed below the first, constant beyond the last.
double spindle_time_s(const std::vector<SpindleTime>& table, double rev_per_min) noexcept {
  SpindleTime below;
  for (const SpindleTime& row : table) {
    if (rev_per_min <= row.rev_per_min) {
      const double share = (rev_per_min - below.rev_per_min) / (row.rev_per_min - below.rev_per_min);
      return below.seconds + share * (row.seconds - below.seconds);
    }
    below = row;
  }
  return below.seconds;
}

bool starts(int code) noexcept { return code == 3 || code == 4; }

// Whoever stops the program, changes the tool or turns the spindle the other way waits for it to rest.
bool waits_for_rest(int code) noexcept { return code <= 4 || code == detail::tool_change_code || code == 30; }

}  // namespace

namespace detail {

FunctionTimes::FunctionTimes(const Program& program, const FanucModel& model) : model_(model) {
  if (model.last_tool_in_spindle) {
    std::int64_t selected = -1;
    for (const MachineFunction& function : program.functions) {
      selected = function.tool >= 0 ? function.tool : selected;
      tool_ = changes_tool(function) ? selected : tool_;
    }
  }
}

FunctionWait FunctionTimes::functions(const MachineFunction& function, double now_s) {
  selected_ = function.tool >= 0 ? function.tool : selected_;
  if (function.spindle_rev_per_min >= 0.0) {
    spindle_ = function.spindle_rev_per_min;
    if (running_ > 0.0 && function.m_count == 0) {
      start(now_s);
    }
  }
  FunctionWait sum;
  sum.function_s = start_of_program();
  const auto elapsed = [&] { return now_s + sum.tool_change_s + sum.function_s; };
  for (const int code : std::span(function.m_codes).first(static_cast<std::size_t>(function.m_count))) {
    if (waits_for_rest(code)) {
      sum.function_s += wait(elapsed(), true);
    }
    if (starts(code)) {
      start(elapsed());
    } else if (code == 5) {
      stopped_s_ = elapsed() + spindle_time_s(model_.spindle_stop_s, running_);
      running_ = 0.0;
      ready_s_ = 0.0;
    } else {
      sum.function_s += wait(elapsed(), false);
    }
    if (code == tool_change_code) {
      sum.tool_change_s += tool_ >= 0 && tool_ == selected_ ? 0.0 : model_.tool_change_s;
      tool_ = model_.last_tool_in_spindle ? selected_ : -1;
    } else {
      const auto own = model_.m_code_s.find(code);
      sum.function_s += own != model_.m_code_s.end() ? own->second : model_.m_function_s;
    }
  }
  double move_s = 0.0;
  for (std::size_t axis = 0; axis < axis_count; ++axis) {
    if (function.unknown_move[axis]) {
      move_s = std::max(move_s, model_.unknown_move_s[static_cast<Eigen::Index>(axis)]);
    }
  }
  sum.function_s += move_s / model_.rapid_override;
  return sum;
}

double FunctionTimes::before_cut(double now_s) { return start_of_program() + wait(now_s, false); }

double FunctionTimes::start_of_program() noexcept {
  return std::exchange(started_, true) ? 0.0 : model_.program_start_s;
}

double FunctionTimes::wait(double now_s, bool for_stop) {
  return std::max(0.0, (for_stop ? stopped_s_ : ready_s_) - now_s);
}

void FunctionTimes::start(double now_s) {
  ready_s_ = now_s + std::abs(spindle_time_s(model_.spindle_start_s, spindle_) -
                              spindle_time_s(model_.spindle_start_s, running_));
  running_ = spindle_;
  stopped_s_ = 0.0;
}

}  // namespace detail
}  // namespace shapegcode
