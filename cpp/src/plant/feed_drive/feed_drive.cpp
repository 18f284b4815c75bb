#include "shapegcode/plant/feed_drive.hpp"

#include <cmath>
#include <optional>
#include <string>
#include <utility>

#include <fmt/format.h>

#include "base/checks.hpp"
#include "plant/feed_drive/feed_drive_equations.hpp"
#include "plant/feed_drive/ode.hpp"
#include "shapegcode/error.hpp"

namespace shapegcode {
namespace {

using Eigen::MatrixXd;
using Eigen::VectorXd;

constexpr double speed_tolerance_per_s = 100.0;   // absolute tolerance of speeds over that of lengths
constexpr double bristle_tolerance_share = 0.01;  // of that of lengths: bristles bend by micrometres
constexpr double longest_step_periods = 0.5;      // two even steps fit between two set-points

}  // namespace

void FeedDriveParameters::check() const {
  require_above_zero(motor_mass_kg, "mass of the motor", "kg");
  require_above_zero(table_mass_kg, "mass of the table", "kg");
  require_above_zero(stiffness_n_per_m, "stiffness between motor and table", "N/m");
  require_not_below_zero(damping_n_s_per_m, "damping between motor and table", "N s/m");
  require_not_below_zero(backlash_m, "backlash", "m");
  require_above_zero(position_gain_per_s, "position gain", "1/s");
  require_above_zero(velocity_gain_n_s_per_m, "velocity gain", "N s/m");
  require_not_below_zero(velocity_integral_time_s, "integral time of the velocity loop", "s");
  require_within(velocity_feed_forward_ratio, 0.0, 1.0, "velocity feed-forward", "(ratio)");
  require_within(acceleration_feed_forward_ratio, 0.0, 1.0, "acceleration feed-forward", "(ratio)");
  require_not_below_zero(force_limit_n, "force limit", "N");
  table_friction.check("table");
  motor_friction.check("motor");
  for (const Mode& mode : modes) {
    static_cast<void>(pole(mode));
    require_within(mode.participation, -unbounded, unbounded, "participation of a mode", "(ratio)");
  }
}

FeedDriveLinearModel linear_model(const FeedDriveParameters& parameters) {
  if (parameters.table_friction.model != FrictionModel::viscous ||
      parameters.motor_friction.model != FrictionModel::viscous) {
    throw Error(ErrorKind::argument, "a linear model needs viscous friction alone");
  }
  if (parameters.backlash_m != 0.0 || parameters.force_limit_n != 0.0) {
    throw Error(ErrorKind::argument,
                fmt::format("a linear model needs a drive without backlash and force limit, here {} m and {} N",
                            parameters.backlash_m, parameters.force_limit_n));
  }
  // The model does not depend on the period, which only converts set-points to their speed, an input here.
  const FeedDriveEquations equations(parameters, 1.0);
  const FeedDriveEquations::Layout& at = equations.layout();
  const VectorXd rest = VectorXd::Zero(at.size);
  FeedDriveLinearModel model;
  model.a = MatrixXd::Zero(at.size, at.size);
  equations.jacobian({}, 0.0, rest.data(), model.a.data());
  const bool accelerates = parameters.acceleration_feed_forward_ratio > 0.0;
  model.b.resize(at.size, accelerates ? 2 : 1);
  // The set-point enters as r - x_m, the speed fed forward as an addition to the state `speed`.
  model.b.col(0) = -model.a.col(at.position);
  if (accelerates) model.b.col(1) = equations.acceleration_share() * model.a.col(at.speed);
  model.c = MatrixXd::Zero(1, at.size);
  for (int i = 0; i < at.size; ++i) model.c(0, i) = equations.response(VectorXd::Unit(at.size, i).eval().data());
  model.d = MatrixXd::Zero(1, model.b.cols());
  return model;
}

struct FeedDrive::Impl final : OdeSystem {
  /// All but the integrator.
  struct Plant {
    FeedDriveEquations equations;
    double period_s;
    double rtol;
    double atol_m;
    FeedDriveInput input{};
    double origin_m = 0.0;  // positions inside count from here
    double period_begin_s = 0.0;
    double time_s = 0.0;
    VectorXd y = VectorXd::Zero(equations.layout().size);

