#pragma once

#include <cmath>
#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include <Eigen/Core>

#include "shapegcode/mode.hpp"

namespace shapegcode {

/// Friction of a sliding pair.
enum class FrictionModel : std::uint8_t {
  viscous,   ///< proportional to the speed only
  stribeck,  ///< Coulomb, static and Stribeck friction as a function of the speed, smoothed through zero
  lugre,     ///< the same with bristles between the surfaces: presliding, stick, frictional lag; one state
};

/// Friction of one sliding pair, SI. Curve of the steady speed v:
/// F(v) = sign(v) * (coulomb + (static - coulomb) * exp(-(v/stribeck_velocity)^2)) + viscous * v.
struct FrictionParameters {
  FrictionModel model = FrictionModel::viscous;
  double viscous_n_s_per_m = 0.0;           ///< >= 0
  double coulomb_n = 0.0;                   ///< sliding friction; > 0 unless viscous
  double static_n = 0.0;                    ///< friction to be overcome from rest; >= coulomb_n
  double stribeck_velocity_m_per_s = 0.0;   ///< speed of the transition from static to sliding friction; > 0
  double smoothing_velocity_m_per_s = 0.0;  ///< Stribeck: sign(v) is tanh(v / this); > 0
  double bristle_stiffness_n_per_m = 0.0;   ///< LuGre, sigma0: force over displacement before sliding; > 0
  double bristle_damping_n_s_per_m = 0.0;   ///< LuGre, sigma1; >= 0

  /// Throws Error(argument) with the value and its limit; `part` begins the message ("friction of the table").
  void check(const char* part) const;
  [[nodiscard]] bool has_bristles() const noexcept { return model == FrictionModel::lugre; }
};

/// Force against the motion and its derivatives.
struct FrictionForce {
  double force_n = 0.0;
  double by_velocity = 0.0;           ///< N/(m/s)
  double by_bristle = 0.0;            ///< N/m
  double bristle_rate_m_per_s = 0.0;  ///< of the bristles' deflection
  double rate_by_velocity = 0.0;
  double rate_by_bristle = 0.0;  ///< 1/s
};

/// Force at a speed (m/s) and, with LuGre, a deflection of the bristles (m). LuGre after Canudas de Wit, Olsson, Astrom
/// and Lischinsky (1995): z' = v - sigma0 |v| z / g(v), F = sigma0 z + sigma1 z' + viscous v, g the curve above.
[[nodiscard]] FrictionForce friction_force(const FrictionParameters& friction, double velocity_m_per_s,
                                           double bristle_m) noexcept;

/// Position that the position loop compares with the set-point.
enum class PositionFeedback : std::uint8_t {
  motor,  ///< encoder on the motor (semi-closed loop)
  table,  ///< linear scale on the table (fully closed loop)
};

/// Feed drive of one axis, SI units, referred to the travel of the worktable.
struct FeedDriveParameters {
  double motor_mass_kg = 0.0;                                    ///< inertia of motor, coupling and screw; > 0
  double table_mass_kg = 0.0;                                    ///< worktable with its load; > 0
  double stiffness_n_per_m = 0.0;                                ///< motor to table, axial; > 0
  double damping_n_s_per_m = 0.0;                                ///< parallel to the stiffness; >= 0
  double backlash_m = 0.0;                                       ///< whole gap; >= 0
  FrictionParameters table_friction;                             ///< guideways
  FrictionParameters motor_friction;                             ///< bearings, seals, nut
  PositionFeedback position_feedback = PositionFeedback::motor;  ///< the speed is always taken from the motor
  double position_gain_per_s = 0.0;                              ///< > 0
  double velocity_gain_n_s_per_m = 0.0;                          ///< force over speed error; > 0
  double velocity_integral_time_s = 0.0;                         ///< of the speed controller; 0: none
  double velocity_feed_forward_ratio = 0.0;                      ///< 0 ... 1: ratio of the set-points' speed
  double acceleration_feed_forward_ratio = 0.0;                  ///< 0 ... 1: ratio of acceleration times both masses
  double force_limit_n = 0.0;                                    ///< of the motor; 0: none
  std::vector<Mode> modes;                                       ///< of the structure, excited by the table

