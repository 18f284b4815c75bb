#include "plant/feed_drive/feed_drive_equations.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <numbers>
#include <utility>

namespace shapegcode {
namespace {

// The balls do not touch all at once: the stiffness builds up over this fraction of the gap, half of it inside. This
// also avoids a jump of the damping, which acts in contact only.
constexpr double contact_share = 0.1;

}  // namespace

struct FeedDriveEquations::Control {
  double error = 0.0;  // m, motor
  double motor_velocity = 0.0;
  double position_error = 0.0;  // m, of what the loop feeds back
  double wanted = 0.0;          // N
  double force = 0.0;           // N, within the limit
};

struct FeedDriveEquations::Spring {
  double force = 0.0;
  double by_deflection = 0.0;
  double by_velocity = 0.0;
};

FeedDriveEquations::FeedDriveEquations(FeedDriveParameters parameters, double period_s)
    : parameters_(std::move(parameters)), rate_hz_(1.0 / period_s) {
  parameters_.check();
  const FeedDriveParameters& p = parameters_;
  int next = 4;
  if (p.velocity_integral_time_s > 0.0) layout_.integral = next++;
  if (p.table_friction.has_bristles()) layout_.table_bristle = next++;
  if (p.motor_friction.has_bristles()) layout_.motor_bristle = next++;
  layout_.modes = next;
  layout_.size = next + 2 * static_cast<int>(p.modes.size());
  total_mass_ = p.motor_mass_kg + p.table_mass_kg;
  error_share_ = p.velocity_gain_n_s_per_m * p.velocity_feed_forward_ratio / p.motor_mass_kg;
  acceleration_share_ = p.acceleration_feed_forward_ratio * total_mass_ / p.motor_mass_kg;
  integral_gain_ = p.velocity_integral_time_s > 0.0 ? p.velocity_gain_n_s_per_m / p.velocity_integral_time_s : 0.0;
  contact_m_ = contact_share * p.backlash_m;
  for (const Mode& mode : p.modes) {
    const double omega = 2.0 * std::numbers::pi * mode.frequency_hz;
    modes_.push_back({omega * omega, 2.0 * mode.damping_ratio * omega, mode.participation});
  }
}

FeedDriveEquations::Control FeedDriveEquations::control(const FeedDriveInput& input, double time_s,
                                                        const double* y) const noexcept {
  const FeedDriveParameters& p = parameters_;
  const double slope = (input.velocity_m_per_s - input.velocity_before_m_per_s) * rate_hz_;
  Control control;
  control.error = following_error(input, time_s, y);
  control.motor_velocity = motor_velocity(input, time_s, y);
  control.position_error =
      control.error + (p.position_feedback == PositionFeedback::table ? y[layout_.deflection] : 0.0);
  control.wanted =
      p.velocity_gain_n_s_per_m * (p.position_gain_per_s * control.position_error +
                                   p.velocity_feed_forward_ratio * input.velocity_m_per_s - control.motor_velocity) +
      integral_gain_ * speed_integral(input, time_s, y) + p.acceleration_feed_forward_ratio * total_mass_ * slope;
  control.force =
      p.force_limit_n > 0.0 ? std::clamp(control.wanted, -p.force_limit_n, p.force_limit_n) : control.wanted;
  return control;
}

FeedDriveEquations::Spring FeedDriveEquations::spring(double deflection, double velocity) const noexcept {
  const FeedDriveParameters& p = parameters_;
  double travel = deflection;  // into contact
  double contact = 1.0;        // d(travel)/d(deflection)
  double contact_rise = 0.0;
  if (contact_m_ > 0.0) {
    const double past = std::abs(deflection) - 0.5 * p.backlash_m + 0.5 * contact_m_;
    if (past <= 0.0) return {};
    if (past < contact_m_) {
      contact = past / contact_m_;
      contact_rise = std::copysign(1.0 / contact_m_, deflection);
      travel = std::copysign(0.5 * past * contact, deflection);
    } else {
      travel = std::copysign(past - 0.5 * contact_m_, deflection);
    }
  }
  Spring spring;
  spring.force = p.stiffness_n_per_m * travel + p.damping_n_s_per_m * contact * velocity;
  spring.by_deflection = p.stiffness_n_per_m * contact + p.damping_n_s_per_m * contact_rise * velocity;
  spring.by_velocity = p.damping_n_s_per_m * contact;
  return spring;
}

void FeedDriveEquations::rate(const FeedDriveInput& input, double time_s, const double* y,
                              double* rate) const noexcept {
  const FeedDriveParameters& p = parameters_;
  const Layout& at = layout_;
  const Control control = this->control(input, time_s, y);
  const double motor_velocity = control.motor_velocity;
  const double table_velocity = y[at.table_velocity];
  const Spring spring = this->spring(y[at.deflection], motor_velocity - table_velocity);
  const FrictionForce on_table =
      friction_force(p.table_friction, table_velocity, at.table_bristle < 0 ? 0.0 : y[at.table_bristle]);
  const FrictionForce on_motor =
      friction_force(p.motor_friction, motor_velocity, at.motor_bristle < 0 ? 0.0 : y[at.motor_bristle]);
  const double table_acceleration = (spring.force - on_table.force_n) / p.table_mass_kg;
  const double slope = (input.velocity_m_per_s - input.velocity_before_m_per_s) * rate_hz_;

  rate[at.position] = motor_velocity;
  rate[at.speed] = (control.force - spring.force - on_motor.force_n) / p.motor_mass_kg -
                   error_share_ * (input.velocity_m_per_s - motor_velocity) - acceleration_share_ * slope;
  rate[at.deflection] = motor_velocity - table_velocity;
  rate[at.table_velocity] = table_acceleration;
  if (at.integral >= 0) {
    rate[at.integral] = p.position_gain_per_s * control.position_error -
                        (1.0 - p.velocity_feed_forward_ratio) * motor_velocity +
                        (control.force - control.wanted) / p.velocity_gain_n_s_per_m;
  }
  if (at.table_bristle >= 0) rate[at.table_bristle] = on_table.bristle_rate_m_per_s;
  if (at.motor_bristle >= 0) rate[at.motor_bristle] = on_motor.bristle_rate_m_per_s;
  int i = at.modes;
  for (const ModeRates& mode : modes_) {
    rate[i] = y[i + 1];
    rate[i + 1] = -mode.stiffness * y[i] - mode.damping * y[i + 1] - table_acceleration;
    i += 2;
  }
}

// A table of entries.  NOLINTNEXTLINE(readability-function-size)
void FeedDriveEquations::drive_jacobian(const FeedDriveInput& input, double time_s, const double* y, double* matrix,
                                        int stride) const noexcept {
  const FeedDriveParameters& p = parameters_;
  const Layout& at = layout_;
  const auto entry = [&](int row, int column) -> double& { return matrix[column * stride + row]; };
  const Control control = this->control(input, time_s, y);
  const double motor_velocity = control.motor_velocity;
  const double table_velocity = y[at.table_velocity];
  const Spring spring = this->spring(y[at.deflection], motor_velocity - table_velocity);
  const FrictionForce on_table =
      friction_force(p.table_friction, table_velocity, at.table_bristle < 0 ? 0.0 : y[at.table_bristle]);
  const FrictionForce on_motor =
      friction_force(p.motor_friction, motor_velocity, at.motor_bristle < 0 ? 0.0 : y[at.motor_bristle]);

  // Speed of the motor and wanted force, by the states.
  const double velocity_by_position = -error_share_;
  const bool scale = p.position_feedback == PositionFeedback::table;
  const double kv = p.velocity_gain_n_s_per_m;
  const double kp = p.position_gain_per_s;
  const double forward = p.velocity_feed_forward_ratio;
  const double wanted_by_position = kv * (-kp - velocity_by_position) - integral_gain_ * forward;
  const double wanted_by_speed = -kv;
  const double wanted_by_deflection = scale ? kv * kp : 0.0;
  const double share = control.force == control.wanted ? 1.0 : 0.0;  // of a change that reaches the motor

  entry(at.position, at.position) = velocity_by_position;
  entry(at.position, at.speed) = 1.0;

  const double motor_mass = p.motor_mass_kg;
  const double force_by_velocity = spring.by_velocity + on_motor.by_velocity;
  entry(at.speed, at.position) = (share * wanted_by_position - force_by_velocity * velocity_by_position) / motor_mass +
                                 error_share_ * velocity_by_position;
  entry(at.speed, at.speed) = (share * wanted_by_speed - force_by_velocity) / motor_mass + error_share_;
  entry(at.speed, at.deflection) = (share * wanted_by_deflection - spring.by_deflection) / motor_mass;
  entry(at.speed, at.table_velocity) = spring.by_velocity / motor_mass;

  entry(at.deflection, at.position) = velocity_by_position;
  entry(at.deflection, at.speed) = 1.0;
  entry(at.deflection, at.table_velocity) = -1.0;

  const double table_mass = p.table_mass_kg;
  entry(at.table_velocity, at.position) = spring.by_velocity * velocity_by_position / table_mass;
  entry(at.table_velocity, at.speed) = spring.by_velocity / table_mass;
  entry(at.table_velocity, at.deflection) = spring.by_deflection / table_mass;
  entry(at.table_velocity, at.table_velocity) = -(spring.by_velocity + on_table.by_velocity) / table_mass;

  if (at.integral >= 0) {
    const double windup = (share - 1.0) / kv;
    entry(at.speed, at.integral) = share * integral_gain_ / motor_mass;
    entry(at.integral, at.position) = -kp - (1.0 - forward) * velocity_by_position + windup * wanted_by_position;
    entry(at.integral, at.speed) = -(1.0 - forward) + windup * wanted_by_speed;
    entry(at.integral, at.deflection) = (scale ? kp : 0.0) + windup * wanted_by_deflection;
    entry(at.integral, at.integral) = windup * integral_gain_;
  }
  if (at.table_bristle >= 0) {
    entry(at.table_velocity, at.table_bristle) = -on_table.by_bristle / table_mass;
    entry(at.table_bristle, at.table_velocity) = on_table.rate_by_velocity;
    entry(at.table_bristle, at.table_bristle) = on_table.rate_by_bristle;
  }
  if (at.motor_bristle >= 0) {
    entry(at.speed, at.motor_bristle) = -on_motor.by_bristle / motor_mass;
    entry(at.motor_bristle, at.position) = on_motor.rate_by_velocity * velocity_by_position;
    entry(at.motor_bristle, at.speed) = on_motor.rate_by_velocity;
    entry(at.motor_bristle, at.motor_bristle) = on_motor.rate_by_bristle;
  }
}

void FeedDriveEquations::jacobian(const FeedDriveInput& input, double time_s, const double* y,
                                  double* matrix) const noexcept {
  const Layout& at = layout_;
  const auto entry = [&](int row, int column) -> double& { return matrix[column * at.size + row]; };
  drive_jacobian(input, time_s, y, matrix, at.size);
  int i = at.modes;
  for (const ModeRates& mode : modes_) {
    entry(i, i + 1) = 1.0;
    for (int column = 0; column < at.modes; ++column) entry(i + 1, column) = -entry(at.table_velocity, column);
    entry(i + 1, i) = -mode.stiffness;
    entry(i + 1, i + 1) = -mode.damping;
    i += 2;
  }
}

double FeedDriveEquations::following_error(const FeedDriveInput& input, double time_s, const double* y) const noexcept {
  return input.setpoint_m + input.velocity_m_per_s * time_s - y[layout_.position];
}

double FeedDriveEquations::motor_velocity(const FeedDriveInput& input, double time_s, const double* y) const noexcept {
  const double slope = (input.velocity_m_per_s - input.velocity_before_m_per_s) * rate_hz_;
  return y[layout_.speed] + error_share_ * following_error(input, time_s, y) +
         acceleration_share_ * (input.velocity_before_m_per_s + slope * time_s);
}

double FeedDriveEquations::speed_integral(const FeedDriveInput& input, double time_s, const double* y) const noexcept {
  return layout_.integral < 0
             ? 0.0
             : y[layout_.integral] + parameters_.velocity_feed_forward_ratio * following_error(input, time_s, y);
}

double FeedDriveEquations::motor_force(const FeedDriveInput& input, double time_s, const double* y) const noexcept {
  return control(input, time_s, y).force;
}

double FeedDriveEquations::spring_force(const FeedDriveInput& input, double time_s, const double* y) const noexcept {
  return spring(y[layout_.deflection], motor_velocity(input, time_s, y) - y[layout_.table_velocity]).force;
}

double FeedDriveEquations::table_friction(const double* y) const noexcept {
  return friction_force(parameters_.table_friction, y[layout_.table_velocity],
                        layout_.table_bristle < 0 ? 0.0 : y[layout_.table_bristle])
      .force_n;
}

double FeedDriveEquations::response(const double* y) const noexcept {
  double response = y[layout_.position] - y[layout_.deflection];
  int i = layout_.modes;
  for (const ModeRates& mode : modes_) {
    response += mode.participation * y[i];
    i += 2;
  }
  return response;
}

bool FeedDriveEquations::is_limited(const FeedDriveInput& input, double time_s, const double* y) const noexcept {
  const Control control = this->control(input, time_s, y);
  return control.force != control.wanted;
}

}  // namespace shapegcode
