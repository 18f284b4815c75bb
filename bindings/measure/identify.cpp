#include <pybind11/complex.h>
#include <pybind11/eigen.h>
#include <pybind11/numpy.h>
#include <pybind11/pybind11.h>
#include <pybind11/stl.h>
#include <pybind11/typing.h>

#include <complex>
#include <cstddef>
#include <optional>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "arrays.hpp"
#include "register.hpp"
#include "shapegcode/error.hpp"
#include "shapegcode/identify/arma.hpp"
#include "shapegcode/identify/equivalent_mass.hpp"
#include "shapegcode/identify/modal_fit.hpp"

namespace py = pybind11;

namespace shapegcode::bindings {
namespace {

std::span<const double> span_of(const VectorArray& values, const char* what) {
  if (values.ndim() != 1) {
    throw Error(ErrorKind::argument,
                std::string(what) + " must be one-dimensional, has " + std::to_string(values.ndim()) + " dimensions");
  }
  return {values.data(), static_cast<std::size_t>(values.size())};
}

std::vector<std::span<const double>> spans_of(const std::vector<VectorArray>& records, const char* what) {
  std::vector<std::span<const double>> spans;
  spans.reserve(records.size());
  for (const VectorArray& record : records) spans.push_back(span_of(record, what));
  return spans;
}

std::vector<TapSignals> taps_of(const std::vector<VectorArray>& forces, const std::vector<VectorArray>& responses) {
  if (forces.size() != responses.size()) {
    throw Error(ErrorKind::argument, std::to_string(forces.size()) + " records of force and " +
                                         std::to_string(responses.size()) + " of response: as many needed");
  }
  std::vector<TapSignals> taps;
  for (std::size_t r = 0; r < forces.size(); ++r) {
    taps.push_back({span_of(forces[r], "force"), span_of(responses[r], "response")});
  }
  return taps;
}

Quantity quantity_of(const std::string& name) {
  if (name == "acceleration") return Quantity::acceleration;
  if (name == "velocity") return Quantity::velocity;
  if (name == "displacement") return Quantity::displacement;
  throw Error(ErrorKind::argument, "quantity is '" + name + "', must be 'acceleration', 'velocity' or 'displacement'");
}

ForceHold hold_of(const std::string& name) {
  if (name == "linear") return ForceHold::linear;
  if (name == "band_limited") return ForceHold::band_limited;
  if (name == "impulse") return ForceHold::impulse;
  throw Error(ErrorKind::argument, "hold is '" + name + "', must be 'linear', 'band_limited' or 'impulse'");
}

NaturalModes modes_of(const VectorArray& omega_rad_s, const VectorArray& damping_ratio) {
  const auto omega = span_of(omega_rad_s, "natural frequencies");
  const auto zeta = span_of(damping_ratio, "damping ratios");
  return {{omega.begin(), omega.end()}, {zeta.begin(), zeta.end()}};
}

using RealArray = py::array_t<double>;
using ComplexArray = py::array_t<std::complex<double>>;

template <typename Scalar>
py::array_t<Scalar> read_only_copy(const Scalar* values, std::size_t size) {
  py::array_t<Scalar> array(static_cast<py::ssize_t>(size), values);
  array.attr("flags").attr("writeable") = false;
  return array;
}

RealArray array_of(const std::vector<double>& values) { return read_only_copy(values.data(), values.size()); }

RealArray array_of(const Eigen::VectorXd& values) {
  return read_only_copy(values.data(), static_cast<std::size_t>(values.size()));
}

ComplexArray array_of(const std::vector<std::complex<double>>& values) {
  return read_only_copy(values.data(), values.size());
}

/// Read-only properties that every fit has.
template <typename Fit>
void add_quality(py::class_<Fit>& type) {
  type.def_property_readonly(
          "sum_of_squares", [](const Fit& self) { return self.quality.sum_of_squares; },
          "Sum of the squared residuals, in the response's unit squared.")
      .def_property_readonly(
          "log_likelihood", [](const Fit& self) { return self.quality.log_likelihood; },
          "Logarithm of the likelihood, for white normal residuals of the same variance in all records.")
      .def_property_readonly(
          "samples", [](const Fit& self) { return self.quality.samples; }, "Samples of all records together.")
      .def_property_readonly(
          "parameters", [](const Fit& self) { return self.quality.parameters; },
          "Fitted parameters, offsets and amplitudes included.")
      .def_property_readonly(
          "residual_autocorrelation", [](const Fit& self) { return self.quality.residual_autocorrelation; },
          "Autocorrelation of the residuals at a lag of one sample, no unit; about 0 where they are white.")
      .def_property_readonly(
          "residual_rms", [](const Fit& self) { return array_of(self.quality.residual_rms); },
          "RMS of the residuals per record, shape (records,), in the response's unit.")
      .def_property_readonly(
          "fitted",
          [](const Fit& self) {
            py::typing::List<RealArray> records;
            for (const Eigen::VectorXd& record : self.quality.fitted) records.append(array_of(record));
            return records;
          },
          "Response of the model per record, each of shape (n,), offset included.")
      .def_property_readonly(
          "iterations", [](const Fit& self) { return self.quality.iterations; }, "Steps of the search.")
      .def_property_readonly(
          "converged", [](const Fit& self) { return self.quality.converged; }, "True if a minimum was reached.")
      .def_property_readonly(
          "reason", [](const Fit& self) { return self.quality.reason; }, "Why it has not converged; else empty.")
      .def_property_readonly(
          "omega_rad_s", [](const Fit& self) { return array_of(self.omega_rad_s); },
          "Undamped natural frequencies in rad/s, shape (n,), in the order of the starts.")
      .def_property_readonly(
          "damping_ratio", [](const Fit& self) { return array_of(self.damping_ratio); },
          "Damping ratios, no unit, shape (n,).")
      .def_property_readonly(
          "offset", [](const Fit& self) { return array_of(self.offset); },
          "Offset per record, shape (records,), in the response's unit.");
}

void register_arma(py::module_& m) {
  py::class_<Arma>(m, "Arma", R"(ARMA(2n, 2n-1) model: response = B(z)/A(z) force, A = 1 - phi_1/z - ... - phi_2n/z^2n.

For a free decay the force is a unit impulse at the first sample. Source: paper 003, eq. 1-4.)")
      .def_property_readonly(
          "phi", [](const Arma& self) { return array_of(self.phi); },
          "phi_1 ... phi_2n, shape (2n,): lambda^2n - phi_1 lambda^(2n-1) - ... = 0 gives the poles.")
      .def_property_readonly(
          "numerator", [](const py::object& self) { return view(self.cast<const Arma&>().numerator, self); },
          "b_0, b_1, ...: shape (1, 2n+1) of taps, (records, 2n) of free decays.")
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
          "True if phi settled; otherwise this is the best of all rounds.");
  m.def(
      "arma_driven",
      [](const std::vector<VectorArray>& forces, const std::vector<VectorArray>& responses, int n_modes, bool plain) {
        const auto taps = taps_of(forces, responses);
        const py::gil_scoped_release released;
        return arma_driven(taps, n_modes, plain);
      },
      py::arg("forces"), py::arg("responses"), py::arg("n_modes"), py::arg("plain") = false,
      R"(ARMA model of one or several taps of the same point, by iterated least squares.

Args:
    forces: Force per tap in N, each of shape (n,), at rest at the first sample.
    responses: Response per tap at the same instants, each of shape (n,); poles and numerator are common.
    n_modes: Number of modes, 1 to 50; the model has 2*n_modes poles and 2*n_modes+1 numerator terms.
    plain: One round of unfiltered least squares, which noise bends, instead of the iterated one.

Returns:
    The model whose phi settled, or the best of all rounds with converged False.

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
      R"(ARMA model of one or several free decays: common poles, each record's own initial state.

Args:
    responses: Response per decay, each of shape (n,), in any unit.
    n_modes: Number of modes, 1 to 50.
    plain: One round of unfiltered least squares instead of the iterated one.

Returns:
    The model, as from arma_driven with a unit impulse at the first sample for the force.

Raises:
    ArgumentError: As arma_driven.
    NumericError: No finite coefficients.

Source: K. Steiglitz, L. McBride 1965; paper 003, eq. 1.)");
  m.def(
      "poles_to_modes",
      [](const std::vector<std::complex<double>>& poles, double period_s) {
        const NaturalModes modes = poles_to_modes(poles, period_s);
        return py::typing::Tuple<RealArray, RealArray>(
            py::make_tuple(array_of(modes.omega_rad_s), array_of(modes.damping_ratio)));
      },
      py::arg("poles"), py::arg("period_s"),
      R"(Natural frequencies and damping ratios of discrete poles: complex pairs that are stable, ascending.

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
      R"(Poles of models with 1 ... n_max modes, for a stabilisation chart and for starts. Quick.

All orders are read off one covariance matrix of the free decay (ESPRIT); of taps the decay is the correlation of
response with force, which weighs all taps.

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

void register_modal_fits(py::module_& m) {
  py::class_<ModalFit> modal(m, "ModalFit", "Modes fitted to taps by fit_modes, with their covariance.");
  add_quality(modal);
  modal
      .def_property_readonly(
          "inverse_mass", [](const ModalFit& self) { return array_of(self.inverse_mass); },
          "Residues 1/m in 1/kg, shape (n,); negative where the mode shape has opposite signs at tap and sensor.")
      .def_property_readonly(
          "covariance", [](const py::object& self) { return view(self.cast<const ModalFit&>().covariance, self); },
          "Covariance, shape (3n, 3n), of omega, zeta, 1/m of the first mode, then of the second, ...")
      .def_property_readonly(
          "mass_line", [](const ModalFit& self) { return self.mass_line; },
          "What modes far below add: 1/kg of a free mass; 0 without it.")
      .def_property_readonly(
          "compliance", [](const ModalFit& self) { return self.compliance; },
          "What modes far above add: m/N of a spring without mass; 0 without it.");
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
      R"(Output-error (for white noise: maximum likelihood) fit of modes to one or several taps of the same point.

The response is the sum over modes of (1/m) s^q/(s^2 + 2 zeta omega s + omega^2) applied to the force, from rest at the
first sample. Search by Levenberg-Marquardt in ln omega and ln zeta with exact
derivatives; everything linear is eliminated.

Args:
    forces: Force per tap in N, each of shape (n,).
    responses: Response per tap at the same instants in SI units, each of shape (n,).
    period_s: Time between samples in s, above 0.
    omega_rad_s: Starts, undamped natural frequencies in rad/s, shape (n_modes,), below Nyquist.
    damping_ratio: Starts, 0 < zeta < 1, shape (n_modes,).
    quantity: "acceleration", "velocity" or "displacement".
    with_offset: Fit a constant offset per record.
    with_mass_line: Add a free mass, for modes far below.
    with_compliance: Add a spring without mass, for modes far above.
    coloured_residuals: Covariance that holds for residuals correlated over time (stationary) as well.
    hold: How the force runs between samples: "linear"; "band_limited", as behind an anti-aliasing filter (sinc
        interpolation); "impulse", blows just before the samples, of force times period.
    force_noise_n: Standard deviation of white noise on the force in N. In pulses of up to 128 samples the true force is
        estimated along with the modes; else its effect is added to the covariance to first order.
    most_iterations: Steps after which the search gives up, with converged False.

Returns:
    The fit; look at converged and reason before use.

Raises:
    ArgumentError: Records as in arma_driven, a start or option outside its range, or too few samples.

Source: L. Ljung, System Identification, ch. 7; G. Golub, V. Pereyra 2003.)");
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
    coloured_residuals: Covariance that holds for residuals correlated over time (stationary) as well.
    most_iterations: Steps after which the search gives up, with converged False.

Returns:
    The fit; look at converged and reason before use.

Raises:
    ArgumentError: As fit_modes.

Source: G. Golub, V. Pereyra 2003.)");
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
    hold: How the force runs between samples, as in fit_modes.

Returns:
    Response in SI units, shape (n,).

Raises:
    ArgumentError: Unequal lengths or a value outside its range.

Source: this project.)");
}

