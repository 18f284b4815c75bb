#include "shapegcode/plant/feed_drive.hpp"

#include <array>
#include <cmath>
#include <cstddef>
#include <utility>

#include <fmt/format.h>
#include <Eigen/Core>
#include <Eigen/LU>

#include "base/checks.hpp"
#include "base/rest.hpp"
#include "plant/feed_drive/feed_drive_equations.hpp"
#include "shapegcode/error.hpp"

namespace shapegcode {
namespace {

using Eigen::VectorXd;

constexpr int max_substeps = 1000;

// Rodas3 in the form that needs no product with the Jacobian: (1/(gamma h) - J) k_i = f(y + sum a_ij k_j)
// + sum c_ij/h k_j + h gamma_i df/dt, y_next = y + sum m_i k_i.
constexpr std::size_t stages = 4;
constexpr double gamma = 0.5;
using Coefficients = std::array<std::array<double, stages>, stages>;
constexpr Coefficients stage_share{{{0, 0, 0, 0}, {0, 0, 0, 0}, {2, 0, 0, 0}, {2, 0, 1, 0}}};
constexpr Coefficients slope_share{{{0, 0, 0, 0}, {4, 0, 0, 0}, {1, -1, 0, 0}, {1, -1, -8.0 / 3.0, 0}}};
constexpr std::array<double, stages> result_share{2, 0, 1, 1};
constexpr std::array<double, stages> stage_time{0, 0, 1, 1};
constexpr std::array<double, stages> time_share{0.5, 1.5, 0, 0};
constexpr std::array<bool, stages> asks_again{true, false, true, true};  // stage 2 stands where stage 1 does

constexpr std::size_t error_stage = 3;  // its k is the difference to the embedded method of second order

// A step whose error is past this share of the motion, or these amounts, is taken again in parts; what a machine can
// follow stays far below. Twice at most, so that the work is bounded.
constexpr std::size_t max_divisions = 2;
constexpr int parts = 4;
constexpr double error_share = 0.01;
constexpr double error_length_m = 1e-6;
constexpr double error_speed_m_per_s = 1e-3;
constexpr double error_bristle_m = 1e-6;

}  // namespace

struct FeedDriveRealTime::Impl {
  static constexpr int most = FeedDriveEquations::max_drive_states;
  using DriveMatrix = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::ColMajor, most, most>;

  FeedDriveEquations equations;
  double period_s;
  int substeps;
  double origin_m = 0.0;
  FeedDriveInput input{};
  double since_s = 0.0;  // of the period
  VectorXd y = VectorXd::Zero(equations.layout().size);
  VectorXd stage = y;
  VectorXd rate = y;
  VectorXd rate_by_time = y;
  std::array<VectorXd, stages> k{y, y, y, y};
  std::array<VectorXd, max_divisions> before{y, y};
  VectorXd allowed = y;  // error of a step beside its share of the motion
  DriveMatrix jacobian = DriveMatrix::Zero(equations.layout().modes, equations.layout().modes);
  Eigen::PartialPivLU<DriveMatrix> lu{jacobian};

  Impl(FeedDriveParameters parameters, double period, int steps)
      : equations(std::move(parameters), period), period_s(period), substeps(steps) {
    const FeedDriveEquations::Layout& at = equations.layout();
    allowed.setConstant(error_length_m);
    allowed[at.speed] = error_speed_m_per_s;
    allowed[at.table_velocity] = error_speed_m_per_s;
    if (at.table_bristle >= 0) allowed[at.table_bristle] = error_bristle_m;
    if (at.motor_bristle >= 0) allowed[at.motor_bristle] = error_bristle_m;
    for (int i = at.modes + 1; i < at.size; i += 2) allowed[i] = error_speed_m_per_s;
  }

  /// Solves (diagonal - J) k = right in place. The modes only follow the table: each is a 2x2 system of its own.
  void solve(double diagonal, VectorXd& right) const noexcept {
    const FeedDriveEquations::Layout& at = equations.layout();
    const double table_right = right[at.table_velocity];
    Eigen::Matrix<double, Eigen::Dynamic, 1, 0, most, 1> drive = right.head(at.modes);
    right.head(at.modes) = lu.solve(drive);
    const double table_slope = diagonal * right[at.table_velocity] - table_right;  // row of the table in J, times k
    int i = at.modes;
    for (const FeedDriveEquations::ModeRates& mode : equations.modes()) {
      const double deflection = right[i];
      const double velocity = right[i + 1] - table_slope;
      const double determinant = diagonal * (diagonal + mode.damping) + mode.stiffness;
      right[i] = ((diagonal + mode.damping) * deflection + velocity) / determinant;
      right[i + 1] = (diagonal * velocity - mode.stiffness * deflection) / determinant;
      i += 2;
    }
  }

  /// df/dt at fixed states: the set-point moves, and with it the speed that is fed forward.
  void differentiate_by_time() noexcept {
    const FeedDriveEquations::Layout& at = equations.layout();
    const double slope = (input.velocity_m_per_s - input.velocity_before_m_per_s) / period_s;
    rate_by_time.head(at.modes) = -input.velocity_m_per_s * jacobian.col(at.position) +
                                  equations.acceleration_share() * slope * jacobian.col(at.speed);
    for (int i = at.modes; i < at.size; i += 2) {
      rate_by_time[i] = 0.0;
      rate_by_time[i + 1] = -rate_by_time[at.table_velocity];
    }
  }