    [[nodiscard]] double since_period() const noexcept { return time_s - period_begin_s; }
    [[nodiscard]] bool is_limited() const noexcept { return equations.is_limited(input, since_period(), y.data()); }
  };
  Plant plant;
  bool continues = false;  // the integrator's history belongs to the plant's state
  std::optional<OdeSolver> solver;

  explicit Impl(Plant state) : plant(std::move(state)) {}

  void rate(double t, const double* y, double* rate) override {
    plant.equations.rate(plant.input, t - plant.period_begin_s, y, rate);
  }
  void jacobian(double t, const double* y, double* matrix) override {
    plant.equations.jacobian(plant.input, t - plant.period_begin_s, y, matrix);
  }
  void magnitudes(double t, const double* y, Eigen::Ref<VectorXd> magnitude) override {
    OdeSystem::magnitudes(t, y, magnitude);
    const FeedDriveEquations& equations = plant.equations;
    const FeedDriveEquations::Layout& at = equations.layout();
    const double since = t - plant.period_begin_s;
    magnitude[at.position] = std::abs(equations.following_error(plant.input, since, y));
    magnitude[at.speed] = std::abs(equations.motor_velocity(plant.input, since, y));
    if (at.integral >= 0) magnitude[at.integral] = std::abs(equations.speed_integral(plant.input, since, y));
  }
  [[nodiscard]] VectorXd absolute_tolerances() const {
    const FeedDriveEquations::Layout& at = plant.equations.layout();
    VectorXd atol = VectorXd::Constant(at.size, plant.atol_m);
    atol[at.speed] *= speed_tolerance_per_s;
    atol[at.table_velocity] *= speed_tolerance_per_s;
    if (at.table_bristle >= 0) atol[at.table_bristle] *= bristle_tolerance_share;
    if (at.motor_bristle >= 0) atol[at.motor_bristle] *= bristle_tolerance_share;
    for (int i = at.modes + 1; i < at.size; i += 2) atol[i] *= speed_tolerance_per_s;
    return atol;
  }
  void integrate_to(double end_s) {
    if (!solver) {
      solver.emplace(*this, plant.y, plant.time_s, plant.rtol, absolute_tolerances());
      solver->limit_step(longest_step_periods * plant.period_s);
    } else if (!continues) {
      solver->restart(plant.y, plant.time_s);
    }
    plant.y = solver->advance(end_s);
  }
};

FeedDrive::FeedDrive(FeedDriveParameters parameters, double period_s, double rtol, double atol_mm) {
  require_period(period_s);
  require_above_zero(rtol, "relative tolerance", "(ratio)");
  require_above_zero(atol_mm, "absolute tolerance", "mm");
  impl_ = std::make_unique<Impl>(
      Impl::Plant{FeedDriveEquations(std::move(parameters), period_s), period_s, rtol, atol_mm * m_per_mm});
}

FeedDrive::~FeedDrive() = default;
FeedDrive::FeedDrive(FeedDrive&&) noexcept = default;
FeedDrive& FeedDrive::operator=(FeedDrive&&) noexcept = default;

FeedDrive::FeedDrive(const FeedDrive& other) : impl_(std::make_unique<Impl>(other.impl_->plant)) {}

FeedDrive& FeedDrive::operator=(const FeedDrive& other) {
  if (this != &other) impl_ = std::make_unique<Impl>(other.impl_->plant);
  return *this;
}

void FeedDrive::reset(double position_mm) {
  require_within(position_mm, -unbounded, unbounded, "position", "mm");
  Impl::Plant& plant = impl_->plant;
  plant.origin_m = position_mm * m_per_mm;
  plant.input = {};
  plant.period_begin_s = 0.0;
  plant.time_s = 0.0;
  plant.y.setZero();
  impl_->continues = false;
}

void FeedDrive::shift(double by_mm) noexcept { impl_->plant.origin_m += by_mm * m_per_mm; }

double FeedDrive::step(double setpoint_mm) {
  require_within(setpoint_mm, -unbounded, unbounded, "set-point", "mm");
  Impl::Plant& plant = impl_->plant;
  const FeedDriveInput input_before = plant.input;
  const double begin_before_s = plant.period_begin_s;
  const double from_m = plant.input.setpoint_m + plant.input.velocity_m_per_s * plant.since_period();
  const double velocity = (setpoint_mm * m_per_mm - plant.origin_m - from_m) / plant.period_s;
  // In its limit the force does not answer to the speed of the set-points, which the states count on.
  const bool was_limited = plant.is_limited();
  plant.input = {from_m, velocity, input_before.velocity_m_per_s};
  plant.period_begin_s = plant.time_s;
  if (velocity != input_before.velocity_m_per_s && (was_limited || plant.is_limited())) impl_->continues = false;
  const double end_s = plant.time_s + plant.period_s;
  try {
    impl_->integrate_to(end_s);
  } catch (...) {
    plant.input = input_before;
    plant.period_begin_s = begin_before_s;
    impl_->continues = false;
    throw;
  }
  plant.time_s = end_s;
  impl_->continues = true;
  return response_mm();
}

double FeedDrive::setpoint_mm() const noexcept {
  const Impl::Plant& plant = impl_->plant;
  return (plant.origin_m + plant.input.setpoint_m + plant.input.velocity_m_per_s * plant.since_period()) * mm_per_m;
}

double FeedDrive::response_mm() const noexcept {
  const Impl::Plant& plant = impl_->plant;
  return (plant.origin_m + plant.equations.response(plant.y.data())) * mm_per_m;
}

double FeedDrive::table_mm() const noexcept {
  const FeedDriveEquations::Layout& at = impl_->plant.equations.layout();
  return (impl_->plant.origin_m + impl_->plant.y[at.position] - impl_->plant.y[at.deflection]) * mm_per_m;
}

double FeedDrive::motor_mm() const noexcept {
  return (impl_->plant.origin_m + impl_->plant.y[impl_->plant.equations.layout().position]) * mm_per_m;
}

double FeedDrive::table_velocity_mm_per_s() const noexcept {
  return impl_->plant.y[impl_->plant.equations.layout().table_velocity] * mm_per_m;
}

double FeedDrive::motor_velocity_mm_per_s() const noexcept {
  const Impl::Plant& plant = impl_->plant;
  return plant.equations.motor_velocity(plant.input, plant.since_period(), plant.y.data()) * mm_per_m;
}

double FeedDrive::friction_force_n() const noexcept {
  return impl_->plant.equations.table_friction(impl_->plant.y.data());
}

double FeedDrive::motor_force_n() const noexcept {
  const Impl::Plant& plant = impl_->plant;
  return plant.equations.motor_force(plant.input, plant.since_period(), plant.y.data());
}

double FeedDrive::spring_force_n() const noexcept {
  const Impl::Plant& plant = impl_->plant;
  return plant.equations.spring_force(plant.input, plant.since_period(), plant.y.data());
}

double FeedDrive::time_s() const noexcept { return impl_->plant.time_s; }
const FeedDriveParameters& FeedDrive::parameters() const noexcept { return impl_->plant.equations.parameters(); }
long FeedDrive::steps() const noexcept { return impl_->solver ? impl_->solver->steps() : 0; }
long FeedDrive::rhs_evaluations() const noexcept { return impl_->solver ? impl_->solver->rhs_evaluations() : 0; }

}  // namespace shapegcode
