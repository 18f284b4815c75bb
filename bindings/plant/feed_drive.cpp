#include <pybind11/eigen.h>
#include <pybind11/pybind11.h>
#include <pybind11/stl.h>

#include <cstddef>
#include <string>
#include <utility>
#include <vector>

#include "arrays.hpp"
#include "register.hpp"
#include "shapegcode/error.hpp"
#include "shapegcode/plant/feed_drive.hpp"

namespace py = pybind11;

namespace shapegcode::bindings {
namespace {

constexpr Eigen::Index response_columns = 6;

void check_one_axis(const VectorArray& setpoints_mm) {
  if (setpoints_mm.ndim() == 1) return;
  throw Error(ErrorKind::argument, "set-points of one axis must have the shape (n,), these have " +
                                       std::to_string(setpoints_mm.ndim()) + " dimensions");
}

py::array respond(FeedDrive& drive, const VectorArray& setpoints_mm) {
  check_one_axis(setpoints_mm);
  const double* setpoints = setpoints_mm.data();
  Eigen::MatrixXd response_rows(setpoints_mm.size(), response_columns);
  {
    const py::gil_scoped_release release;
    for (Eigen::Index i = 0; i < response_rows.rows(); ++i) {
      const double response = drive.step(setpoints[i]);
      response_rows.row(i) << response, drive.table_mm(), drive.motor_mm(), drive.friction_force_n(),
          drive.motor_force_n(), drive.spring_force_n();
    }
  }
  return take(std::move(response_rows));
}

py::array simulate_in_real_time(FeedDriveRealTime& drive, const VectorArray& setpoints_mm) {
  check_one_axis(setpoints_mm);
  const double* setpoints = setpoints_mm.data();
  Eigen::VectorXd response_rows(setpoints_mm.size());
  {
    const py::gil_scoped_release release;
    for (Eigen::Index i = 0; i < response_rows.size(); ++i) response_rows[i] = drive.step(setpoints[i]);
  }
  return py::cast(std::move(response_rows));
}

void register_friction(py::module_& module) {
  py::enum_<FrictionModel>(module, "FrictionModel", "Friction of a sliding pair.")
      .value("viscous", FrictionModel::viscous, "In proportion to the speed alone.")
      .value("stribeck", FrictionModel::stribeck, "Coulomb, static and Stribeck, smooth through zero speed.")
      .value("lugre", FrictionModel::lugre, "The same with bristles: presliding, stick, frictional lag.");

  py::class_<FrictionParameters>(module, "FrictionParameters", R"(Friction of one sliding pair. Immutable.

Args:
    model: See FrictionModel.
    viscous_n_s_per_m: Viscous friction in N s/m, >= 0.
    coulomb_n: Sliding friction in N, > 0 unless viscous.
    static_n: Friction to be overcome from rest in N, >= coulomb_n.
    stribeck_velocity_m_per_s: Speed of the transition from static to sliding friction in m/s, > 0 unless viscous.
    smoothing_velocity_m_per_s: Stribeck: sign(v) is tanh(v / this), m/s, > 0.
    bristle_stiffness_n_per_m: LuGre: force over displacement before sliding in N/m, > 0.
    bristle_damping_n_s_per_m: LuGre: damping of the bristles in N s/m, >= 0.

Raises:
    ArgumentError: A value outside its range.)")
      .def(py::init([](FrictionModel model, double viscous, double coulomb, double adhesion, double stribeck,
                       double smoothing, double stiffness, double damping) {
             const FrictionParameters friction{model,    viscous,   coulomb,   adhesion,
                                               stribeck, smoothing, stiffness, damping};
             friction.check("pair");
             return friction;
           }),
           py::arg_v("model", FrictionModel::viscous, "FrictionModel.viscous"), py::kw_only(),
           py::arg("viscous_n_s_per_m") = 0.0, py::arg("coulomb_n") = 0.0, py::arg("static_n") = 0.0,
           py::arg("stribeck_velocity_m_per_s") = 0.0, py::arg("smoothing_velocity_m_per_s") = 0.0,
           py::arg("bristle_stiffness_n_per_m") = 0.0, py::arg("bristle_damping_n_s_per_m") = 0.0,
           "Raises ArgumentError on a value outside its range.")
      .def_readonly("model", &FrictionParameters::model, "Model.")
      .def_readonly("viscous_n_s_per_m", &FrictionParameters::viscous_n_s_per_m, "N s/m.")
      .def_readonly("coulomb_n", &FrictionParameters::coulomb_n, "N.")
      .def_readonly("static_n", &FrictionParameters::static_n, "N.")
      .def_readonly("stribeck_velocity_m_per_s", &FrictionParameters::stribeck_velocity_m_per_s, "m/s.")
      .def_readonly("smoothing_velocity_m_per_s", &FrictionParameters::smoothing_velocity_m_per_s, "m/s.")
      .def_readonly("bristle_stiffness_n_per_m", &FrictionParameters::bristle_stiffness_n_per_m, "N/m.")
      .def_readonly("bristle_damping_n_s_per_m", &FrictionParameters::bristle_damping_n_s_per_m, "N s/m.");
}

void register_parameters(py::module_& module) {
  py::enum_<PositionFeedback>(module, "PositionFeedback", "What the position loop compares with the set-point.")
      .value("motor", PositionFeedback::motor, "Encoder on the motor (semi-closed loop).")
      .value("table", PositionFeedback::table, "Linear scale on the table (fully closed loop).");

  py::class_<FeedDriveParameters>(module, "FeedDriveParameters", R"(Feed drive of one axis, referred to the travel of
the table. Immutable.

Args:
    motor_mass_kg: Inertia of motor, coupling and screw in kg, > 0.
    table_mass_kg: Table with its load in kg, > 0.
    stiffness_n_per_m: Motor to table, axial, in N/m, > 0.
    damping_n_s_per_m: Damping parallel to the stiffness in N s/m, >= 0.
    position_gain_per_s: Gain of the position loop in 1/s, > 0.
    velocity_gain_n_s_per_m: Force over speed error in N s/m, > 0.
    velocity_integral_time_s: Integral time of the speed controller in s; 0: none.
    velocity_feed_forward_ratio: Ratio of the set-points' speed that is fed forward, 0 ... 1.
    acceleration_feed_forward_ratio: Ratio of acceleration times both masses that is fed forward, 0 ... 1.
    position_feedback: What the position loop measures; the speed is always taken from the motor.
    backlash_m: Whole gap between motor and table in m, >= 0.
    force_limit_n: Force limit of the motor in N; 0: none.
    table_friction: Friction of the guideways.
    motor_friction: Friction of bearings, seals and nut.
    modes: Modes of the structure, excited by the table.

Raises:
    ArgumentError: A value outside its range.)")
      .def(py::init([](double motor_mass, double table_mass, double stiffness, double damping, double position_gain,
                       double velocity_gain, double integral_time, double velocity_ratio, double acceleration_ratio,
                       PositionFeedback feedback, double backlash, double force_limit,
                       const FrictionParameters& table_friction, const FrictionParameters& motor_friction,
                       std::vector<Mode> modes) {
             FeedDriveParameters parameters;
             parameters.motor_mass_kg = motor_mass;
             parameters.table_mass_kg = table_mass;
             parameters.stiffness_n_per_m = stiffness;
             parameters.damping_n_s_per_m = damping;
             parameters.backlash_m = backlash;
             parameters.table_friction = table_friction;
             parameters.motor_friction = motor_friction;
             parameters.position_feedback = feedback;
             parameters.position_gain_per_s = position_gain;
             parameters.velocity_gain_n_s_per_m = velocity_gain;
             parameters.velocity_integral_time_s = integral_time;
             parameters.velocity_feed_forward_ratio = velocity_ratio;
             parameters.acceleration_feed_forward_ratio = acceleration_ratio;
             parameters.force_limit_n = force_limit;
             parameters.modes = std::move(modes);
             parameters.check();
             return parameters;
           }),
           py::kw_only(), py::arg("motor_mass_kg"), py::arg("table_mass_kg"), py::arg("stiffness_n_per_m"),
           py::arg("damping_n_s_per_m"), py::arg("position_gain_per_s"), py::arg("velocity_gain_n_s_per_m"),
           py::arg("velocity_integral_time_s") = 0.0, py::arg("velocity_feed_forward_ratio") = 0.0,
           py::arg("acceleration_feed_forward_ratio") = 0.0,
           py::arg_v("position_feedback", PositionFeedback::motor, "PositionFeedback.motor"),
           py::arg("backlash_m") = 0.0, py::arg("force_limit_n") = 0.0,
           py::arg("table_friction") = FrictionParameters(), py::arg("motor_friction") = FrictionParameters(),
           py::arg("modes") = std::vector<Mode>{}, "Raises ArgumentError on a value outside its range.")
      .def_readonly("motor_mass_kg", &FeedDriveParameters::motor_mass_kg, "kg.")
      .def_readonly("table_mass_kg", &FeedDriveParameters::table_mass_kg, "kg.")
      .def_readonly("stiffness_n_per_m", &FeedDriveParameters::stiffness_n_per_m, "N/m.")
      .def_readonly("damping_n_s_per_m", &FeedDriveParameters::damping_n_s_per_m, "N s/m.")
      .def_readonly("backlash_m", &FeedDriveParameters::backlash_m, "m.")
      .def_readonly("table_friction", &FeedDriveParameters::table_friction, "Of the guideways.")
      .def_readonly("motor_friction", &FeedDriveParameters::motor_friction, "Of bearings, seals and nut.")
      .def_readonly("position_feedback", &FeedDriveParameters::position_feedback, "What the position loop measures.")
      .def_readonly("position_gain_per_s", &FeedDriveParameters::position_gain_per_s, "1/s.")
      .def_readonly("velocity_gain_n_s_per_m", &FeedDriveParameters::velocity_gain_n_s_per_m, "N s/m.")
      .def_readonly("velocity_integral_time_s", &FeedDriveParameters::velocity_integral_time_s, "s; 0: none.")
      .def_readonly("velocity_feed_forward_ratio", &FeedDriveParameters::velocity_feed_forward_ratio, "0 ... 1.")
      .def_readonly("acceleration_feed_forward_ratio", &FeedDriveParameters::acceleration_feed_forward_ratio,
                    "0 ... 1.")
      .def_readonly("force_limit_n", &FeedDriveParameters::force_limit_n, "N; 0: none.")
      .def_readonly("modes", &FeedDriveParameters::modes, "Modes of the structure, excited by the table.");

  module.def(
      "linear_model",
      [](const FeedDriveParameters& parameters) {
        FeedDriveLinearModel model = linear_model(parameters);
        return py::make_tuple(std::move(model.a), std::move(model.b), std::move(model.c), std::move(model.d));
      },
      py::arg("parameters"), R"(The drive as x' = A x + B w, y = C x + D w with inputs linear between the set-points.

Args:
    parameters: The drive, with viscous friction only and without backlash and force limit.

Returns:
    A, B, C, D. Input 0 is the set-point; input 1, only with acceleration feed-forward, the speed of the set-points,
    sampled as the difference from the previous set-point divided by the period. The output is the response. Lengths in
    any one unit, time in s.

Raises:
    ArgumentError: The drive is not linear.)");
}

}  // namespace

void register_feed_drive(py::module_& module) {
  register_friction(module);
  register_parameters(module);

  py::class_<FeedDrive>(module, "FeedDrive", R"(Feed drive of one axis, integrated by CVODE.

Set-points come once per period and are joined by straight lines.

Args:
    parameters: The drive.
    period_s: Time between set-points in s.
    rtol: Relative tolerance of following error, deflections and speeds.
    atol_mm: Absolute tolerance of lengths in mm; that of speeds is 100 atol_mm per second.

Raises:
    ArgumentError: A value outside its range.)")
      .def(py::init<FeedDriveParameters, double, double, double>(), py::arg("parameters"), py::arg("period_s"),
           py::arg("rtol") = 1e-6, py::arg("atol_mm") = 1e-6, "ArgumentError on a value outside its range.")
      .def("reset", &FeedDrive::reset, py::arg("position_mm"), "At rest at a position (mm).")
      .def("step", &FeedDrive::step, py::arg("setpoint_mm"),
           "Takes the next set-point (mm) and returns the response at that instant in mm. Raises ArgumentError on a "
           "set-point that is not finite, NumericError with CVODE's flag and the time if the integrator fails.")
      .def("respond", &respond, py::arg("setpoints_mm"), R"(Takes many set-points and returns the motion of the drive.

Args:
    setpoints_mm: Shape (n,), mm.

Returns:
    (n, 6): response, table and motor in mm, friction on the table, force of the motor and of the spring in N, each
    at the instant of its set-point.

Raises:
    ArgumentError: Another shape or a value that is not finite.
    NumericError: The integrator failed; the message carries CVODE's flag and the time.)")
      .def_property_readonly("response_mm", &FeedDrive::response_mm, "Table and modes, mm.")
      .def_property_readonly("table_mm", &FeedDrive::table_mm, "mm.")
      .def_property_readonly("motor_mm", &FeedDrive::motor_mm, "Angle of the motor as travel, mm.")
      .def_property_readonly("time_s", &FeedDrive::time_s, "Time since reset(), s.")
      .def_property_readonly("parameters", &FeedDrive::parameters, "The drive.")
      .def_property_readonly("steps", &FeedDrive::steps, "Internal steps so far.")
      .def_property_readonly("rhs_evaluations", &FeedDrive::rhs_evaluations, "Evaluations of the equations so far.")
      .def("__copy__", [](const FeedDrive& self) { return FeedDrive(self); });

  py::class_<FeedDriveRealTime>(module, "FeedDriveRealTime",
                                R"(FeedDrive with fixed steps and without error control: the real-time form.

Args:
    parameters: The drive.
    period_s: Time between set-points in s.
    substeps: Steps in a period, 1 ... 1000.

Raises:
    ArgumentError: A value outside its range.)")
      .def(py::init<FeedDriveParameters, double, int>(), py::arg("parameters"), py::arg("period_s"),
           py::arg("substeps") = FeedDriveRealTime::default_substeps, "ArgumentError on a value outside its range.")
      .def("reset", &FeedDriveRealTime::reset, py::arg("position_mm"), "At rest at a position (mm).")
      .def("step", py::overload_cast<double>(&FeedDriveRealTime::step), py::arg("setpoint_mm"),
           "Takes the next set-point (mm) and returns the response at that instant in mm.")
      .def("respond", &simulate_in_real_time, py::arg("setpoints_mm"),
           "Responses (n,) in mm at many set-points (n,) in mm. Raises ArgumentError on another shape.");
}

}  // namespace shapegcode::bindings
