#pragma once

#include <vector>

#include "shapegcode/plant/feed_drive.hpp"

namespace shapegcode {

inline constexpr double m_per_mm = 1e-3;
inline constexpr double mm_per_m = 1e3;

/// Set-points of one period: `setpoint_m` at its beginning and their speed until its end.
struct FeedDriveInput {
  double setpoint_m = 0.0;
  double velocity_m_per_s = 0.0;
  double velocity_before_m_per_s = 0.0;  ///< of the period before
};

/// The equations of one feed drive, SI, as the integrators see them.
///
/// Two states are not the physical ones: `speed` is v_m - c e - a w and `integral` is q - b e, with the following error
/// e = r - x_m, the ratio b of the speed that is fed forward, c = b times velocity gain over motor mass, and w the
/// set-points' speed joined by straight lines (a times its slope is the acceleration that is fed forward). With them
/// the right side has no jump at a set-point, only a kink (unless the force limit acts): an integrator may run on.
class FeedDriveEquations {
 public:
  /// Where a state is found; -1: the drive has none.
  struct Layout {
    int position = 0;  ///< of the motor
    int speed = 1;
    int deflection = 2;      ///< motor minus table
    int table_velocity = 3;  ///< of the table
    int integral = -1;
    int table_bristle = -1;
    int motor_bristle = -1;
    int modes = 4;  ///< deflection and velocity of each: also the number of states before them
    int size = 4;
  };

  struct ModeRates {
    double stiffness = 0.0;  ///< omega^2
    double damping = 0.0;    ///< 2 zeta omega
    double participation = 1.0;
  };
  static constexpr int max_drive_states = 7;  ///< before the modes

  FeedDriveEquations(FeedDriveParameters parameters, double period_s);

  [[nodiscard]] const FeedDriveParameters& parameters() const noexcept { return parameters_; }
  [[nodiscard]] const Layout& layout() const noexcept { return layout_; }
  [[nodiscard]] const std::vector<ModeRates>& modes() const noexcept { return modes_; }
  /// a: by how much the set-points' speed, joined by straight lines, is contained in that of the motor.
  [[nodiscard]] double acceleration_share() const noexcept { return acceleration_share_; }

  /// `time_s` since the beginning of the period. All sizes are layout().size, the matrix column by column; it comes
  /// filled with zeros.
  void rate(const FeedDriveInput& input, double time_s, const double* y, double* rate) const noexcept;
  void jacobian(const FeedDriveInput& input, double time_s, const double* y, double* matrix) const noexcept;
  /// The same for the states before the modes alone (which do not depend on them), columns `stride` apart.
  void drive_jacobian(const FeedDriveInput& input, double time_s, const double* y, double* matrix,
                      int stride) const noexcept;

  /// Following error in m, speed of the motor in m/s and integral of the speed error in m.
  [[nodiscard]] double following_error(const FeedDriveInput& input, double time_s, const double* y) const noexcept;
  [[nodiscard]] double motor_velocity(const FeedDriveInput& input, double time_s, const double* y) const noexcept;
  [[nodiscard]] double speed_integral(const FeedDriveInput& input, double time_s, const double* y) const noexcept;
  [[nodiscard]] double motor_force(const FeedDriveInput& input, double time_s, const double* y) const noexcept;
  [[nodiscard]] double spring_force(const FeedDriveInput& input, double time_s, const double* y) const noexcept;
  [[nodiscard]] double table_friction(const double* y) const noexcept;
  /// Table and modes, m.
  [[nodiscard]] double response(const double* y) const noexcept;
  /// Whether the limit of the force acts, so that the right side jumps where the set-points' speed does.
  [[nodiscard]] bool is_limited(const FeedDriveInput& input, double time_s, const double* y) const noexcept;

 private:
  struct Control;
  struct Spring;
  [[nodiscard]] Control control(const FeedDriveInput& input, double time_s, const double* y) const noexcept;
  [[nodiscard]] Spring spring(double deflection, double velocity) const noexcept;

  FeedDriveParameters parameters_;
  Layout layout_;
  double rate_hz_;
  double error_share_;         // c, 1/s
  double acceleration_share_;  // a
  double integral_gain_;       // N/m
  double total_mass_;
  double contact_m_;  // over which the stiffness builds up behind the gap
  std::vector<ModeRates> modes_;
};

}  // namespace shapegcode