  /// Throws Error(argument) with the value and its limit.
  void check() const;
};

/// x' = A x + B w, y = C x + D w with inputs that are linear between the set-points.
struct FeedDriveLinearModel {
  Eigen::MatrixXd a;
  /// Column 0: set-point. Column 1, only with acceleration feed-forward: speed of the set-points, sampled as the
  /// difference from the previous set-point divided by the period.
  Eigen::MatrixXd b;
  Eigen::MatrixXd c;  ///< one row: response (table and modes)
  Eigen::MatrixXd d;
};

/// The linear model of a drive. Throws Error(argument) on friction other than viscous, backlash or a force limit.
/// Lengths in any one unit, s. At rest at a set-point r the state is -r times `a^-1 b`.
[[nodiscard]] FeedDriveLinearModel linear_model(const FeedDriveParameters& parameters);

/// Motor, ball screw and table of one axis with its position and speed controller, integrated by CVODE (BDF with an
/// analytic Jacobian). Set-points come once per period and are joined by straight lines; the feed-forward speed steps
/// at each of them. A copy has the state but not the integrator's history: its next step is as accurate, but not the
/// same to the last digit. docs/concepts/feed_drive.md has the equations.
class FeedDrive {
 public:
  /// At rest at zero. `rtol` relative tolerance (of following error, deflections and speeds), `atol_mm` absolute
  /// tolerance of lengths; that of speeds is 100 atol_mm per second. Throws Error(argument) on parameters or
  /// tolerances outside their range or a period <= 0.
  FeedDrive(FeedDriveParameters parameters, double period_s, double rtol = 1e-6, double atol_mm = 1e-6);
  ~FeedDrive();
  FeedDrive(const FeedDrive& other);
  FeedDrive& operator=(const FeedDrive& other);
  FeedDrive(FeedDrive&& other) noexcept;
  FeedDrive& operator=(FeedDrive&& other) noexcept;

  /// At rest at `position_mm`, without force in spring and bristles.
  void reset(double position_mm);
  /// Moves set-point and positions alike: a change of coordinates.
  void shift(double by_mm) noexcept;
  /// Next set-point; returns the response (table and modes, mm) at that instant. Throws Error(argument) on a set-point
  /// that is not finite, Error(numeric) with CVODE's flag and the time since reset() when the integrator fails.
  double step(double setpoint_mm);

  // As of the last set-point.
  [[nodiscard]] double setpoint_mm() const noexcept;
  [[nodiscard]] double response_mm() const noexcept;  ///< table and modes
  [[nodiscard]] double table_mm() const noexcept;
  [[nodiscard]] double motor_mm() const noexcept;  ///< angle of the motor as travel
  [[nodiscard]] double table_velocity_mm_per_s() const noexcept;
  [[nodiscard]] double motor_velocity_mm_per_s() const noexcept;
  [[nodiscard]] double friction_force_n() const noexcept;  ///< on the table, against its motion
  [[nodiscard]] double motor_force_n() const noexcept;     ///< torque of the motor as force, within its limit
  [[nodiscard]] double spring_force_n() const noexcept;    ///< from motor to table
  [[nodiscard]] double time_s() const noexcept;            ///< since reset()
  [[nodiscard]] const FeedDriveParameters& parameters() const noexcept;

  /// Internal steps and evaluations of the equations by this object: for tests and reports.
  [[nodiscard]] long steps() const noexcept;
  [[nodiscard]] long rhs_evaluations() const noexcept;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

/// The equations of FeedDrive with fixed steps, for controller prototypes that need bounded time: a Rosenbrock method
/// (L-stable, third order: Rodas3 of Sandu et al. 1997) whose linear systems are solved in place. After construction no
/// allocation, no lock, no exception. Each step() takes the same time, except for set-points that no machine can follow
/// (jumps of metres per second): failing steps are divided there, at most to 21 times the work.
/// docs/concepts/feed_drive.md gives the error relative to FeedDrive for typical drives; for others compare with twice
/// the substeps.
class FeedDriveRealTime {
 public:
  static constexpr int default_substeps = 4;

  /// At rest at zero. `substeps` per period, 1 ... 1000. Throws Error(argument) on parameters outside their range, a
  /// period <= 0 or other substeps.
  FeedDriveRealTime(FeedDriveParameters parameters, double period_s, int substeps = default_substeps);
  ~FeedDriveRealTime();
  FeedDriveRealTime(const FeedDriveRealTime& other);
  FeedDriveRealTime& operator=(const FeedDriveRealTime& other);
  FeedDriveRealTime(FeedDriveRealTime&& other) noexcept;
  FeedDriveRealTime& operator=(FeedDriveRealTime&& other) noexcept;

  /// At rest at `position_mm`, without force in spring and bristles.
  void reset(double position_mm) noexcept;
  /// Next set-point in, the response (table and modes, mm) at that instant out: one value each. A set-point that is not
  /// finite gives a response that is not finite from then on, until reset().
  void step(std::span<const double> in, std::span<double> out) noexcept { out[0] = step(in[0]); }
  double step(double setpoint_mm) noexcept;

  // As of the last set-point.
  [[nodiscard]] double response_mm() const noexcept;  ///< table and modes
  [[nodiscard]] double table_mm() const noexcept;
  [[nodiscard]] double motor_mm() const noexcept;          ///< angle of the motor as travel
  [[nodiscard]] double friction_force_n() const noexcept;  ///< on the table, against its motion
  [[nodiscard]] double motor_force_n() const noexcept;     ///< torque of the motor as force, within its limit

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace shapegcode
