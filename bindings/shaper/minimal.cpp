#include <pybind11/numpy.h>
#include <pybind11/pybind11.h>
#include <pybind11/stl.h>

#include <cstddef>
#include <cstdint>
#include <utility>
#include <vector>

#include "register.hpp"
#include "shapegcode/minimal_shapers.hpp"
#include "shapegcode/mode.hpp"

namespace py = pybind11;

namespace shapegcode::bindings {

namespace {

void register_search(py::module_& m) {
  py::class_<MinimalShapers>(m, "MinimalShapers", "The minimal shapers of some modes, and what is known about others.")
      .def_readonly("shapers", &MinimalShapers::shapers, "The shapers, ascending in duration, then in the times.")
      .def_readonly("complete", &MinimalShapers::complete,
                    "True if every box of times was decided: there is no other shaper in the range.")
      .def_readonly("complete_up_to_s", &MinimalShapers::complete_up_to_s,
                    "Duration in s up to which there is no other shaper; 0: nothing is proven.")
      .def_readonly("max_duration_s", &MinimalShapers::max_duration_s, "Range of the search: largest duration in s.")
      .def_readonly("max_abs_sum", &MinimalShapers::max_abs_sum, "Range of the search: largest sum of magnitudes.")
      .def_readonly("boxes", &MinimalShapers::boxes, "Boxes of times examined by the proof.")
      .def_readonly("unresolved", &MinimalShapers::unresolved,
                    "Boxes too small to halve further that could not be decided: solutions there are not isolated.")
      .def_readonly("starts", &MinimalShapers::starts, "Newton starts.")
      .def_readonly("converged", &MinimalShapers::converged, "Starts that reached a shaper in the range.")
      .def_readonly("found_once", &MinimalShapers::found_once,
                    "Shapers reached by one start only. Divided by `converged`, the number estimates the ratio of "
                    "starts that would reach a shaper not yet listed (Good 1953).");
  m.def(
      "minimal_shapers",
      [](const std::vector<Mode>& modes, double max_duration_s, double max_abs_sum, int max_starts,
         std::int64_t max_boxes) {
        return minimal_shapers(modes, max_duration_s, {max_abs_sum, max_starts, max_boxes});
      },
      py::arg("modes"), py::arg("max_duration_s"), py::kw_only(), py::arg("max_abs_sum") = MinimalOptions{}.max_abs_sum,
      py::arg("max_starts") = MinimalOptions{}.max_starts, py::arg("max_boxes") = MinimalOptions{}.max_boxes,
      release_gil(),
      R"(Minimal multi-mode shapers: n+1 impulses that cancel n modes (one to six), damped or not.

One mode is closed form and two are searched completely. Three and more are searched from many low-discrepancy starts
and by boxes of times in ascending duration, each proven empty, shrunk to one solution, or unresolved; `complete` and
`complete_up_to_s` state what is proven. Shapers with fewer impulses that cancel all modes are listed too; families of
solutions that are not isolated (with undamped modes at odd ratios, which one ZV cancels) are not.

Args:
    modes: One to six modes, no two poles within 1e-6 of one another (relative).
    max_duration_s: Largest duration in s, above 0, at most 100 periods of the fastest mode.
    max_abs_sum: Largest sum of the amplitudes' magnitudes (no unit), at least 1.
    max_starts: Maximum number of Newton starts; fewer are used once every solution was found three times.
    max_boxes: Maximum number of boxes of times examined (some 2 microseconds each for four modes); 0: no proof.

Returns:
    The shapers, residual_ratio of every mode at most 1e-12, and what was searched.

Raises:
    ArgumentError: No mode, more than six, two with equal poles, or a value outside its range.

Source: paper 002, eq. 4-11; the searches are this project's.)");
}

/// Read-only view of values that `owner` keeps alive.
py::array_t<double> view(const std::vector<double>& values, std::vector<std::size_t> shape, const py::object& owner) {
  py::array_t<double> out(std::move(shape), values.data(), owner);
  out.attr("flags").attr("writeable") = false;
  return out;
}

void register_branches(py::module_& m) {
  py::class_<MinimalBranches>(
      m, "MinimalBranches", "The minimal shapers of two modes over the ratio of their frequencies, joined into curves.")
      .def_property_readonly(
          "ratios",
          [](const py::object& self) {
            const auto& out = self.cast<const MinimalBranches&>();
            return view(out.ratios, {out.ratios.size()}, self);
          },
          "Frequency ratios (no unit), shape (n_ratios,), read-only view.")
      .def_property_readonly(
          "times_s",
          [](const py::object& self) {
            const auto& out = self.cast<const MinimalBranches&>();
            return view(out.times_s, {out.branches, out.ratios.size(), 3}, self);
          },
          "Times of the impulses in s, shape (n_branches, n_ratios, 3), NaN where a curve has no shaper; read-only "
          "view.\n\n[..., 2] is the duration.")
      .def_property_readonly(
          "amplitudes",
          [](const py::object& self) {
            const auto& out = self.cast<const MinimalBranches&>();
            return view(out.amplitudes, {out.branches, out.ratios.size(), 3}, self);
          },
          "Amplitudes (no unit), shape (n_branches, n_ratios, 3), NaN as in `times_s`; read-only view.");
  m.def(
      "minimal_branches",
      [](const Mode& first, double second_damping, const std::vector<double>& ratios, double max_duration_s,
         double max_abs_sum) { return minimal_branches(first, second_damping, ratios, max_duration_s, max_abs_sum); },
      py::arg("first"), py::arg("second_damping"), py::arg("ratios"), py::arg("max_duration_s"), py::kw_only(),
      py::arg("max_abs_sum") = MinimalOptions{}.max_abs_sum, release_gil(),
      R"(All minimal two-mode shapers over the ratio of the frequencies, joined into curves (paper 002, figures 2, 3).

At each ratio the list is that of `minimal_two_mode`; curves are followed by continuation, also through gaps, where the
sum of magnitudes or the duration exceeds its limit. Where two curves touch, their ends may be exchanged.

Args:
    first: The mode whose frequency is constant.
    second_damping: Damping ratio of the other mode (no unit).
    ratios: Frequencies of the other mode over that of the first, ascending, above 0, shape (n_ratios,).
    max_duration_s: Largest duration in s, at most 100 periods of the faster mode at any ratio.
    max_abs_sum: Largest sum of the amplitudes' magnitudes (no unit), at least 1.

Returns:
    The curves, ordered by the ratio at which they begin, then by duration.

Raises:
    ArgumentError: No ratio, ratios that do not ascend, or a value outside its range.

Source: paper 002; the continuation is this project's.)");
}

}  // namespace

void register_minimal(py::module_& module) {
  register_search(module);
  register_branches(module);
}

}  // namespace shapegcode::bindings
