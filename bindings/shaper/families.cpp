#include <pybind11/pybind11.h>
#include <pybind11/stl.h>

#include <vector>

#include "register.hpp"
#include "shapegcode/mode.hpp"
#include "shapegcode/shaper.hpp"

namespace py = pybind11;

namespace shapegcode::bindings {
namespace {

using shapegcode::ExtraInsensitive;
using shapegcode::FrequencyBand;
using shapegcode::Mode;
using shapegcode::Shaper;
using shapegcode::WorstResidual;

void register_exact(py::module_& m) {
  m.def("repeated_zv", &shapegcode::repeated_zv, py::arg("mode"), py::arg("zeros"), release_gil(),
        R"(The ZV shaper in series with itself: 1 is ZV, 2 ZVD, 3 ZVDD.

Args:
    mode: The mode to cancel.
    zeros: Zeros at the mode, 1 to 20: the residual and its first zeros-1 derivatives vanish there.

Returns:
    A shaper of zeros+1 non-negative impulses, half a damped period apart.

Raises:
    ArgumentError: `zeros` is outside its range.

Source: Singer and Seering 1990.)");
  m.def("mzv", &shapegcode::mzv, py::arg("mode"), release_gil(),
        R"(Modified ZV: three non-negative impulses, 3/8 of the damped period apart.

Cancels the mode and the pole of the same decay at 5/3 of its damped frequency; 1.5 times as long as ZV; without
damping its residual has 0.62 of ZV's slope at the mode.

Args:
    mode: The mode to cancel.

Returns:
    The shaper.

Source: the open printer firmware Klipper, "mzv".)");
  m.def("mzv_second_zero", &shapegcode::mzv_second_zero, py::arg("mode"), release_gil(),
        R"(The second pole that `mzv` cancels, as a mode: the same decay rate, 5/3 of the damped frequency.

Args:
    mode: The mode of the MZV shaper.

Returns:
    The other mode.

Source: this project.)");
  m.def("negative_zv", &shapegcode::negative_zv, py::arg("mode"), release_gil(),
        R"(Negative ZV of unity magnitude: amplitudes exactly 1, -1, 1; undamped at 0, 1/6 and 1/3 of the period.

Args:
    mode: The mode to cancel; its damping is met exactly, not by a fitted formula.

Returns:
    The shaper; its sum of magnitudes is 3.

Raises:
    DesignError: The damping is too high for such a shaper.

Source: Singhose, Singer and Seering 1994; the damped solution: this project.)");
}

void register_extra_insensitive(py::module_& m) {
  py::class_<ExtraInsensitive>(m, "ExtraInsensitive",
                               "An extra-insensitive shaper, with the zeros and maxima of its residual.")
      .def_readonly("shaper", &ExtraInsensitive::shaper, "The shaper, humps+2 non-negative impulses.")
      .def_readonly("zeros_hz", &ExtraInsensitive::zeros_hz,
                    "Natural frequencies without residual in Hz, ascending, one more than humps.")
      .def_readonly("humps_hz", &ExtraInsensitive::humps_hz,
                    "Natural frequencies in Hz, ascending, at which the residual is the vibration limit.");
  m.def("extra_insensitive", &shapegcode::extra_insensitive, py::arg("mode"), py::arg("vibration_limit"),
        py::arg("humps") = 1, release_gil(),
        R"(Extra-insensitive (EI) shaper with one, two or three humps, damped or not, solved from its definition.

Between its outermost zeros the residual rises to exactly the limit at each hump. The middle hump, or with two humps the
middle zero, lies at the mode. Without damping it is the Dolph-Chebyshev window over half periods.

Args:
    mode: The mode around which the residual is to be small.
    vibration_limit: Residual ratio at the humps (no unit), above 0 and below 1.
    humps: Number of humps, 1 to 3.

Returns:
    The shaper and its zeros and humps.

Raises:
    ArgumentError: A value is outside its range.
    DesignError: There is no such shaper with non-negative impulses (high damping).

Source: Singhose, Seering and Singer 1994; Singhose, Porter, Tuttle and Singer 1997; the solution: this project.)");
}

void register_sensitivity(py::module_& m) {
  py::class_<WorstResidual>(m, "WorstResidual", "The largest residual over a band of frequencies.")
      .def_readonly("residual_ratio", &WorstResidual::residual_ratio, "Residual ratio at frequency_hz, no unit.")
      .def_readonly("frequency_hz", &WorstResidual::frequency_hz, "Natural frequency in Hz at which it was found.")
      .def_readonly("upper_bound", &WorstResidual::upper_bound,
                    "No frequency of the band has a larger residual ratio; above residual_ratio by at most 1e-6 of it, "
                    "or 1e-12.");
  py::class_<FrequencyBand>(m, "FrequencyBand", "A band of frequencies.")
      .def_readonly("lowest_hz", &FrequencyBand::lowest_hz, "Lower end in Hz.")
      .def_readonly("highest_hz", &FrequencyBand::highest_hz, "Upper end in Hz.");
  m.def(
      "sensitivity_curve",
      [](const Shaper& shaper, double damping_ratio, const std::vector<double>& frequencies_hz) {
        return shapegcode::sensitivity_curve(shaper, damping_ratio, frequencies_hz);
      },
      py::arg("shaper"), py::arg("damping_ratio"), py::arg("frequencies_hz"), release_gil(),
      R"(Residual ratio over the natural frequency.

Args:
    shaper: The shaper.
    damping_ratio: Damping ratio of the modes (no unit), at least 0 and below 1.
    frequencies_hz: Natural frequencies in Hz, above 0.

Returns:
    The residual ratio (no unit) at each frequency, in their order.

Raises:
    ArgumentError: A value is outside its range.

Source: paper 002, eq. 8.)");
  m.def("worst_residual", &shapegcode::worst_residual, py::arg("shaper"), py::arg("mode"), py::arg("lowest_hz"),
        py::arg("highest_hz"), release_gil(),
        R"(Largest residual ratio over a band of natural frequencies, found and proven.

Args:
    shaper: The shaper.
    mode: Gives the damping ratio.
    lowest_hz: Lower end of the band in Hz, above 0.
    highest_hz: Upper end of the band in Hz, at least the lower one.

Returns:
    The largest residual, where it is, and the proven bound.

Raises:
    ArgumentError: A value is outside its range.
    DesignError: More than a million parts of the band are needed for the proof.

Source: this project.)");
  m.def("insensitive_band", &shapegcode::insensitive_band, py::arg("shaper"), py::arg("mode"),
        py::arg("vibration_limit"), release_gil(),
        R"(The band of natural frequencies around a mode in which the residual stays within a limit.

Args:
    shaper: The shaper.
    mode: Nominal frequency and damping ratio.
    vibration_limit: Residual ratio (no unit), above 0 and below 1.

Returns:
    The band; of zero width if the limit is exceeded at the mode; never beyond ten times the mode's frequency.

Raises:
    ArgumentError: The limit is outside its range.

Source: this project.)");
  m.def("insensitivity", &shapegcode::insensitivity, py::arg("shaper"), py::arg("mode"), py::arg("vibration_limit"),
        release_gil(),
        R"(Insensitivity: width of `insensitive_band` over the mode's frequency.

Args:
    shaper: The shaper.
    mode: Nominal frequency and damping ratio.
    vibration_limit: Residual ratio (no unit), above 0 and below 1.

Returns:
    The relative width (no unit): .064 for ZV and .399 for EI at 5 % without damping.

Raises:
    ArgumentError: The limit is outside its range.

Source: Singer and Seering 1990.)");
}

}  // namespace

/// Families of shapers and their sensitivity; `register_shaping` comes first, it makes Mode and Shaper known.
void register_shaping_families(py::module_& m) {
  register_exact(m);
  register_extra_insensitive(m);
  register_sensitivity(m);
}

}  // namespace shapegcode::bindings
