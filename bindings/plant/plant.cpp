#include <pybind11/eigen.h>
#include <pybind11/pybind11.h>
#include <pybind11/stl.h>

#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "arrays.hpp"
#include "register.hpp"
#include "shapegcode/error.hpp"
#include "shapegcode/plant/linear_plant.hpp"
#include "shapegcode/plant/modal.hpp"

namespace py = pybind11;

namespace shapegcode::bindings {
namespace {

ModeTable checked_table(int axis, std::vector<double> position_mm, std::vector<double> frequency_hz,
                        std::vector<double> damping_ratio) {
  ModeTable table{axis, std::move(position_mm), std::move(frequency_hz), std::move(damping_ratio)};
  check_table(table);
  return table;
}

Eigen::VectorXd stepped(LinearPlant& plant, const Eigen::VectorXd& input) {
  if (input.size() != plant.inputs() || !input.allFinite()) {
    throw Error(ErrorKind::argument, "input of a linear plant of " + std::to_string(plant.inputs()) +
                                         " inputs must be as many finite values, got " + std::to_string(input.size()));
  }
  Eigen::VectorXd output(plant.outputs());
  plant.step({input.data(), static_cast<std::size_t>(input.size())},
             {output.data(), static_cast<std::size_t>(output.size())});
  return output;
}

py::array response(LinearPlant& plant, const Eigen::MatrixXd& inputs, const std::optional<Eigen::VectorXd>& state) {
  Eigen::MatrixXd outputs;
  {
    const py::gil_scoped_release release;
    outputs = state ? plant.respond(inputs, *state) : plant.respond(inputs);
  }
  return take(std::move(outputs));
}

void register_linear_plant(py::module_& module) {
  py::class_<LinearPlant>(module, "LinearPlant",
                          R"(A linear plant x' = A x + B u, y = C x + D u, propagated exactly from sample to sample.

The input is linear between samples (first-order hold), as a servo's set-points are; the state goes over a period by the
matrix exponential, so stiff, undamped and integrating plants are as exact as any other. Units: whatever fits together,
time in s.

Args:
    a: System matrix, (n, n).
    b: Input matrix, (n, m).
    c: Output matrix, (p, n).
    d: Feed-through, (p, m).
    period_s: Time between samples in s, above 0.

Raises:
    ArgumentError: Shapes that do not fit, an empty one, a value that is not finite, or a period not above 0.
    NumericError: The plant outgrows all numbers within a period.)")
      .def(py::init([](Eigen::MatrixXd a, Eigen::MatrixXd b, Eigen::MatrixXd c, Eigen::MatrixXd d, double period_s) {
             return LinearPlant({std::move(a), std::move(b), std::move(c), std::move(d)}, period_s);
           }),
           py::arg("a"), py::arg("b"), py::arg("c"), py::arg("d"), py::arg("period_s"),
           "Make a plant, at rest with state and input 0.")
      .def("reset", &LinearPlant::reset, py::arg("state"), py::arg("input"),
           "State (n,) at the instant at which the input is `input` (m,); ArgumentError on another shape.")
      .def(
          "reset_at_rest",
          [](LinearPlant& self, const Eigen::VectorXd& input, const std::optional<Eigen::VectorXd>& near) {
            near ? self.reset_at_rest(input, *near) : self.reset_at_rest(input);
          },
          py::arg("input"), py::arg("near") = py::none(),
          R"(Steady state under a constant input.

Args:
    input: Input, (m,).
    near: Where integrators leave a choice, the state of rest nearest to this one, (n,), is taken; none: to zero.

Raises:
    ArgumentError: No state rests under this input (an integrator fills), or another shape.)")
      .def("step", &stepped, py::arg("input"),
           "One period later, with `input` (m,) at its end: the output (p,) there. In C++ real-time safe.")
      .def("respond", &response, py::arg("inputs"), py::arg("state") = py::none(),
           R"(Outputs for a whole record of inputs; what step() gives, to the last bit.

Args:
    inputs: One row per sample, (n_samples, m), at least one row.
    state: State at the first row, (n,); none: at rest under the first row.

Returns:
    Output at each row, (n_samples, p).

Raises:
    ArgumentError: Another shape, a value that is not finite, or no state of rest.)")
      .def_property_readonly("state", &LinearPlant::state, "State at the last sample, (n,).")
      .def_property_readonly("output", &LinearPlant::output, "Output at the last sample, (p,).")
      .def_property_readonly("period_s", &LinearPlant::period_s, "Time between samples in s.");
  module.def("matrix_exponential", &matrix_exponential, py::arg("matrix"),
             R"(Matrix exponential, balanced, by scaling and squaring.

Raises:
    ArgumentError: Not square or not finite.
    NumericError: The result exceeds all numbers.)");
}

// NumPy owns the result, in the memory order of the command.
py::array_t<double> modal_response(const py::array_t<double, py::array::forcecast>& command_mm,
                                   const std::vector<std::vector<Mode>>& modes, double period_s) {
  ModalResponse plant(modes, period_s);
  if (command_mm.ndim() != 2) throw Error(ErrorKind::argument, "command must have the shape (n_samples, n_axes)");
  constexpr auto size = static_cast<py::ssize_t>(sizeof(double));
  const py::ssize_t rows = command_mm.shape(0);
  const py::ssize_t columns = command_mm.shape(1);
  const bool by_row = (command_mm.flags() & py::array::c_style) != 0;
  py::array_t<double> response({rows, columns}, {by_row ? size * columns : size, by_row ? size : size * rows});
  const auto stride = [](const py::array& array) {
    return Eigen::Stride<Eigen::Dynamic, Eigen::Dynamic>(array.strides(1) / size, array.strides(0) / size);
  };
  using Matrix = Eigen::Map<const Eigen::MatrixXd, 0, Eigen::Stride<Eigen::Dynamic, Eigen::Dynamic>>;
  using MutableMatrix = Eigen::Map<Eigen::MatrixXd, 0, Eigen::Stride<Eigen::Dynamic, Eigen::Dynamic>>;
  const Matrix command(command_mm.data(), rows, columns, stride(command_mm));
  MutableMatrix result(response.mutable_data(), rows, columns, stride(response));
  {
    const py::gil_scoped_release release;
    plant.apply(command, result);
  }
  return response;
}

}  // namespace

void register_plant(py::module_& module) {
  module.def("plant_response", &modal_response, py::arg("command_mm"), py::arg("modes"), py::arg("period_s"),
             R"(Response of base-excited modes to a whole record of set-points, exact for set-points linear in between.

What the real-time plant of the core gives sample by sample, to the last bit, at the speed of a batch. At rest at the
first row.

Args:
    command_mm: Set-points in mm, shape (n_samples, n_axes), one per period.
    modes: The modes of each axis; none: the axis follows its command.
    period_s: Time between samples in s, above 0.

Returns:
    Positions of the table in mm at the same instants, (n_samples, n_axes), in the memory order of the command.

Raises:
    ArgumentError: Not as many lists of modes as axes, a command that is not finite, an invalid mode or period.)");
  register_linear_plant(module);
  py::class_<ModeTable>(module, "ModeTable", R"(How a mode depends on where an axis stands. Immutable.

Linear in frequency and damping ratio between the rows, constant beyond the ends; without rows the mode stays as it is.

Args:
    axis: Whose position counts: 0, 1, 2 for X, Y, Z.
    position_mm: Strictly ascending positions in mm, shape (n,).
    frequency_hz: Undamped natural frequencies in Hz, one per position, above 0.
    damping_ratio: Damping ratios (no unit), one per position, 0 <= zeta < 1; none: that of the mode.

Raises:
    ArgumentError: Unequal lengths, positions that do not ascend, or a value outside its range.)")
      .def(py::init(&checked_table), py::arg("axis") = 0, py::arg("position_mm") = std::vector<double>{},
           py::arg("frequency_hz") = std::vector<double>{}, py::arg("damping_ratio") = std::vector<double>{},
           "Make a table; ArgumentError if it is not what the class asks for.")
      .def_readonly("axis", &ModeTable::axis, "Axis whose position counts.")
      .def_readonly("position_mm", &ModeTable::position_mm, "Positions in mm.")
      .def_readonly("frequency_hz", &ModeTable::frequency_hz, "Frequencies in Hz.")
      .def_readonly("damping_ratio", &ModeTable::damping_ratio, "Damping ratios, or none.")
      .def(
          "mode_at",
          [](const ModeTable& self, const Mode& mode, double position_mm) { return mode_at(mode, self, position_mm); },
          py::arg("mode"), py::arg("position_mm"), "The mode at a position (mm) of the axis; its participation stays.");
}

}  // namespace shapegcode::bindings
