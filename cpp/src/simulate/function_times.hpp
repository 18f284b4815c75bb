#pragma once

#include "shapegcode/fanuc_model.hpp"
#include "shapegcode/program.hpp"

namespace shapegcode::detail {

/// Time of the machine functions of one block.
struct FunctionWait {
  double tool_change_s = 0.0;
  double function_s = 0.0;
};

/// Times of machine functions one after the other. The spindle starts and stops while the axes move: what is left of
/// its time is waited for where a machine waits, before the next cut, M code or stop of the program.
class FunctionTimes {
 public:
  FunctionTimes(const Program& program, const FanucModel& model);

  /// Of a block that begins at that time.
  [[nodiscard]] FunctionWait functions(const MachineFunction& function, double now_s);
  /// Before a cut that would begin at that time.
  [[nodiscard]] double before_cut(double now_s);

 private:
  [[nodiscard]] double wait(double now_s, bool for_stop);
  void start(double now_s);
  /// What is left of it: all of it before the first block that takes time here.
  [[nodiscard]] double start_of_program() noexcept;

  const FanucModel& model_;
  bool started_ = false;
  std::int64_t selected_ = -1;  // by the last T
  std::int64_t tool_ = -1;      // in the spindle; -1: not known
  double spindle_ = 0.0;        // S as last given
  double running_ = 0.0;        // speed asked for by M03 or M04; 0: at rest
  double ready_s_ = 0.0;        // when the spindle is as fast as it was asked to be
  double stopped_s_ = 0.0;      // when it is at rest
};

}  // namespace shapegcode::detail