void register_ranking(py::module_& m) {
  py::class_<ModeRanking>(m, "ModeRanking", "Candidates in the order in which they explain what others leave.")
      .def_readonly("chosen", &ModeRanking::chosen, "Indices into the candidates, best first.")
      .def_property_readonly(
          "sum_of_squares", [](const ModeRanking& self) { return array_of(self.sum_of_squares); },
          "What is left after each choice, shape (len(chosen),), in the response's unit squared.")
      .def_readonly("total", &ModeRanking::total, "Squares of the responses, offsets taken out.");
  m.def(
      "rank_modes",
      [](const std::vector<VectorArray>& responses, double period_s, const VectorArray& omega_rad_s,
         const VectorArray& damping_ratio, std::size_t most, const std::optional<std::vector<VectorArray>>& forces,
         const std::string& quantity, std::size_t kept) {
        const auto records = spans_of(responses, "response");
        const auto taps = forces ? taps_of(*forces, responses) : std::vector<TapSignals>{};
        const NaturalModes candidates = modes_of(omega_rad_s, damping_ratio);
        const Quantity measured = quantity_of(quantity);
        const py::gil_scoped_release released;
        return forces ? rank_modes(taps, period_s, candidates, most, kept, measured)
                      : rank_modes(records, period_s, candidates, most, kept);
      },
      py::arg("responses"), py::arg("period_s"), py::arg("omega_rad_s"), py::arg("damping_ratio"), py::arg("most"),
      py::arg("forces") = py::none(), py::arg("quantity") = "acceleration", py::arg("kept") = 0,
      R"(Ranks candidate modes by forward selection: starts for fit_modes and fit_decay from the poles of a chart.

At each step the candidate is chosen that, together with those before it, leaves the least squares; residues (of
decays: amplitudes and phases per record) are fitted, frequencies and damping ratios are not.

Args:
    responses: Response per record, each of shape (n,).
    period_s: Time between samples in s, above 0.
    omega_rad_s: Candidates, undamped natural frequencies in rad/s, shape (n_candidates,), below Nyquist.
    damping_ratio: Candidates, 0 < zeta < 1, shape (n_candidates,).
    most: How many to choose, at least 1.
    forces: Force per record in N at the same instants; None: the records are free decays.
    quantity: "acceleration", "velocity" or "displacement"; only with forces.
    kept: The first so many candidates are chosen before all others, in their order; handed over as fitted, they leave
        only what is new to the rest.

Returns:
    The ranking; shorter than asked for where no candidate explains anything more.

Raises:
    ArgumentError: As fit_modes.

Source: this project (orthogonal least squares; S. Chen, S. Billings, W. Luo 1989).)");
}

