#include "measure/fit_quality.hpp"
#include "measure/records.hpp"

namespace py = pybind11;

namespace shapegcode::bindings {

namespace {

void define_decay_fit(py::module_& m) {
  py::class_<DecayFit> decay(m, "DecayFit", "Modes fitted to free decays by fit_decay, with their covariance.");
  add_quality(decay);
  decay
      .def_property_readonly(
          "covariance", [](const py::object& self) { return view(self.cast<const DecayFit&>().covariance, self); },
          "Covariance, shape (2n, 2n), of omega, zeta of the first mode, then of the second, ...")
      .def_property_readonly(
          "amplitude", [](const py::object& self) { return view(self.cast<const DecayFit&>().amplitude, self); },
          "Amplitudes at the first sample, shape (records, n), in the response's unit.")
      .def_property_readonly(
          "phase_rad", [](const py::object& self) { return view(self.cast<const DecayFit&>().phase_rad, self); },
          "Phases of the cosines at the first sample in rad, shape (records, n).");
}

void define_fit_decay(py::module_& m) {
  m.def(
      "fit_decay",
      [](const std::vector<VectorArray>& responses, double period_s, const VectorArray& omega_rad_s,
         const VectorArray& damping_ratio, bool with_offset, bool coloured_residuals, int most_iterations) {
        const auto records = spans_of(responses, "response");
        const NaturalModes start = modes_of(omega_rad_s, damping_ratio);
        const py::gil_scoped_release released;
        return fit_decay(records, period_s, start, {with_offset, coloured_residuals, most_iterations});
      },
      py::arg("responses"), py::arg("period_s"), py::arg("omega_rad_s"), py::arg("damping_ratio"), py::kw_only(),
      py::arg("with_offset") = true, py::arg("coloured_residuals") = false, py::arg("most_iterations") = 60,
      R"(Least-squares fit of decaying cosines to one or several free decays; omega and zeta are common.

Args:
    responses: Response per record, each of shape (n,), in any unit.
    period_s: Time between samples in s, above 0.
    omega_rad_s: Starts, undamped natural frequencies in rad/s, shape (n_modes,), below Nyquist.
    damping_ratio: Starts, 0 < zeta < 1, shape (n_modes,).
    with_offset: Fit a constant offset per record.
    coloured_residuals: The covariance also holds for residuals that are correlated over time (stationary noise).
    most_iterations: Steps after which the search gives up, with converged False.

Returns:
    The fit; check converged and reason before use.

Raises:
    ArgumentError: As fit_modes.

Source: G. Golub, V. Pereyra 2003.)");
}

}  // namespace

void register_decay_fits(py::module_& module) {
  define_decay_fit(module);
  define_fit_decay(module);
}

}  // namespace shapegcode::bindings
