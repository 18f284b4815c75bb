// The set-points of a whole program, one per period: cutting runs, rapids, waits. Full interpolation of the cycle time
// and the simulation of a program use the same ones.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <variant>
#include <vector>

#include "shapegcode/fanuc_model.hpp"
#include "shapegcode/motion.hpp"
#include "shapegcode/plant/servo_lag.hpp"
#include "shapegcode/program.hpp"
#include "shapegcode/timing.hpp"
#include "simulate/filter_chain.hpp"
#include "simulate/function_times.hpp"

namespace shapegcode::detail {

/// A set-point behind every filter of the controller.
struct SetPoint {
  Vector3 position_mm = Vector3::Zero();
  /// So far the coordinates jumped since the set-point before, without any motion: a change of coordinates, or of an
  /// axis whose position was not known.
  Vector3 jump_mm = Vector3::Zero();
  std::uint32_t line = 0;  ///< of the block that is being interpolated
  BlockKind kind = BlockKind::cutting;
  std::size_t region = 0;  ///< whose coordinates hold: the one being cut, the last one, or the next behind a jump
};

/// Gives the set-points of a program in real time, the start first. Memory is that of one region. A wait that is no
/// whole number of periods leaves its rest to the next one.
class ProgramSetPoints {
 public:
  enum class Waits : std::uint8_t {
    full,  ///< every set-point of them
    cut,   ///< only as many as the servo loop needs to settle; their whole time is counted
  };
  /// Program and model must outlive the object. Throws Error(argument) on a model that `check` refuses.
  ProgramSetPoints(const Program& program, const FanucModel& model, Waits waits);
  // An interpolator of blocks holds a view of blocks that the object owns.
  ProgramSetPoints(const ProgramSetPoints&) = delete;
  ProgramSetPoints& operator=(const ProgramSetPoints&) = delete;

  /// Next set-point; false behind the last one. Throws Error(argument) on a block without a feed, or more set-points
  /// than can be computed.
  bool step(SetPoint& next);
  /// Where the time went up to the last set-point given; whole once `step` was false.
  [[nodiscard]] InterpolatedTime time() const;

 private:
  // A run from rest to rest; what comes out of a smoothing is seen to rest when a set-point repeats the one before it.
  struct Cut {
    std::shared_ptr<const Path> path;
    std::vector<Segment> blocks;
    std::variant<std::monostate, Interpolator, BlockInterpolator> motion;
    Vector3 end = Vector3::Zero();
    bool smoothed = false;
    bool draining = false;
    bool exact_stop = false;
    bool is_region = false;
    FilterChain* filters = nullptr;

    bool step(Vector3& position);
    [[nodiscard]] std::uint32_t line() const;
  };
  struct Rapid {
    RapidInterpolator motion;
    std::array<bool, axis_count> moved{};
  };
  struct Wait {
    std::uint64_t periods = 0;
  };
  struct InPositionWait {};

  [[nodiscard]] Vector3 first_position() const;
  /// Begins the next step of the program; false if there is none.
  bool open_step();
  void open_functions(const MachineFunction& function);
  /// Opens what is left of the spindle's time before a cut; false if nothing is.
  bool wait_for_spindle();
  /// Since the start of the program.
  [[nodiscard]] double elapsed_s() const noexcept;
  void open_other_move(std::uint32_t line);
  void open_rapid(const Segment& segment);
  void open_cut(const std::shared_ptr<const Path>& programmed, bool exact_stop, bool is_region, bool shaped);
  void open_arrival(const std::array<bool, axis_count>& moved);
  void open_wait(double seconds);
  /// The coordinates at the start of a motion hold; nothing moves.
  void start_at(const Vector3& position);
  bool step_cut(Cut& cut);
  void close_cut(const Cut& cut);
  void give(const Vector3& position);
  void end_region();

  const Program& program_;
  const FanucModel& model_;
  FanucModel shaped_model_;
  PlannerRules rules_;
  Waits waits_;
  FilterChain filters_;
  FilterChain shaped_filters_;
  FunctionTimes function_times_;
  ServoLag servo_;
  std::variant<std::monostate, Cut, Rapid, Wait, InPositionWait> active_;
  std::size_t at_ = 0;  // step of the program that comes next
  std::size_t regions_started_ = 0;
  double region_start_periods_ = 0.0;
  bool in_region_ = false;
  bool started_ = false;
  double owed_periods_ = 0.0;  // of waits, less than one
  Vector3 set_point_ = Vector3::Zero();
  SetPoint next_;
  double periods_cutting_ = 0.0;
  double periods_rapid_ = 0.0;
  double periods_waiting_ = 0.0;
  double measured_s_ = 0.0;
  InterpolatedTime time_;
};

}  // namespace shapegcode::detail
