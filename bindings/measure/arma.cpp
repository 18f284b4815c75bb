#include "measure/records.hpp"

#include <optional>

namespace py = pybind11;

namespace shapegcode::bindings {

namespace {

void define_arma(py::module_& m) {
  py::class_<Arma>(m, "Arma", R"(ARMA(2n, 2n-1) model: response = B(z)/A(z) force, A = 1 - phi_1/z - ... - phi_2n/z^2n.

For a free decay the force is a unit impulse at the first sample. Source: paper 003, eq. 1-4.)")
      .def_property_readonly(
          "phi", [](const Arma& self) { return array_of(self.phi); },
          "phi_1 ... phi_2n, shape (2n,): lambda^2n - phi_1 lambda^(2n-1) - ... = 0 gives the poles.")
      .def_property_readonly(
          "numerator", [](const py::object& self) { return view(self.cast<const Arma&>().numerator, self); },
          "b_0, b_1, ...: shape (1, 2n+1) for impacts, (records, 2n) for free decays.")
      .def_property_readonly(
          "theta", [](const py::object& self) { return view(self.cast<const Arma&>().theta, self); },
          "theta_k = -b_k/b_0, one column less than the numerator; nan where b_0 is 0.")
      .def_property_readonly(
          "poles", [](const Arma& self) { return array_of(self.poles); }, "Roots lambda, complex, shape (2n,).")
      .def_property_readonly(
          "residual_rms", [](const Arma& self) { return array_of(self.residual_rms); },
          "RMS of response minus B/A force per record, shape (records,), in the response's unit.")
      .def_property_readonly(
          "iterations", [](const Arma& self) { return self.iterations; }, "Rounds of least squares.")
      .def_property_readonly(
          "converged", [](const Arma& self) { return self.converged; },
          "True if phi converged; otherwise this is the best of all rounds.");
}

void define_arma_fits(py::module_& m) {
  m.def(
      "arma_driven",
      [](const std::vector<VectorArray>& forces, const std::vector<VectorArray>& responses, int n_modes, bool plain) {
        const auto taps = taps_of(forces, responses);
        const py::gil_scoped_release released;
        return arma_driven(taps, n_modes, plain);
      },
      py::arg("forces"), py::arg("responses"), py::arg("n_modes"), py::arg("plain") = false,
      R"(ARMA model of one or several impacts at the same point, by iterated least squares.

Args:
    forces: Force per impact in N, each of shape (n,); the structure is at rest at the first sample.
    responses: Response per impact at the same instants, each of shape (n,); poles and numerator are common.
    n_modes: Number of modes, 1 to 50; the model has 2*n_modes poles and 2*n_modes+1 numerator terms.
    plain: One round of unfiltered least squares instead of the iteration; noise biases its poles.

Returns:
    The model whose phi converged, or the best of all rounds with converged False.

Raises:
    ArgumentError: No record, unequal lengths, a value that is not finite, a force that is zero throughout, a number
        of modes outside its range, or fewer samples than 8*n_modes+8.
    NumericError: No finite coefficients.

Source: K. Steiglitz, L. McBride 1965; paper 003, eq. 1.)");
  m.def(
      "arma_decay",
      [](const std::vector<VectorArray>& responses, int n_modes, bool plain) {
        const auto records = spans_of(responses, "response");
        const py::gil_scoped_release released;
        return arma_decay(records, n_modes, plain);
      },
      py::arg("responses"), py::arg("n_modes"), py::arg("plain") = false,
      R"(ARMA model of one or several free decays: common poles, a separate initial state for each record.

Args:
    responses: Response per decay, each of shape (n,), in any unit.
    n_modes: Number of modes, 1 to 50.
    plain: One round of unfiltered least squares instead of the iteration.

Returns:
    The model, as from arma_driven with a unit impulse at the first sample as force.

Raises:
    ArgumentError: As arma_driven.
    NumericError: No finite coefficients.

Source: K. Steiglitz, L. McBride 1965; paper 003, eq. 1.)");
}

void define_poles(py::module_& m) {
  m.def(
      "poles_to_modes",
      [](const std::vector<std::complex<double>>& poles, double period_s) {
        const NaturalModes modes = poles_to_modes(poles, period_s);
        return py::typing::Tuple<RealArray, RealArray>(
            py::make_tuple(array_of(modes.omega_rad_s), array_of(modes.damping_ratio)));
      },
      py::arg("poles"), py::arg("period_s"),
      R"(Natural frequencies and damping ratios of discrete poles: stable complex pairs, ascending in frequency.

omega = |ln lambda|/period, zeta = -Re(ln lambda)/|ln lambda|.

Args:
    poles: Poles lambda, complex.
    period_s: Time between samples in s, above 0.

Returns:
    (omega_rad_s, damping_ratio), two arrays of equal length, empty if no pole is a mode.

Raises:
    ArgumentError: The period is not positive.

Source: paper 003, eq. 5-6.)");
  m.def(
      "stabilisation_poles",
      [](const std::vector<VectorArray>& responses, int n_max, const std::optional<std::vector<VectorArray>>& forces) {
        std::vector<std::vector<std::complex<double>>> poles;
        const auto records = spans_of(responses, "response");
        const auto taps = forces ? taps_of(*forces, responses) : std::vector<TapSignals>{};
        {
          const py::gil_scoped_release released;
          poles = forces ? stabilisation_poles(taps, n_max) : stabilisation_poles(records, n_max);
        }
        py::typing::List<ComplexArray> orders;
        for (const auto& order : poles) orders.append(array_of(order));
        return orders;
      },
      py::arg("responses"), py::arg("n_max"), py::arg("forces") = py::none(),
      R"(Poles of models with 1 ... n_max modes, for a stabilisation chart and as starts of a fit.

All orders follow from one covariance matrix of the free decay (ESPRIT). For impacts the decay is the correlation of
response with force, in which each impact is weighted by its force.

Args:
    responses: Response per record, each of shape (n,).
    n_max: Largest number of modes, 1 to 50.
    forces: Force per record in N at the same instants; None: the records are free decays.

Returns:
    n_max complex arrays; entry n-1 holds the 2n discrete poles of the model with n modes.

Raises:
    ArgumentError: As arma_driven; fewer samples than 8*n_max+8.

Source: R. Roy, T. Kailath 1989.)");
}

}  // namespace

void register_arma(py::module_& module) {
  define_arma(module);
  define_arma_fits(module);
  define_poles(module);
}

}  // namespace shapegcode::bindings