void register_equivalent_mass(py::module_& m) {
  py::class_<EquivalentMass>(m, "EquivalentMass", "Mass whose simulated response has the measured RMS.")
      .def_readonly("mass_kg", &EquivalentMass::mass_kg, "Equivalent mass in kg.")
      .def_readonly("measured_rms", &EquivalentMass::measured_rms, "RMS of the measured response, in its unit.")
      .def_readonly("simulated_rms", &EquivalentMass::simulated_rms, "RMS of the simulated one, in the same unit.")
      .def_readonly("halvings", &EquivalentMass::halvings,
                    "How often the range was halved before its middle was right; 0 in closed form.")
      .def_readonly("converged", &EquivalentMass::converged, "True if both RMS agree within the tolerance.");
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
    theta: Stretch of the step over which the acceleration is linear, at least 1; stable from 1.37 on.
    displacement_m: At the first sample.
    velocity_m_per_s: At the first sample.

Returns:
    (displacement in m, velocity in m/s, acceleration in m/s^2), each of shape (n,).

Raises:
    ArgumentError: A value outside its range.

Source: paper 003, section 2.2; K.-J. Bathe, Finite Element Procedures, 9.2.)");
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
    theta: Of the Wilson theta method.
    impulse_n_s: Besides the force: an impulse just before the first sample, in N s.

