#pragma once

#include <atomic>
#include <cstdint>
#include <mutex>
#include <optional>
#include <string>
#include <vector>

#include "job.hpp"
#include "machine.hpp"
#include "recorder.hpp"
#include "shapegcode/controller.hpp"

/// The control: a job goes in, the operator speaks to it, and once in a period it moves the drives. Three threads use
/// it, each only its own part; what they share are atomic flags and the MotionController.
class Control {
 public:
  Control(const Machine& machine, Job job, const shapegcode::Vector3& start_mm);

  // The planning thread.
  /// Pushes what there is room for, and plans ahead. False: nothing more to do at present, come again after some
  /// periods.
  bool plan();

  // The real-time thread: no allocation, no lock, no exception.
  void period() noexcept;

  // The operator's thread.
  void hold() noexcept { motion_.hold(); }
  shapegcode::JogResult jog_by(int axis, double distance_mm) noexcept {
    return motion_.jog_by(axis, distance_mm, jog_speed_mm_per_s);
  }
  void resume() noexcept;
  void feed_override(double ratio) noexcept { motion_.feed_override(ratio); }
  void abort() noexcept { is_cut_short_ = true, motion_.abort(); }
  void flush() noexcept;
  void probe() noexcept { touches_ = true; }  // as if the probe touched now
  /// A block of program text, to be run from where the machine rests. False: it does not rest yet.
  bool run_block(const std::string& text);
  /// What the planning thread has to say about such a block.
  std::optional<std::string> take_message();
  /// At rest, and nothing left to do.
  [[nodiscard]] bool is_done() const noexcept;
  /// At rest until the operator resumes.
  [[nodiscard]] bool is_held() const noexcept;
  [[nodiscard]] bool is_at_rest() const noexcept { return is_done() || is_held(); }
  [[nodiscard]] bool is_cut_short() const noexcept { return is_cut_short_; }
  [[nodiscard]] shapegcode::ControllerState state() const noexcept { return motion_.state(); }
  [[nodiscard]] RowQueue& rows() noexcept { return rows_; }

 private:
  static constexpr double jog_speed_mm_per_s = 50.0;
  bool push(const Item& item) noexcept;
  void begin_block(const std::string& text);

  Machine machine_;
  shapegcode::MotionController motion_;
  std::vector<Drive> drives_;
  RowQueue rows_;
  double time_s_ = 0.0;  // the real-time thread's

  // The planning thread's.
  Job job_;
  std::size_t next_ = 0;  // item to push

  std::uint64_t resumed_at_ = 0;  // the operator's thread: in which period

  std::atomic<bool> touches_ = false;       // operator or probe -> real-time thread
  std::atomic<int> idle_periods_ = 0;       // real-time thread -> operator: in a row
  std::atomic<bool> flushes_ = false;       // operator or real-time thread -> planning thread
  std::atomic<bool> is_pushed_ = false;     // planning thread: all of the job
  std::atomic<std::uint64_t> pushed_at_{};  // and in which period
  std::atomic<bool> is_cut_short_ = false;  // not all of the program is run
  std::atomic<bool> is_on_path_ = true;     // what moves is the program

  std::mutex mutex_;  // of operator and planning thread
  std::optional<std::string> block_, message_;
};
