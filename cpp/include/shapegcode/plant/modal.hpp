#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include <Eigen/Core>

#include "shapegcode/mode.hpp"
#include "shapegcode/samples.hpp"

namespace shapegcode {

/// (d, d')(t+h) = matrix * (d, d')(t): deflection and its velocity of a free mode over a time h.
struct ModeTransition {
  double dd = 1.0, dv = 0.0, vd = 0.0, vv = 1.0;
};

/// The matrix exponential of d'' + 2*zeta*omega*d' + omega^2*d = 0 over `time_s`, in closed form. Throws as pole().
[[nodiscard]] ModeTransition mode_transition(const Mode& mode, double time_s);

/// Dependence of a mode on an axis position: frequency and damping ratio are linear between the rows, constant beyond
/// the ends. An empty table leaves the mode constant.
struct ModeTable {
  int axis = 0;                       ///< axis of the position: 0, 1, 2 for X, Y, Z
  std::vector<double> position_mm;    ///< strictly ascending
  std::vector<double> frequency_hz;   ///< undamped natural frequency, one per position
  std::vector<double> damping_ratio;  ///< one per position, or empty: that of the mode

  [[nodiscard]] bool empty() const noexcept { return position_mm.empty(); }
};

/// One table per mode of every axis; an axis may have fewer tables than modes, the others do not vary.
using AxisModeTables = std::array<std::vector<ModeTable>, axis_count>;

/// Throws Error(argument) unless the table is empty, or names an axis and has strictly ascending, finite positions, as
/// many frequencies above 0, and none or as many damping ratios 0 <= zeta < 1.
void check_table(const ModeTable& table);

/// The mode at a position (mm) of the table's axis, with the same participation. The table must pass check_table.
[[nodiscard]] Mode mode_at(const Mode& mode, const ModeTable& table, double position_mm) noexcept;

/// Base-excited modes by the axis which they move: d'' + 2*zeta*omega*d' + omega^2*d = -x'' and response u = x +
/// sum(participation*d), where x'' is the acceleration of that axis, or the sum of excited_by*x'' over X, Y, Z. A mode
/// that moves several axes is listed at each of them.
using AxisModes = std::array<std::vector<Mode>, axis_count>;

/// Factors of the accelerations of X, Y and Z that excite a mode of `axis`.
[[nodiscard]] Vector3 excitation(const Mode& mode, std::size_t axis) noexcept;
/// Throws Error(argument) on a participation or an excitation factor that is not finite.
void check_shares(const Mode& mode, std::size_t axis);

/// Propagates the modes exactly (matrix exponential) for a command that is linear between set-points, as a servo's
/// set-points are (first-order hold). Real-time safe after construction: no allocation, no exception, bounded work. For
/// each mode excited by its own axis: u'' + 2*zeta*omega*u' + omega^2*u = 2*zeta*omega*x' + omega^2*x.
///
/// Modes may vary with the commanded position of an axis. Frequency and damping are then held over each period at their
/// value in its middle (an error of second order in the period), and the matrices of the period are interpolated
/// between neighbours whose omega*period differs by at most 1e-3 rad: an error below 2e-7 of the motion per period.
/// (Fewer matrices, and a larger error, only where more than 2^18 would be needed.)
class ModalPlant {
 public:
  /// `tables`: how modes vary with position, by axis and number of the mode; empty: constant modes. Throws
  /// Error(argument) on period <= 0, an invalid mode or table, or more tables than modes of an axis.
  ModalPlant(AxisModes modes, double period_s, AxisModeTables tables = {});
  /// At rest at `position`; peak() restarts from zero.
  void reset(const Vector3& position) noexcept;
  /// Shifts set-point and worktable together: a change of coordinates.
  void shift(const Vector3& by_mm) noexcept { command_ += by_mm; }
  /// Next set-point in, the response at that instant out: X, Y and Z.
  void step(std::span<const double> in, std::span<double> out) noexcept {
    const Vector3 response = step(Vector3(in[0], in[1], in[2]));
    std::copy_n(response.data(), axis_count, out.begin());
  }
  Vector3 step(const Vector3& command) noexcept;
  /// Deflection u - x at the last set-point.
  [[nodiscard]] Vector3 deflection() const noexcept { return deflection_; }
  /// Largest |deflection| per axis since the last reset() or reset_peak(), between set-points too: evaluated at most
  /// 1/20 period of the axis' fastest mode apart (at most 1024 times per set-point) and refined at turning points of
  /// the deflection, so that it is accurate to about 1e-4 of itself.
  [[nodiscard]] Vector3 peak() const noexcept { return peak_; }
  /// peak() restarts from the present deflection.
  void reset_peak() noexcept { peak_ = deflection_.cwiseAbs(); }
  /// Largest future |deflection| per axis if the command rests from now on (continuous time, not only at samples;
  /// searched over the time in which the slowest mode of the axis makes `n_periods` oscillations, in steps of 1/64
  /// period of the fastest; ends early when no larger one can follow, and after 1e6 steps). The stop itself counts: the
  /// command's last velocity falls to zero at the last set-point. Throws Error(argument) on n_periods < 1.
  [[nodiscard]] Vector3 residual_peak(int n_periods = 5) const;

 private:
  using Transition = ModeTransition;
  /// Properties of a mode needed for the motion over a period.
  struct Node {
    Transition over_period;
    double decay_rate = 0.0;       // 1/s: zeta*omega
    double damped_period_s = 0.0;  // over 2 pi
  };
  struct State : Node {
    double participation = 1.0;
    Vector3 excited_by = Vector3::Zero();
    double deflection = 0.0;  // mm
    double velocity = 0.0;    // mm/s, of the deflection