  /// Whether the last step can be kept; a value that is not finite cannot.
  [[nodiscard]] bool is_good() const noexcept {
    bool good = true;
    for (Eigen::Index i = 0; i < y.size(); ++i) {
      good = good && std::abs(k[error_stage][i]) <= allowed[i] + error_share * std::abs(y[i]);
    }
    return good;
  }

  void advance(double step_s, std::size_t divisions) noexcept {
    if (divisions < max_divisions) before[divisions] = y;
    substep(step_s);
    if (divisions == max_divisions || is_good()) {
      since_s += step_s;
      return;
    }
    y = before[divisions];
    for (int i = 0; i < parts; ++i) advance(step_s / parts, divisions + 1);
  }

  void substep(double step_s) noexcept {
    const double diagonal = 1.0 / (gamma * step_s);
    jacobian.setZero();
    equations.drive_jacobian(input, since_s, y.data(), jacobian.data(), equations.layout().modes);
    differentiate_by_time();
    jacobian = -jacobian;
    jacobian.diagonal().array() += diagonal;
    lu.compute(jacobian);
    for (std::size_t i = 0; i < stages; ++i) {
      if (asks_again[i]) {
        stage = y;
        for (std::size_t j = 0; j < i; ++j) {
          if (stage_share[i][j] != 0.0) stage += stage_share[i][j] * k[j];
        }
        equations.rate(input, since_s + stage_time[i] * step_s, stage.data(), rate.data());
      }
      k[i] = rate + (time_share[i] * step_s) * rate_by_time;
      for (std::size_t j = 0; j < i; ++j) {
        if (slope_share[i][j] != 0.0) k[i] += (slope_share[i][j] / step_s) * k[j];
      }
      solve(diagonal, k[i]);
    }
    for (std::size_t i = 0; i < stages; ++i) {
      if (result_share[i] != 0.0) y += result_share[i] * k[i];
    }
  }
};

FeedDriveRealTime::FeedDriveRealTime(FeedDriveParameters parameters, double period_s, int substeps) {
  require_period(period_s);
  if (substeps < 1 || substeps > max_substeps) {
    throw Error(ErrorKind::argument, fmt::format("{} substeps in a period, must be 1 ... {}", substeps, max_substeps));
  }
  impl_ = std::make_unique<Impl>(std::move(parameters), period_s, substeps);
}

FeedDriveRealTime::~FeedDriveRealTime() = default;
FeedDriveRealTime::FeedDriveRealTime(FeedDriveRealTime&&) noexcept = default;
FeedDriveRealTime& FeedDriveRealTime::operator=(FeedDriveRealTime&&) noexcept = default;

FeedDriveRealTime::FeedDriveRealTime(const FeedDriveRealTime& other) : impl_(std::make_unique<Impl>(*other.impl_)) {}

FeedDriveRealTime& FeedDriveRealTime::operator=(const FeedDriveRealTime& other) {
  if (this != &other) impl_ = std::make_unique<Impl>(*other.impl_);
  return *this;
}

void FeedDriveRealTime::reset(double position_mm) noexcept {
  impl_->origin_m = position_mm * m_per_mm;
  impl_->input = {};
  impl_->since_s = 0.0;
  impl_->y.setZero();
}

double FeedDriveRealTime::step(double setpoint_mm) noexcept {
  Impl& self = *impl_;
  const double from_m = self.input.setpoint_m + self.input.velocity_m_per_s * self.since_s;
  const double velocity = (setpoint_mm * m_per_mm - self.origin_m - from_m) / self.period_s;
  self.input = {from_m, velocity, self.input.velocity_m_per_s};
  const double step_s = self.period_s / self.substeps;
  for (int i = 0; i < self.substeps; ++i) {
    self.since_s = i * step_s;
    self.advance(step_s, 0);
  }
  for (double& value : self.y) value = state_or_none(value);
  self.since_s = self.period_s;
  return response_mm();
}

double FeedDriveRealTime::response_mm() const noexcept {
  return (impl_->origin_m + impl_->equations.response(impl_->y.data())) * mm_per_m;
}

double FeedDriveRealTime::table_mm() const noexcept {
  const FeedDriveEquations::Layout& at = impl_->equations.layout();
  return (impl_->origin_m + impl_->y[at.position] - impl_->y[at.deflection]) * mm_per_m;
}

double FeedDriveRealTime::motor_mm() const noexcept {
  return (impl_->origin_m + impl_->y[impl_->equations.layout().position]) * mm_per_m;
}

double FeedDriveRealTime::friction_force_n() const noexcept { return impl_->equations.table_friction(impl_->y.data()); }

double FeedDriveRealTime::motor_force_n() const noexcept {
  return impl_->equations.motor_force(impl_->input, impl_->since_s, impl_->y.data());
}

}  // namespace shapegcode
