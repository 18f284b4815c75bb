#include "measure/records.hpp"

#include <optional>

namespace py = pybind11;

namespace shapegcode::bindings {

void register_ranking(py::module_& m) {
  py::class_<ModeRanking>(m, "ModeRanking", "Candidates in the order in which each explains most of the residual.")
      .def_readonly("chosen", &ModeRanking::chosen, "Indices into the candidates, best first.")
      .def_property_readonly(
          "sum_of_squares", [](const ModeRanking& self) { return array_of(self.sum_of_squares); },
          "Sum of squares of the residual after each choice, shape (len(chosen),), in the response's unit squared.")
      .def_readonly("total", &ModeRanking::total, "Sum of squares of the responses, without offsets.");
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

Each step chooses the candidate that, together with those already chosen, gives the smallest sum of squares. Residues
(for decays: amplitudes and phases per record) are fitted; frequencies and damping ratios are not.

Args:
    responses: Response per record, each of shape (n,).
    period_s: Time between samples in s, above 0.
    omega_rad_s: Candidates, undamped natural frequencies in rad/s, shape (n_candidates,), below Nyquist.
    damping_ratio: Candidates, 0 < zeta < 1, shape (n_candidates,).
    most: Number of candidates to choose, at least 1.
    forces: Force per record in N at the same instants; None: the records are free decays.
    quantity: "acceleration", "velocity" or "displacement"; only with forces.
    kept: Number of candidates at the start of the list that are chosen before all others, in their order: modes
        already fitted.

Returns:
    The ranking; shorter than `most` if no candidate explains anything more.

Raises:
    ArgumentError: As fit_modes.

Source: this project (orthogonal least squares; S. Chen, S. Billings, W. Luo 1989).)");
}

}  // namespace shapegcode::bindings