    void propagate() noexcept {
      const double next = over_period.dd * deflection + over_period.dv * velocity;
      velocity = over_period.vd * deflection + over_period.vv * velocity;
      deflection = next;
    }
    /// Square of an amplitude that no later deflection of the free mode exceeds, before participation.
    [[nodiscard]] double amplitude2() const noexcept {
      const double quadrature = (velocity + decay_rate * deflection) * damped_period_s;
      return deflection * deflection + quadrature * quadrature;
    }
    /// Upper bound of the free mode's later contribution to the response.
    [[nodiscard]] double reachable() const noexcept;
  };
  /// A mode that varies: nodes between the rows of its table, every interval divided evenly.
  struct Varying {
    std::size_t axis = 0;
    std::size_t mode = 0;  // of the axis
    ModeTable table;
    std::vector<std::size_t> first_node;  // at row k of the table
    std::vector<Node> nodes;
    std::vector<Transition> sub;  // times participation; node, end of sub-step
  };
  /// Position of a varying mode between its nodes.
  struct TablePosition {
    double position_mm = 0.0;
    std::size_t node = 0;
    double share = 0.0;  // of the next node
    bool known = false;
  };
  /// Deflection of an axis and its rate, all modes together.
  struct Motion {
    double deflection = 0.0;
    double rate = 0.0;
  };
  /// mode_transition() for the ends of an axis' sub-steps, times the participation.
  [[nodiscard]] Transition sub_transition(std::size_t axis, const Mode& mode, int substep) const;
  [[nodiscard]] static Transition between(const Transition& a, const Transition& b, double share) noexcept;
  [[nodiscard]] static Node node_of(const Mode& mode, double period_s);
  [[nodiscard]] Varying tabulate(std::size_t axis, std::size_t mode, const ModeTable& table) const;
  /// Sets the varying modes to `position`.
  void move_to(const Vector3& position) noexcept;
  /// Sub-step matrices of the varying modes of an axis.
  void move_sub_steps(std::size_t axis) noexcept;
  /// A mode of an axis at the last set-point.
  [[nodiscard]] Mode mode_now(std::size_t axis, std::size_t mode) const noexcept;
  /// Sets negligible states to zero.
  void forget_nothing() noexcept;
  /// Upper bound of later deflections of an axis that is free from now on.
  [[nodiscard]] double reachable(std::size_t axis) const noexcept;
  /// An axis with one mode, after the commands' velocities jumped.
  void step_only_mode(std::size_t axis, const Vector3& jumps) noexcept;
  /// Updates `peak_` between the ends of the present period; called only if it may grow.
  void look_between(std::size_t axis) noexcept;
  /// Largest |deflection| between two instants `time_s` apart, with the turning point found by the secant of the rate.
  [[nodiscard]] static double largest_between(const Motion& from, const Motion& to, double time_s) noexcept;

  AxisModes modes_;
  double period_s_;
  double rate_hz_;
  std::array<std::size_t, axis_count + 1> first_{};  // states_ of axis a: first_[a] up to first_[a+1]
  std::vector<State> states_;
  std::array<int, axis_count> substeps_{};               // per period and axis
  std::array<std::size_t, axis_count> first_sub_{};      // where an axis' sub-step matrices begin
  std::vector<Transition> sub_;                          // times participation; axis, end of sub-step, mode
  std::shared_ptr<const std::vector<Varying>> varying_;  // never changes: copies of the plant share it
  std::vector<TablePosition> table_position_;            // one per varying mode
  std::int64_t row_ = 0;                                 // set-points since reset()
  Vector3 command_ = Vector3::Zero();
  Vector3 command_velocity_ = Vector3::Zero();
  Vector3 deflection_ = Vector3::Zero();
  Vector3 peak_ = Vector3::Zero();
};

/// ModalPlant with constant modes for whole records: the same motion to the last bit, without peaks between samples,
/// for any number of axes, and about as fast as memory access. Records may be passed in pieces.
class ModalResponse {
 public:
  /// (n_samples, n_axes) in any memory order, mm.
  using Record = Eigen::Ref<const Eigen::MatrixXd, 0, Eigen::Stride<Eigen::Dynamic, Eigen::Dynamic>>;
  using Result = Eigen::Ref<Eigen::MatrixXd, 0, Eigen::Stride<Eigen::Dynamic, Eigen::Dynamic>>;

  /// `modes`: by axis; an axis without modes follows its command. Modes that other axes excite are slower, and only for
  /// up to three axes. Throws Error(argument) on period_s <= 0, an invalid mode or no axis.
  ModalResponse(const std::vector<std::vector<Mode>>& modes, double period_s);
  ~ModalResponse();
  ModalResponse(ModalResponse&&) noexcept;
  ModalResponse& operator=(ModalResponse&&) noexcept;
  ModalResponse(const ModalResponse&) = delete;
  ModalResponse& operator=(const ModalResponse&) = delete;

  /// Response at each row of the next piece of a record, in the units of the command. At the first row of the first
  /// piece the plant is at rest. `response` has the shape of `command`, and may be the command itself. Throws
  /// Error(argument) on another shape or a value that is not finite (not to be continued then).
  void apply(const Record& command, Result response);

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

/// The response of base-excited modes to a record of set-points that is linear between them (ModalResponse), at rest
/// at the first row. Throws as ModalResponse and its apply().
[[nodiscard]] Eigen::MatrixXd plant_response(const ModalResponse::Record& command,
                                             const std::vector<std::vector<Mode>>& modes, double period_s);

}  // namespace shapegcode