Returns:
    The mass that makes the RMS of simulated and measured response equal.

Raises:
    ArgumentError: A value outside its range, or a force or response that is zero throughout.

Source: paper 003, section 2.2.)");
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
      R"(Equivalent mass by bisection: paper 003's steps 1 to 7, the check of the closed form.

Args:
    force_n: Measured force in N, shape (n,).
    response: Measured response in SI units, shape (n,).
    period_s: Time between samples in s, above 0.
    omega_rad_s: Undamped natural frequency in rad/s, above 0.
    damping_ratio: 0 to 1.
    low_kg: Lower end of the range, above 0.
    high_kg: Upper end of the range.
    tolerance: Of the RMS, relative to the measured one.
    most_halvings: After which the search gives up, with converged False.
    quantity: "acceleration", "velocity" or "displacement".
    theta: Of the Wilson theta method.
    impulse_n_s: Besides the force: an impulse just before the first sample, in N s.

Returns:
    The mass, the number of halvings and both RMS.

Raises:
    ArgumentError: A value outside its range, or a force or response that is zero throughout.

Source: paper 003, section 2.2, steps 1-7.)");
}

}  // namespace

/// Numerical core of identification: ARMA models, modal fits, equivalent mass.
void register_identification(py::module_& module) {
  register_arma(module);
  register_modal_fits(module);
  register_ranking(module);
  register_equivalent_mass(module);
}

}  // namespace shapegcode::bindings
