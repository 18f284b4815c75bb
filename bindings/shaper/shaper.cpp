#include <pybind11/complex.h>
#include <pybind11/numpy.h>
#include <pybind11/operators.h>
#include <pybind11/pybind11.h>
#include <pybind11/stl.h>

#include <array>
#include <cmath>
#include <cstddef>
#include <optional>
#include <sstream>
#include <string>
#include <utility>
#include <variant>
#include <vector>

#include "register.hpp"
#include "shapegcode/error.hpp"
#include "shapegcode/minimal_shapers.hpp"
#include "shapegcode/mode.hpp"
#include "shapegcode/shaper.hpp"

namespace py = pybind11;

namespace shapegcode::bindings {
namespace {

using shapegcode::Mode;
using shapegcode::Shaper;

Mode checked_mode(double frequency_hz, double damping_ratio, double participation = 1.0,
                  const std::array<double, 3>& excited_by = {}) {
  const Mode mode{frequency_hz, damping_ratio, participation, excited_by};
  static_cast<void>(shapegcode::pole(mode));  // checks frequency and damping
  for (const double share : {participation, excited_by[0], excited_by[1], excited_by[2]}) {
    if (std::isfinite(share)) continue;
    std::ostringstream message;
    message << "mode at " << frequency_hz << " Hz has a participation or excitation of " << share << ", must be finite";
    throw shapegcode::Error(shapegcode::ErrorKind::argument, message.str());
  }
  return mode;
}

std::string repr(double value) { return py::repr(py::float_(value)).cast<std::string>(); }

std::string repr(const std::vector<double>& values) { return py::repr(py::cast(values)).cast<std::string>(); }

/// Read-only view on memory that `owner` keeps alive.
py::array_t<double> read_only_view(const std::vector<double>& values, const py::object& owner) {
  py::array_t<double> view(static_cast<py::ssize_t>(values.size()), values.data(), owner);
  view.attr("flags").attr("writeable") = false;
  return view;
}

void register_mode(py::module_& m) {
  py::class_<Mode>(
      m, "Mode",
      R"(One vibration mode as it moves one axis, base-excited by the command of that axis or of others. Immutable.

Args:
    frequency_hz: Undamped natural frequency in Hz, above 0.
    damping_ratio: Damping ratio (no unit), 0 <= zeta < 1.
    participation: Factor of this mode's relative deflection in the response (no unit), finite.
    excited_by: Factors of the accelerations of X, Y and Z that excite it (no unit), finite; all zero: the axis which
        it moves, with factor one.

Raises:
    ArgumentError: A value is outside its range.)")
      .def(py::init(&checked_mode), py::arg("frequency_hz"), py::arg("damping_ratio") = 0.0,
           py::arg("participation") = 1.0, py::arg("excited_by") = std::array<double, 3>{},
           "Raises ArgumentError on a value outside its range.")
      .def_readonly("frequency_hz", &Mode::frequency_hz, "Undamped natural frequency in Hz.")
      .def_readonly("damping_ratio", &Mode::damping_ratio, "Damping ratio, no unit.")
      .def_readonly("participation", &Mode::participation,
                    "Factor of this mode's relative deflection in the response, no unit.")
      .def_readonly("excited_by", &Mode::excited_by,
                    "Factors of the accelerations of X, Y, Z that excite it; all zero: 1 for the axis it moves.")
      .def_property_readonly("pole", &shapegcode::pole,
                             "Pole -zeta*omega + j*omega*sqrt(1-zeta^2) in rad/s (paper 002, eq. 7).")
      .def("__repr__",
           [](const Mode& self) {
             return "Mode(frequency_hz=" + repr(self.frequency_hz) + ", damping_ratio=" + repr(self.damping_ratio) +
                    ", participation=" + repr(self.participation) +
                    (self.crosses() ? ", excited_by=" + py::repr(py::cast(self.excited_by)).cast<std::string>() : "") +
                    ")";
           })
      .def(
          "__eq__",
          [](const Mode& self, const Mode& other) {
            return self.frequency_hz == other.frequency_hz && self.damping_ratio == other.damping_ratio &&
                   self.participation == other.participation && self.excited_by == other.excited_by;
          },
          py::is_operator())
      .def("__hash__",
           [](const Mode& self) {
             return py::hash(py::make_tuple(self.frequency_hz, self.damping_ratio, self.participation,
                                            self.excited_by[0], self.excited_by[1], self.excited_by[2]));
           })
      .def(py::pickle(
          [](const Mode& self) {
            return py::make_tuple(self.frequency_hz, self.damping_ratio, self.participation, self.excited_by);
          },
          [](const py::tuple& state) {
            return checked_mode(state[0].cast<double>(), state[1].cast<double>(), state[2].cast<double>(),
                                state[3].cast<std::array<double, 3>>());
          }));
}

void register_shaper(py::module_& m) {
  py::class_<Shaper>(m, "Shaper",
                     R"(Input shaper: impulses at ascending times, whose amplitudes add up to one. Immutable.

Args:
    times_s: Times of the impulses in s, shape (n,), n >= 1, strictly ascending from exactly 0.
    amplitudes: Amplitudes of the impulses (no unit), shape (n,), sum 1 within 1e-9; may be negative.

Raises:
    ArgumentError: Unequal lengths, no impulse, a value that is not finite, times that do not ascend from 0, or a sum
        other than 1.

Source: paper 002, eq. 4 and 9.)")
      .def(py::init(&shapegcode::make_shaper), py::arg("times_s"), py::arg("amplitudes"),
           "Raises ArgumentError if the impulses are not as the class states.")
      .def_property_readonly(
          "times_s", [](const py::object& self) { return read_only_view(self.cast<const Shaper&>().times_s, self); },
          "Times of the impulses in s, shape (n,), read-only view.")
      .def_property_readonly(
          "amplitudes",
          [](const py::object& self) { return read_only_view(self.cast<const Shaper&>().amplitudes, self); },
          "Amplitudes of the impulses (no unit), shape (n,), read-only view.")
      .def_property_readonly("duration_s", &shapegcode::duration_s,
                             "Time of the last impulse in s, by which the shaped command is longer.")
      .def_property_readonly("mean_s", &shapegcode::mean_s, "First moment in s: the mean delay of the shaped command.")
      .def_property_readonly("variance_s2", &shapegcode::variance_s2,
                             "Second central moment in s^2; radius error of a circle: dR/R = variance*(v/R)^2/2.")
      .def_property_readonly("has_negative", &shapegcode::has_negative, "True if any amplitude is below zero.")
      .def_property_readonly("abs_sum", &shapegcode::abs_sum,
                             "Sum of the amplitudes' magnitudes (no unit): 1 for a non-negative shaper.")
      .def("residual_ratio", &shapegcode::residual_ratio, py::arg("mode"),
           R"(Residual vibration of a mode after the last impulse, relative to the unshaped one.

V = exp(-zeta*omega*t_N) * |sum A_k exp(zeta*omega*t_k) exp(j*omega_d*t_k)|; the participation has no effect.
V has a rounding floor of about 1e-16*(1 + omega*t_N)*abs_sum.

Args:
    mode: The mode that vibrates; it need not be one that the shaper was designed for.

Returns:
    The ratio V (no unit), 0 where the shaper cancels the mode.

Source: paper 002, eq. 8.)")
      .def("residual", py::vectorize([](const Shaper* self, double frequency_hz, double damping_ratio) {
             return shapegcode::residual_ratio(*self, checked_mode(frequency_hz, damping_ratio));
           }),
           py::arg("frequency_hz"), py::arg("damping_ratio") = 0.0,
           R"(Residual vibration over frequency: `residual_ratio` of modes of these frequencies.

Args:
    frequency_hz: Natural frequency in Hz, above 0; a number or an array of any shape.
    damping_ratio: Damping ratio (no unit), 0 <= zeta < 1; a number, or an array that broadcasts with the frequencies.

Returns:
    The ratio (no unit): a number for numbers, else an array of the broadcast shape.

Raises:
    ArgumentError: A value is outside its range.)")
      .def("to_fir", &shapegcode::to_fir, py::arg("period_s"),
           R"(The shaper as a filter of samples: ``shaper.to_fir(0.001).apply(samples)``.

Args:
    period_s: Period of the samples in s, above 0.

Returns:
    The filter; its delays are the times of the impulses in periods.

Raises:
    ArgumentError: The period is not above 0, or the shaper is too long.
    DesignError: A time is not a multiple of the period, as those of `zv_on_grid` are: times are never rounded.)")
      .def("__repr__",
           [](const Shaper& self) {
             return "Shaper(times_s=" + repr(self.times_s) + ", amplitudes=" + repr(self.amplitudes) + ")";
           })
      .def(
          "__eq__", [](const Shaper& self, const Shaper& other) { return self == other; }, py::is_operator())
      .def(py::pickle([](const Shaper& self) { return py::make_tuple(self.times_s, self.amplitudes); },
                      [](const py::tuple& state) {
                        return shapegcode::make_shaper(state[0].cast<std::vector<double>>(),
                                                       state[1].cast<std::vector<double>>());
                      }));
}

void register_designs(py::module_& m) {
  m.def(
      "zv",
      [](const std::variant<Mode, double>& mode, std::optional<double> damping_ratio) {
        if (const auto* given = std::get_if<Mode>(&mode)) {
          if (damping_ratio) throw Error(ErrorKind::argument, "damping_ratio is given, but the mode has its own");
          return shapegcode::zv(*given);
        }
        return shapegcode::zv(checked_mode(std::get<double>(mode), damping_ratio.value_or(0.0)));
      },
      py::arg("mode"), py::arg("damping_ratio") = py::none(), release_gil(),
      R"(Zero-vibration shaper of one mode: impulses at 0 and half the damped period.

Args:
    mode: The mode to cancel, or its undamped natural frequency in Hz: ``zv(46, 0.02)``.
    damping_ratio: With a frequency, the damping ratio (no unit), 0 <= zeta < 1; None: 0.

Returns:
    A shaper with 2 non-negative impulses.

Raises:
    ArgumentError: A value is outside its range, or a damping ratio is given although `mode` is a Mode.

Source: paper 002, eq. 1-2 (Smith 1958).)");
  m.def("zv_on_grid", &shapegcode::zv_on_grid, py::arg("mode"), py::arg("period_s"), release_gil(),
        R"(ZV with impulses at multiples of a period only: the second impulse is divided between two of them.

Args:
    mode: The mode to cancel.
    period_s: Period of the grid in s, above 0, at most a quarter of the damped period.

Returns:
    A shaper with 3 non-negative impulses, 2 where half the damped period is a multiple; residual exactly zero at the
    mode.

Raises:
    ArgumentError: The period is not above 0.
    DesignError: The period is too long.

Source: this project.)");
  m.def("convolve", &shapegcode::convolve, py::arg("first"), py::arg("second"), release_gil(),
        R"(The two shapers in series: cancels the modes of both; the durations add.

Args:
    first: A shaper.
    second: Another one; the order does not matter.

Returns:
    The series shaper; impulses whose times agree within 1e-12 of its duration are merged.

Source: paper 002, eq. 3.)");
  m.def(
      "convolved_zv", [](const std::vector<Mode>& modes) { return shapegcode::convolved_zv(modes); }, py::arg("modes"),
      release_gil(),
      R"(Convolved ZV, the conventional multi-mode shaper: up to 2^n non-negative impulses.

Args:
    modes: The n >= 1 modes to cancel.

Returns:
    The shaper; its duration is the sum of the half damped periods.

Raises:
    ArgumentError: No mode.

Source: paper 002, section 2.)");
  m.def("minimal_two_mode", &shapegcode::minimal_two_mode, py::arg("first"), py::arg("second"),
        py::arg("max_duration_s"), py::arg("max_abs_sum") = 10.0, release_gil(),
        R"(All minimal (three-impulse) shapers of two modes, ascending in duration, then in the second time.

Complete: boxes of the plane of the two free times are discarded only if a bound on derivatives proves that they contain
no solution, and Newton starts from all others. If one ZV cancels both modes (undamped, odd ratio), it is listed with
its two impulses. If amplitudes at given times are not unique, those with the smallest sum of squares are listed.

Args:
    first: One mode, damped or not.
    second: The other one; either may be the faster.
    max_duration_s: Largest duration in s, above 0, at most 100 periods of the faster mode.
    max_abs_sum: Largest sum of the amplitudes' magnitudes (no unit), at least 1. With 1, rounding
        may exclude non-negative shapers: select those by has_negative instead.

Returns:
    The shapers, residual_ratio of both modes below 1e-13; empty if there is none in the range.

Raises:
    ArgumentError: The modes' poles agree within 1e-6 (relative), or a value is outside its range.

Source: paper 002, eq. 12-17; the search is this project's.)");
  m.def(
      "grid_polynomial",
      [](const std::vector<Mode>& modes, double period_s) { return shapegcode::grid_polynomial(modes, period_s); },
      py::arg("modes"), py::arg("period_s"), release_gil(),
      R"(Shortest shaper with impulses at multiples of a period that cancels every mode exactly.

The polynomial with the roots z = exp(s*period) and their conjugates: two periods per mode, one for a mode whose z is
real, none for one that aliases onto an earlier one. Amplitudes may be negative and large: check abs_sum before use.

Args:
    modes: The modes to cancel, at least one; one above the grid's Nyquist frequency is allowed.
    period_s: Period of the grid in s, above 0.

Returns:
    The shaper; residual_ratio of every mode is at most 1e-10, usually about 1e-16*abs_sum.

Raises:
    ArgumentError: No mode, or a period that is not positive.
    DesignError: A z closer to +1 than 0.01, or round-off that leaves a residual above 1e-10.

Source: this project.)");
}

}  // namespace

/// Mode, Shaper and the designs of the core. The exceptions of bindings/errors.cpp must be registered as well.
void register_shaping(py::module_& m) {
  register_mode(m);
  register_shaper(m);
  register_designs(m);
}

}  // namespace shapegcode::bindings
