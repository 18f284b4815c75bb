#include "shapegcode/identify/equivalent_mass.hpp"
#include "measure/records.hpp"

namespace py = pybind11;

namespace shapegcode::bindings {

namespace {

void define_mass(py::module_& m) {
  py::class_<EquivalentMass>(m, "EquivalentMass", "Mass whose simulated response has the measured RMS.")
      .def_readonly("mass_kg", &EquivalentMass::mass_kg, "Equivalent mass in kg.")
      .def_readonly("measured_rms", &EquivalentMass::measured_rms, "RMS of the measured response, in its unit.")
      .def_readonly("simulated_rms", &EquivalentMass::simulated_rms, "RMS of the simulated response, in the same unit.")
      .def_readonly("halvings", &EquivalentMass::halvings,
                    "Number of halvings of the range of masses; 0 in closed form.")
      .def_readonly("converged", &EquivalentMass::converged, "True if both RMS agree within the tolerance.");
}

void define_wilson_theta(py::module_& m) {
  m.def(
      "wilson_theta",
      [](double mass_kg, double damping_n_s_per_m, double stiffness_n_per_m, const VectorArray& force_n,
         double period_s, double theta, double displacement_m, double velocity_m_per_s) {
        const OscillatorMotion motion =
            wilson_theta({mass_kg, damping_n_s_per_m, stiffness_n_per_m}, span_of(force_n, "force"), period_s, theta,
                         displacement_m, velocity_m_per_s);
        return py::typing::Tuple<RealArray, RealArray, RealArray>(
            py::make_tuple(array_of(motion.displacement_m), array_of(motion.velocity_m_per_s),
                           array_of(motion.acceleration_m_per_s2)));
      },
      py::arg("mass_kg"), py::arg("damping_n_s_per_m"), py::arg("stiffness_n_per_m"), py::arg("force_n"),
      py::arg("period_s"), py::arg("theta") = 1.4, py::arg("displacement_m") = 0.0, py::arg("velocity_m_per_s") = 0.0,
      R"(Step-by-step integration of m x'' + c x' + k x = force by the Wilson theta method.

Args:
    mass_kg: Mass, above 0.
    damping_n_s_per_m: Viscous damping, at least 0.
    stiffness_n_per_m: Stiffness, above 0.
    force_n: Force in N, shape (n,).
    period_s: Time between samples in s, above 0.
    theta: Number of periods over which the acceleration is linear, at least 1; from 1.37 on stable for any period.
    displacement_m: At the first sample.
    velocity_m_per_s: At the first sample.

Returns:
    (displacement in m, velocity in m/s, acceleration in m/s^2), each of shape (n,).

Raises:
    ArgumentError: A value outside its range.

Source: paper 003, section 2.2; K.-J. Bathe, Finite Element Procedures, 9.2.)");
}

void define_closed_form(py::module_& m) {
  m.def(
      "equivalent_mass_closed_form",
      [](const VectorArray& force_n, const VectorArray& response, double period_s, double omega_rad_s,
         double damping_ratio, const std::string& quantity, double theta, double impulse_n_s) {
        return equivalent_mass_closed_form({{span_of(force_n, "force"), span_of(response, "response")},
                                            period_s,
                                            omega_rad_s,
                                            damping_ratio,
                                            quantity_of(quantity),
                                            theta,
                                            impulse_n_s});
      },
      py::arg("force_n"), py::arg("response"), py::arg("period_s"), py::arg("omega_rad_s"), py::arg("damping_ratio"),
      py::arg("quantity") = "acceleration", py::arg("theta") = 1.4, py::arg("impulse_n_s") = 0.0,
      R"(Equivalent mass by one simulation: the response is proportional to 1/m.

Args:
    force_n: Measured force in N, shape (n,).
    response: Measured response in SI units, shape (n,).
    period_s: Time between samples in s, above 0.
    omega_rad_s: Undamped natural frequency in rad/s, above 0.
    damping_ratio: 0 to 1.
    quantity: "acceleration", "velocity" or "displacement".
    theta: Parameter of the Wilson theta method, at least 1.
    impulse_n_s: Besides the force: an impulse just before the first sample, in N s.

Returns:
    The mass that makes the RMS of simulated and measured response equal.

Raises:
    ArgumentError: A value outside its range, a zero response, or a zero force without an impulse.

Source: paper 003, section 2.2.)");
}

void define_bisection(py::module_& m) {
  m.def(
      "equivalent_mass_bisection",
      [](const VectorArray& force_n, const VectorArray& response, double period_s, double omega_rad_s,
         double damping_ratio, double low_kg, double high_kg, double tolerance, int most_halvings,
         const std::string& quantity, double theta, double impulse_n_s) {
        return equivalent_mass_bisection({{span_of(force_n, "force"), span_of(response, "response")},
                                          period_s,
                                          omega_rad_s,
                                          damping_ratio,
                                          quantity_of(quantity),
                                          theta,
                                          impulse_n_s},
                                         {low_kg, high_kg, tolerance, most_halvings});
      },
      py::arg("force_n"), py::arg("response"), py::arg("period_s"), py::arg("omega_rad_s"), py::arg("damping_ratio"),
      py::arg("low_kg") = 1e-3, py::arg("high_kg") = 1e3, py::arg("tolerance") = 0.01, py::arg("most_halvings") = 100,
      py::arg("quantity") = "acceleration", py::arg("theta") = 1.4, py::arg("impulse_n_s") = 0.0,
      R"(Equivalent mass by bisection: paper 003, steps 1 to 7; a check of the closed form.

Args:
    force_n: Measured force in N, shape (n,).
    response: Measured response in SI units, shape (n,).
    period_s: Time between samples in s, above 0.
    omega_rad_s: Undamped natural frequency in rad/s, above 0.
    damping_ratio: 0 to 1.
    low_kg: Lower end of the range, above 0.
    high_kg: Upper end of the range.
    tolerance: Tolerance of the RMS, relative to the measured one.
    most_halvings: Number of halvings after which the search gives up, with converged False.
    quantity: "acceleration", "velocity" or "displacement".
    theta: Parameter of the Wilson theta method, at least 1.
    impulse_n_s: Besides the force: an impulse just before the first sample, in N s.

Returns:
    The mass, the number of halvings and both RMS.

Raises:
    ArgumentError: A value outside its range, a zero response, or a zero force without an impulse.

Source: paper 003, section 2.2, steps 1-7.)");
}

}  // namespace

void register_equivalent_mass(py::module_& module) {
  define_mass(module);
  define_wilson_theta(module);
  define_closed_form(module);
  define_bisection(module);
}

}  // namespace shapegcode::bindings
