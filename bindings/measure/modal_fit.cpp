#include "measure/fit_quality.hpp"
#include "measure/records.hpp"

namespace py = pybind11;

namespace shapegcode::bindings {

namespace {

void define_modal_fit(py::module_& m) {
  py::class_<ModalFit> modal(m, "ModalFit", "Modes fitted to impacts by fit_modes, with their covariance.");
  add_quality(modal);
  modal
      .def_property_readonly(
          "inverse_mass", [](const ModalFit& self) { return array_of(self.inverse_mass); },
          "Residues 1/m in 1/kg, shape (n,); negative where the mode shape has opposite signs at impact and sensor.")
      .def_property_readonly(
          "covariance", [](const py::object& self) { return view(self.cast<const ModalFit&>().covariance, self); },
          "Covariance, shape (3n, 3n), of omega, zeta, 1/m of the first mode, then of the second, ...")
      .def_property_readonly(
          "mass_line", [](const ModalFit& self) { return self.mass_line; },
          "Contribution of modes far below: inverse mass of a free mass, 1/kg; 0 without it.")
      .def_property_readonly(
          "compliance", [](const ModalFit& self) { return self.compliance; },
          "Contribution of modes far above: compliance of a spring without mass, m/N; 0 without it.");
}

void define_fit_modes(py::module_& m) {
  m.def(
      "fit_modes",
      [](const std::vector<VectorArray>& forces, const std::vector<VectorArray>& responses, double period_s,
         const VectorArray& omega_rad_s, const VectorArray& damping_ratio, const std::string& quantity,
         bool with_offset, bool with_mass_line, bool with_compliance, bool coloured_residuals, const std::string& hold,
         double force_noise_n, int most_iterations) {
        const auto taps = taps_of(forces, responses);
        const NaturalModes start = modes_of(omega_rad_s, damping_ratio);
        const ModalFitOptions options{quantity_of(quantity), with_offset,   with_mass_line, with_compliance,
                                      coloured_residuals,    hold_of(hold), force_noise_n,  most_iterations};
        const py::gil_scoped_release released;
        return fit_modes(taps, period_s, start, options);
      },
      py::arg("forces"), py::arg("responses"), py::arg("period_s"), py::arg("omega_rad_s"), py::arg("damping_ratio"),
      py::kw_only(), py::arg("quantity") = "acceleration", py::arg("with_offset") = true,
      py::arg("with_mass_line") = false, py::arg("with_compliance") = false, py::arg("coloured_residuals") = false,
      py::arg("hold") = "linear", py::arg("force_noise_n") = 0.0, py::arg("most_iterations") = 60,
      R"(Output-error fit of modes to one or several impacts at the same point (for white noise: maximum likelihood).

The response is the sum over modes of (1/m) s^q/(s^2 + 2 zeta omega s + omega^2) applied to the force, from rest at the
first sample. The search is Levenberg-Marquardt in ln omega and ln zeta with exact derivatives; linear parameters are
eliminated.

Args:
    forces: Force per impact in N, each of shape (n,).
    responses: Response per impact at the same instants in SI units, each of shape (n,).
    period_s: Time between samples in s, above 0.
    omega_rad_s: Starts, undamped natural frequencies in rad/s, shape (n_modes,), below Nyquist.
    damping_ratio: Starts, 0 < zeta < 1, shape (n_modes,).
    quantity: "acceleration", "velocity" or "displacement".
    with_offset: Fit a constant offset per record.
    with_mass_line: Add a free mass, for modes far below.
    with_compliance: Add a spring without mass, for modes far above.
    coloured_residuals: The covariance also holds for residuals that are correlated over time (stationary noise).
    hold: Course of the force between samples: "linear"; "band_limited", as after an anti-aliasing filter (sinc
        interpolation); "impulse", impulses of force times period just before the samples.
    force_noise_n: Standard deviation of white noise on the force in N. In pulses of up to 128 samples the true force is
        estimated together with the modes; otherwise the effect of the noise is added to the covariance, to first order.
    most_iterations: Steps after which the search gives up, with converged False.

Returns:
    The fit; check converged and reason before use.

Raises:
    ArgumentError: Records as in arma_driven, a start or option outside its range, or too few samples.

Source: L. Ljung, System Identification, ch. 7; G. Golub, V. Pereyra 2003.)");
}

void define_modal_response(py::module_& m) {
  m.def(
      "modal_response",
      [](const VectorArray& force_n, double period_s, const VectorArray& omega_rad_s, const VectorArray& damping_ratio,
         const VectorArray& inverse_mass, const std::string& quantity, const std::string& hold) {
        const auto force = span_of(force_n, "force");
        const auto residues = span_of(inverse_mass, "residues");
        const NaturalModes modes = modes_of(omega_rad_s, damping_ratio);
        return array_of(modal_response(force, period_s, modes, residues, quantity_of(quantity), hold_of(hold)));
      },
      py::arg("force_n"), py::arg("period_s"), py::arg("omega_rad_s"), py::arg("damping_ratio"),
      py::arg("inverse_mass"), py::arg("quantity") = "acceleration", py::arg("hold") = "linear",
      R"(Response of modes to a force, exact, from rest: the model of fit_modes.

Args:
    force_n: Force in N, shape (n,).
    period_s: Time between samples in s, above 0.
    omega_rad_s: Undamped natural frequencies in rad/s, shape (n_modes,), below Nyquist.
    damping_ratio: Damping ratios, 0 < zeta < 1, shape (n_modes,).
    inverse_mass: Residues 1/m in 1/kg, shape (n_modes,).
    quantity: "acceleration", "velocity" or "displacement".
    hold: Course of the force between samples, as in fit_modes.

Returns:
    Response in SI units, shape (n,).

Raises:
    ArgumentError: Unequal lengths or a value outside its range.

Source: this project.)");
}

}  // namespace

void register_modal_fits(py::module_& module) {
  define_modal_fit(module);
  define_fit_modes(module);
  define_modal_response(module);
}

}  // namespace shapegcode::bindings
